//! What a user may choose about the solution of the discrete problem.

/// Which solver finds the contact set.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Solver {
    /// The active set method on small meshes, multigrid from [`crate::MULTIGRID_FROM`] vertices on; the interior-point method as a
    /// second opinion should the active set fail.
    #[default]
    Auto,
    /// The interior-point method of the crate clarabel.
    Clarabel,
    /// The active-set method on faer's sparse Cholesky factorisation.
    ActiveSet,
    /// Conjugate gradients with a multigrid cycle over the bisection hierarchy; the active set method on a mesh without one, and where
    /// multigrid does not reach its goal.
    Multigrid,
}

/// When a level counts as solved.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub enum Tolerance {
    /// As far as the error estimate needs: multigrid goes to [`Settings::energy_target`], or to a KKT residual of 1e-10 where none is
    /// given; a direct solver goes to rounding anyway. What must be reached at least is [`crate::ACTIVE_SET_LIMIT`] or
    /// [`crate::INTERIOR_POINT_LIMIT`], unless there is a target and it is met.
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
    /// Under [`Tolerance::Balanced`], the energy norm |||.||| of the algebraic error, as estimated, at which an iterative solver may
    /// stop; scaled units. A tenth of the error to be expected from the mesh loses nothing.
    pub energy_target: Option<f64>,
    /// Whether sigma is computed. It is always solved to rounding, so that on a level that is only passed it would cost multigrid more
    /// than all the rest; without it [`crate::Solution::sigma`] is empty until [`crate::add_sigma`].
    pub sigma: bool,
    /// How many threads multigrid may use: with more than one, mean and gap of a reduced model are solved side by side. The result is the
    /// same to the bit.
    pub threads: usize,
}

impl Settings {
    /// Whether a problem with so many vertices is solved by multigrid, if its mesh has a hierarchy.
    pub(crate) fn iterates(&self, vertices: usize) -> bool {
        match self.solver {
            Solver::Multigrid => true,
            Solver::Auto => vertices >= crate::MULTIGRID_FROM,
            Solver::ActiveSet | Solver::Clarabel => false,
        }
    }
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            solver: Solver::Auto,
            tolerance: Tolerance::Balanced,
            reduce: true,
            energy_target: None,
            sigma: true,
            threads: 1,
        }
    }
}
