//! Multigrid: conjugate gradients preconditioned by one symmetric cycle over the bisection hierarchy, truncated on the contact set.
//!
//! From the bottom up: `hierarchy` (what the births say), `unknowns` (one field or two), `finest` (the matrix of the mesh), `galerkin`
//! (those of all levels), `coarse` (the initial mesh), `cycle`, `step` and `descent` (the method), and here the fields of a
//! problem one after the other. Where the tensions reduce these are the mean (linear), the gap (an obstacle problem) and sigma; else both displacements
//! together, glued where they touch, and sigma.

mod coarse;
mod cycle;
mod descent;
mod finest;
mod galerkin;
mod hierarchy;
mod step;
#[cfg(test)]
mod tests;
mod unknowns;

use fem_core::SymmetricMatrix;

use crate::error::SolveError;
use crate::interior::Role;
use crate::level::{Level, ROW_ROUNDING};
use crate::problem::DiscreteProblem;
use crate::reduce::{Proportional, initial_pair, pair_system};
use crate::settings::{Settings, Tolerance};
use crate::solution::{Cycles, Reduction, Solution, SolveInfo, Status, kkt_residual};
use crate::start::Start;
use crate::system::System;
use descent::{Descent, Goal, Report, Vectors};
use finest::Finest;
use galerkin::Levels;
use hierarchy::Hierarchy;
use unknowns::{Pair, Scalar, Unknowns};

/// Name of the method in the record.
pub(crate) const MULTIGRID: &str = "multigrid";

/// The relative KKT residual to go to when neither it nor the energy error is prescribed.
const KKT: f64 = 1e-10;

/// The inequality is solved to this part of a prescribed KKT residual: the mean takes the rest.
const SHARE: f64 = 0.9;

/// With a contraction beyond this every level takes steps enough to see how far it has come.
const SLOW: f64 = 0.25;

/// What the part left by a first step grows by when it is handed on unseen: after about ten levels of one step each it is looked at
/// again.
const AGEING: f64 = 1.25;

/// A field after its descent, in the order of the mesh.
struct Solved<U: Unknowns> {
    x: Vec<U::Value>,
    /// The residual, of an inequality.
    r: Vec<U::Value>,
    contact: Vec<bool>,
    report: Report,
}

/// The solution by multigrid; `None` on a mesh without bisections, where the initial mesh is everything.
///
/// Its status says whether every field of the model reached its goal; sigma is empty where its own solve did not converge.
pub(crate) fn solve(
    level: &Level,
    settings: &Settings,
    start: Option<&Start>,
) -> Result<Option<Solution>, SolveError> {
    let problem = level.problem;
    if !has_levels(problem) {
        return Ok(None);
    }
    let hierarchy = Hierarchy::new(problem);
    let run = Run {
        level,
        settings,
        start,
        hierarchy: &hierarchy,
    };
    let reduced = Proportional::of(problem).filter(|_| settings.reduce);
    match reduced {
        Some(model) => run.reduced(&model),
        None => run.pair(),
    }
    .map(Some)
}

/// K sigma = z for given forces, where there is a hierarchy and the method converges.
pub(crate) fn sigma(
    level: &Level,
    settings: &Settings,
    force: &[f64],
) -> Result<Option<Vec<f64>>, SolveError> {
    if !has_levels(level.problem) {
        return Ok(None);
    }
    let run = Run {
        level,
        settings,
        start: None,
        hierarchy: &Hierarchy::new(level.problem),
    };
    let (sigma, _) = run.sigma(force, None)?;
    Ok(Some(sigma).filter(|s| !s.is_empty()))
}

/// One solve on one hierarchy.
struct Run<'a> {
    level: &'a Level<'a>,
    settings: &'a Settings,
    start: Option<&'a Start>,
    hierarchy: &'a Hierarchy,
}

/// What the fields of a model add up to.
struct Model {
    displacement: [Vec<f64>; 2],
    force: Vec<f64>,
    contact: Vec<bool>,
    reduction: Reduction,
    /// Matrix and levels of sigma, where the model has them.
    laplacian: Option<(Finest<Scalar>, Levels<Scalar>)>,
    mean: Option<Report>,
    inequality: Report,
    error_squared: f64,
}

