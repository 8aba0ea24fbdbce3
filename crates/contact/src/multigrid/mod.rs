//! Multigrid: conjugate gradients preconditioned by one symmetric cycle over the bisection hierarchy, truncated on the contact set.
//!
//! From the bottom up: `hierarchy` (what the births say), `unknowns` (one field or two), `finest` (the matrix of the mesh), `galerkin`
//! (those of all levels), `coarse` (the initial mesh; `algebraic`, `aggregates` and `blocks` if it is large), `cycle`, `step` and `descent` (the method), and here the fields of a
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
mod step;
#[cfg(test)]
mod tests;
mod unknowns;

use std::sync::{Arc, Weak};

use fem_core::{Mesh, VertexId};

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

/// Name of the method in the record.
pub(crate) const MULTIGRID: &str = "multigrid";

/// The relative KKT residual to go to when neither it nor the energy error is prescribed.
const KKT: f64 = 1e-10;

/// The inequality is solved to this part of a prescribed KKT residual: the mean takes the rest.
const SHARE: f64 = 0.9;

/// A pull so many times what the largest gap and the diagonal make of its row's rounding is a force without a closer look: a row of a mesh with
/// ordinary shapes has magnitudes of twice its diagonal.
const FAR: f64 = 64.0;

/// The mean misses its rows by at most this part of what the KKT residual may be.
const MEAN_SHARE: f64 = 0.25;

/// With a contraction beyond this every level takes steps enough to see how far it has come.
const SLOW: f64 = 0.25;

/// A triangle is a needle if its longest side is more than this many times its height.
const NEEDLE: f64 = 5.0;

/// On large initial meshes with more than this share of needles the bisections are left aside, and all is left to aggregates.
const NEEDLES: f64 = 0.25;

/// What the part left by a first step grows by when it is handed on unseen: after about ten levels of one step each it is looked at
/// again.
const AGEING: f64 = 1.25;

/// What a solver keeps from one solve to the next: memory above all, and what was read off a mesh while it stays the same.
///
/// One workspace serves the levels of one run, whose meshes descend from one another.
#[derive(Default)]
pub struct Workspace {
    /// The mesh that `hierarchy` was read off.
    mesh: Weak<Mesh>,
    /// The order of the vertices of the initial mesh.
    initial: Vec<u32>,
    hierarchy: Hierarchy,
    scalar: Store<Scalar>,
    pair: Store<Pair>,
}

/// Matrices of a mesh and of its levels.
#[derive(Default)]
struct Store<U: Unknowns> {
    /// The matrix that `finest` holds for the mesh of the workspace, if it is one.
    held: Option<Role>,
    finest: Finest<U>,
    levels: Levels<U>,
    /// Matrices of the levels for a second field beside the first.
    beside: Levels<U>,
}

impl Workspace {
    /// Reads the hierarchy of a mesh ahead of a solve on it, if that will be by multigrid: something to do beside the assembly.
    pub fn read(&mut self, mesh: &Arc<Mesh>, settings: &Settings) {
        if settings.iterates(mesh.vertex_count()) {
            self.take(mesh);
        }
    }

    /// Takes in a mesh; false if it has no hierarchy and is not large enough for one of aggregates.
    fn take(&mut self, mesh: &Arc<Mesh>) -> bool {
        if self.mesh.as_ptr() == Arc::as_ptr(mesh) {
            return true;
        }
        let births = mesh.genealogy().iter().zip(mesh.boundary());
        let inner = births.clone().filter(|(b, fixed)| b.level == 0 && !**fixed);
        let large = inner.count() > coarse::LARGE;
        if births.clone().all(|(birth, _)| birth.level == 0) {
            self.initial = along_leaves(mesh);
            if !large {
                return false;
            }
        }
        let flat = large && stretched(mesh);
        self.hierarchy.read(mesh, Some(&self.initial), flat);
        self.initial.clear();
        self.initial
            .extend_from_slice(self.hierarchy.initial_order());
        self.mesh = Arc::downgrade(mesh);
        self.scalar.held = None;
        self.pair.held = None;
        true
    }
}

/// Whether the triangles of a mesh are needles: the relaxation of single vertices level by level does little there, since couplings along the short
/// sides dominate. Aggregates follow the strong couplings.
fn stretched(mesh: &Mesh) -> bool {
    let points = mesh.points();
    let needle = |v: &&[VertexId; 3]| {
        let corner = v.map(|v| points[v.index()]);
        let edge =
            [(0, 1), (1, 2), (2, 0)].map(|(k, l)| [0, 1].map(|i| corner[l][i] - corner[k][i]));
        let longest = edge.iter().map(|e| e[0] * e[0] + e[1] * e[1]);
        let twice = (edge[0][0] * edge[1][1] - edge[0][1] * edge[1][0]).abs();
        longest.fold(0.0, f64::max) > NEEDLE * twice
    };
    let needles = mesh.triangles().iter().filter(needle).count();
    needles as f64 > NEEDLES * mesh.triangle_count() as f64
}

