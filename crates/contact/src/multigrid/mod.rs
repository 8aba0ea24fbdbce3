//! Multigrid: conjugate gradients preconditioned by one symmetric cycle over the bisection hierarchy, truncated on the contact set.
//!
//! From the bottom up: `hierarchy` (what the births say; `rows` holds its edges), `unknowns` (one field or two), `finest` (the matrix of the mesh), `galerkin`
//! (those of all levels), `coarse` (the initial mesh; `algebraic`, `aggregates` and `blocks` if it is large), `cycle`, `step` and `descent` (the method), `workspace` (what is kept), `reduced` and here the fields of a
//! problem one after the other. Where the tensions reduce these are the mean (linear), the gap (an obstacle problem) and sigma; else both displacements
//! together, glued where they touch, and sigma.

mod aggregates;
mod algebraic;
mod blocks;
mod coarse;
mod cycle;
mod descent;
mod finest;
mod galerkin;
mod hierarchy;
mod reduced;
mod rows;
mod step;
#[cfg(test)]
mod tests;
mod unknowns;
mod workspace;

use crate::error::SolveError;
use crate::interior::Role;
use crate::level::{ROW_ROUNDING, named};
use crate::problem::DiscreteProblem;
use crate::reduce::Proportional;
use crate::settings::{Settings, Tolerance};
use crate::solution::{Cycles, Reduction, Solution, SolveInfo, Status};
use crate::solve::ACTIVE_SET_LIMIT;
use crate::start::Start;
use descent::{Descent, Goal, Report, Vectors};
use finest::Finest;
use galerkin::Levels;
use hierarchy::Hierarchy;
use unknowns::{Pair, Scalar, Unknowns};
use workspace::Store;
pub use workspace::Workspace;

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

/// The solution by multigrid; `None` on a mesh without bisections that is small: there the initial mesh is everything.
///
/// Its status says whether every field of the model reached its goal; sigma is empty where its own solve did not converge.
pub(crate) fn solve(
    problem: &DiscreteProblem,
    settings: &Settings,
    start: Option<&Start>,
    workspace: &mut Workspace,
) -> Result<Option<Solution>, SolveError> {
    if !workspace.take(&problem.mesh) {
        return Ok(None);
    }
    let Workspace {
        hierarchy,
        scalar,
        pair,
        ..
    } = workspace;
    let run = Run {
        problem,
        settings,
        start,
        hierarchy,
    };
    let reduced = Proportional::of(problem).filter(|_| settings.reduce);
    let solution = match reduced {
        Some(model) => run.reduced(&model, scalar),
        None => run.pair(pair, scalar),
    };
    scalar.rest();
    pair.rest();
    solution.map(Some)
}

/// K sigma = z for given forces, where there is a hierarchy and the method converges.
pub(crate) fn sigma(
    problem: &DiscreteProblem,
    settings: &Settings,
    force: &[f64],
    workspace: &mut Workspace,
) -> Result<Option<Vec<f64>>, SolveError> {
    if !workspace.take(&problem.mesh) {
        return Ok(None);
    }
    let run = Run {
        problem,
        settings,
        start: None,
        hierarchy: &workspace.hierarchy,
    };
    let (sigma, _) = run.sigma(force, &mut workspace.scalar)?;
    Ok(Some(sigma).filter(|s| !s.is_empty()))
}

/// One solve on one hierarchy.
struct Run<'a> {
    problem: &'a DiscreteProblem,
    settings: &'a Settings,
    start: Option<&'a Start>,
    hierarchy: &'a Hierarchy,
}

/// A field after its descent, in the order of the hierarchy.
struct Solved<U: Unknowns> {
    x: Vec<U::Value>,
    /// The residual, of an inequality.
    r: Vec<U::Value>,
    contact: Vec<bool>,
    report: Report,
}

/// What the fields of a model add up to.
struct Model {
    displacement: [Vec<f64>; 2],
    force: Vec<f64>,
    contact: Vec<bool>,
    reduction: Reduction,
    mean: Option<Report>,
    inequality: Report,
    kkt_residual: f64,
    error_squared: f64,
}

