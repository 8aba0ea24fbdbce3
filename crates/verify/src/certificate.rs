//! The guaranteed bound: what a run may claim of it, and what is recomputed.
//!
//! The claims are the cell array `certified` and the columns `certified`, `eta_alg`, the bound kinds `rt0` and `rt1`, and the object
//! `certificate = { bound, guaranteed, caveats }` of the summary. This version of the program makes none of them.

use crate::data::Discrete;
use crate::indicators::Local;
use crate::number::Number;

/// The recomputed claims of the certificate of a level.
#[derive(Clone, Debug)]
pub(crate) struct Certificate {
    /// Local contributions (eta_K^2 + C on K)^(1/2), one a triangle.
    pub local: Local,
    /// The bound (B1), in units of the energy norm.
    pub bound: Number,
    /// The algebraic part of the bound.
    pub eta_alg: Number,
}

/// Recomputes the certificate from the mesh, the load and tension fields (`level.problem`), the displacements and the force.
///
/// None in this version: whatever a file claims of a certificate is then refused.
pub(crate) fn certificate(_level: &Discrete<'_>) -> Option<Certificate> {
    None
}
