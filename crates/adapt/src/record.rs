//! The numbers of one level: a row of the history, in the user's units.

use contact::Reduction;

/// One level of a run. `None` does not apply. Units: see the field's formula in terms of lengths, tensions and loads;
/// numbers are those of the user's units, the scale is already put back.
#[derive(Clone, Debug, PartialEq)]
pub struct LevelRecord {
    /// Number of the level, from 0.
    pub level: usize,
    /// Vertices, boundary included.
    pub vertices: usize,
    /// Triangles.
    pub triangles: usize,
    /// Size of the algebraic problem solved.
    pub unknowns: usize,
    /// Interior vertices of the contact set.
    pub contact_vertices: usize,
    /// Sum of their dual areas |D_j|.
    pub contact_area: f64,
    /// J(u_h).
    pub energy: f64,
    /// |||u_h|||.
    pub energy_norm: f64,
    /// Root of the sum of squares of (7.1).
    pub eta_k: Option<f64>,
    /// Plain sum of (7.2).
    pub eta_e_sum: Option<f64>,
    /// The global bound (7.11) without its constant.
    pub bound_711: Option<f64>,
    /// The same with a second term that converges.
    pub bound_711_repaired: Option<f64>,
    /// Residual estimator.
    pub residual: Option<f64>,
    /// Data oscillation.
    pub oscillation: f64,
    /// The number that the run is judged by.
    pub error_bound: f64,
    /// Which number that is: `residual` or `paper`.
    pub bound_kind: &'static str,
    /// error_bound / energy_norm; none when the norm is zero.
    pub relative_bound: Option<f64>,
    /// |||u - u_h|||.
    pub true_error: Option<f64>,
    /// error_bound / true_error; none when the error is zero.
    pub effectivity: Option<f64>,
    /// |sigma - sigma_h|_1.
    pub sigma_error: Option<f64>,
    /// (|u1 - u1h|_1^2 + |u2 - u2h|_1^2)^(1/2).
    pub h1_error: Option<f64>,
    /// Name of the solver.
    pub solver: &'static str,
    /// The model that was solved.
    pub reduction: Reduction,
    /// Its iterations.
    pub iterations: usize,
    /// Relative KKT residual.
    pub kkt_residual: f64,
    /// Sum of z_j.
    pub contact_force: f64,
    /// Largest pressure z_j / |D_j|.
    pub max_action: f64,
    /// Difference of contact_area and the area of the exact contact set.
    pub contact_area_error: Option<f64>,
    /// Area of both contact sets over that of either.
    pub contact_jaccard: Option<f64>,
    /// Hausdorff distance of the two contact sets; none when one of them is empty.
    pub contact_hausdorff: Option<f64>,
    /// Smallest gap u1 - u2 over all vertices.
    pub smallest_gap: f64,
    /// Wall seconds of refinement and transfer to this level.
    pub seconds_refine: f64,
    /// Wall seconds of loads and matrices.
    pub seconds_assemble: f64,
    /// Wall seconds of the solver.
    pub seconds_solve: f64,
    /// Wall seconds of estimators and true errors.
    pub seconds_estimate: f64,
    /// Wall seconds since the run began.
    pub seconds_total: f64,
    /// Peak resident memory so far, in MiB; none where the system does not tell.
    pub peak_memory_mb: Option<f64>,
}
