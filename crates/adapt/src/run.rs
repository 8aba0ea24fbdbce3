//! The adaptive loop.

use std::time::Instant;

use contact::{SolveError, Workspace};
use fem_core::scale::times_power_of_two;
use fem_core::{FieldError, Mesh, MeshError, Scale, parallel};

use crate::discretise::DataError;
use crate::estimates::bound_unit;
use crate::forecast::Forecast;
use crate::level::{Context, Level};
use crate::mark::mark;
use crate::output::OutputError;
use crate::problem::Problem;
use crate::settings::{Estimator, Final, Settings};

/// Runs solve, estimate, mark and refine until a rule of `settings.stop` holds.
///
/// Every finished level is shown to `observer`, the last one with the reason why it is the last; with several threads beside the next level, where its fields
/// are wanted. Nothing in here writes or prints. A failure on a level after the first leaves everything up to the level before it: that level is shown
/// again through [`Observer::failed`].
///
/// # Errors
/// [`RunError`]: what failed, and on which level.
pub fn run(
    problem: &Problem,
    settings: &Settings,
    observer: &mut dyn Observer,
) -> Result<Outcome, RunError> {
    let context = Context {
        problem,
        settings,
        begun: Instant::now(),
    };
    let mut workspace = Workspace::default();
    let failed = |level: usize| move |cause: LevelError| RunError { level, cause };
    let mut level = Level::initial(context, &mut workspace).map_err(failed(0))?; // SOLVE, ESTIMATE
    let mut sharpness = SHARPNESS;
    let mut forecast = Forecast::default();
    loop {
        let number = level.number;
        let reason = finish(
            &mut level,
            context,
            forecast,
            &mut workspace,
            &mut sharpness,
        )
        .map_err(failed(number))?;
        forecast.see(&level);
        if settings.output.wants_fields(number, reason.is_some()) {
            level
                .complete(context, &mut workspace)
                .map_err(failed(number))?;
        }
        if let Some(reason) = reason {
            observer
                .level(&level, Some(reason))
                .map_err(|e| failed(number)(e.into()))?;
            return Ok(Outcome { reason, level });
        }
        let marked = mark(&level.estimates.marking, &settings.mark); // MARK
        level.estimates.marking = Vec::new();
        let last = |before: &Level, mesh: &Mesh, expected: f64| {
            let full = |limit: usize| mesh.vertex_count() >= limit;
            settings.stop.vertices.is_some_and(full)
                || reached(settings, before, problem.scale, NEAR * expected).is_some()
        };
        // Fields are written beside the next level.
        let threads = match settings.output.wants_fields(number, false) {
            true => settings.solve.threads,
            false => 1,
        };
        let finished = &level;
        let (shown, next) = if threads > 1 {
            let next = || finished.refine(&marked, context, forecast, last, &mut workspace);
            let (next, shown) = parallel::both(threads, next, || observer.level(finished, None));
            (shown, Some(next))
        } else {
            (observer.level(finished, None), None)
        };
        shown.map_err(|e| failed(number)(e.into()))?;
        // REFINE, SOLVE, ESTIMATE
        let next = next
            .unwrap_or_else(|| finished.refine(&marked, context, forecast, last, &mut workspace));
        level = match next {
            Ok(next) => next,
            Err(cause) => {
                level
                    .complete(context, &mut workspace)
                    .map_err(failed(number))?;
                observer
                    .failed(&level)
                    .map_err(|e| failed(number)(e.into()))?;
                return Err(failed(number + 1)(cause));
            }
        };
    }
}

/// Whether a level is the last one; if it is, or may be, its certificate is made as good as the mesh allows.
///
/// `sharpness` is the quotient of the sharp certificate and the fast one that was seen last.
fn finish(
    level: &mut Level,
    context: Context<'_>,
    forecast: Forecast,
    workspace: &mut Workspace,
    sharpness: &mut f64,
) -> Result<Option<Reason>, LevelError> {
    let settings = context.settings;
    let reason = |level: &Level, bound: f64| reached(settings, level, context.problem.scale, bound);
    if !settings.estimate.wants(Estimator::Certified) {
        return Ok(reason(level, level.estimates.bound));
    }
    let drives = settings.estimate.estimator == Estimator::Certified;
    let sharp = settings.estimate.last == Final::Sharp;
    let factor = if drives && sharp { *sharpness } else { 1.0 };
    if level.estimates.certificate.is_none() {
        let near = reason(level, NEAR * factor * level.estimates.reachable).is_some();
        if !near && !forecast.is_old(&level.mesh) {
            return Ok(None);
        }
        level.certify(context, forecast, near, workspace)?;
    }
    if reason(level, factor * level.estimates.reachable).is_none() {
        return Ok(None);
    }
    level.settle(context, workspace)?;
    if sharp {
        *sharpness = level.sharpen(context)?;
    }
    level.guarantee(context)?;
    Ok(reason(level, level.estimates.bound))
}

