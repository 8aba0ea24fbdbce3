//! One level of a run: mesh, discrete problem, solution, estimates, and the step to the next.

use std::sync::Arc;
use std::time::Instant;

use contact::{DiscreteProblem, Solution, Start, Tolerance, Workspace};
use estimate::certificate::POINCARE;
use estimate::{Given, Grade, Moments, Prepared, certify};
use fem_core::{Mesh, TriangleId, parallel};

use crate::discretise::{Before, DataError, discretise, discretise_carried, moments_near, near};
use crate::estimates::{Estimates, given};
use crate::forecast::Forecast;
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
    pub mesh: Arc<Mesh>,
    /// Matrices and loads.
    pub discrete: DiscreteProblem,
    /// Moments of the data, where there is a certificate.
    pub moments: Option<Moments>,
    /// The quotient that stands in for a certificate that was left out.
    forecast: Option<f64>,
    /// Displacements, action, Riesz representative, contact set.
    pub solution: Solution,
    /// Indicators and errors.
    pub estimates: Estimates,
    /// The numbers of the level in the user's units.
    pub record: LevelRecord,
}

/// Under a balanced tolerance the estimated algebraic error is at most this part of the estimated error.
pub const BALANCE: f64 = 0.1;

/// On a level whose bound is reported as guaranteed eta_alg is at most this part of eta: it is added to the bound, and a part ten times
/// smaller costs an iterative solver one step.
pub const SETTLED: f64 = 0.01;

/// Predictions of eta and eta_alg may be so much too large.
const AHEAD: f64 = 0.8;

/// An algebraic error up to so many times what was to be gone for is left as it is: eta_alg is looked at next in any case.
const CLOSE: f64 = 1.5;

/// How often a level is solved to a higher accuracy before its balance is given up.
const ROUNDS: usize = 8;

/// What a level is begun with.
#[derive(Default)]
struct Begin {
    number: usize,
    start: Option<Start>,
    /// The algebraic error to go for.
    target: Option<f64>,
    forecast: Option<f64>,
    seconds_refine: f64,
}

/// What a run knows everywhere.
#[derive(Clone, Copy)]
pub(crate) struct Context<'a> {
    pub problem: &'a Problem,
    pub settings: &'a Settings,
    pub begun: Instant,
}

impl Level {
    /// Solves and estimates on the initial mesh.
    pub(crate) fn initial(
        context: Context<'_>,
        workspace: &mut Workspace,
    ) -> Result<Level, LevelError> {
        let mesh = Arc::new(context.problem.mesh.clone());
        let discrete =
            |mesh: &Arc<Mesh>| discretise(context.problem, mesh, context.settings.solve.threads);
        Level::on(mesh, context, discrete, Begin::default(), workspace)
    }

    /// Refines the marked triangles, carries the solution over, solves and estimates. `last` is told this level, the new mesh and the error expected there, and says
    /// whether the new level may be the last.
    pub(crate) fn refine(
        &self,
        marked: &[TriangleId],
        context: Context<'_>,
        forecast: Forecast,
        last: impl FnOnce(&Level, &Mesh, f64) -> bool,
        workspace: &mut Workspace,
    ) -> Result<Level, LevelError> {
        let settings = context.settings;
        let clock = Instant::now();
        let children = match settings.mark.strategy {
            Strategy::Uniform => Children::Four,
            _ => settings.mark.children,
        };
        let (mesh, refinement) = self
            .mesh
            .refined_on(marked, children, settings.solve.threads)?;
        let carried = Start::prolong(&self.solution, &mesh, refinement.old_vertices);
        // First-order elements: the error goes like the root of the number of vertices at best.
        let growth = self.mesh.vertex_count() as f64 / mesh.vertex_count() as f64;
        let expected = self.estimates.error_size.map(|size| size * growth.sqrt());
        let forecast_here = forecast.on(&mesh);
        let target = expected.map(|size| {
            // Where the certificate will be asked for, the solver goes at once as far as that wants it.
            let settled = forecast
                .settled(size, &mesh)
                .filter(|_| forecast_here.is_some() && last(self, &mesh, size));
            settled.unwrap_or(BALANCE * size)
        });
        let begin = Begin {
            number: self.number + 1,
            start: Some(carried),
            target,
            forecast: forecast_here,
            seconds_refine: clock.elapsed().as_secs_f64(),
        };
        let before = Before {
            discrete: &self.discrete,
            parent: &refinement.parent,
        };
        let discrete = |mesh: &Arc<Mesh>| {
            discretise_carried(context.problem, mesh, before, settings.solve.threads)
        };
        Level::on(Arc::new(mesh), context, discrete, begin, workspace)
    }