impl Run<'_> {
    fn pair(
        &self,
        store: &mut Store<Pair>,
        scalar: &mut Store<Scalar>,
    ) -> Result<Solution, SolveError> {
        let problem = self.problem;
        let hierarchy = self.hierarchy;
        let tension = &problem.tension_mean;
        store.hold(Role::Stiffness, hierarchy, &problem.mesh, |i, t| {
            tension[i][t]
        });
        let Store { finest, levels, .. } = store;
        let boundary = |j: usize| [0, 1].map(|i| problem.heights[i][j]);
        let initial = |j: usize| {
            self.start
                .map_or([0.0; 2], |s| [0, 1].map(|i| s.displacement[i][j]))
        };
        let load = |j: usize| [0, 1].map(|i| problem.loads[i].nodal[j]);
        let vectors = self.vectors(finest, levels, boundary, initial, load, false);
        let goal = self.goal(0.5, Goal::Kkt(SHARE * self.kkt()));
        let scale = |j: usize| {
            let [f, g] = load(j).map(f64::abs);
            f.min(g)
        };
        let both = self.descend(finest, levels, Some(&scale), vectors, goal)?;
        levels.forget();
        let mut force = vec![0.0; hierarchy.len()];
        for p in (0..force.len()).filter(|&p| both.contact[p] && !hierarchy.fixed[p]) {
            let [d1, d2] = finest.diagonal[p];
            let i = usize::from(d2 < d1);
            let z = if i == 0 { -both.r[p][0] } else { both.r[p][1] };
            let load = load(hierarchy.vertex[p] as usize)[i].abs();
            let terms = load + row_magnitude(hierarchy, finest, &both.x, p)[i];
            if z > ROW_ROUNDING * terms {
                force[p] = z;
            }
        }
        let mut product = levels.vector(hierarchy.len());
        finest.multiply(hierarchy, &both.x, &mut product);
        finest.add_boundary(1.0, boundary, &mut product);
        let (solved, kkt_residual) = self.conclude(
            |p| both.x[p],
            |p| product[p],
            |p| finest.diagonal[p],
            &force,
            &both.contact,
        );
        levels.spare.extend([product, both.x, both.r]);
        let (displacement, force, contact) = solved;
        let reduction = if self.settings.reduce {
            named(problem, &contact, Reduction::TwoField)
        } else {
            Reduction::TwoField
        };
        let model = Model {
            displacement,
            force,
            contact,
            reduction,
            mean: None,
            inequality: both.report,
            kkt_residual,
            error_squared: both.report.error_squared,
        };
        self.finish(model, scalar)
    }

    /// The KKT residual to go to.
    fn kkt(&self) -> f64 {
        match self.settings.tolerance {
            Tolerance::Relative(t) => t,
            Tolerance::Balanced => KKT,
        }
    }

    /// The KKT residual that is accepted.
    fn limit(&self) -> f64 {
        match self.settings.tolerance {
            Tolerance::Relative(t) => t,
            Tolerance::Balanced => ACTIVE_SET_LIMIT,
        }
    }

    /// Half of the prescribed squared energy error, in a field whose matrix has this weight in the energy; else as given.
    fn goal(&self, weight: f64, otherwise: Goal) -> Goal {
        match (self.settings.tolerance, self.settings.energy_target) {
            (Tolerance::Balanced, Some(target)) => Goal::Energy(0.5 * target * target / weight),
            _ => otherwise,
        }
    }

    /// Values and loads in the order of the hierarchy, from functions of the vertices of the mesh; what the values on the boundary
    /// contribute is moved right.
    fn vectors<U: Unknowns>(
        &self,
        finest: &Finest<U>,
        levels: &mut Levels<U>,
        boundary: impl Fn(usize) -> U::Value,
        initial: impl Fn(usize) -> U::Value,
        load: impl Fn(usize) -> U::Value,
        plain: bool,
    ) -> Vectors<U> {
        let hierarchy = self.hierarchy;
        let rows = || hierarchy.vertex.iter().zip(&hierarchy.fixed);
        let x = levels.filled(rows().map(|(&j, &fixed)| {
            if fixed {
                U::Value::default()
            } else {
                initial(j as usize)
            }
        }));
        let mut b = levels.filled(rows().map(|(&j, &fixed)| {
            if fixed {
                U::Value::default()
            } else {
                load(j as usize)
            }
        }));
        finest.add_boundary(-1.0, &boundary, &mut b);
        let on_boundary = hierarchy.boundary.iter();
        let sizes = on_boundary.map(|&p| U::size(boundary(hierarchy.vertex[p as usize] as usize)));
        Vectors {
            x,
            b,
            boundary_size: sizes.fold(0.0, f64::max),
            plain,
        }
    }

    /// Solves for one field, or two that are coupled; `scale` is there for an inequality: the sum of the magnitudes that the load of a
    /// vertex of the mesh was computed from.
    fn descend<U: Unknowns>(
        &self,
        finest: &Finest<U>,
        levels: &mut Levels<U>,
        scale: Option<&dyn Fn(usize) -> f64>,
        vectors: Vectors<U>,
        goal: Goal,
    ) -> Result<Solved<U>, SolveError> {
        let hierarchy = self.hierarchy;
        let load_scale = |p: usize| scale.map_or(0.0, |scale| scale(hierarchy.vertex[p] as usize));
        let inequality = scale.is_some();
        let mut descent = Descent::new(hierarchy, finest, levels, inequality, &load_scale, vectors);
        let left = self.start.and_then(|s| s.first_cycle).map(|c| c * c);
        let report = descent.run(goal, self.start.is_none(), left)?;
        if inequality {
            descent.settle();
        }
        let (x, r, contact) = descent.release();
        Ok(Solved {
            x,
            r,
            contact,
            report,
        })
    }

    /// Displacements, forces and contact set in the order of the mesh, and the relative KKT residual
    /// ([`kkt_residual`](crate::kkt_residual)) from displacements, products and diagonals in the order of the hierarchy.
    #[allow(clippy::type_complexity, reason = "three arrays and a number")]
    fn conclude(
        &self,
        displacement: impl Fn(usize) -> [f64; 2],
        product: impl Fn(usize) -> [f64; 2],
        diagonal: impl Fn(usize) -> [f64; 2],
        force: &[f64],
        contact: &[bool],
    ) -> (([Vec<f64>; 2], Vec<f64>, Vec<bool>), f64) {
        let problem = self.problem;
        let hierarchy = self.hierarchy;
        let n = hierarchy.len();
        let [mut upper, mut lower, mut z] = [(); 3].map(|()| vec![0.0; n]);
        let mut touching = vec![false; n];
        let mut unit = 0.0f64;
        let (mut finite, mut worst) = (true, 0.0f64);
        let values = upper.iter_mut().zip(&mut lower);
        let values = values.zip(z.iter_mut().zip(&mut touching));
        let ranks = hierarchy.rank.iter().zip(problem.boundary());
        let [f1, f2] = [0, 1].map(|i| problem.loads[i].nodal.iter());
        let given = ranks.zip(f1.zip(f2)).enumerate();
        // The larger one, and not what is no number.
        let larger = |x: f64, than: f64| if x > than { x } else { than };
        for (((upper, lower), (z, touching)), (j, ((&p, &fixed), (&f1, &f2)))) in values.zip(given)
        {
            let p = p as usize;
            let u = if fixed {
                [0, 1].map(|i| problem.heights[i][j])
            } else {
                displacement(p)
            };
            [*upper, *lower] = u;
            unit = larger(u[1].abs(), larger(u[0].abs(), unit));
            let force = force[p];
            finite &= u[0].is_finite() && u[1].is_finite() && force.is_finite();
            if fixed {
                continue;
            }
            *z = force;
            *touching = contact[p];
            let (product, d) = (product(p), diagonal(p));
            for (i, load) in [f1 + force, f2 - force].into_iter().enumerate() {
                worst = larger((load - product[i]).abs() / d[i], worst);
            }
            let pressed = if force == 0.0 {
                0.0
            } else {
                force / (d[0] / (1.0 + d[0] / d[1]))
            };
            worst = larger((u[0] - u[1]).min(pressed).abs(), worst);
        }
        let unit = if unit == 0.0 { 1.0 } else { unit };
        let residual = if finite { worst / unit } else { f64::INFINITY };
        (([upper, lower], z, touching), residual)
    }

    /// sigma and the record.
    fn finish(&self, model: Model, store: &mut Store<Scalar>) -> Result<Solution, SolveError> {
        let Model {
            displacement,
            force,
            contact,
            ..
        } = model;
        let (sigma, sigma_report) = if self.settings.sigma {
            self.sigma(&force, store)?
        } else {
            (Vec::new(), None)
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
        let n = self.hierarchy.len() - self.hierarchy.boundary.len();
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
            kkt_residual: model.kkt_residual,
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
        store: &mut Store<Scalar>,
    ) -> Result<(Vec<f64>, Option<Report>), SolveError> {
        if force.iter().all(|&z| z == 0.0) {
            return Ok((vec![0.0; force.len()], None));
        }
        let hierarchy = self.hierarchy;
        store.hold(Role::Laplacian, hierarchy, &self.problem.mesh, |_, _| 1.0);
        let Store { finest, levels, .. } = store;
        let known = self.start.and_then(|s| s.sigma.as_ref());
        let initial = |j: usize| known.map_or(0.0, |sigma| sigma[j]);
        let vectors = self.vectors(finest, levels, |_| 0.0, initial, |j| force[j], false);
        let solved = self.descend(finest, levels, None, vectors, Goal::Tight(f64::INFINITY))?;
        let sigma = match solved.report.status {
            Status::Converged => {
                let own = hierarchy.rank.iter();
                own.map(|&p| solved.x[p as usize]).collect()
            }
            _ => Vec::new(),
        };
        levels.spare.push(solved.x);
        Ok((sigma, Some(solved.report)))
    }
}

/// The sums `|A||x|` of the row of a rank, one a field.
fn row_magnitude<U: Unknowns>(
    hierarchy: &Hierarchy,
    finest: &Finest<U>,
    x: &[U::Value],
    p: usize,
) -> [f64; 2] {
    let mut sum = [0.0; 2];
    let mut add = |entry: U::Plain, q: usize| {
        for i in 0..U::WIDTH {
            sum[i] += (U::plain_at(entry, i) * U::at(x[q], i)).abs();
        }
    };
    add(finest.diagonal[p], p);
    for (q, slot) in hierarchy.edges(p) {
        add(finest.slot[slot], q);
    }
    sum
}

/// Converged if all are, else the first that is not.
fn worst_status(statuses: impl Iterator<Item = Status>) -> Status {
    statuses
        .into_iter()
        .find(|&s| s != Status::Converged)
        .unwrap_or(Status::Converged)
}