/// Watches a run: history, files, progress.
pub trait Observer {
    /// A level is finished; `last` says why no other follows.
    ///
    /// # Errors
    /// What could not be written; it ends the run.
    fn level(&mut self, level: &Level, last: Option<Reason>) -> Result<(), OutputError>;

    /// The level after this one failed, so this one is the last good one.
    ///
    /// # Errors
    /// What could not be written.
    fn failed(&mut self, _last_good: &Level) -> Result<(), OutputError> {
        Ok(())
    }
}

/// A closure that is shown every level watches a run too.
impl<F> Observer for F
where
    F: FnMut(&Level, Option<Reason>) -> Result<(), OutputError>,
{
    fn level(&mut self, level: &Level, last: Option<Reason>) -> Result<(), OutputError> {
        self(level, last)
    }
}

/// Why a run ended: the rule of the scene that held.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Reason {
    /// The relative error goal.
    RelativeError,
    /// The absolute error goal.
    Error,
    /// The limit on vertices.
    Vertices,
    /// The limit on levels.
    Levels,
    /// The limit on seconds.
    Seconds,
}

impl Reason {
    /// Whether the run reached the accuracy that was asked for.
    pub fn is_goal(self) -> bool {
        matches!(self, Reason::RelativeError | Reason::Error)
    }

    /// The key of the scene file that names the rule.
    pub fn key(self) -> &'static str {
        match self {
            Reason::RelativeError => "relative_error",
            Reason::Error => "error",
            Reason::Vertices => "vertices",
            Reason::Levels => "levels",
            Reason::Seconds => "seconds",
        }
    }
}

/// A run that came to its end.
pub struct Outcome {
    /// Why.
    pub reason: Reason,
    /// The last level.
    pub level: Level,
}

/// What went wrong, and on which level.
#[derive(Debug, thiserror::Error)]
#[error("level {level}: {cause}")]
pub struct RunError {
    /// Number of the level that could not be finished.
    pub level: usize,
    /// Why.
    #[source]
    pub cause: LevelError,
}

/// What can go wrong on a level.
#[derive(Debug, thiserror::Error)]
pub enum LevelError {
    /// The mesh cannot be refined further.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// The data are wrong somewhere.
    #[error(transparent)]
    Data(#[from] DataError),
    /// The discrete problem was not solved.
    #[error(transparent)]
    Solve(#[from] SolveError),
    /// A file was not written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

impl From<FieldError> for LevelError {
    fn from(error: FieldError) -> Self {
        LevelError::Data(error.into())
    }
}

/// Whether a goal also counts as reached when the bound is rounding: this part of the largest element contribution.
const ROUNDING_SHARE: f64 = 1e-12;

/// Quotient of the sharp certificate and the fast one that is expected before one has been seen: the largest measured.
const SHARPNESS: f64 = 0.9;

/// A predicted bound times this is taken to be the least that the certificate may come out as.
const NEAR: f64 = 0.96;

/// The first rule that would hold on a level with this bound.
fn reached(settings: &Settings, level: &Level, scale: Scale, bound: f64) -> Option<Reason> {
    let stop = &settings.stop;
    let record = &level.record;
    let unit = bound_unit(settings.estimate.estimator, scale);
    let estimates = &level.estimates;
    let floor = ROUNDING_SHARE * estimates.largest_contribution;
    // Compared in the unit of the bound, so that neither side leaves the range of double precision.
    let norm = times_power_of_two(estimates.energy.energy_norm, scale.energy_norm() - unit);
    // A load that the mesh does not resolve is no part of the bound, so it must meet the goal by itself.
    let within = |limit: f64| bound <= limit && estimates.unseen <= limit;
    let relative = stop
        .relative_error
        .is_some_and(|goal| within(goal * norm + floor));
    let absolute = stop
        .error
        .is_some_and(|goal| within(times_power_of_two(goal, -unit)));
    let rules = [
        (relative, Reason::RelativeError),
        (absolute, Reason::Error),
        (
            stop.vertices.is_some_and(|limit| record.vertices >= limit),
            Reason::Vertices,
        ),
        (
            stop.levels.is_some_and(|limit| record.level + 1 >= limit),
            Reason::Levels,
        ),
        (
            stop.seconds
                .is_some_and(|limit| record.seconds_total >= limit),
            Reason::Seconds,
        ),
    ];
    rules
        .into_iter()
        .find(|(holds, _)| *holds)
        .map(|(_, reason)| reason)
}
