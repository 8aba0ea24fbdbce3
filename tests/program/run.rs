//! Runs the binary in a folder of its own.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

/// A finished run of the program.
pub struct Run {
    pub code: i32,
    pub stdout: String,
    pub stderr: String,
    pub out: PathBuf,
    _folder: tempfile::TempDir,
}

impl Run {
    pub fn summary(&self) -> Value {
        let text = std::fs::read_to_string(self.out.join("summary.json")).expect("a summary");
        serde_json::from_str(&text).expect("JSON")
    }

    /// The history as rows of named cells.
    pub fn history(&self) -> Vec<Vec<(String, String)>> {
        let text = std::fs::read_to_string(self.out.join("history.csv")).expect("a history");
        let mut lines = text.lines();
        let names: Vec<String> = lines
            .next()
            .expect("a header")
            .split(',')
            .map(str::to_owned)
            .collect();
        lines
            .map(|l| {
                names
                    .iter()
                    .cloned()
                    .zip(l.split(',').map(str::to_owned))
                    .collect()
            })
            .collect()
    }
}

pub fn config(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../../configs/{name}.toml"))
}

/// The binary itself.
pub fn membranes(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_membranes"))
        .args(arguments)
        .output()
        .expect("the program starts")
}

/// `membranes run SCENE --out ... ARGUMENTS`.
pub fn run(scene: &Path, arguments: &[&str]) -> Run {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let out = folder.path().join("out");
    let mut all = vec![
        "run",
        scene.to_str().expect("a path"),
        "--out",
        out.to_str().expect("a path"),
    ];
    all.extend(arguments);
    let output = membranes(&all);
    Run {
        code: output.status.code().expect("no signal"),
        stdout: String::from_utf8(output.stdout).expect("text"),
        stderr: String::from_utf8(output.stderr).expect("text"),
        out,
        _folder: folder,
    }
}
