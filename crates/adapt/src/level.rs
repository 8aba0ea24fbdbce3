//! One level of a run: mesh, discrete problem, solution, estimates, and the step to the next.

use std::time::Instant;

use contact::{DiscreteProblem, Solution, Start};
use estimate::{Energy, Paper, TrueErrors, root_sum};
use fem_core::scale::times_power_of_two;
use fem_core::{Mesh, Scale, TriangleId};

use crate::discretise::discretise;
use crate::output::memory::peak_memory_mb;
use crate::problem::Problem;
use crate::record::LevelRecord;
use crate::run::LevelError;
use crate::settings::{Children, Estimator, Settings, Strategy};

/// A solved level. Everything is in scaled units but the record.
#[derive(Clone)]
pub struct Level {
    /// Number, from 0.
    pub number: usize,
    /// The mesh.
    pub mesh: Mesh,
    /// Matrices and loads.
    pub discrete: DiscreteProblem,
    /// Displacements, action, Riesz representative, contact set.
    pub solution: Solution,
    /// Indicators and errors.
    pub estimates: Estimates,
    /// The numbers of the level in the user's units.
    pub record: LevelRecord,
}

/// Indicators and errors of a level, one entry a triangle, scaled.
#[derive(Clone)]
pub struct Estimates {
    /// Indicators of the paper, if wanted.
    pub paper: Option<Paper>,
    /// Residual estimator, if wanted.
    pub residual: Option<Vec<f64>>,
    /// Data oscillation.
    pub oscillation: Vec<f64>,
    /// Errors against the exact solution, if known.
    pub errors: Option<TrueErrors>,
    /// Squares that triangles are marked by: the driving estimator and the oscillation.
    pub marking: Vec<f64>,
    /// The largest contribution h_K |K|^(1/2) |f_ih| of the loads to the driving estimator, before anything cancels.
    pub largest_contribution: f64,
    /// J(u_h) and |||u_h|||.
    pub energy: Energy,
    /// What the estimator does not see of the loads, in the unit of the bound: their oscillation, over the root of the tension where
    /// the energy norm is estimated.
    pub unseen: f64,
    /// The number that the run is judged by.
    pub bound: f64,
}

impl Level {
    /// Solves and estimates on the initial mesh.
    pub(crate) fn initial(
        problem: &Problem,
        settings: &Settings,
        begun: Instant,
    ) -> Result<Level, LevelError> {
        Level::on(
            problem.mesh.clone(),
            problem,
            settings,
            None,
            Steps {
                number: 0,
                refine: 0.0,
                begun,
            },
        )
    }

    /// Refines the marked triangles, carries the solution over, solves and estimates.
    pub(crate) fn refine(
        &self,
        marked: &[TriangleId],
        problem: &Problem,
        settings: &Settings,
        begun: Instant,
    ) -> Result<Level, LevelError> {
        let start = Instant::now();
        let mut mesh = self.mesh.clone();
        let children = match settings.mark.strategy {
            Strategy::Uniform => Children::Four,
            _ => settings.mark.children,
        };
        let refinement = mesh.refine(marked, children)?;
        let carried = Start::prolong(&self.solution, &mesh, refinement.old_vertices);
        let steps = Steps {
            number: self.number + 1,
            refine: start.elapsed().as_secs_f64(),
            begun,
        };
        Level::on(mesh, problem, settings, Some(carried), steps)
    }

    fn on(
        mesh: Mesh,
        problem: &Problem,
        settings: &Settings,
        carried: Option<Start>,
        steps: Steps,
    ) -> Result<Level, LevelError> {
        let clock = Instant::now();
        let discrete = discretise(problem, &mesh)?;
        let assemble = clock.elapsed().as_secs_f64();
        let clock = Instant::now();
        let solution = contact::solve(&discrete, &settings.solve, carried.as_ref())?;
        let solve = clock.elapsed().as_secs_f64();
        let clock = Instant::now();
        let estimates = Estimates::of(&mesh, &discrete, &solution, problem, settings)?;
        let mut record = record(
            &mesh,
            &discrete,
            &solution,
            &estimates,
            settings,
            problem.scale,
        );
        record.level = steps.number;
        record.seconds_refine = steps.refine;
        record.seconds_assemble = assemble;
        record.seconds_solve = solve;
        record.seconds_estimate = clock.elapsed().as_secs_f64();
        record.seconds_total = steps.begun.elapsed().as_secs_f64();
        record.peak_memory_mb = peak_memory_mb();
        Ok(Level {
            number: steps.number,
            mesh,
            discrete,
            solution,
            estimates,
            record,
        })
    }
}

/// What a level inherits from the step that led to it.
struct Steps {
    number: usize,
    refine: f64,
    begun: Instant,
}

