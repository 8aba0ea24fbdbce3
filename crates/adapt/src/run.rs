//! The adaptive loop.

use std::time::Instant;

use contact::SolveError;
use fem_core::scale::times_power_of_two;
use fem_core::{FieldError, MeshError, Scale};

use crate::discretise::DataError;
use crate::level::{Level, bound_unit};
use crate::mark::mark;
use crate::output::OutputError;
use crate::problem::Problem;
use crate::settings::{Estimator, Final, Settings, Stop};

/// Runs solve, estimate, mark and refine until a rule of `settings.stop` holds.
///
/// Every finished level is shown to `observer`, the last one with the reason why it is the last. Nothing in here writes or
/// prints. A failure on a level after the first leaves everything up to the level before it: that level is shown
/// again through [`Observer::failed`].
///
/// # Errors
/// [`RunError`]: what failed, and on which level.
pub fn run(
    problem: &Problem,
    settings: &Settings,
    observer: &mut dyn Observer,
) -> Result<Outcome, RunError> {
    let begun = Instant::now();
    let failed = |level: usize| move |cause: LevelError| RunError { level, cause };
    let mut level = Level::initial(problem, settings, begun).map_err(failed(0))?; // SOLVE, ESTIMATE
    let mut sharpness = SHARPNESS;
    loop {
        let mut reason = reached(&settings.stop, settings, &level, problem.scale, 1.0);
        // The sharp certificate belongs to the last level; it also decides whether this is the last one when the goal is near.
        let sharp =
            settings.estimate.wants(Estimator::Certified) && settings.estimate.last == Final::Sharp;
        let near = || {
            settings.estimate.estimator == Estimator::Certified
                && reached(&settings.stop, settings, &level, problem.scale, sharpness).is_some()
        };
        if sharp && (reason.is_some() || near()) {
            sharpness = level
                .sharpen(problem, settings, begun)
                .map_err(failed(level.number))?;
            reason = reached(&settings.stop, settings, &level, problem.scale, 1.0);
        }
        observer.level(&level, reason).map_err(|e| RunError {
            level: level.number,
            cause: e.into(),
        })?;
        if let Some(reason) = reason {
            return Ok(Outcome { reason, level });
        }
        let marked = mark(&level.estimates.marking, &settings.mark); // MARK
        level = match level.refine(&marked, problem, settings, begun) {
            // REFINE, SOLVE, ESTIMATE
            Ok(next) => next,
            Err(cause) => {
                observer.failed(&level).map_err(|e| RunError {
                    level: level.number,
                    cause: e.into(),
                })?;
                return Err(RunError {
                    level: level.number + 1,
                    cause,
                });
            }
        };
    }
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

/// The first rule that would hold on a level whose bound is `factor` times what it is.
fn reached(
    stop: &Stop,
    settings: &Settings,
    level: &Level,
    scale: Scale,
    factor: f64,
) -> Option<Reason> {
    let record = &level.record;
    let unit = bound_unit(settings.estimate.estimator, scale);
    let estimates = &level.estimates;
    let floor = ROUNDING_SHARE * estimates.largest_contribution;
    // Compared in the unit of the bound, so that neither side leaves the range of double precision.
    let norm = times_power_of_two(estimates.energy.energy_norm, scale.energy_norm() - unit);
    // A load that the mesh does not resolve is no part of the bound, so it must meet the goal by itself.
    let within = |limit: f64| factor * estimates.bound <= limit && estimates.unseen <= limit;
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
