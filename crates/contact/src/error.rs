//! What can go wrong between a discrete problem and its solution.

use crate::solution::Status;

/// Why [`crate::solve()`] returned no solution.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SolveError {
    /// An array of the problem or of the start does not have one entry a vertex.
    #[error("`{what}` has {found} entries where the mesh has {expected} vertices")]
    Length {
        /// The array.
        what: &'static str,
        /// Number of vertices.
        expected: usize,
        /// Entries it has.
        found: usize,
    },
    /// A number of the problem, or one computed from it, is infinite or not a number.
    #[error("`{what}` is not finite at vertex {vertex}")]
    NotFinite {
        /// Where the number stands.
        what: &'static str,
        /// Vertex number.
        vertex: usize,
    },
    /// The boundary heights cross: the lower membrane is fixed above the upper one.
    #[error(
        "the boundary height {lower:e} of the lower membrane exceeds {upper:e} of the upper one at vertex {vertex}"
    )]
    HeightsCross {
        /// Vertex number.
        vertex: usize,
        /// Height of the upper membrane there.
        upper: f64,
        /// Height of the lower membrane there.
        lower: f64,
    },
    /// A stiffness matrix is not positive definite to double precision.
    #[error(
        "the stiffness matrix is not positive definite in double precision: the pivot at vertex {vertex} is not positive"
    )]
    NotPositiveDefinite {
        /// Vertex whose pivot failed.
        vertex: usize,
    },
    /// The factorisation outgrew memory or 32-bit indices.
    #[error(
        "the factorisation of a matrix of order {order} needs more memory or larger indices than there are"
    )]
    TooLarge {
        /// Order of the matrix.
        order: usize,
    },
    /// The interior-point method refused its data.
    #[error("the interior-point method refused the problem: {reason}")]
    InteriorPoint {
        /// What it said.
        reason: String,
    },
    /// The iterate that would be returned does not meet the tolerance.
    #[error(
        "the relative KKT residual {kkt_residual:.3e} exceeds the tolerance {tolerance:.3e} ({status:?})"
    )]
    NotConverged {
        /// Relative KKT residual reached.
        kkt_residual: f64,
        /// Relative KKT residual asked for.
        tolerance: f64,
        /// How the solver ended.
        status: Status,
    },
}
