//! Wrong scenes, meshes and command lines: each is refused with one message that shows the place, before anything is
//! written.
//!
//! A scene is wrong in one way; the beginning of its name in `tests/bad/` is its group. The messages of a group stand
//! in one snapshot, `tests/snapshots/bad_GROUP.snap`.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A copy of `tests/bad/` to run in, so that messages hold no path of this machine.
struct Place {
    folder: tempfile::TempDir,
}

impl Place {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        for entry in fs::read_dir(bad()).expect("the folder of wrong scenes") {
            let path = entry.expect("an entry").path();
            let name = path.file_name().expect("a name");
            fs::copy(&path, folder.path().join(name)).expect("a copy");
        }
        Place { folder }
    }

    /// Every file below the folder, sorted.
    fn files(&self) -> Vec<PathBuf> {
        fn walk(folder: &Path, found: &mut Vec<PathBuf>) {
            for entry in fs::read_dir(folder).expect("a folder") {
                let path = entry.expect("an entry").path();
                if path.is_dir() {
                    walk(&path, found);
                }
                found.push(path);
            }
        }
        let mut found = Vec::new();
        walk(self.folder.path(), &mut found);
        found.sort();
        found
    }

    /// What the program says to a wrong command; all that every wrong command has in common is checked here.
    fn refused(&self, arguments: &[&str]) -> String {
        let before = self.files();
        let output = Command::new(env!("CARGO_BIN_EXE_membranes"))
            .args(arguments)
            .current_dir(self.folder.path())
            .env("NO_COLOR", "1")
            .output()
            .expect("the program starts");
        let shown = format!("$ membranes {}", arguments.join(" "));
        let said = String::from_utf8(output.stderr).expect("text");
        assert_eq!(output.status.code(), Some(2), "{shown}\n{said}");
        assert!(
            output.stdout.is_empty(),
            "{shown} writes to standard output"
        );
        assert_eq!(before, self.files(), "{shown} leaves files");
        format!("{shown}\n{}\n", said.trim_end())
    }
}

fn tests() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests")
}

fn bad() -> PathBuf {
    tests().join("bad")
}

/// Exactly one message, at its beginning, with at most one hint, at its end.
fn is_one_message(shown: &str) {
    let lines: Vec<&str> = shown.lines().skip(1).collect();
    assert!(lines[0].starts_with("error: "), "{shown}");
    assert!(!lines[0].ends_with('.'), "{shown}");
    let count = |start: &str| lines.iter().filter(|line| line.starts_with(start)).count();
    assert_eq!(count("error: "), 1, "{shown}");
    match count("hint: ") {
        0 => {}
        1 => assert!(
            lines.last().expect("a line").starts_with("hint: "),
            "{shown}"
        ),
        _ => panic!("several hints: {shown}"),
    }
}

fn assert_messages(group: &str, shown: &[String]) {
    let mut settings = insta::Settings::clone_current();
    settings.set_snapshot_path(tests().join("snapshots"));
    settings.set_prepend_module_to_snapshot(false);
    settings.set_omit_expression(true);
    settings.bind(|| insta::assert_snapshot!(format!("bad_{group}"), shown.join("\n")));
}

/// Runs every scene of a group.
fn group(group: &str, at_least: usize) {
    let place = Place::new();
    let mut names: Vec<String> = place
        .files()
        .iter()
        .filter_map(|path| path.file_name()?.to_str().map(str::to_owned))
        .filter(|name| name.ends_with(".toml") && name.starts_with(&format!("{group}-")))
        .collect();
    names.sort();
    assert!(names.len() >= at_least, "{names:?}");
    let shown: Vec<String> = names
        .iter()
        .map(|name| {
            let shown = place.refused(&["run", name]);
            is_one_message(&shown);
            assert!(shown.contains("\n  --> "), "{shown}");
            // `check` says the same.
            let checked = place.refused(&["check", name]);
            assert_eq!(
                shown.split_once('\n').map(|x| x.1),
                checked.split_once('\n').map(|x| x.1)
            );
            shown
        })
        .collect();
    assert_messages(group, &shown);
}