impl Run<'_> {
    fn reduced(&self, model: &Proportional) -> Result<Solution, SolveError> {
        let interior = &self.level.interior;
        let matrices = [model.matrix];
        let finest = Finest::<Scalar>::new(self.hierarchy, &matrices);
        let mut levels = Levels::<Scalar>::new(self.hierarchy);
        let none = vec![false; self.hierarchy.len()];
        levels.sweep(self.hierarchy, &finest, &none)?;
        drop(none);
        let [mean_weight, gap_weight] = model.energy_weights();
        let initial = model.initial_mean(interior, self.start);
        let mean_load = |_: usize, j: usize| model.mean_load(j);
        let vectors = self.vectors::<Scalar>(&matrices, &[initial], &mean_load, true);
        let goal = self.goal(mean_weight, Goal::Tight);
        let mean = self.descend(&finest, &mut levels, &matrices, None, vectors, goal)?;
        let size = mean.x.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let system = model.system(interior);
        let initial = model.initial_gap(interior, self.start).remove(0);
        let load = |i: usize, j: usize| system.loads[i][j];
        let mut vectors = self.vectors::<Scalar>(&matrices, &[initial], &load, true);
        // Half the gap and the mean are bounds of the largest displacement from below.
        vectors.boundary_size = vectors.boundary_size.max(2.0 * size);
        let goal = self.goal(gap_weight, Goal::Kkt(0.5 * SHARE * self.kkt()));
        let gap = self.descend(
            &finest,
            &mut levels,
            &matrices,
            Some(&system),
            vectors,
            goal,
        )?;
        let displacement = model.displacements(interior, &mean.x, &gap.x);
        let mut force = vec![0.0; self.hierarchy.len()];
        for j in interior.iter().filter(|&j| gap.contact[j]) {
            let terms = system.loads[0][j].abs() + model.matrix.row_dot_abs(j, &gap.x);
            if -gap.r[j] > ROW_ROUNDING * terms {
                force[j] = -gap.r[j];
            }
        }
        model.forces(&mut force);
        let error_squared =
            mean_weight * mean.report.error_squared + gap_weight * gap.report.error_squared;
        self.finish(Model {
            displacement,
            force,
            reduction: self.level.named(&gap.contact, model.reduction),
            contact: gap.contact,
            laplacian: (model.role == Role::Laplacian).then_some((finest, levels)),
            mean: Some(mean.report),
            inequality: gap.report,
            error_squared,
        })
    }

    fn pair(&self) -> Result<Solution, SolveError> {
        let interior = &self.level.interior;
        let problem = self.level.problem;
        let system = pair_system(problem, interior);
        let initial = initial_pair(problem, interior, self.start);
        let load = |i: usize, j: usize| system.loads[i][j];
        let finest = Finest::<Pair>::new(self.hierarchy, &system.matrices);
        let mut levels = Levels::<Pair>::new(self.hierarchy);
        let vectors = self.vectors::<Pair>(&system.matrices, &initial, &load, false);
        let goal = self.goal(0.5, Goal::Kkt(SHARE * self.kkt()));
        let both = self.descend(
            &finest,
            &mut levels,
            &system.matrices,
            Some(&system),
            vectors,
            goal,
        )?;
        drop((finest, levels));
        let mut displacement = problem.heights.clone();
        let mut force = vec![0.0; self.hierarchy.len()];
        for j in interior.iter() {
            let u = both.x[j];
            displacement[0][j] = u[0];
            displacement[1][j] = u[1];
        }
        for j in interior.iter().filter(|&j| both.contact[j]) {
            let i = usize::from(problem.diagonal(1, j) < problem.diagonal(0, j));
            let z = if i == 0 { -both.r[j][0] } else { both.r[j][1] };
            let terms =
                system.loads[i][j].abs() + problem.stiffness[i].row_dot_abs(j, &displacement[i]);
            if z > ROW_ROUNDING * terms {
                force[j] = z;
            }
        }
        let reduction = if self.settings.reduce {
            self.level.named(&both.contact, Reduction::TwoField)
        } else {
            Reduction::TwoField
        };
        self.finish(Model {
            displacement,
            force,
            contact: both.contact,
            reduction,
            laplacian: None,
            mean: None,
            inequality: both.report,
            error_squared: both.report.error_squared,
        })
    }

    /// The KKT residual to go to.
    fn kkt(&self) -> f64 {
        match self.settings.tolerance {
            Tolerance::Relative(t) => t,
            Tolerance::Balanced => KKT,
        }
    }

    /// Half of the prescribed squared energy error, in a field whose matrix has this weight in the energy; else as given.
    fn goal(&self, weight: f64, otherwise: Goal) -> Goal {
        match (self.settings.tolerance, self.settings.energy_target) {
            (Tolerance::Balanced, Some(target)) => Goal::Energy(0.5 * target * target / weight),
            _ => otherwise,
        }
    }

    /// Values and loads in the order of the hierarchy.
    fn vectors<U: Unknowns>(
        &self,
        matrices: &[&SymmetricMatrix],
        values: &[Vec<f64>],
        load: &dyn Fn(usize, usize) -> f64,
        plain: bool,
    ) -> Vectors<U> {
        let boundary = &self.level.problem.boundary;
        let pattern = matrices[0].pattern();
        let n = self.hierarchy.len();
        let mut vectors = Vectors {
            x: vec![U::Value::default(); n],
            b: vec![U::Value::default(); n],
            boundary_size: 0.0,
            plain,
        };
        for (p, &j) in self.hierarchy.vertex.iter().enumerate() {
            let j = j as usize;
            let own = U::value(|i| values[i][j]);
            if boundary[j] {
                vectors.boundary_size = vectors.boundary_size.max(U::size(own));
                continue;
            }
            vectors.x[p] = own;
            vectors.b[p] = U::value(|i| load(i, j));
        }
        for &p in &self.hierarchy.boundary {
            let j = self.hierarchy.vertex[p as usize] as usize;
            let own = U::value(|i| values[i][j]);
            for (at, &k) in pattern.range(j).zip(pattern.columns(j)) {
                if !boundary[k as usize] {
                    let b = &mut vectors.b[self.hierarchy.rank[k as usize] as usize];
                    *b = U::plus_plain(*b, U::plain(|i| -matrices[i].values()[at]), own);
                }
            }
        }
        vectors
    }

    /// Solves for one field, or two that are coupled; `system` is there for an inequality.
    fn descend<U: Unknowns>(
        &self,
        finest: &Finest<U>,
        levels: &mut Levels<U>,
        matrices: &[&SymmetricMatrix],
        system: Option<&System>,
        vectors: Vectors<U>,
        goal: Goal,
    ) -> Result<Solved<U>, SolveError> {
        let hierarchy = self.hierarchy;
        let load_scale = |p: usize| {
            let j = hierarchy.vertex[p] as usize;
            system.map_or(0.0, |s| {
                let scales = s.load_scale.iter().map(|scale| scale[j]);
                scales.fold(f64::INFINITY, f64::min)
            })
        };
        let mut descent = Descent::new(
            hierarchy,
            finest,
            levels,
            matrices,
            system.is_some(),
            &load_scale,
            vectors,
        );
        let left = self.start.and_then(|s| s.first_cycle).map(|c| c * c);
        let report = descent.run(goal, self.start.is_none(), left)?;
        descent.settle();
        let back = |values: &[U::Value]| -> Vec<U::Value> {
            hierarchy.rank.iter().map(|&p| values[p as usize]).collect()
        };
        let contact = |&p: &u32| descent.contact[p as usize] && !hierarchy.fixed[p as usize];
        let solved = Solved {
            x: back(&descent.x),
            r: if system.is_some() {
                back(&descent.r)
            } else {
                Vec::new()
            },
            contact: hierarchy.rank.iter().map(contact).collect(),
            report,
        };
        descent.release();
        Ok(solved)
    }

    /// sigma and the record.
    fn finish(&self, model: Model) -> Result<Solution, SolveError> {
        let problem = self.level.problem;
        let Model {
            displacement,
            force,
            contact,
            ..
        } = model;
        let (sigma, sigma_report) = if self.settings.sigma {
            self.sigma(&force, model.laplacian)?
        } else {
            (vec![0.0; force.len()], None)
        };
        let inequality = model.inequality;
        let reports = [Some(inequality), model.mean];
        let status = worst_status(reports.into_iter().flatten().map(|r| r.status));
        let root_of_largest = |get: fn(&Report) -> Option<f64>| {
            let fields = [Some(inequality), model.mean];
            let seen = fields.iter().flatten().filter_map(get);
            seen.reduce(f64::max)
                .map(|ratio| ratio.clamp(0.0, 1.0).sqrt())
        };
        let inherited = self.start.and_then(|s| s.first_cycle);
        let contraction = root_of_largest(|r| r.ratio);
        let first_cycle = match contraction {
            // Here single steps are not to be trusted.
            Some(c) if c > SLOW => None,
            Some(_) => root_of_largest(|r| r.left),
            None => inherited.map(|c| (c * c * AGEING).min(0.5).sqrt()),
        };
        let steps = |r: Option<Report>| r.map_or(0, |r| r.steps);
        let cycles = Cycles {
            inequality: inequality.steps,
            monotone: inequality.monotone,
            mean: steps(model.mean),
            sigma: steps(sigma_report),
            factorisations: sigma_report
                .map_or(0, |r| r.factorisations)
                .max(inequality.factorisations),
        };
        let n = self.level.interior.len();
        let info = SolveInfo {
            solver: MULTIGRID,
            reduction: model.reduction,
            status,
            iterations: cycles.inequality + cycles.monotone + cycles.mean,
            unknowns: if model.reduction == Reduction::FullContact {
                n
            } else {
                2 * n
            },
            kkt_residual: kkt_residual(problem, &displacement, &force),
            algebraic_error: Some(model.error_squared.max(0.0).sqrt()),
            contraction,
            first_cycle,
            cycles: Some(cycles),
        };
        Ok(Solution {
            displacement,
            force,
            sigma,
            contact,
            info,
        })
    }

    /// K sigma = z, always as exactly as rounding allows; empty where that takes too many cycles.
    fn sigma(
        &self,
        force: &[f64],
        laplacian: Option<(Finest<Scalar>, Levels<Scalar>)>,
    ) -> Result<(Vec<f64>, Option<Report>), SolveError> {
        if force.iter().all(|&z| z == 0.0) {
            return Ok((vec![0.0; force.len()], None));
        }
        let matrices = [&self.level.problem.laplacian];
        let (finest, mut levels) = match laplacian {
            Some(both) => both,
            None => (
                Finest::new(self.hierarchy, &matrices),
                Levels::new(self.hierarchy),
            ),
        };
        let load = |_: usize, j: usize| force[j];
        let initial = match self.start.and_then(|s| s.sigma.as_ref()) {
            Some(sigma) => sigma.clone(),
            None => vec![0.0; force.len()],
        };
        let vectors = self.vectors::<Scalar>(&matrices, &[initial], &load, false);
        let solved = self.descend(&finest, &mut levels, &matrices, None, vectors, Goal::Tight)?;
        let sigma = match solved.report.status {
            Status::Converged => solved.x,
            _ => Vec::new(),
        };
        Ok((sigma, Some(solved.report)))
    }
}

/// Converged if all are, else the first that is not.
fn worst_status(statuses: impl Iterator<Item = Status>) -> Status {
    statuses
        .into_iter()
        .find(|&s| s != Status::Converged)
        .unwrap_or(Status::Converged)
}

/// Whether a problem has a hierarchy to work on.
pub(crate) fn has_levels(problem: &DiscreteProblem) -> bool {
    problem.genealogy.iter().any(|birth| birth.level > 0)
}