impl Estimates {
    fn of(
        mesh: &Mesh,
        discrete: &DiscreteProblem,
        solution: &Solution,
        problem: &Problem,
        settings: &Settings,
    ) -> Result<Estimates, LevelError> {
        let wants = |e| settings.estimate.wants(e);
        let paper = wants(Estimator::Paper).then(|| estimate::paper(mesh, discrete, solution));
        let residual =
            wants(Estimator::Residual).then(|| estimate::residual(mesh, discrete, solution));
        let oscillation = estimate::oscillation(mesh, discrete);
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
        let weighted = settings.estimate.estimator == Estimator::Residual;
        // The driving estimator was asked for, so it is there.
        let unseen: Vec<f64> = (0..mesh.triangle_count())
            .map(|t| {
                let h = mesh.shape(TriangleId(t as u32)).diameter();
                let part = |i: usize| {
                    discrete.loads[i].deviation_squared[t]
                        / tension_weight(discrete, i, t, weighted)
                };
                h * h * (part(0) + part(1))
            })
            .collect();
        let driving: &[f64] = match (settings.estimate.estimator, &paper, &residual) {
            (Estimator::Paper, Some(paper), _) => &paper.eta_k,
            (_, _, residual) => residual.as_deref().unwrap_or_default(),
        };
        let marking: Vec<f64> = driving
            .iter()
            .zip(&unseen)
            .map(|(e, o)| e * e + o)
            .collect();
        let unseen = unseen.iter().sum::<f64>().sqrt();
        let bound = match settings.estimate.estimator {
            Estimator::Paper => marking.iter().sum::<f64>().sqrt(),
            Estimator::Residual => root_sum(driving),
        };
        let mut largest = 0.0f64;
        for t in mesh.triangle_ids() {
            let shape = mesh.shape(t);
            let weight = shape.diameter().powi(2) * shape.area;
            let square = [0, 1].map(|i| {
                let mean = discrete.loads[i].mean[t.index()];
                weight * mean * mean / tension_weight(discrete, i, t.index(), weighted)
            });
            largest = largest.max(square[0] + square[1]);
        }
        Ok(Estimates {
            paper,
            residual,
            oscillation,
            errors,
            marking,
            unseen,
            largest_contribution: largest.sqrt(),
            energy: estimate::energy(mesh, discrete, solution),
            bound,
        })
    }
}

/// The tension that the squares of an estimator of the energy norm are divided by; 1 for the paper's.
fn tension_weight(
    discrete: &DiscreteProblem,
    membrane: usize,
    triangle: usize,
    weighted: bool,
) -> f64 {
    if weighted {
        discrete.tension_mean[membrane][triangle]
    } else {
        1.0
    }
}

/// Puts the scale back: the numbers of a level in the user's units.
fn record(
    mesh: &Mesh,
    discrete: &DiscreteProblem,
    solution: &Solution,
    estimates: &Estimates,
    settings: &Settings,
    scale: Scale,
) -> LevelRecord {
    let by = times_power_of_two;
    let (bound_exponent, bound_kind) = bound_unit(settings.estimate.estimator, scale);
    let Energy {
        energy,
        energy_norm: norm,
    } = estimates.energy;
    // A quotient of different units; the exponents are joined first, so that neither number can leave the range.
    let over = |number: f64| {
        (number != 0.0).then(|| {
            by(
                estimates.bound / number,
                bound_exponent - scale.energy_norm(),
            )
        })
    };
    let in_contact = || (0..mesh.vertex_count()).filter(|&j| solution.contact[j]);
    let pressures = (0..mesh.vertex_count()).map(|j| solution.force[j] / discrete.dual_area[j]);
    let errors = estimates.errors.as_ref();
    LevelRecord {
        level: 0,
        vertices: mesh.vertex_count(),
        triangles: mesh.triangle_count(),
        unknowns: solution.info.unknowns,
        contact_vertices: in_contact().count(),
        contact_area: by(
            in_contact()
                .map(|j| discrete.dual_area[j])
                .fold(0.0, |a, b| a + b),
            scale.area(),
        ),
        energy: by(energy, scale.energy()),
        energy_norm: by(norm, scale.energy_norm()),
        eta_k: estimates
            .paper
            .as_ref()
            .map(|p| by(p.eta_k_total(), scale.force())),
        eta_e_sum: estimates
            .paper
            .as_ref()
            .map(|p| by(p.eta_e_sum(), scale.force())),
        residual: estimates
            .residual
            .as_ref()
            .map(|r| by(root_sum(r), scale.energy_norm())),
        oscillation: by(root_sum(&estimates.oscillation), scale.force()),
        error_bound: by(estimates.bound, bound_exponent),
        bound_kind,
        relative_bound: over(norm),
        true_error: errors.map(|e| by(e.energy, scale.energy_norm())),
        effectivity: errors.and_then(|e| over(e.energy)),
        sigma_error: errors.and_then(|e| e.sigma).map(|s| by(s, scale.force())),
        h1_error: errors.map(|e| by(e.h1_total, scale.displacement())),
        solver: solution.info.solver,
        reduction: solution.info.reduction,
        iterations: solution.info.iterations,
        kkt_residual: solution.info.kkt_residual,
        contact_force: by(solution.force.iter().fold(0.0, |a, b| a + b), scale.force()),
        max_action: by(pressures.fold(0.0, f64::max), scale.load),
        smallest_gap: by(
            (0..mesh.vertex_count())
                .map(|j| solution.gap(j))
                .fold(f64::INFINITY, f64::min),
            scale.displacement(),
        ),
        seconds_refine: 0.0,
        seconds_assemble: 0.0,
        seconds_solve: 0.0,
        seconds_estimate: 0.0,
        seconds_total: 0.0,
        peak_memory_mb: None,
    }
}

/// Exponent of the unit of an estimator, and its name in the history.
pub(crate) fn bound_unit(estimator: Estimator, scale: Scale) -> (i32, &'static str) {
    match estimator {
        Estimator::Residual => (scale.energy_norm(), "residual"),
        Estimator::Paper => (scale.force(), "paper"),
    }
}
