//! The number of threads shows in no file.

use super::run::run;

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

#[test]
fn one_two_and_three_threads_write_the_same_bytes() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let scene = folder.path().join("scene.toml");
    std::fs::write(&scene, SCENE).expect("written");
    let of = |threads: &str| {
        let set = "output.fields=\"all\"";
        let run = run(&scene, &["--threads", threads, "--quiet", "--set", set]);
        assert_eq!(run.code, 0, "{}", run.stderr);
        // The clock and the memory are not results.
        let history: Vec<Vec<(String, String)>> = run
            .history()
            .into_iter()
            .map(|row| {
                row.into_iter()
                    .filter(|(name, _)| !name.starts_with("seconds") && !name.contains("memory"))
                    .collect()
            })
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
        (history, fields)
    };
    let one = of("1");
    let vertices = one.0.last().and_then(|row| {
        let cell = row.iter().find(|(name, _)| name == "vertices")?;
        cell.1.parse::<usize>().ok()
    });
    assert!(vertices >= Some(30_000), "{vertices:?}");
    for threads in ["2", "3"] {
        let more = of(threads);
        assert_eq!(more.0, one.0, "{threads} threads");
        assert!(more.1 == one.1, "the fields of {threads} threads");
    }
}
