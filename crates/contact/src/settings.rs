//! What a user may choose about the solution of the discrete problem.

/// Which solver finds the contact set.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Solver {
    /// The active set method at every size; the interior-point method as a second opinion should it fail.
    #[default]
    Auto,
    /// The interior-point method of the crate clarabel.
    Clarabel,
    /// The active-set method on faer's sparse Cholesky factorisation.
    ActiveSet,
}

/// When a level counts as solved.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub enum Tolerance {
    /// As far as the error estimate needs; a direct solver goes to rounding anyway. What must be reached at least is
    /// [`crate::ACTIVE_SET_LIMIT`] or [`crate::INTERIOR_POINT_LIMIT`].
    #[default]
    Balanced,
    /// The relative KKT residual that must be reached.
    Relative(f64),
}

/// Settings of [`crate::solve()`].
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Settings {
    /// Which solver.
    pub solver: Solver,
    /// How exactly.
    pub tolerance: Tolerance,
    /// Whether the smallest model is taken (`true`) or always the two-field problem.
    pub reduce: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            solver: Solver::Auto,
            tolerance: Tolerance::Balanced,
            reduce: true,
        }
    }
}