    /// Solves and estimates on a mesh; `discrete` finds the discrete problem.
    fn on(
        mesh: Arc<Mesh>,
        context: Context<'_>,
        discrete: impl FnOnce(&Arc<Mesh>) -> Result<DiscreteProblem, DataError>,
        begin: Begin,
        workspace: &mut Workspace,
    ) -> Result<Level, LevelError> {
        let Context {
            problem, settings, ..
        } = context;
        let clock = Instant::now();
        let certified = settings.estimate.wants(Estimator::Certified) && begin.forecast.is_none();
        let discrete = if settings.solve.threads > 1 {
            let threads = settings.solve.threads;
            let read = || workspace.read(&mesh, &settings.solve);
            parallel::both(threads, read, || discrete(&mesh)).1?
        } else {
            discrete(&mesh)?
        };
        let seconds_assemble = clock.elapsed().as_secs_f64();
        let clock = Instant::now();
        let solve = contact::Settings {
            energy_target: begin.target,
            sigma: needs_sigma(problem, settings),
            ..settings.solve
        };
        let solution = contact::solve_in(&discrete, &solve, begin.start.as_ref(), workspace)?;
        drop(begin.start);
        let seconds_solve = clock.elapsed().as_secs_f64();
        let clock = Instant::now();
        let moments = certified
            .then(|| moments_near(problem, &discrete, &solution.force))
            .transpose()?;
        let seconds_assemble = seconds_assemble + clock.elapsed().as_secs_f64();
        let clock = Instant::now();
        let estimates = Estimates::of(
            &mesh,
            &discrete,
            moments.as_ref(),
            None,
            &solution,
            problem,
            settings,
            begin.forecast,
        )?;
        let mut record =
            LevelRecord::of(&mesh, &discrete, &solution, &estimates, problem, settings)?;
        record.level = begin.number;
        record.seconds_refine = begin.seconds_refine;
        record.seconds_assemble = seconds_assemble;
        record.seconds_solve = seconds_solve;
        record.seconds_estimate = clock.elapsed().as_secs_f64();
        let mut level = Level {
            number: begin.number,
            mesh,
            discrete,
            moments,
            forecast: begin.forecast,
            solution,
            estimates,
            record,
        };
        level.balance(context, workspace, |estimates, algebraic| {
            let size = estimates.error_size?;
            (algebraic > BALANCE * size).then_some(BALANCE * size)
        })?;
        level.stamp(context);
        Ok(level)
    }

    /// Solves on to a higher accuracy as long as `target` wants one: it is shown the estimates and the estimated algebraic error, and tells
    /// the algebraic error to go for. Nothing is done for direct solvers, or where the user chose the tolerance.
    fn balance(
        &mut self,
        context: Context<'_>,
        workspace: &mut Workspace,
        target: impl Fn(&Estimates, f64) -> Option<f64>,
    ) -> Result<(), LevelError> {
        if context.settings.solve.tolerance != Tolerance::Balanced {
            return Ok(());
        }
        for _ in 0..ROUNDS {
            let Some(algebraic) = self.solution.info.algebraic_error else {
                return Ok(());
            };
            let Some(goal) = target(&self.estimates, algebraic) else {
                return Ok(());
            };
            self.solve_on(context, goal, workspace)?;
            self.estimate_again(None, context)?;
        }
        Ok(())
    }

