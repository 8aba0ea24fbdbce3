//! What a run may touch in its folder, and what is left when writing fails.

mod output_sample;

use std::fs;
use std::io::{self, Write};
use std::path::Path;

use adapt::output::atomic::write_whole;
use adapt::output::{LevelFields, OutputError, RunFolder};
use output_sample::{edge_fields, level_fields, record, squares, triangle};

fn entries(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn a_folder_comes_to_be_with_the_first_file() {
    let parent = tempfile::tempdir().unwrap();
    let path = parent.path().join("runs").join("disk");
    let mut run = RunFolder::prepare(&path, false).unwrap();
    assert_eq!(run.path(), path);
    assert!(entries(parent.path()).is_empty());
    run.write_scene("title = \"a\"\n").unwrap();
    run.write_history(&[record(0)]).unwrap();
    let mesh = squares(1);
    run.write_level(level_fields(&mesh, 0)).unwrap();
    run.write_edges(edge_fields(&mesh, 0)).unwrap();
    assert_eq!(
        entries(&path),
        [
            "edges_0000.vtp",
            "history.csv",
            "level_0000.vtu",
            "scene.toml",
            "series.pvd"
        ]
    );
    assert_eq!(
        fs::read_to_string(path.join("scene.toml")).unwrap(),
        "title = \"a\"\n"
    );
}

#[test]
fn a_folder_that_holds_something_is_refused_untouched() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("notes.txt"), "mine").unwrap();
    let error = RunFolder::prepare(folder.path(), false).unwrap_err();
    assert!(matches!(error, OutputError::DirectoryNotEmpty { .. }));
    assert!(error.is_user_error());
    assert_eq!(
        error.to_string(),
        format!("the folder `{}` is not empty", folder.path().display())
    );
    assert_eq!(entries(folder.path()), ["notes.txt"]);
}

#[test]
fn a_file_is_no_folder_with_or_without_force() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("out");
    fs::write(&file, "mine").unwrap();
    for force in [false, true] {
        let error = RunFolder::prepare(&file, force).unwrap_err();
        assert!(
            matches!(error, OutputError::NotADirectory { .. }),
            "{error}"
        );
        assert!(error.is_user_error());
    }
    assert_eq!(fs::read_to_string(file).unwrap(), "mine");
}

#[test]
fn force_replaces_the_files_of_a_run_and_no_others() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let ours = [
        "scene.toml",
        "summary.json",
        "history.csv",
        "series.pvd",
        "level_0000.vtu",
        "level_0099.vtu",
        "edges_0099.vtp",
        "checkpoint.bin",
        ".level_0100.vtu.17-3.tmp",
    ];
    let others = ["level_best.vtu", "notes.txt", "plot.svg"];
    for name in ours.iter().chain(&others) {
        fs::write(path.join(name), "old").unwrap();
    }
    fs::create_dir(path.join("checkpoint.d")).unwrap();
    let before = entries(path);

    // Preparing changes nothing, also when the run then fails before its first file.
    let mut run = RunFolder::prepare(path, true).unwrap();
    assert_eq!(entries(path), before);

    run.begin().unwrap();
    assert_eq!(
        entries(path),
        ["checkpoint.d", "level_best.vtu", "notes.txt", "plot.svg"]
    );
    run.write_scene("new").unwrap();
    // A second beginning must not remove what the run wrote.
    run.begin().unwrap();
    assert_eq!(fs::read_to_string(path.join("scene.toml")).unwrap(), "new");
    assert_eq!(fs::read_to_string(path.join("notes.txt")).unwrap(), "old");
}

#[test]
fn a_folder_filled_in_the_meantime_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = RunFolder::prepare(folder.path(), false).unwrap();
    fs::write(folder.path().join("history.csv"), "of another run").unwrap();
    let error = run.write_scene("new").unwrap_err();
    assert!(matches!(error, OutputError::DirectoryNotEmpty { .. }));
    assert_eq!(entries(folder.path()), ["history.csv"]);
}

#[test]
fn a_failed_file_leaves_no_trace_and_the_old_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("history.csv");
    write_whole(&path, |writer| writer.write_all(b"old")).unwrap();
    let error = write_whole(&path, |writer| {
        writer.write_all(&[b'x'; 1 << 20])?;
        writer.flush()?;
        Err(io::Error::other("no more"))
    })
    .unwrap_err();
    assert!(!error.is_user_error());
    assert_eq!(
        error.to_string(),
        format!("could not write `{}`: no more", path.display())
    );
    assert_eq!(entries(folder.path()), ["history.csv"]);
    assert_eq!(fs::read_to_string(&path).unwrap(), "old");

    let panicked = std::panic::catch_unwind(|| write_whole(&path, |_| panic!("in between")));
    assert!(panicked.is_err());
    assert_eq!(entries(folder.path()), ["history.csv"]);
}

#[test]
fn a_folder_in_the_place_of_a_file_is_an_error_without_trace() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("history.csv");
    fs::create_dir(&path).unwrap();
    let error = write_whole(&path, |writer| writer.write_all(b"new")).unwrap_err();
    assert!(matches!(
        error,
        OutputError::Io {
            action: "write",
            ..
        }
    ));
    assert_eq!(entries(folder.path()), ["history.csv"]);
}

#[test]
fn a_level_that_cannot_be_written_is_not_in_the_index() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = RunFolder::prepare(folder.path(), false).unwrap();
    let mesh = triangle();
    run.write_level(level_fields(&mesh, 0)).unwrap();
    let index = fs::read_to_string(folder.path().join("series.pvd")).unwrap();
    let error = run
        .write_level(LevelFields {
            gap: Vec::new().into(),
            ..level_fields(&mesh, 1)
        })
        .unwrap_err();
    assert!(error.to_string().contains("level_0001.vtu"), "{error}");
    assert_eq!(entries(folder.path()), ["level_0000.vtu", "series.pvd"]);
    assert_eq!(
        fs::read_to_string(folder.path().join("series.pvd")).unwrap(),
        index
    );
}