#[test]
fn syntax() {
    group("syntax", 6);
}

#[test]
fn keys() {
    group("keys", 14);
}

#[test]
fn values() {
    group("values", 40);
}

#[test]
fn expressions() {
    group("expressions", 20);
}

#[test]
fn domains() {
    group("domain", 16);
}

#[test]
fn data() {
    group("data", 11);
}

#[test]
fn meshes() {
    group("mesh", 16);
}

#[test]
fn every_scene_belongs_to_a_group() {
    let groups = [
        "syntax",
        "keys",
        "values",
        "expressions",
        "domain",
        "data",
        "mesh",
    ];
    for entry in fs::read_dir(bad()).expect("the folder of wrong scenes") {
        let name = entry
            .expect("an entry")
            .file_name()
            .into_string()
            .expect("text");
        let known = groups
            .iter()
            .any(|group| name.starts_with(&format!("{group}-")));
        assert!(
            known || name.ends_with(".msh") || name == "good.toml",
            "{name}"
        );
    }
}

#[test]
fn overrides() {
    let place = Place::new();
    let shown: Vec<String> = [
        "stop.vertexes=5",
        "stop=5",
        "stopp.levels=5",
        "stop.levels",
        "=5",
        "stop..levels=5",
        "mark.theta=2",
        "mark.theta.upper=2",
        "upper.load=x + q",
        "upper.load = sin(x, y)",
        "parameters.e=2",
        "domain.disk.radius=1",
        "output.compression=true",
        "output.fields=[1",
        "",
    ]
    .into_iter()
    .map(|set| {
        let shown = place.refused(&["run", "good.toml", "--set", set]);
        is_one_message(&shown);
        assert!(
            shown.contains("--set") && shown.contains("\n  --> "),
            "{shown}"
        );
        shown
    })
    .collect();
    assert_messages("overrides", &shown);
}

#[test]
fn commands() {
    let place = Place::new();
    let folder = place.folder.path();
    fs::create_dir(folder.join("used")).expect("a folder");
    fs::write(folder.join("used/notes.txt"), "mine").expect("written");
    let mut shown: Vec<String> = [
        &["run", "missing.toml"] as &[&str],
        &["check", "missing.toml"],
        &["run", "."],
        &["run", "good.toml", "--out", "used"],
        &["run", "good.toml", "--out", "good.toml"],
        &["run", "good.toml", "--threads", "0"],
        &["run", "good.toml", "--resume"],
        &["study", "good.toml", "--out", "x"],
        &["verify", "used"],
        &["plot", "used"],
        &["schema"],
        &["new", "x.toml"],
        &["completions", "bash"],
    ]
    .into_iter()
    .map(|arguments| {
        let shown = place.refused(arguments);
        is_one_message(&shown);
        shown
    })
    .collect();
    // Misunderstood arguments: the message is that of the argument parser, with a line on usage.
    for arguments in [
        &["rnu", "good.toml"] as &[&str],
        &["solve", "good.toml"],
        &["run", "good.toml", "--quite"],
        &["run", "good.toml", "second.toml"],
        &["run", "good.toml", "--out"],
        &["run"],
        &["check", "good.toml", "--force"],
    ] {
        let said = place.refused(arguments);
        assert_eq!(said.matches("error: ").count(), 1, "{said}");
        shown.push(said);
    }
    assert_messages("commands", &shown);
    // Without any arguments the help is shown.
    assert!(place.refused(&[]).contains("Usage: membranes"));
}

#[test]
fn the_good_scene_is_good() {
    let place = Place::new();
    let before = place.files();
    let output = Command::new(env!("CARGO_BIN_EXE_membranes"))
        .args(["check", "good.toml"])
        .current_dir(place.folder.path())
        .output()
        .expect("the program starts");
    assert_eq!(
        output.status.code(),
        Some(0),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    assert_eq!(before, place.files());
}
