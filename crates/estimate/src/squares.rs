//! Local values of an estimator, as their squares.

/// Squares of local values, one entry a triangle, and their sum. Squares are what is summed and marked by; roots are for files.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Squares {
    local: Vec<f64>,
    sum: f64,
}

impl Squares {
    /// The squares with their sum.
    pub fn new(local: Vec<f64>) -> Squares {
        Squares {
            sum: local.iter().sum(),
            local,
        }
    }

    /// The squares.
    pub fn squares(&self) -> &[f64] {
        &self.local
    }

    /// The local values: the roots.
    pub fn roots(&self) -> Vec<f64> {
        self.local.iter().map(|s| s.sqrt()).collect()
    }

    /// The root of the sum.
    pub fn total(&self) -> f64 {
        self.sum.sqrt()
    }
}