/// The vertices of a mesh in the order in which its triangles touch them first.
fn along_leaves(mesh: &Mesh) -> Vec<u32> {
    let mut seen = vec![false; mesh.vertex_count()];
    let all = mesh.triangles().iter().flatten();
    all.filter(|v| !std::mem::replace(&mut seen[v.index()], true))
        .map(|v| v.0)
        .collect()
}

impl<U: Unknowns> Store<U> {
    /// Gives up what every solve writes anew: the estimators want the memory next.
    fn rest(&mut self) {
        self.levels.forget();
        self.levels.spare.clear();
        self.beside.forget();
        self.beside.spare.clear();
    }

    /// Assembles a matrix, unless it is there.
    fn hold(
        &mut self,
        role: Role,
        hierarchy: &Hierarchy,
        mesh: &Mesh,
        coefficient: impl Fn(usize, usize) -> f64,
    ) {
        let other = self.held != Some(role);
        if other {
            self.finest.assemble(hierarchy, mesh, coefficient);
            self.held = Some(role);
        }
        if other || self.levels.pivot.is_empty() {
            self.levels.fit(hierarchy);
        }
    }
}

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
    fn reduced(
        &self,
        model: &Proportional,
        store: &mut Store<Scalar>,
    ) -> Result<Solution, SolveError> {
        let problem = self.problem;
        let hierarchy = self.hierarchy;
        let tension = &problem.tension_mean[0];
        store.hold(model.role, hierarchy, &problem.mesh, |_, t| {
            match model.role {
                Role::Laplacian => 1.0,
                Role::Stiffness => tension[t],
            }
        });
        let Store {
            finest,
            levels,
            beside,
            ..
        } = store;
        let finest = &*finest;
        let [mean_weight, gap_weight] = model.energy_weights();
        let mean_goal = self.goal(mean_weight, Goal::Tight(MEAN_SHARE * self.limit()));
        let gap_goal = self.goal(gap_weight, Goal::Kkt(0.5 * SHARE * self.kkt()));
        // Only a KKT residual is relative to the mean, and a large initial mesh keeps its factor from the one to the other.
        let apart = matches!(gap_goal, Goal::Energy(_)) && levels.initial.is_small();
        let (mean, gap) = if apart && self.settings.threads > 1 {
            beside.fit(hierarchy);
            std::thread::scope(|scope| {
                let mean = scope.spawn(|| self.mean(model, finest, beside, mean_goal));
                let gap = self.gap(model, finest, levels, gap_goal, 0.0);
                let mean = mean.join().unwrap_or_else(|e| std::panic::resume_unwind(e));
                Ok::<_, SolveError>((mean?, gap?))
            })?
        } else {
            let mean = self.mean(model, finest, levels, mean_goal)?;
            let size = mean.x.iter().fold(0.0f64, |m, v| m.max(v.abs()));
            let gap = self.gap(model, finest, levels, gap_goal, size)?;
            (mean, gap)
        };

        levels.forget();
        beside.forget();

        // The pull on a closed gap becomes the force, where it is more than rounding.
        let n = hierarchy.len();
        let largest = gap.x.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let mut force = gap.r;
        for p in 0..n {
            let r = force[p];
            let held = gap.contact[p] && !hierarchy.fixed[p] && r < 0.0;
            force[p] = if held && {
                let scale = model.gap_load(hierarchy.vertex[p] as usize).1;
                // Nearly all are far above what the largest gap could leave in their row.
                -r > FAR * ROW_ROUNDING * (scale + finest.diagonal[p] * largest)
                    || -r > ROW_ROUNDING * (scale + row_magnitude(hierarchy, finest, &gap.x, p)[0])
            } {
                model.force(-r)
            } else {
                0.0
            };
        }
        let [mut upper, mut lower] = [mean.x, gap.x];
        for p in 0..n {
            if !hierarchy.fixed[p] {
                [upper[p], lower[p]] = model.displacements(upper[p], lower[p]);
            }
        }
        let mut product = |i: usize, u: &[f64]| {
            let mut y = levels.vector(n);
            finest.multiply(hierarchy, u, &mut y);
            finest.add_boundary(1.0, |j| problem.heights[i][j], &mut y);
            y
        };
        let products = [product(0, &upper), product(1, &lower)];
        let stiffness = model.tension();
        let (solved, kkt_residual) = self.conclude(
            |p| [upper[p], lower[p]],
            |p| [0, 1].map(|i| stiffness[i] * products[i][p]),
            |p| [0, 1].map(|i| stiffness[i] * finest.diagonal[p]),
            &force,
            &gap.contact,
        );
        levels.spare.extend(products);
        levels.spare.extend([upper, lower, force]);
        let (displacement, force, contact) = solved;
        let error_squared =
            mean_weight * mean.report.error_squared + gap_weight * gap.report.error_squared;
        let model = Model {
            displacement,
            force,
            reduction: named(problem, &contact, model.reduction),
            contact,
            mean: Some(mean.report),
            inequality: gap.report,
            kkt_residual,
            error_squared,
        };
        self.finish(model, store)
    }

    /// The mean of a reduced model.
    fn mean(
        &self,
        model: &Proportional,
        finest: &Finest<Scalar>,
        levels: &mut Levels<Scalar>,
        goal: Goal,
    ) -> Result<Solved<Scalar>, SolveError> {
        levels.sweep(self.hierarchy, finest, &[])?;
        let heights = &self.problem.heights;
        let boundary = |j: usize| model.mean_of([0, 1].map(|i| heights[i][j]));
        let initial = |j: usize| {
            self.start
                .map_or(0.0, |s| model.mean_of([0, 1].map(|i| s.displacement[i][j])))
        };
        let load = |j: usize| model.mean_load(j);
        let vectors = self.vectors(finest, levels, boundary, initial, load, true);
        self.descend(finest, levels, None, vectors, goal)
    }

    /// The gap of a reduced model; `size` is the largest mean.
    fn gap(
        &self,
        model: &Proportional,
        finest: &Finest<Scalar>,
        levels: &mut Levels<Scalar>,
        goal: Goal,
        size: f64,
    ) -> Result<Solved<Scalar>, SolveError> {
        let heights = &self.problem.heights;
        let boundary = |j: usize| heights[0][j] - heights[1][j];
        let initial = |j: usize| {
            self.start.map_or(0.0, |s| {
                (s.displacement[0][j] - s.displacement[1][j]).max(0.0)
            })
        };
        let load = |j: usize| model.gap_load(j).0;
        let mut vectors = self.vectors(finest, levels, boundary, initial, load, false);
        // Half the gap and the mean are bounds of the largest displacement from below.
        vectors.boundary_size = vectors.boundary_size.max(2.0 * size);
        let scale = |j: usize| model.gap_load(j).1;
        self.descend(finest, levels, Some(&scale), vectors, goal)
    }

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
        let n = hierarchy.len();
        let [mut x, mut b] = [(); 2].map(|()| levels.vector(n));
        for (p, &j) in hierarchy.vertex.iter().enumerate() {
            let inner = !hierarchy.fixed[p];
            let j = j as usize;
            x[p] = if inner {
                initial(j)
            } else {
                U::Value::default()
            };
            b[p] = if inner { load(j) } else { U::Value::default() };
        }
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
        let mut own = [vec![0.0; n], vec![0.0; n]];
        let (mut z, mut touching) = (vec![0.0; n], vec![false; n]);
        let mut unit = 0.0f64;
        let (mut finite, mut worst) = (true, 0.0f64);
        for (p, &j) in hierarchy.vertex.iter().enumerate() {
            let j = j as usize;
            let fixed = hierarchy.fixed[p];
            let u = if fixed {
                [0, 1].map(|i| problem.heights[i][j])
            } else {
                displacement(p)
            };
            [own[0][j], own[1][j]] = u;
            unit = unit.max(u[0].abs()).max(u[1].abs());
            finite &= u[0].is_finite() && u[1].is_finite() && force[p].is_finite();
            if fixed {
                continue;
            }
            z[j] = force[p];
            touching[j] = contact[p];
            let (product, d) = (product(p), diagonal(p));
            for (i, sign) in [(0, 1.0), (1, -1.0)] {
                let rest = problem.loads[i].nodal[j] + sign * force[p] - product[i];
                worst = worst.max(rest.abs() / d[i]);
            }
            let harmonic = d[0] / (1.0 + d[0] / d[1]);
            worst = worst.max((u[0] - u[1]).min(force[p] / harmonic).abs());
        }
        let unit = if unit == 0.0 { 1.0 } else { unit };
        let residual = if finite { worst / unit } else { f64::INFINITY };
        ((own, z, touching), residual)
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
    for &[q, slot] in hierarchy.rows.row(p as u32) {
        add(finest.at(slot), q as usize);
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
