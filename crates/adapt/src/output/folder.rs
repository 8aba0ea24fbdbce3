//! The folder of a run: what may be replaced in it, and when.

use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use super::atomic::{TEMPORARY, write_bytes, write_whole};
use super::checksum::summed;
use super::error::OutputError;
use super::history::write_history;
use super::pvd::write_series;
use super::summary::Summary;
use super::vtp::{EdgeFields, write_edges};
use super::vtu::{LevelFields, write_level};
use crate::record::LevelRecord;

/// The scene as it was run.
pub const SCENE: &str = "scene.toml";
/// The run in one object.
pub const SUMMARY: &str = "summary.json";
/// One row a level.
pub const HISTORY: &str = "history.csv";
/// ParaView's index.
pub const SERIES: &str = "series.pvd";

/// The file of a level's fields.
pub fn level_file(level: usize) -> String {
    format!("level_{level:04}.vtu")
}

/// The file of a level's edges.
pub fn edges_file(level: usize) -> String {
    format!("edges_{level:04}.vtp")
}

/// A folder that a run may write to. Nothing is touched before the first file is about to be written.
#[derive(Debug)]
pub struct RunFolder {
    path: PathBuf,
    force: bool,
    begun: bool,
    threads: usize,
    /// Levels that have a file, ascending.
    levels: Vec<usize>,
    /// SHA-256 of every file written but the summary, by name.
    checksums: BTreeMap<String, String>,
}

impl RunFolder {
    /// Makes sure that a run may write to `path`, which need not exist. Creates and changes nothing.
    ///
    /// With `force` a folder that is not empty will do: [`RunFolder::begin`] then removes the files of an earlier run, and
    /// nothing else.
    ///
    /// # Errors
    /// [`OutputError::DirectoryNotEmpty`] without `force`, [`OutputError::NotADirectory`], or [`OutputError::Io`] when the
    /// folder cannot be read.
    pub fn prepare(path: impl Into<PathBuf>, force: bool) -> Result<RunFolder, OutputError> {
        let folder = RunFolder {
            path: path.into(),
            force,
            begun: false,
            threads: 1,
            levels: Vec::new(),
            checksums: BTreeMap::new(),
        };
        folder.check()?;
        Ok(folder)
    }

