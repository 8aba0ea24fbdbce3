//! `membranes run`.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use adapt::output::{Ending, RunFolder};
use adapt::{Finish, LevelError, LevelRecord, Recorder, RunError};
use scene::Scene;
use serde_json::{Map, Value};

use crate::args::RunArgs;
use crate::failure::{FILES, Failure, LIMIT, NUMERICAL, say, tell};
use crate::number::{percent, short};
use crate::progress::Progress;

/// Runs a scene; the exit code says whether its goal was reached.
///
/// # Errors
/// Whatever came before the first level, or could not be written. A numerical failure after that is reported here
/// too, when the last good level is safe.
pub fn run(arguments: &RunArgs) -> Result<u8, Failure> {
    let mut scene = scene::load(&arguments.scene, &arguments.set)?;
    let cores = || std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
    scene.settings.solve.threads = arguments.threads.map_or_else(cores, NonZeroUsize::get);
    let out = match &arguments.out {
        Some(out) => out.clone(),
        None => default_folder(&arguments.scene),
    };
    let folder =
        RunFolder::prepare(&out, arguments.force)?.with_threads(scene.settings.solve.threads);
    let mut recorder = Recorder::new(
        folder,
        scene.text.clone(),
        scene.settings.output,
        scene.problem.scale,
    );
    let mut progress = Progress {
        recorder: &mut recorder,
        quiet: arguments.quiet,
    };
    let done = adapt::run(&scene.problem, &scene.settings, &mut progress);
    let (ending, stopped_by, failure) = match done {
        Ok(outcome) if outcome.reason.is_goal() => {
            (Ending::Goal, outcome.reason.key().to_owned(), None)
        }
        Ok(outcome) => (Ending::Limit, outcome.reason.key().to_owned(), None),
        Err(error) => {
            let stopped_by = error.to_string();
            let failure = failed(error, &scene);
            if recorder.levels().is_empty() || failure.code == FILES {
                return Err(failure);
            }
            (Ending::Failed, stopped_by, Some(failure))
        }
    };
    let code = match ending {
        Ending::Goal => 0,
        Ending::Limit if !has_goal(&scene) => 0,
        Ending::Limit => LIMIT,
        _ => NUMERICAL,
    };
    let summary = recorder.finish(Finish {
        ending,
        stopped_by,
        exit_code: i32::from(code),
        scene: arguments.scene.display().to_string(),
        title: scene.title.clone(),
        additions: Map::new(),
    })?;
    if !arguments.quiet {
        caveats(recorder.levels())
            .iter()
            .for_each(|note| tell(note));
    }
    say(&if arguments.json {
        with_folder(summary, &out).to_string()
    } else {
        final_line(ending, recorder.levels(), &out)
    })?;
    match failure {
        Some(failure) => Err(failure),
        None => Ok(code),
    }
}

/// `runs/<stem of the scene file>`.
fn default_folder(scene: &Path) -> PathBuf {
    Path::new("runs").join(scene.file_stem().unwrap_or(scene.as_os_str()))
}

fn has_goal(scene: &Scene) -> bool {
    let stop = &scene.settings.stop;
    stop.relative_error.is_some() || stop.error.is_some()
}

/// What a failed run says. Data that are wrong on the first level are a mistake in the scene.
fn failed(error: RunError, scene: &Scene) -> Failure {
    match error.cause {
        LevelError::Output(error) => error.into(),
        LevelError::Data(data) if error.level == 0 => scene.data_error(&data).into(),
        LevelError::Data(data) => {
            let message = format!("level {}: {data}", error.level);
            let hint = "refinement met a point where the data of the scene are wrong; the level before is kept";
            Failure::new(NUMERICAL, message, Some(hint))
        }
        cause => {
            let hint = (error.level > 0).then_some("the level before is kept");
            Failure::new(NUMERICAL, format!("level {}: {cause}", error.level), hint)
        }
    }
}

/// What the certificate of the last level does not hold for, a line each.
fn caveats(levels: &[LevelRecord]) -> Vec<String> {
    let assurance = levels.last().and_then(|last| last.assurance.as_ref());
    let caveats = assurance.map_or(&[][..], |a| &a.caveats);
    caveats.iter().map(|c| format!("note: {c}")).collect()
}

fn with_folder(summary: Value, out: &Path) -> Value {
    match summary {
        Value::Object(mut object) => {
            object.insert("folder".into(), out.display().to_string().into());
            Value::Object(object)
        }
        other => other,
    }
}

/// The result in one line.
fn final_line(ending: Ending, levels: &[LevelRecord], out: &Path) -> String {
    let Some(last) = levels.last() else {
        return format!("{}: no level, {}", ending.name(), out.display());
    };
    let relative = last
        .relative_bound
        .map(|relative| format!(" ({})", percent(relative)))
        .unwrap_or_default();
    let count = match levels.len() {
        1 => "1 level".to_owned(),
        n => format!("{n} levels"),
    };
    format!(
        "{}: bound {}{relative}, contact area {}, contact force {}, largest pressure {}, smallest gap {}, {}, {} vertices, {}",
        ending.name(),
        short(last.error_bound),
        short(last.contact_area),
        short(last.contact_force),
        short(last.max_action),
        short(last.smallest_gap),
        count,
        last.vertices,
        out.display(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_folder_is_named_after_the_scene() {
        let folder = |scene: &str| default_folder(Path::new(scene));
        assert_eq!(folder("scenes/plate.v2.toml"), Path::new("runs/plate.v2"));
        assert_eq!(folder("plate"), Path::new("runs/plate"));
    }
}