    /// Estimates the present solution, and makes the record anew; `prepared` as for [`Estimates::of`].
    fn estimate_again(
        &mut self,
        prepared: Option<&Prepared>,
        context: Context<'_>,
    ) -> Result<(), LevelError> {
        let clock = Instant::now();
        self.estimates = Estimates::of(
            &self.mesh,
            &self.discrete,
            self.moments.as_ref(),
            prepared,
            &self.solution,
            context.problem,
            context.settings,
            self.forecast,
        )?;
        self.renew(context)?;
        self.record.seconds_estimate += clock.elapsed().as_secs_f64();
        Ok(())
    }

    /// Continues the solution to an algebraic error of `goal`.
    fn solve_on(
        &mut self,
        context: Context<'_>,
        goal: f64,
        workspace: &mut Workspace,
    ) -> Result<(), LevelError> {
        let clock = Instant::now();
        let solve = contact::Settings {
            energy_target: Some(goal),
            sigma: needs_sigma(context.problem, context.settings),
            ..context.settings.solve
        };
        let start = Start::again(&self.solution);
        let mut better = contact::solve_in(&self.discrete, &solve, Some(&start), workspace)?;
        better.info.iterations += self.solution.info.iterations;
        self.solution = better;
        self.record.seconds_solve += clock.elapsed().as_secs_f64();
        Ok(())
    }

    /// Makes the certificate that was left out. For a level that may be the last or whose goal is near, which `settled` says, after the steps that bring its
    /// algebraic part down to where it is settled as far as that can be foreseen.
    pub(crate) fn certify(
        &mut self,
        context: Context<'_>,
        forecast: Forecast,
        settled: bool,
        workspace: &mut Workspace,
    ) -> Result<(), LevelError> {
        let Context {
            problem, settings, ..
        } = context;
        let settled = settled && settings.solve.tolerance == Tolerance::Balanced;
        let size = self.estimates.error_size;
        let goal = size.and_then(|size| forecast.settled(size, &self.mesh));
        let mut estimated = true;
        let info = &self.solution.info;
        if let (Some(goal), Some(algebraic)) = (goal, info.algebraic_error)
            && settled
            && algebraic > CLOSE * goal
        {
            self.solve_on(context, goal, workspace)?;
            estimated = false;
        }
        let clock = Instant::now();
        let mut moments = moments_near(problem, &self.discrete, &self.solution.force)?;
        self.forecast = None;
        self.record.seconds_assemble += clock.elapsed().as_secs_f64();
        // The part that tells eta_alg is cheap: what is missing is made up for before the rest.
        let mut prepared = None;
        for _ in 0..ROUNDS {
            let (Some(size), Some(algebraic)) = (
                self.estimates.error_size,
                self.solution.info.algebraic_error,
            ) else {
                break;
            };
            let clock = Instant::now();
            let first = Prepared::of(&self.given(&moments, context))?;
            let found = first.algebraic();
            self.record.seconds_estimate += clock.elapsed().as_secs_f64();
            let share = AHEAD * SETTLED * size;
            if !settled || found <= share {
                prepared = Some(first);
                break;
            }
            self.solve_on(context, AHEAD * algebraic * share / found, workspace)?;
            estimated = false;
            let (load, tension) = (problem.loads(), problem.tensions());
            let near = near(&self.discrete, &self.solution.force);
            moments.cover(&self.mesh, load, tension, Some(near))?;
        }
        self.moments = Some(moments);
        if estimated {
            self.add_certificate(Grade::Rt0, prepared.as_ref(), context)?;
        } else {
            self.estimate_again(prepared.as_ref(), context)?;
        }
        self.stamp(context);
        Ok(())
    }

