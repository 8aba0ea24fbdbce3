//! Verification of a finished run from its files alone.
//!
//! [`verify`] reads `scene.toml`, `summary.json`, `history.csv`, the `.vtu` and `.vtp` files and `series.pvd` of a folder and recomputes every
//! number that follows from the mesh, the nodal fields and the scene. It shares the mesh, the quadrature of data and the scene reader with the run, and
//! nothing with its solvers: residuals are summed element by element without a matrix (`conditions`), sigma is proved by its residual
//! (`sigma`), estimators are written anew (`indicators`), VTK files are read by a reader of its own (`vtk`). Only the true
//! errors are those of `estimate`.
//!
//! What cannot be recomputed (times, memory, iterations, levels without fields) is covered by the SHA-256 sums in `summary.json`.
//!
//! - `folder`, `tables`, `vtk`, `fields`: files, cells and arrays;
//! - `cover`: whether the triangles cover the scene's domain as a refinement of its initial mesh;
//! - `data`, `element`: the scene's data on a mesh; `conditions`, `sigma`: the discrete conditions;
//! - `indicators`, `action`, `certificate`: what is estimated; `columns`: how each column follows;
//! - `ending`: outcome, rule and exit code;
//! - `number`, `report`: comparison and result.
//!
//! Nothing in here prints.

mod action;
mod appended;
mod base64;
mod certificate;
mod columns;
mod conditions;
mod cover;
mod data;
mod element;
mod ending;
mod error;
mod fields;
mod folder;
mod grid;
mod indicators;
mod level;
mod number;
mod report;
mod sigma;
mod summary;
mod tables;
#[cfg(test)]
mod testing;
mod vtk;

use std::path::Path;

use adapt::output::folder::{HISTORY, SCENE};
use scene::Scene;
use serde_json::Value;

pub use error::VerifyError;
pub use number::TOLERANCE;
pub use report::{Failure, Report};

use certificate::Place;
use columns::{COLUMNS, Recomputed};
use folder::Folder;
use tables::{History, compare};

/// Verifies the run in a folder.
///
/// The report holds every claim that fails. Claims that need a file which is missing or changed beyond reading are
/// not counted.
///
/// # Errors
/// [`VerifyError`]: the folder holds no finished run, or something in it cannot be read though it is as the run wrote it.
pub fn verify(path: &Path) -> Result<Report, VerifyError> {
    let mut report = Report::default();
    let mut folder = Folder::open(path)?;
    let summary = folder.summary()?;
    summary::check_own_sum(&summary, &mut report);
    folder.check_sums(&summary, &mut report)?;
    let scene = read_scene(&folder, &mut report)?;
    let history = read_history(&folder, &mut report)?;
    let (Some(scene), Some(history)) = (scene, history) else {
        return Ok(report);
    };
    report.levels = history.len();
    let code = summary
        .get("exit_code")
        .and_then(Value::as_i64)
        .unwrap_or(0);
    let with_fields = folder.check_names(&scene.settings, history.len(), code, &mut report);
    summary::check_text(&summary, &scene, &history, &mut report);
    summary::check_series(&folder, &with_fields, &mut report)?;
    summary::check_rows(&history, &scene, &mut report);
    for number in 0..history.len() {
        let last = number + 1 == history.len();
        let place = Place {
            // The level that a failed run kept was not meant to be its last.
            last: last && code != 3,
            claimed: history.text(number, "bound_kind"),
            certified: history.number(number, "certified").is_some(),
            algebraic: history.number(number, "algebraic_error"),
            bound: history.number(number, "error_bound"),
        };
        let file = match with_fields.binary_search(&number) {
            Ok(_) => level::read(&folder, number, &scene, &mut report)?,
            Err(_) => None,
        };
        let discrete = match &file {
            Some(file) => file.discrete(&scene, place).map(Some),
            None => Ok(None),
        };
        let level = discrete
            .as_ref()
            .map_err(Clone::clone)
            .and_then(|discrete| match discrete {
                Some(discrete) => {
                    Recomputed::new(discrete, number, &scene.problem, &scene.settings, place)
                        .map(Some)
                }
                None => Ok(None),
            });
        let level = match level {
            Ok(level) => level,
            Err(why) => {
                report.property(
                    SCENE,
                    &format!("data on level {number}"),
                    Some(why.to_string()),
                );
                None
            }
        };
        if let (Some(level), Some(file)) = (&level, &file) {
            report.recomputed.push(number);
            file.check(level, &scene, &mut report);
            file.check_edges(level, &folder, &mut report)?;
            for (name, entry) in COLUMNS {
                if let Some(cell) = history.cell(number, name) {
                    compare(&mut report, HISTORY, name, cell, &entry(level));
                }
            }
            if last {
                summary::check_numbers(&summary, level, &mut report);
            }
        }
        if last {
            // Without fields its certificate is covered by the checksum only.
            if let Some(level) = &level {
                certificate::check_summary(&summary, level.certificate.as_ref(), &mut report);
            }
            ending::check_last(
                &scene.settings,
                &summary,
                &history,
                level.as_ref(),
                &mut report,
            );
        } else {
            ending::check_earlier(
                &scene.settings,
                number,
                &history,
                level.as_ref(),
                &mut report,
            );
        }
    }
    Ok(report)
}

/// The scene; `None` if it is missing or was changed so that it cannot be built.
fn read_scene(folder: &Folder, report: &mut Report) -> Result<Option<Scene>, VerifyError> {
    let Some(content) = folder.read(SCENE)? else {
        report.property(SCENE, "file", Some("it is missing".into()));
        return Ok(None);
    };
    match scene::load(&folder.path(SCENE), &[]) {
        Ok(scene) => Ok(Some(scene)),
        Err(why) if content.genuine => Err(VerifyError::Scene(why.to_string())),
        Err(why) => {
            report.property(SCENE, "scene", Some(why.report().message.clone()));
            Ok(None)
        }
    }
}

/// The history; `None` if it is missing or was changed so that it cannot be read.
fn read_history(folder: &Folder, report: &mut Report) -> Result<Option<History>, VerifyError> {
    let Some(content) = folder.read(HISTORY)? else {
        report.property(HISTORY, "file", Some("it is missing".into()));
        return Ok(None);
    };
    match History::parse(&content.bytes) {
        Ok(history) => Ok(Some(history)),
        Err(why) if content.genuine => Err(VerifyError::Unreadable {
            path: folder.path(HISTORY),
            why,
        }),
        Err(why) => {
            report.property(HISTORY, "format", Some(why));
            Ok(None)
        }
    }
}
