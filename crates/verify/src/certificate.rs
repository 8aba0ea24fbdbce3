//! The guaranteed bound: what a run claims of it, and what is recomputed.
//!
//! The claims are the cell array `certified`, the columns `certified` and `eta_alg`, the bound kinds `rt0` and `rt1`, and the object
//! `certificate = { bound, guaranteed, caveats }` of the summary. The bound is certified again from the mesh, the displacements and the forces of the file
//! and the fields of the scene; the fluxes that prove it are made anew ([`estimate::certificate`]), so that the solver has no part in it.

use adapt::level::BALANCE;
use adapt::output::folder::SUMMARY;
use adapt::settings::{Estimator, Final};
use adapt::{Assurance, Problem, Settings};
use estimate::certificate::POINCARE;
use estimate::{Given, Grade, certify};
use fem_core::FieldError;
use fem_core::scale::times_power_of_two;
use serde_json::{Map, Value};

use crate::data::Discrete;
use crate::indicators::Local;
use crate::number::Number;
use crate::report::Report;
use crate::tables::Cell;

/// Key of the summary.
pub(crate) const KEY: &str = "certificate";

/// The recomputed claims of the certificate of a level.
#[derive(Clone, Debug)]
pub(crate) struct Certificate {
    /// How its fluxes were made.
    pub grade: Grade,
    /// Local contributions (eta_K^2 + C on K)^(1/2), one a triangle.
    pub local: Local,
    /// The bound (B1), in units of the energy norm.
    pub bound: Number,
    /// The algebraic part of the bound.
    pub eta_alg: Number,
    /// The bound with the claimed estimate of the algebraic error in place of a large eta_alg, on a level that the run went on from.
    pub predicted: Option<Number>,
    /// What the bound holds for.
    pub assurance: Assurance,
}

impl Certificate {
    /// The name of its kind in the history.
    pub fn kind(&self) -> &'static str {
        match self.grade {
            _ if self.predicted.is_some() => "predicted",
            Grade::Rt0 => "rt0",
            Grade::Rt1 => "rt1",
        }
    }

    /// What the level is judged by.
    pub fn judged(&self) -> Number {
        self.predicted.unwrap_or(self.bound)
    }
}

/// Where a level stands in its run, as far as its certificate is concerned.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place<'a> {
    /// Whether the run ended regularly on this level.
    pub last: bool,
    /// The kind of bound that the history claims.
    pub claimed: Option<&'a str>,
    /// Whether the history claims a certificate.
    pub certified: bool,
    /// The bound that the history claims, in the user's units.
    pub bound: Option<f64>,
    /// The estimate of the algebraic error that the history claims, in the user's units.
    pub algebraic: Option<f64>,
}

impl Place<'_> {
    /// Whether there must be a certificate here.
    pub fn has(&self, settings: &Settings) -> bool {
        settings.estimate.wants(Estimator::Certified) && !self.left_out(settings)
    }

    /// Whether the certificate may be left out here and was: a level that the run went on from, judged by cheap indicators.
    pub fn left_out(&self, settings: &Settings) -> bool {
        let drives = settings.estimate.estimator == Estimator::Certified;
        drives && !self.last && !self.certified && self.claimed == Some("predicted")
    }
}

/// The grade that the certificate of a level must have: on the last level the one that the scene asks for; on an earlier one the sharp one stands
/// where it was claimed and the scene allows it, since the run may have tried it near its goal.
fn grade(settings: &Settings, place: Place<'_>) -> Grade {
    let sharp = settings.estimate.last == Final::Sharp;
    let drives = settings.estimate.estimator == Estimator::Certified;
    let tried = drives && place.claimed == Some("rt1");
    if sharp && (place.last || tried) {
        Grade::Rt1
    } else {
        Grade::Rt0
    }
}

/// Recomputes the certificate from the mesh, displacements and forces of a level and the load and tension fields of the problem, if the
/// scene asks for it.
///
/// # Errors
/// A value of the data that is not finite.
pub(crate) fn certificate(
    level: &Discrete<'_>,
    problem: &Problem,
    settings: &Settings,
    place: Place<'_>,
) -> Result<Option<Certificate>, FieldError> {
    let Some(moments) = &level.moments else {
        return Ok(None);
    };
    let load = problem.loads();
    let tension = problem.tensions();
    let given = Given {
        mesh: level.mesh,
        load,
        tension,
        moments,
        loads: &level.loads,
        tension_mean: &level.tension,
        displacement: &level.displacement,
        force: &level.force,
        threads: 1,
    };
    let found = certify(&given, grade(settings, place), POINCARE)?;
    let exponent = level.scale.energy_norm();
    // A run that tried the sharp one here reported what is guaranteed.
    let passed = !place.last && place.claimed != Some("rt1");
    let loose = found.algebraic > BALANCE * found.eta;
    let predicted = place.algebraic.filter(|_| passed && loose).map(|claimed| {
        let algebraic = times_power_of_two(claimed, -exponent);
        Number::plain(found.predicted(algebraic), exponent)
    });
    Ok(Some(Certificate {
        predicted,
        grade: found.grade,
        assurance: Assurance::of(level.mesh, &level.tension, problem, &found)?,
        local: Local {
            terms: vec![0.0; found.local.len()],
            value: found.local,
        },
        bound: Number::plain(found.bound, exponent),
        // It stands beside eta: less than rounding of that means nothing.
        eta_alg: Number::new(found.algebraic, found.eta, exponent),
    }))
}

/// Compares the object of the summary with the certificate of the last level.
pub(crate) fn check_summary(
    summary: &Map<String, Value>,
    level: Option<&Certificate>,
    report: &mut Report,
) {
    let claimed = summary.get(KEY).filter(|value| !value.is_null());
    let Some(certificate) = level else {
        let wrong = claimed.map(|_| "the scene asks for none".to_owned());
        report.property(SUMMARY, KEY, wrong);
        return;
    };
    let Some(claimed) = claimed.and_then(Value::as_object) else {
        report.property(SUMMARY, KEY, Some("it is missing".into()));
        return;
    };
    let expected = certificate.bound;
    let wrong = match Cell::of_json(claimed.get("bound")).number() {
        Some(bound) if expected.agrees(bound) => None,
        Some(bound) => Some(format!(
            "`bound` is {bound:e}, not {:e}",
            expected.physical()
        )),
        None => Some("`bound` is no number".into()),
    };
    report.property(SUMMARY, "certificate.bound", wrong);
    let Assurance {
        guaranteed,
        caveats,
    } = &certificate.assurance;
    let told = claimed.get("guaranteed").and_then(Value::as_bool);
    let wrong = (told != Some(*guaranteed)).then(|| format!("it should be {guaranteed}"));
    report.property(SUMMARY, "certificate.guaranteed", wrong);
    let same = claimed
        .get("caveats")
        .and_then(Value::as_array)
        .is_some_and(|told| {
            told.iter()
                .map(Value::as_str)
                .eq(caveats.iter().map(|c| Some(c.as_str())))
        });
    let wrong = (!same).then(|| format!("they should be {caveats:?}"));
    report.property(SUMMARY, "certificate.caveats", wrong);
    let extra = claimed
        .keys()
        .find(|key| !["bound", "guaranteed", "caveats"].contains(&key.as_str()));
    let wrong = extra.map(|key| format!("`{key}` is not known to this version"));
    report.property(SUMMARY, KEY, wrong);
}