    /// Allows so many threads at a time, one at first; the files do not depend on it.
    pub fn with_threads(self, threads: usize) -> RunFolder {
        RunFolder { threads, ..self }
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    fn check(&self) -> Result<(), OutputError> {
        let entries = match fs::read_dir(&self.path) {
            Ok(mut entries) => entries.next().transpose(),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(error),
        };
        match entries {
            Ok(Some(_)) if !self.force => Err(OutputError::DirectoryNotEmpty {
                path: self.path.clone(),
            }),
            Ok(_) => Ok(()),
            Err(error) if error.kind() == io::ErrorKind::NotADirectory => {
                Err(OutputError::NotADirectory {
                    path: self.path.clone(),
                })
            }
            Err(error) => Err(OutputError::io("read", &self.path)(error)),
        }
    }

    /// Creates the folder and removes the files of an earlier run, so that no level of it is left. Does so once; every
    /// `write_` method calls it first.
    ///
    /// # Errors
    /// As [`RunFolder::prepare`] (the folder may have changed since), and [`OutputError::Io`] when the folder cannot be
    /// created or an old file not be removed.
    pub fn begin(&mut self) -> Result<(), OutputError> {
        if self.begun {
            return Ok(());
        }
        self.check()?;
        fs::create_dir_all(&self.path).map_err(OutputError::io("create", &self.path))?;
        let failed = || OutputError::io("read", &self.path);
        for entry in fs::read_dir(&self.path).map_err(failed())? {
            let entry = entry.map_err(failed())?;
            let is_file = !entry.file_type().map_err(failed())?.is_dir();
            if is_file && entry.file_name().to_str().is_some_and(is_ours) {
                let path = entry.path();
                fs::remove_file(&path).map_err(OutputError::io("remove", &path))?;
            }
        }
        self.begun = true;
        Ok(())
    }

    /// Writes `scene.toml`.
    ///
    /// # Errors
    /// Those of [`RunFolder::begin`] and [`write_whole`].
    pub fn write_scene(&mut self, text: &str) -> Result<(), OutputError> {
        self.begin()?;
        self.write(SCENE, |writer| writer.write_all(text.as_bytes()))
    }

    /// Writes `history.csv` with every level so far; a finished level stays whatever happens later.
    ///
    /// # Errors
    /// Those of [`RunFolder::begin`] and [`write_whole`].
    pub fn write_history(&mut self, levels: &[LevelRecord]) -> Result<(), OutputError> {
        self.begin()?;
        self.write(HISTORY, |mut writer| write_history(&mut writer, levels))
    }

    /// Writes `level_NNNN.vtu`, then `series.pvd` with it.
    ///
    /// # Errors
    /// Those of [`RunFolder::begin`], [`write_whole`] and [`write_level`].
    pub fn write_level(&mut self, fields: LevelFields<'_>) -> Result<(), OutputError> {
        self.begin()?;
        let level = fields.level;
        self.write(&level_file(level), |writer| write_level(writer, fields))?;
        if let Err(place) = self.levels.binary_search(&level) {
            self.levels.insert(place, level);
        }
        let files: Vec<(usize, String)> = self.levels.iter().map(|&l| (l, level_file(l))).collect();
        self.write(SERIES, |mut writer| {
            write_series(
                &mut writer,
                files.iter().map(|(l, name)| (*l, name.as_str())),
            )
        })
    }

    /// Writes `edges_NNNN.vtp`.
    ///
    /// # Errors
    /// Those of [`RunFolder::begin`], [`write_whole`] and [`write_edges`].
    pub fn write_edges(&mut self, fields: EdgeFields<'_>) -> Result<(), OutputError> {
        self.begin()?;
        self.write(&edges_file(fields.level), |mut writer| {
            write_edges(&mut writer, fields)
        })
    }

    /// SHA-256, in hexadecimal digits, of the bytes of every file written so far but `summary.json`, by name.
    pub fn checksums(&self) -> &BTreeMap<String, String> {
        &self.checksums
    }

    /// Writes a file and keeps the checksum of its bytes.
    fn write(
        &mut self,
        name: &str,
        content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<(), OutputError> {
        let mut sum = String::new();
        write_whole(&self.path.join(name), |writer| {
            sum = summed(writer, self.threads, content)?;
            Ok(())
        })?;
        self.checksums.insert(name.to_owned(), sum);
        Ok(())
    }

    /// Writes `summary.json`.
    ///
    /// # Errors
    /// Those of [`RunFolder::begin`] and [`write_whole`].
    pub fn write_summary(&mut self, summary: &Summary<'_>) -> Result<(), OutputError> {
        self.begin()?;
        write_bytes(&self.path.join(SUMMARY), summary.to_text().as_bytes())
    }
}

/// Whether a run writes files of this name, a temporary file that a killed run left behind included.
pub fn is_ours(name: &str) -> bool {
    let numbered = |name: &str, head: &str, tail: &str| {
        name.strip_prefix(head)
            .and_then(|rest| rest.strip_suffix(tail))
            .is_some_and(|n| n.len() >= 4 && n.bytes().all(|b| b.is_ascii_digit()))
    };
    let result = |name: &str| {
        [SCENE, SUMMARY, HISTORY, SERIES].contains(&name)
            || numbered(name, "level_", ".vtu")
            || numbered(name, "edges_", ".vtp")
            || name.starts_with("checkpoint.")
    };
    // `.NAME.PROCESS-NUMBER.tmp`
    let under_way = name
        .strip_prefix('.')
        .and_then(|rest| rest.strip_suffix(TEMPORARY))
        .and_then(|rest| rest.rsplit_once('.'))
        .is_some_and(|(name, number)| {
            result(name) && number.bytes().all(|b| b.is_ascii_digit() || b == b'-')
        });
    result(name) || under_way
}

#[cfg(test)]
mod tests {
    use super::is_ours;

    #[test]
    fn names_of_a_run_are_told_from_others() {
        for name in [
            "scene.toml",
            "summary.json",
            "history.csv",
            "series.pvd",
            "level_0000.vtu",
            "level_12345.vtu",
            "edges_0007.vtp",
            "checkpoint.bin",
            ".level_0003.vtu.4711-12.tmp",
            ".checkpoint.bin.1-0.tmp",
        ] {
            assert!(is_ours(name), "{name}");
        }
        for name in [
            "level_1.vtu",
            "level_best.vtu",
            "level_0000.vtu.bak",
            "level_0000.vtp",
            "my_history.csv",
            "notes.tmp",
            ".notes.txt.1-0.tmp",
            "level_.vtu",
            "checkpoint",
            "plot.svg",
        ] {
            assert!(!is_ours(name), "{name}");
        }
    }
}
