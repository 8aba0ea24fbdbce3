//! The files of a run: which are there, what they hold, and whether that is what the run wrote.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use adapt::Settings;
use adapt::output::checksum::checksum;
use adapt::output::folder::{HISTORY, SCENE, SERIES, SUMMARY, edges_file, is_ours, level_file};
use adapt::settings::{Estimator, Fields};
use serde_json::{Map, Value};

use crate::error::VerifyError;
use crate::report::Report;

/// The folder of a run.
pub(crate) struct Folder {
    path: PathBuf,
    /// Files of a run that are there.
    names: BTreeSet<String>,
    /// Checksums that the summary states.
    sums: BTreeMap<String, String>,
}

/// A file and whether its checksum is that of the summary.
pub(crate) struct Content {
    /// Its bytes.
    pub bytes: Vec<u8>,
    /// Whether they are those that the run wrote.
    pub genuine: bool,
}

impl Folder {
    /// Lists a folder that must hold a summary.
    pub fn open(path: &Path) -> Result<Folder, VerifyError> {
        let none = |why: &'static str| VerifyError::NoRun {
            path: path.to_path_buf(),
            why,
        };
        let failed = |cause: io::Error| VerifyError::Io {
            path: path.to_path_buf(),
            cause,
        };
        let entries = match fs::read_dir(path) {
            Ok(entries) => entries,
            Err(e) if e.kind() == io::ErrorKind::NotFound => return Err(none("it does not exist")),
            Err(e) if e.kind() == io::ErrorKind::NotADirectory => {
                return Err(none("it is not a folder"));
            }
            Err(e) => return Err(failed(e)),
        };
        let mut names = BTreeSet::new();
        for entry in entries {
            let name = entry.map_err(failed)?.file_name();
            if let Some(name) = name.to_str().filter(|n| is_ours(n)) {
                names.insert(name.to_owned());
            }
        }
        if !names.contains(SUMMARY) {
            return Err(none(
                "there is no `summary.json`, which a run writes at its end",
            ));
        }
        Ok(Folder {
            path: path.to_path_buf(),
            names,
            sums: BTreeMap::new(),
        })
    }

    /// The path of a file.
    pub fn path(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// The bytes of a file; `None` if it is missing.
    pub fn read(&self, name: &str) -> Result<Option<Content>, VerifyError> {
        let path = self.path(name);
        match fs::read(&path) {
            Ok(bytes) => {
                let genuine = self
                    .sums
                    .get(name)
                    .is_some_and(|sum| *sum == checksum(&bytes));
                Ok(Some(Content { bytes, genuine }))
            }
            Err(e) if e.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(cause) => Err(VerifyError::Io { path, cause }),
        }
    }

    /// The summary as an object.
    pub fn summary(&self) -> Result<Map<String, Value>, VerifyError> {
        let unreadable = |why: String| VerifyError::Unreadable {
            path: self.path(SUMMARY),
            why,
        };
        let content = self.read(SUMMARY)?;
        let content = content.ok_or_else(|| unreadable("it is gone".into()))?;
        match serde_json::from_slice(&content.bytes) {
            Ok(Value::Object(object)) => Ok(object),
            Ok(_) => Err(unreadable("it is no JSON object".into())),
            Err(e) => Err(unreadable(format!("it is no JSON: {e}"))),
        }
    }

    /// Compares every file with the checksums of the summary, which are kept.
    pub fn check_sums(
        &mut self,
        summary: &Map<String, Value>,
        report: &mut Report,
    ) -> Result<(), VerifyError> {
        let Some(sums) = summary.get("checksums").and_then(Value::as_object) else {
            report.property(SUMMARY, "checksums", Some("there are none".into()));
            return Ok(());
        };
        for (name, sum) in sums {
            let sum = sum.as_str().unwrap_or_default().to_owned();
            self.sums.insert(name.clone(), sum);
        }
        for (name, sum) in self.sums.clone() {
            // A name that no run writes is not looked for: it might lead out of the folder.
            let content = if is_ours(&name) && name != SUMMARY {
                self.read(&name)?
            } else {
                None
            };
            match content {
                Some(content) => {
                    let found = checksum(&content.bytes);
                    report.same(&name, "SHA-256", sum, found);
                }
                None => report.property(&name, "file", Some("it is missing".into())),
            }
        }
        Ok(())
    }

    /// Compares the files that are there with those that a run of `levels` levels leaves. Gives the levels that have fields.
    pub fn check_names(
        &self,
        settings: &Settings,
        levels: usize,
        exit_code: i64,
        report: &mut Report,
    ) -> Vec<usize> {
        let last = levels.checked_sub(1);
        let wanted = |l: usize| match settings.output.fields {
            Fields::All => true,
            Fields::Last => Some(l) == last,
            Fields::None => false,
            Fields::Every(n) => Some(l) == last || l.is_multiple_of(n.max(1)),
        };
        // No more levels than files and rows can be there; a wild count must not run the loop for ever.
        let with_fields: Vec<usize> = (0..levels).filter(|&l| wanted(l)).collect();
        let mut expected: BTreeSet<String> = [SCENE, HISTORY, SUMMARY].map(str::to_owned).into();
        if !with_fields.is_empty() {
            expected.insert(SERIES.to_owned());
        }
        let edges = settings.output.edges && settings.estimate.wants(Estimator::Paper);
        for &level in &with_fields {
            expected.insert(level_file(level));
            if edges {
                expected.insert(edges_file(level));
            }
        }
        for name in expected.difference(&self.names) {
            // A file whose checksum is stated is reported with it.
            if !self.sums.contains_key(name) {
                report.property(name, "file", Some("it is missing".into()));
            }
        }
        for name in self.names.difference(&expected) {
            // What a run that may be resumed leaves behind.
            if exit_code == 0 || !name.starts_with("checkpoint.") {
                report.property(
                    name,
                    "file",
                    Some("a run of this scene does not write it".into()),
                );
            }
        }
        for name in &expected {
            let stated = name == SUMMARY || self.sums.contains_key(name);
            if !stated && self.names.contains(name) {
                report.property(
                    name,
                    "SHA-256",
                    Some("the summary does not state it".into()),
                );
            }
        }
        with_fields
    }
}
