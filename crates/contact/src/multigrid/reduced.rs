//! A reduced model: the mean of the displacements, a linear problem, and their gap, an obstacle problem.

use super::descent::Goal;
use super::finest::Finest;
use super::galerkin::Levels;
use super::unknowns::Scalar;
use super::workspace::Store;
use super::{Model, Run, SHARE, Solved, row_magnitude};
use crate::error::SolveError;
use crate::interior::Role;
use crate::level::{ROW_ROUNDING, named};
use crate::reduce::Proportional;
use crate::solution::Solution;

/// A pull so many times what the largest gap and the diagonal make of its row's rounding is a force without a closer look: a row of a mesh with
/// ordinary shapes has magnitudes of twice its diagonal.
const FAR: f64 = 64.0;

/// The mean misses its rows by at most this part of what the KKT residual may be.
const MEAN_SHARE: f64 = 0.25;

impl Run<'_> {
    pub(super) fn reduced(
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
        levels.spare.clear();
        beside.forget();

        // The pull on a closed gap becomes the force, where it is more than rounding.
        let largest = gap.x.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let mut force = gap.r;
        for (p, (force, (&touching, &fixed))) in force
            .iter_mut()
            .zip(gap.contact.iter().zip(&hierarchy.fixed))
            .enumerate()
        {
            let r = *force;
            let held = touching && !fixed && r < 0.0;
            *force = if held && {
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
        let fields = mean.x.iter().zip(&gap.x).zip(&hierarchy.fixed);
        let displacement: Vec<[f64; 2]> = fields
            .map(|((&mean, &gap), &fixed)| {
                if fixed {
                    [0.0; 2]
                } else {
                    model.displacements(mean, gap)
                }
            })
            .collect();
        drop([mean.x, gap.x]);
        let heights = |j: usize| [0, 1].map(|i| problem.heights[i][j]);
        let product = finest.multiply_both(hierarchy, &displacement, heights);
        let stiffness = model.tension();
        let (solved, kkt_residual) = self.conclude(
            |p| displacement[p],
            |p| [0, 1].map(|i| stiffness[i] * product[p][i]),
            |p| [0, 1].map(|i| stiffness[i] * finest.diagonal[p]),
            &force,
            &gap.contact,
        );
        drop((displacement, product, force));
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
}
