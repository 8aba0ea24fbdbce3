//! One aligned line a level on standard error, beside what is written.

use adapt::output::OutputError;
use adapt::{Level, LevelRecord, Observer, Reason, Recorder};

use crate::failure::tell;
use crate::number::percent;

/// Hands every level to the recorder and shows its numbers.
pub struct Progress<'a> {
    /// What writes the files.
    pub recorder: &'a mut Recorder,
    /// Whether nothing is to be shown.
    pub quiet: bool,
}

impl Observer for Progress<'_> {
    fn level(&mut self, level: &Level, last: Option<Reason>) -> Result<(), OutputError> {
        self.recorder.level(level, last)?;
        if !self.quiet {
            let record = &level.record;
            if level.number == 0 {
                tell(&header(record));
            }
            tell(&line(record));
        }
        Ok(())
    }

    fn failed(&mut self, last_good: &Level) -> Result<(), OutputError> {
        self.recorder.failed(last_good)
    }
}

/// Names of the columns; those of the true error only where it is known.
fn header(record: &LevelRecord) -> String {
    let exact = match record.true_error {
        Some(_) => format!(" {:>10} {:>7}", "true error", "effect."),
        None => String::new(),
    };
    format!(
        "{:>5} {:>9} {:>9} {:>8} {:>10} {:>9}{exact} {:>12} {:>4} {:>8} {:>8}",
        "level",
        "vertices",
        "triangles",
        "contact",
        "bound",
        "relative",
        "solver",
        "its",
        "kkt",
        "seconds"
    )
}

fn line(record: &LevelRecord) -> String {
    let relative = record.relative_bound.map_or("-".into(), percent);
    let exact = match record.true_error {
        Some(error) => {
            let effectivity = record.effectivity.map_or("-".into(), |e| format!("{e:.2}"));
            format!(" {error:>10.3e} {effectivity:>7}")
        }
        None => String::new(),
    };
    format!(
        "{:>5} {:>9} {:>9} {:>8} {:>10.3e} {relative:>9}{exact} {:>12} {:>4} {:>8.1e} {:>8.2}",
        record.level,
        record.vertices,
        record.triangles,
        record.contact_vertices,
        record.error_bound,
        record.solver,
        record.iterations,
        record.kkt_residual,
        record.seconds_total,
    )
}
