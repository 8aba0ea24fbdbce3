//! Indicators, errors and bounds of a level.

use contact::{DiscreteProblem, Solution};
use estimate::certificate::POINCARE;
use estimate::{
    Certificate, ContactSet, Energy, Given, GlobalBound, Grade, Moments, Paper, Prepared, Squares,
    TrueErrors, certify,
};
use fem_core::{Mesh, Scale};

use crate::level::BALANCE;
use crate::problem::Problem;
use crate::run::LevelError;
use crate::settings::{Estimator, Settings};

/// Indicators and errors of a level, one entry a triangle, scaled.
#[derive(Clone)]
pub struct Estimates {
    /// Indicators of the paper, if wanted.
    pub paper: Option<Paper>,
    /// The terms of the paper's global bound, if its indicators are wanted.
    pub global_bound: Option<GlobalBound>,
    /// Residual estimator, if wanted.
    pub residual: Option<Squares>,
    /// The certificate, if wanted and made on this level.
    pub certificate: Option<Certificate>,
    /// Data oscillation; none for constant loads, which have no oscillation.
    pub oscillation: Option<Squares>,
    /// Errors against the exact solution, if known.
    pub errors: Option<TrueErrors>,
    /// The contact set against the exact one, if that is known.
    pub contact_set: Option<ContactSet>,
    /// Squares that triangles are marked by: the driving estimator and the oscillation.
    pub marking: Vec<f64>,
    /// The largest contribution h_K |K|^(1/2) |f_ih| of the loads to the driving estimator, before anything cancels.
    pub largest_contribution: f64,
    /// J(u_h) and |||u_h|||.
    pub energy: Energy,
    /// What the estimator does not see of the loads, in the unit of the bound: their oscillation, over the root of the tension where
    /// the energy norm is estimated. The certificate sees everything.
    pub unseen: f64,
    /// The number that the run is judged by.
    pub bound: f64,
    /// Whether the bound is predicted: by the cheap indicators, or with the estimated algebraic error in place of eta_alg, since that is
    /// large beside eta.
    pub predicted: bool,
    /// The cheap indicators of a run that the certificate drives: the residual estimator, and the oscillation over the root of the tension.
    pub cheap: Option<f64>,
    /// What the bound would be without eta_alg: within reach of the solver on this mesh.
    pub reachable: f64,
    /// The size of the energy error as far as the estimators tell; the certificate's eta, or two fifths of the residual estimator.
    pub error_size: Option<f64>,
}

