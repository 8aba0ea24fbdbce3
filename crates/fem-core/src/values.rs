//! One value for every triangle, or the same for all.

use std::ops::Index;

/// Values of the triangles of a mesh; nothing is stored for each where they are all the same.
///
/// `values[t]` is the value of triangle `t`.
#[derive(Clone, Debug, PartialEq)]
pub enum ElementValues {
    /// The same value everywhere.
    Same(f64),
    /// One value a triangle, in the order of the mesh.
    Each(Vec<f64>),
}

impl ElementValues {
    /// The value that all triangles have by the way they are stored; O(1).
    #[inline]
    pub fn same(&self) -> Option<f64> {
        match self {
            ElementValues::Same(value) => Some(*value),
            ElementValues::Each(_) => None,
        }
    }

    /// What is stored: a single value, or one a triangle.
    pub fn stored(&self) -> &[f64] {
        match self {
            ElementValues::Same(value) => std::slice::from_ref(value),
            ElementValues::Each(values) => values,
        }
    }
}

impl Index<usize> for ElementValues {
    type Output = f64;

    #[inline]
    fn index(&self, triangle: usize) -> &f64 {
        match self {
            ElementValues::Same(value) => value,
            ElementValues::Each(values) => &values[triangle],
        }
    }
}

impl From<f64> for ElementValues {
    fn from(value: f64) -> Self {
        ElementValues::Same(value)
    }
}

impl From<Vec<f64>> for ElementValues {
    fn from(values: Vec<f64>) -> Self {
        ElementValues::Each(values)
    }
}
