//! The columns of a level: how each is recomputed. One entry a column; a new column needs one line here.

use adapt::settings::Estimator;
use adapt::{Problem, Settings};
use estimate::{ContactSet, TrueErrors, contact_set};
use fem_core::scale::times_power_of_two;
use fem_core::{FieldError, Scale};

use crate::certificate::{Certificate, Place, certificate};
use crate::conditions::kkt_residual;
use crate::data::Discrete;
use crate::indicators::{Local, Paper, energy, global_bound, oscillation, paper, residual};
use crate::number::{Number, sum};
use crate::sigma::seminorm;
use crate::tables::Entry;

/// Everything that the columns of a level are read off.
pub(crate) struct Recomputed<'a> {
    /// Data and fields.
    pub discrete: &'a Discrete<'a>,
    /// Number of the level.
    pub level: usize,
    /// How the scene is run.
    pub settings: &'a Settings,
    /// Units.
    pub scale: Scale,
    /// Indicators of the paper, if the scene asks for them.
    pub paper: Option<Paper>,
    /// Residual estimator, if the scene asks for it.
    pub residual: Option<Local>,
    /// (7.11) as it stands and repaired, if the scene asks for the paper's indicators.
    pub global: Option<[Number; 2]>,
    /// The contact set against the exact one, if the scene gives it.
    pub contact_set: Option<ContactSet>,
    /// The certificate, if the scene asks for it.
    pub certificate: Option<Certificate>,
    /// The bound that is claimed on a level without a certificate, in a run that the certificate drives: a prediction, which proves nothing and
    /// is not recomputed.
    pub predicted: Option<f64>,
    /// Oscillation of the loads.
    pub oscillation: Local,
    /// J(u_h).
    pub energy: Number,
    /// |||u_h|||.
    pub norm: Number,
    /// Errors against the exact solution, if the scene has one.
    pub errors: Option<TrueErrors>,
}

impl<'a> Recomputed<'a> {
    /// Recomputes whatever the scene asks for.
    ///
    /// # Errors
    /// A value of an exact gradient that is not finite.
    pub fn new(
        discrete: &'a Discrete<'a>,
        level: usize,
        problem: &Problem,
        settings: &'a Settings,
        place: Place<'_>,
    ) -> Result<Self, FieldError> {
        let scale = problem.scale;
        let wants = |e| settings.estimate.wants(e);
        let (energy, norm) = energy(discrete, scale);
        let errors = problem.exact.as_ref().map(|exact| {
            estimate::true_errors(
                discrete.mesh,
                &discrete.tension,
                &discrete.displacement,
                &discrete.sigma,
                exact,
                &problem.tension,
            )
        });
        let oscillation = oscillation(discrete);
        let paper = wants(Estimator::Paper).then(|| paper(discrete));
        let contact_set = match problem.exact.as_ref().and_then(|e| e.contact.as_deref()) {
            Some(exact) => Some(contact_set(discrete.mesh, &discrete.contact, exact)?),
            None => None,
        };
        Ok(Recomputed {
            global: paper
                .as_ref()
                .map(|p| global_bound(discrete, p, &oscillation)),
            paper,
            residual: wants(Estimator::Residual).then(|| residual(discrete)),
            predicted: place.bound.filter(|_| place.left_out(settings)),
            certificate: certificate(discrete, problem, settings, place)?,
            contact_set,
            oscillation,
            errors: errors.transpose()?,
            discrete,
            level,
            settings,
            scale,
            energy,
            norm,
        })
    }

    /// The weight that the squares of loads are divided by in the driving estimator: its tension, or 1 for the paper's.
    pub fn weight(&self, membrane: usize, triangle: usize) -> f64 {
        match self.settings.estimate.estimator {
            Estimator::Paper => 1.0,
            Estimator::Certified | Estimator::Residual => self.discrete.tension[membrane][triangle],
        }
    }

    /// The number that the run is judged by.
    pub fn bound(&self) -> Option<Number> {
        match self.settings.estimate.estimator {
            Estimator::Certified => match &self.certificate {
                Some(certificate) => Some(certificate.judged()),
                None => {
                    let exponent = self.scale.energy_norm();
                    let scaled = |bound| times_power_of_two(bound, -exponent);
                    self.predicted.map(|b| Number::plain(scaled(b), exponent))
                }
            },
            Estimator::Residual => {
                let local = self.residual.as_ref()?;
                Some(local.root(self.scale.energy_norm()))
            }
            Estimator::Paper => {
                let eta = self.paper.as_ref()?.eta_k.root(0);
                let oscillation = self.oscillation.root(0);
                let slack = eta.slack + oscillation.slack;
                Some(Number {
                    value: eta.value.hypot(oscillation.value),
                    slack,
                    exponent: self.scale.force(),
                })
            }
        }
    }

    fn true_error(&self) -> Option<Number> {
        let errors = self.errors.as_ref()?;
        Some(Number::new(
            errors.energy,
            self.norm.value,
            self.norm.exponent,
        ))
    }

    fn h1_error(&self) -> Option<Number> {
        let errors = self.errors.as_ref()?;
        let [a, b] = [0, 1].map(|i| seminorm(self.discrete, &self.discrete.displacement[i]));
        Some(Number::new(
            errors.h1_total,
            a + b,
            self.scale.displacement(),
        ))
    }

    fn sigma_error(&self) -> Option<Number> {
        let error = self.errors.as_ref()?.sigma?;
        let terms = seminorm(self.discrete, &self.discrete.sigma);
        Some(Number::new(error, terms, self.scale.force()))
    }