impl Estimates {
    /// `prepared` is the first part of the certificate of the same solution, if it was made.
    #[allow(
        clippy::too_many_arguments,
        reason = "the same list as everywhere, and what is known of the certificate"
    )]
    pub(crate) fn of(
        mesh: &Mesh,
        discrete: &DiscreteProblem,
        moments: Option<&Moments>,
        prepared: Option<&Prepared>,
        solution: &Solution,
        problem: &Problem,
        settings: &Settings,
        forecast: Option<f64>,
    ) -> Result<Estimates, LevelError> {
        let drives = settings.estimate.estimator == Estimator::Certified;
        let wants = |e| settings.estimate.wants(e);
        let paper = wants(Estimator::Paper).then(|| estimate::paper(mesh, discrete, solution));
        let sweep = estimate::sweep(
            mesh,
            discrete,
            solution,
            drives || wants(Estimator::Residual),
            settings.solve.threads,
        );
        let oscillation = sweep.oscillation;
        let global_bound = paper.as_ref().map(|paper| {
            let oscillation = oscillation.as_ref().map_or(0.0, Squares::total);
            estimate::global_bound(mesh, discrete, solution, paper, oscillation)
        });
        let errors = match &problem.exact {
            Some(exact) => Some(estimate::true_errors(
                mesh,
                &discrete.tension_mean,
                &solution.displacement,
                &solution.sigma,
                exact,
                &problem.tension,
            )?),
            None => None,
        };
        let contact_set = match problem.exact.as_ref().and_then(|e| e.contact.as_deref()) {
            Some(exact) => Some(estimate::contact_set(mesh, &solution.contact, exact)?),
            None => None,
        };
        let certificate = match moments {
            Some(moments) => {
                let given = Given {
                    threads: settings.solve.threads,
                    ..given(problem, discrete, moments, solution)
                };
                Some(match prepared {
                    Some(prepared) => prepared.certify(&given, POINCARE)?,
                    None => certify(&given, Grade::Rt0, POINCARE)?,
                })
            }
            None => None,
        };
        let residual = sweep.residual;
        let cheap = residual.as_ref().filter(|_| drives).map(|residual| {
            let unseen = sweep.weighted_oscillation.as_ref();
            residual.total().hypot(unseen.map_or(0.0, Squares::total))
        });
        // The driving estimator was asked for, so it is there. The certificate sees all of the loads.
        let (mut marking, unseen) = match settings.estimate.estimator {
            Estimator::Paper => (
                paper.as_ref().map_or(Vec::new(), |p| squares(&p.eta_k)),
                oscillation.as_ref(),
            ),
            Estimator::Residual => (
                residual.as_ref().map_or(Vec::new(), |r| r.squares().into()),
                sweep.weighted_oscillation.as_ref(),
            ),
            Estimator::Certified => match &certificate {
                Some(certificate) => (squares(&certificate.local), None),
                None => (
                    residual.as_ref().map_or(Vec::new(), |r| r.squares().into()),
                    sweep.weighted_oscillation.as_ref(),
                ),
            },
        };
        if let Some(unseen) = unseen {
            for (square, unseen) in marking.iter_mut().zip(unseen.squares()) {
                *square += unseen;
            }
        }
        let unseen = unseen.filter(|_| !drives).map_or(0.0, Squares::total);
        let predicted = forecast.zip(cheap).map_or(0.0, |(q, cheap)| q * cheap);
        let bound = match settings.estimate.estimator {
            Estimator::Paper => marking.iter().sum::<f64>().sqrt(),
            Estimator::Residual => residual.as_ref().map_or(0.0, Squares::total),
            Estimator::Certified => certificate.as_ref().map_or(predicted, |c| c.bound),
        };
        let largest_contribution = match settings.estimate.estimator {
            Estimator::Paper => sweep.largest_contribution,
            Estimator::Residual | Estimator::Certified => sweep.weighted_contribution,
        };
        let mut estimates = Estimates {
            paper,
            global_bound,
            residual: residual.filter(|_| wants(Estimator::Residual)),
            certificate,
            oscillation,
            errors,
            contact_set,
            marking,
            unseen,
            largest_contribution,
            energy: sweep.energy,
            bound,
            predicted: false,
            cheap,
            reachable: bound,
            error_size: None,
        };
        estimates.judge(drives, solution.info.algebraic_error);
        Ok(estimates)
    }

    /// Takes in a certificate; returns the quotient of the new bound and the old one, 1 where both vanish.
    pub(crate) fn replace(&mut self, new: Certificate, solution: &Solution, drives: bool) -> f64 {
        let before = self.certificate.as_ref().map_or(0.0, |c| c.bound);
        let ratio = if before > 0.0 {
            new.bound / before
        } else {
            1.0
        };
        if drives && new.grade == Grade::Rt0 {
            self.marking = squares(&new.local);
        }
        self.certificate = Some(new);
        self.judge(drives, solution.info.algebraic_error);
        ratio
    }

    /// What the bound, without its algebraic part, is of the cheap indicators on a level that has both.
    pub(crate) fn quotient(&self) -> Option<f64> {
        let bound = self.certificate.as_ref()?.predicted(0.0);
        self.cheap
            .map(|cheap| bound / cheap)
            .filter(|quotient| quotient.is_finite() && *quotient > 0.0)
    }

    /// The bound as it is guaranteed, whatever eta_alg is; for a level that may be the last.
    pub(crate) fn guarantee(&mut self, drives: bool) {
        self.judge(drives, None);
    }

    /// What follows from the certificate, or from the residual estimator where there is none.
    ///
    /// `algebraic` is the algebraic error as an iterative solver estimates it.
    fn judge(&mut self, drives: bool, algebraic: Option<f64>) {
        self.reachable = self.bound;
        if let Some(certificate) = &self.certificate {
            self.error_size = Some(certificate.eta);
            if drives {
                self.reachable = certificate.predicted(0.0);
                let loose = certificate.algebraic > BALANCE * certificate.eta;
                self.predicted = loose && algebraic.is_some();
                self.bound = match algebraic.filter(|_| loose) {
                    Some(algebraic) => certificate.predicted(algebraic),
                    None => certificate.bound,
                };
            }
        } else if drives {
            self.predicted = true;
            self.error_size = Some(self.bound);
        } else if let Some(residual) = &self.residual {
            self.error_size = Some(RESIDUAL_SHARE * residual.total());
        }
    }
}

/// Part of the residual estimator that the solver is told as the size of the error. The estimator is 4 to 7 times the error, so that [`BALANCE`] leaves an algebraic
/// error of a sixth to two sevenths of it, which adds 1 to 4 hundredths to the whole; half as much would cost a second step on every level.
const RESIDUAL_SHARE: f64 = 0.4;

/// The squares of indicators that are given as roots.
fn squares(local: &[f64]) -> Vec<f64> {
    local.iter().map(|e| e * e).collect()
}

/// Exponent of the unit of an estimator.
pub(crate) fn bound_unit(estimator: Estimator, scale: Scale) -> i32 {
    match estimator {
        Estimator::Certified | Estimator::Residual => scale.energy_norm(),
        Estimator::Paper => scale.force(),
    }
}

/// What a certificate is made from, on one thread.
pub fn given<'a>(
    problem: &'a Problem,
    discrete: &'a DiscreteProblem,
    moments: &'a Moments,
    solution: &'a Solution,
) -> Given<'a> {
    Given {
        mesh: &discrete.mesh,
        load: problem.loads(),
        tension: problem.tensions(),
        moments,
        loads: &discrete.loads,
        tension_mean: &discrete.tension_mean,
        displacement: &solution.displacement,
        force: &solution.force,
        threads: 1,
    }
}