    /// What a certificate of this level is made from.
    fn given<'a>(&'a self, moments: &'a Moments, context: Context<'a>) -> Given<'a> {
        Given {
            threads: context.settings.solve.threads,
            ..given(context.problem, &self.discrete, moments, &self.solution)
        }
    }

    /// Iterates until eta_alg too is a small part of the certificate; for a level that may be the last.
    pub(crate) fn settle(
        &mut self,
        context: Context<'_>,
        workspace: &mut Workspace,
    ) -> Result<(), LevelError> {
        self.balance(context, workspace, |estimates, algebraic| {
            let certificate = estimates.certificate.as_ref()?;
            let share = SETTLED * certificate.eta;
            // eta_alg falls with the algebraic error.
            (certificate.algebraic > share).then(|| 0.8 * algebraic * share / certificate.algebraic)
        })?;
        self.stamp(context);
        Ok(())
    }

    /// Replaces the certificate of this level by the sharp one, and the bound with it where the certificate drives the run.
    ///
    /// Returns the quotient of the sharp bound and the one before; 1 where both vanish.
    pub(crate) fn sharpen(&mut self, context: Context<'_>) -> Result<f64, LevelError> {
        if let Some(moments) = &mut self.moments {
            let clock = Instant::now();
            let problem = context.problem;
            moments.cover(&self.mesh, problem.loads(), problem.tensions(), None)?;
            self.record.seconds_assemble += clock.elapsed().as_secs_f64();
        }
        let ratio = self.add_certificate(Grade::Rt1, None, context)?;
        self.stamp(context);
        Ok(ratio)
    }

    /// Makes a certificate of the present solution beside the other estimates; the quotient of the new bound and the one before.
    fn add_certificate(
        &mut self,
        grade: Grade,
        prepared: Option<&Prepared>,
        context: Context<'_>,
    ) -> Result<f64, LevelError> {
        let Some(moments) = &self.moments else {
            return Ok(1.0);
        };
        let clock = Instant::now();
        let given = self.given(moments, context);
        let new = match prepared {
            Some(prepared) => prepared.certify(&given, POINCARE)?,
            None => certify(&given, grade, POINCARE)?,
        };
        let drives = context.settings.estimate.estimator == Estimator::Certified;
        let ratio = self.estimates.replace(new, &self.solution, drives);
        self.renew(context)?;
        self.record.seconds_estimate += clock.elapsed().as_secs_f64();
        Ok(ratio)
    }

    /// Reports the bound with eta_alg in it, however large that is.
    pub(crate) fn guarantee(&mut self, context: Context<'_>) -> Result<(), LevelError> {
        let drives = context.settings.estimate.estimator == Estimator::Certified;
        self.estimates.guarantee(drives);
        self.renew(context)?;
        self.stamp(context);
        Ok(())
    }

    /// Computes sigma if it was left out; before fields are written.
    pub(crate) fn complete(
        &mut self,
        context: Context<'_>,
        workspace: &mut Workspace,
    ) -> Result<(), LevelError> {
        if needs_sigma(context.problem, context.settings) {
            return Ok(());
        }
        let clock = Instant::now();
        contact::add_sigma(
            &self.discrete,
            &context.settings.solve,
            &mut self.solution,
            workspace,
        )?;
        self.record.seconds_solve += clock.elapsed().as_secs_f64();
        self.stamp(context);
        Ok(())
    }

    /// Makes the record anew but for what the clock says.
    fn renew(&mut self, context: Context<'_>) -> Result<(), LevelError> {
        let old = &self.record;
        self.record = LevelRecord {
            level: old.level,
            seconds_refine: old.seconds_refine,
            seconds_assemble: old.seconds_assemble,
            seconds_solve: old.seconds_solve,
            seconds_estimate: old.seconds_estimate,
            ..LevelRecord::of(
                &self.mesh,
                &self.discrete,
                &self.solution,
                &self.estimates,
                context.problem,
                context.settings,
            )?
        };
        Ok(())
    }

    /// Notes the time and the memory.
    fn stamp(&mut self, context: Context<'_>) {
        self.record.seconds_total = context.begun.elapsed().as_secs_f64();
        self.record.peak_memory_mb = peak_memory_mb();
    }
}

/// Whether an estimate of every level needs sigma.
fn needs_sigma(problem: &Problem, settings: &Settings) -> bool {
    let known = problem.exact.as_ref().is_some_and(|e| e.sigma.is_some());
    settings.estimate.wants(Estimator::Paper) || known
}