    fn unknowns(&self) -> Vec<usize> {
        let d = self.discrete;
        let interior = (0..d.vertices()).filter(|&j| d.is_interior(j)).count();
        // Full contact has half the unknowns, if the scene allows the model.
        let full = interior > 0 && d.in_contact().count() == interior && self.settings.solve.reduce;
        if full && shares_boundary(d) {
            vec![interior]
        } else {
            vec![2 * interior]
        }
    }

    fn contact_area(&self) -> Number {
        let area = sum(self
            .discrete
            .in_contact()
            .map(|j| self.discrete.dual_area[j]));
        Number::plain(area, self.scale.area())
    }

    fn max_action(&self) -> Number {
        let d = self.discrete;
        let pressures = d.force.iter().zip(&d.dual_area).map(|(z, area)| z / area);
        Number::plain(pressures.fold(0.0, f64::max), self.scale.load)
    }

    /// The smallest gap; it stands in the summary only.
    pub fn smallest_gap(&self) -> Number {
        let gaps = (0..self.discrete.vertices()).map(|j| self.discrete.gap(j));
        Number::plain(
            gaps.fold(f64::INFINITY, f64::min),
            self.scale.displacement(),
        )
    }
}

/// Whether both heights are equal on the whole boundary.
pub(crate) fn shares_boundary(d: &Discrete<'_>) -> bool {
    (0..d.vertices()).all(|j| d.is_interior(j) || d.heights[0][j] == d.heights[1][j])
}

/// A column and how it is recomputed.
type Column = (&'static str, fn(&Recomputed<'_>) -> Entry);

/// Every column, in the order of the history.
pub(crate) const COLUMNS: &[Column] = &[
    ("level", |r| Entry::Count(vec![r.level])),
    ("vertices", |r| Entry::Count(vec![r.discrete.vertices()])),
    ("triangles", |r| {
        Entry::Count(vec![r.discrete.elements.len()])
    }),
    ("unknowns", |r| Entry::Count(r.unknowns())),
    ("contact_vertices", |r| {
        Entry::Count(vec![r.discrete.in_contact().count()])
    }),
    ("contact_area", |r| Entry::Number(r.contact_area())),
    ("energy", |r| Entry::Number(r.energy)),
    ("energy_norm", |r| Entry::Number(r.norm)),
    ("eta_K", |r| {
        r.paper
            .as_ref()
            .map(|p| p.eta_k.root(r.scale.force()))
            .into()
    }),
    ("eta_e_sum", |r| {
        r.paper
            .as_ref()
            .map(|p| p.eta_e.sum(r.scale.force()))
            .into()
    }),
    ("residual", |r| {
        r.residual
            .as_ref()
            .map(|l| l.root(r.scale.energy_norm()))
            .into()
    }),
    ("certified", |r| {
        r.certificate.as_ref().map(|c| c.bound).into()
    }),
    ("oscillation", |r| {
        Entry::Number(r.oscillation.root(r.scale.force()))
    }),
    ("error_bound", |r| r.bound().into()),
    ("relative_bound", |r| {
        r.bound().and_then(|b| b.over(r.norm)).into()
    }),
    ("true_error", |r| r.true_error().into()),
    ("effectivity", |r| {
        r.bound()
            .zip(r.true_error())
            .and_then(|(b, e)| b.over(e))
            .into()
    }),
    ("sigma_error", |r| r.sigma_error().into()),
    ("solver", |_| Entry::Covered),
    ("iterations", |_| Entry::Covered),
    ("kkt_residual", |r| Entry::Number(kkt_residual(r.discrete))),
    ("seconds_refine", |_| Entry::Covered),
    ("seconds_assemble", |_| Entry::Covered),
    ("seconds_solve", |_| Entry::Covered),
    ("seconds_estimate", |_| Entry::Covered),
    ("seconds_total", |_| Entry::Covered),
    ("peak_memory_mb", |_| Entry::Covered),
    ("bound_kind", |r| {
        Entry::Name(match r.settings.estimate.estimator {
            Estimator::Certified => r
                .certificate
                .as_ref()
                .map_or("predicted", Certificate::kind),
            Estimator::Residual => "residual",
            Estimator::Paper => "paper",
        })
    }),
    ("eta_alg", |r| {
        r.certificate.as_ref().map(|c| c.eta_alg).into()
    }),
    ("bound_711", |r| r.global.map(|[literal, _]| literal).into()),
    ("bound_711_repaired", |r| {
        r.global.map(|[_, repaired]| repaired).into()
    }),
    ("h1_error", |r| r.h1_error().into()),
    ("contact_force", |r| {
        let force = sum(r.discrete.force.iter().copied());
        Entry::Number(Number::plain(force, r.scale.force()))
    }),
    ("max_action", |r| Entry::Number(r.max_action())),
    ("contact_area_error", |r| {
        let set = r.contact_set.as_ref();
        let number =
            |s: &ContactSet| Number::new(s.area_error(), s.area + s.exact_area, r.scale.area());
        set.map(number).into()
    }),
    ("contact_jaccard", |r| {
        let set = r.contact_set.as_ref();
        set.map(|s| Number::plain(s.jaccard(), 0)).into()
    }),
    ("contact_hausdorff", |r| {
        let set = r.contact_set.as_ref();
        set.and_then(|s| s.hausdorff)
            .map(|d| Number::plain(d, r.scale.length))
            .into()
    }),
    // An estimate from the way of the solver; eta_alg is what it can be no larger than.
    ("algebraic_error", |_| Entry::Covered),
];

#[cfg(test)]
mod tests {
    #[test]
    fn every_column_of_the_history_has_its_entry() {
        let here = super::COLUMNS.iter().map(|(name, _)| *name);
        assert!(here.eq(adapt::output::columns::COLUMNS.iter().map(|c| c.name)));
    }
}
