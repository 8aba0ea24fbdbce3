//! The guaranteed bound: what a run may claim of it, and what is recomputed.
//!
//! The claims are the cell array `certified`, the columns `certified` and `eta_alg`, the bound kinds `rt0` and `rt1`, and the object
//! `certificate = { bound, guaranteed, caveats }` of the summary. This version of the program makes none of them; whatever a file claims of a
//! certificate is refused.

use adapt::output::folder::SUMMARY;
use adapt::{Problem, Settings};
use serde_json::{Map, Value};

use crate::data::Discrete;
use crate::indicators::Local;
use crate::number::Number;
use crate::report::Report;

/// Key of the summary.
pub(crate) const KEY: &str = "certificate";

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

/// Recomputes the certificate from the mesh, displacements and forces of a level and the load and tension fields of the problem;
/// `last` tells the level that `estimate.final` is about.
///
/// None in this version.
pub(crate) fn certificate(
    _level: &Discrete<'_>,
    _problem: &Problem,
    _settings: &Settings,
    _last: bool,
) -> Option<Certificate> {
    None
}

/// Compares the object of the summary with the certificate of the last level.
pub(crate) fn check_summary(
    summary: &Map<String, Value>,
    level: Option<&Certificate>,
    report: &mut Report,
) {
    let claimed = summary.get(KEY).is_some_and(|value| !value.is_null());
    let wrong = (claimed && level.is_none()).then(|| "it is not recomputed by this version".into());
    report.property(SUMMARY, KEY, wrong);
}
