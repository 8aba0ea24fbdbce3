//! Error indicators and true errors of a discrete solution.
//!
//! Everything here reads a mesh, the [discrete problem](contact::DiscreteProblem) on it and its [solution](contact::Solution), and costs O(N):
//!
//! - [`mod@paper`]: the indicators eta_K (7.1) and eta_e (7.2) of the paper;
//! - [`mod@global_bound`]: the global bound (7.11), as it stands and repaired;
//! - [`mod@residual`]: a residual estimator that is robust in the tensions;
//! - [`certificate`]: a guaranteed bound of the energy error;
//! - [`mod@oscillation`]: what first-order elements do not see of the loads;
//! - [`action`]: the action as a function, with values at boundary vertices;
//! - [`mod@sweep`]: residual estimator, oscillation and energy in one pass;
//! - [`mod@energy`]: J(u_h) and the energy norm of u_h;
//! - [`exact`], [`errors`]: a known solution, and the true errors against it;
//! - [`mod@contact_set`]: the contact set against the exact one;
//! - [`mod@finite_volume`]: the second discretisation, the action as an unknown on the dual cells, and its errors;
//! - [`mod@efficiency`]: the constants of (7.13) and (7.14) that a solution attains.
//!
//! All numbers are in scaled units, see [`fem_core::scale`]. Local arrays have one entry a triangle (or interior edge) in the order of the mesh
//! and hold roots: the total is the root of the sum of their squares, [`root_sum`]. [`Squares`] are not yet rooted.

pub mod action;
pub mod certificate;
pub mod contact_set;
pub mod efficiency;
pub mod energy;
pub mod errors;
pub mod exact;
pub mod finite_volume;
pub mod global_bound;
mod gradients;
pub mod oscillation;
pub mod paper;
pub mod residual;
pub mod squares;
pub mod sweep;

pub use action::{extend_to_boundary, nodal_action};
pub use certificate::{
    BoundaryOscillation, Certificate, Given, Grade, Moments, Near, Prepared, boundary_oscillation,
    certify,
};
pub use contact_set::{ContactSet, contact_set};
pub use efficiency::{Efficiency, efficiency};
pub use energy::{Energy, energy};
pub use errors::{TrueErrors, true_errors};
pub use exact::{Exact, Gradient};
pub use finite_volume::{Defect, FiniteVolume, finite_volume};
pub use global_bound::{GlobalBound, global_bound};
pub use oscillation::oscillation;
pub use paper::{Paper, paper};
pub use residual::residual;
pub use squares::Squares;
pub use sweep::{Sweep, sweep};

/// The total of local values: the root of the sum of their squares.
pub fn root_sum(local: &[f64]) -> f64 {
    local.iter().map(|v| v * v).sum::<f64>().sqrt()
}

#[cfg(test)]
mod testing;
