//! The number of threads shows in no file.

use std::ffi::OsString;
use std::path::Path;

use super::run::{Run, run};

/// Loads that jump and that cancel, tensions that vary: everything that is sampled, divided and carried over.
const SCENE: &str = r#"
[domain.rectangle]
lower = [-1, -1]
upper = [1, 1]
size = 0.25

[upper]
tension = "1 + 0.25*x^2"
load = "if(x^2 + y^2 < 0.3, -9 + x*y, 3*sin(2*x))"
boundary = 0.0

[lower]
tension = 2.0
load = "if(x > 0.3, 1, -2)*(1 + y^2)"
boundary = 0.0

[estimate]
estimator = "residual"
also = ["paper", "certified"]

[stop]
vertices = 30_000
"#;

/// A run that the certificate drives, with constant tensions and a contact set across blocks of triangles; what the fast certificate does not sample has closed forms.
const CERTIFIED: &str = r#"
[domain.rectangle]
lower = [-1, -1]
upper = [1, 1]
size = 0.25

[upper]
tension = 1.0
load = "if(x^2 + y^2 < 0.3, -9 + x*y, 3*sin(2*x))"
boundary = 0.1

[lower]
tension = 2.0
load = "1 + y^2"
boundary = 0.0

[estimate]
estimator = "certified"
also = []
final = "fast"

[stop]
vertices = 30_000
"#;

/// What a run wrote, but for what the clock and the memory say.
struct Written {
    history: Vec<Vec<(String, String)>>,
    summary: serde_json::Value,
    /// Names and bytes.
    fields: Vec<(OsString, Vec<u8>)>,
}

fn written(run: &Run) -> Written {
    assert_eq!(run.code, 0, "{}", run.stderr);
    let kept = |name: &str| !name.contains("seconds") && !name.contains("memory");
    let history: Vec<_> = run
        .history()
        .into_iter()
        .map(|row| row.into_iter().filter(|(name, _)| kept(name)).collect())
        .collect();
    let mut fields: Vec<_> = std::fs::read_dir(&run.out)
        .expect("a folder")
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.extension().is_some_and(|e| e == "vtu"))
        .map(|path| {
            let bytes = std::fs::read(&path).expect("fields");
            (path.file_name().expect("a name").to_owned(), bytes)
        })
        .collect();
    fields.sort();
    assert_eq!(fields.len(), history.len());
    let mut summary = run.summary();
    let object = summary.as_object_mut().expect("an object");
    // Below `totals` there are seconds only, and the checksums cover the seconds.
    object.retain(|name, _| kept(name) && name != "totals" && !name.starts_with("checksum"));
    Written {
        history,
        summary,
        fields,
    }
}

fn compare(folder: &Path, scene: &str) {
    let path = folder.join("scene.toml");
    std::fs::write(&path, scene).expect("written");
    let all = "output.fields=\"all\"";
    let of = |threads: &str| {
        let keys = ["--threads", threads, "--quiet", "--set", all];
        written(&run(&path, &keys))
    };
    let one = of("1");
    let vertices = one.history.last().and_then(|row| {
        let cell = row.iter().find(|(name, _)| name == "vertices")?;
        cell.1.parse::<usize>().ok()
    });
    assert!(vertices >= Some(30_000), "{vertices:?}");
    for threads in ["2", "3"] {
        let more = of(threads);
        assert_eq!(more.history, one.history, "{threads} threads");
        assert_eq!(more.summary, one.summary, "{threads} threads");
        assert!(more.fields == one.fields, "the fields of {threads} threads");
    }
}

#[test]
fn one_two_and_three_threads_write_the_same_bytes() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    compare(folder.path(), SCENE);
}

#[test]
fn a_certified_run_writes_the_same_bytes_on_any_number_of_threads() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    compare(folder.path(), CERTIFIED);
}
