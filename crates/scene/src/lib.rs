//! Scenes: the TOML file that describes two membranes, read, checked and built.
//!
//! The way of a scene through this crate: text and overrides become a [`SceneFile`] (what was written, every value
//! with its place), that is checked as a whole, and then built into an [`adapt::Problem`] in scaled units. Nothing half
//! valid exists between these steps, and nothing is written anywhere. The first mistake ends it with a [`SceneError`]
//! that shows the place.

mod build;
mod check;
mod domain_mesh;
mod error;
mod fields;
mod geometry;
mod mesh_file;
mod overrides;
mod parse;
mod reader;
mod source;
mod tree;
pub mod types;
mod validate;

use std::path::Path;

pub use build::{Overview, Scene};
pub use error::{Excerpt, Kind, Report, SceneError};
pub use source::{At, Place};
pub use types::SceneFile;

use source::Sources;

/// Reads, checks and builds the scene file at `path`, with overrides `KEY=VALUE` applied.
///
/// The text of the scene names its mesh file, if it has one, by an absolute path: it can be run from any folder.
///
/// # Errors
/// The first thing that is wrong with the file, an override, the mesh file it names or the problem they describe.
pub fn load(path: &Path, overrides: &[String]) -> Result<Scene, SceneError> {
    let name = path.display().to_string();
    let text = read_text(path, &name)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut scene = from_text(&text, &name, folder, overrides)?;
    if let Some(text) = mesh_file::absolute(&scene.text, folder) {
        scene.text = text;
    }
    Ok(scene)
}

/// As [`load`], for a text that messages call `name`; mesh files are relative to `folder`.
///
/// # Errors
/// As [`load`].
pub fn from_text(
    text: &str,
    name: &str,
    folder: &Path,
    overrides: &[String],
) -> Result<Scene, SceneError> {
    let sources = Sources {
        name: name.to_owned(),
        text,
        overrides,
    };
    let report = |fault| sources.report(fault);
    let sets = overrides::parse(overrides).map_err(report)?;
    let file = decode(&sources, &sets)?;
    let checked = validate::check(&file, &sources).map_err(report)?;
    let as_run = overrides::apply(text, &sets);
    build::scene(checked, &sources, folder, as_run)
}

/// Decodes a scene without checking or building it.
///
/// # Errors
/// Syntax, unknown keys, wrong types, malformed overrides.
pub fn parse_text(text: &str, name: &str, overrides: &[String]) -> Result<SceneFile, SceneError> {
    let sources = Sources {
        name: name.to_owned(),
        text,
        overrides,
    };
    let sets = overrides::parse(overrides).map_err(|fault| sources.report(fault))?;
    decode(&sources, &sets)
}

/// From text and overrides to what was written.
fn decode(sources: &Sources<'_>, sets: &[overrides::Override]) -> Result<SceneFile, SceneError> {
    let tree = tree::read(sources, sets).map_err(|fault| sources.report(fault))?;
    parse::scene(&tree).map_err(|fault| sources.report(fault))
}

fn read_text(path: &Path, name: &str) -> Result<String, SceneError> {
    let failed = |message: String, hint: Option<&str>, kind: Kind| {
        SceneError::new(Report {
            file: name.to_owned(),
            message,
            hint: hint.map(str::to_owned),
            kind,
            ..Report::default()
        })
    };
    if path.is_dir() {
        let hint = Some("give the path of a TOML file");
        return Err(failed("the scene is a directory".into(), hint, Kind::Input));
    }
    let bytes = std::fs::read(path).map_err(|error| match error.kind() {
        std::io::ErrorKind::NotFound => {
            let hint = Some("a relative path is taken from the current folder");
            failed("the scene does not exist".into(), hint, Kind::Input)
        }
        _ => failed(
            format!("the scene cannot be read: {error}"),
            None,
            Kind::Reading,
        ),
    })?;
    String::from_utf8(bytes).map_err(|error| {
        let line = 1 + error.as_bytes()[..error.utf8_error().valid_up_to()]
            .iter()
            .filter(|&&b| b == b'\n')
            .count();
        SceneError::new(Report {
            file: name.to_owned(),
            line: Some(line),
            message: "the scene is not UTF-8 text".into(),
            hint: Some("save it in the encoding UTF-8".into()),
            ..Report::default()
        })
    })
}
