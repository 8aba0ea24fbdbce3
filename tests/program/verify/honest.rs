//! Runs as the program wrote them: every claim holds.

use std::fs;
use std::path::Path;

use crate::run::{Run, config, membranes, run};

/// Verifies a run with the library; every failure is shown.
fn holds(name: &str, run: &Run) -> verify::Report {
    let report = verify::verify(&run.out).unwrap_or_else(|e| panic!("{name}: {e}"));
    let said: Vec<String> = report.failures.iter().map(ToString::to_string).collect();
    assert!(report.holds(), "{name}: {said:#?}");
    println!(
        "{name}: {} claims, levels {:?} of {}",
        report.claims, report.recomputed, report.levels
    );
    report
}

fn set<'a>(keys: &[&'a str]) -> Vec<&'a str> {
    keys.iter().flat_map(|key| ["--set", key]).collect()
}

#[test]
fn every_scene_of_the_repository_with_all_fields() {
    for name in [
        "disk",
        "square",
        "lshape",
        "full-contact",
        "no-contact",
        "tension-jump",
        "two-diaphragms",
    ] {
        let keys = [
            "output.fields=\"all\"",
            "output.edges=true",
            "stop.levels=4",
        ];
        let run = run(&config(name), &set(&keys));
        assert_eq!(run.code, 5, "{name}: {}", run.stderr);
        assert_eq!(holds(name, &run).recomputed, [0, 1, 2, 3], "{name}");
    }
}

#[test]
fn every_way_to_run_a_scene() {
    for (name, keys, recomputed) in [
        ("square", &["stop.relative_error=0.25"][..], 1),
        ("square", &["output.fields=\"none\"", "stop.levels=3"], 0),
        ("square", &["output.fields=2", "stop.levels=4"], 3),
        (
            "square",
            &["estimate.estimator=\"paper\"", "stop.relative_error=1.0"],
            1,
        ),
        (
            "square",
            &[
                "estimate.estimator=\"paper\"",
                "estimate.also=[]",
                "output.edges=true",
                "stop.levels=2",
            ],
            1,
        ),
        ("square", &["estimate.also=[]", "stop.levels=2"], 1),
        ("square", &["stop.error=3.0"], 1),
        ("square", &["stop.seconds=1e-9"], 1),
        (
            "square",
            &[
                "solve.solver=\"clarabel\"",
                "output.fields=\"all\"",
                "stop.levels=3",
            ],
            3,
        ),
        ("square", &["solve.reduction=\"off\"", "stop.levels=3"], 1),
        (
            "square",
            &[
                "solve.solver=\"multigrid\"",
                "output.fields=\"all\"",
                "stop.levels=6",
            ],
            6,
        ),
        ("square", &["estimate.final=\"fast\"", "stop.levels=3"], 1),
        (
            "square",
            &[
                "estimate.estimator=\"residual\"",
                "estimate.also=[\"certified\"]",
                "stop.levels=3",
            ],
            1,
        ),
        (
            "full-contact",
            &["solve.reduction=\"off\"", "stop.levels=3"],
            1,
        ),
        (
            "disk",
            &[
                "mark.strategy=\"uniform\"",
                "domain.disk.size=2",
                "output.fields=\"all\"",
                "stop.levels=4",
            ],
            4,
        ),
        (
            "disk",
            &[
                "mark.strategy=\"maximum\"",
                "mark.children=2",
                "domain.disk.size=2",
                "output.fields=\"all\"",
                "stop.levels=9",
            ],
            9,
        ),
    ] {
        let run = run(&config(name), &set(keys));
        let label = format!("{name} {keys:?}");
        assert!(matches!(run.code, 0 | 5), "{label}: {}", run.stderr);
        assert_eq!(holds(&label, &run).recomputed.len(), recomputed, "{label}");
    }
}

fn scene(folder: &Path, text: &str) -> Run {
    let path = folder.join("scene.toml");
    fs::write(&path, text).expect("written");
    run(&path, &["--quiet"])
}

#[test]
fn every_case_with_a_known_solution() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let cases = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/cases");
    let mut names: Vec<_> = fs::read_dir(cases)
        .expect("the cases")
        .map(|e| e.expect("an entry").path())
        .collect();
    names.sort();
    assert_eq!(names.len(), 14);
    for (k, case) in names.iter().enumerate() {
        let name = case.file_stem().and_then(|n| n.to_str()).expect("a name");
        let domain = match name {
            "P1" => "[domain.disk]\nradius = 1\n",
            "P3" => {
                "[domain.polygon]\nouter = [[-1, -1], [0, -1], [0, 0], [1, 0], [1, 1], [-1, 1]]\n"
            }
            _ => "[domain.rectangle]\nlower = [-1, -1]\nupper = [1, 1]\nsize = 0.25\n",
        };
        let solver = ["active-set", "clarabel"][k % 2];
        let data = fs::read_to_string(case).expect("a case");
        let text = format!(
            "{domain}{data}\n[solve]\nsolver = \"{solver}\"\n[stop]\nvertices = 500\n[output]\nfields = \"all\"\n"
        );
        let run = scene(folder.path(), &text);
        assert_eq!(run.code, 0, "{name}: {}", run.stderr);
        holds(name, &run);
    }
}

#[test]
fn whatever_the_units_are() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (length, tension, load) in [
        ("1e-100", "1e40", "1e-20"),
        ("1e100", "1e-90", "1e-7"),
        ("1e-30", "1e-200", "1e100"),
        ("3e5", "0.02", "1e-9"),
    ] {
        let text = format!(
            "[parameters]\nL = {length}\nT = {tension}\nF = {load}\n[domain.disk]\ncenter = [{length}, 0]\nradius = {length}\n\
             [upper]\ntension = \"T*(2 + x/L)\"\nload = \"-F\"\nboundary = \"F/T*L^2/9*(1 + y/L)\"\n\
             [lower]\ntension = \"T\"\nload = \"if(x > L, 3*F, -2*F)\"\n\
             [exact]\nupper = \"F/T*x*y\"\nlower = \"F/T*x*x\"\nsigma = \"F*x*y\"\n\
             [output]\nfields = \"all\"\nedges = true\n[stop]\nlevels = 4\n"
        );
        let run = scene(folder.path(), &text);
        assert_eq!(run.code, 0, "{length}: {}", run.stderr);
        assert!(
            run.summary()["contact_vertices"].as_u64() > Some(0),
            "{length}"
        );
        assert_eq!(holds(length, &run).recomputed.len(), 4);
    }
}

#[test]
fn zero_solutions_and_runs_that_failed() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (upper, lower) in [("0", "0"), ("-1", "1")] {
        let text = format!(
            "[domain.rectangle]\nlower = [0, 0]\nupper = [1, 1]\n[upper]\nload = {upper}\n[lower]\nload = {lower}\n"
        );
        holds("flat", &scene(folder.path(), &text));
    }
    // Refinement at a point far from the origin until coordinates run out.
    let run = scene(
        folder.path(),
        "[domain.rectangle]\nlower = [1e12, 1e12]\nupper = [1000000000001, 1000000000001]\nsize = 0.5\n\
         [upper]\nload = \"min(1e30, hypot(x - 1e12 - 0.3, y - 1e12 - 0.7)^(-1.99))\"\n[lower]\nload = 0\n\
         [mark]\nstrategy = \"maximum\"\ntheta = 0.99\nchildren = 2\n[stop]\nlevels = 1000\nrelative_error = 1e-12\n",
    );
    assert_eq!(run.summary()["outcome"], "failed");
    let report = holds("failed", &run);
    assert_eq!(report.recomputed, [report.levels - 1]);
}

#[test]
fn meshes_from_files_and_what_happens_without_them() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mesh = Path::new(env!("CARGO_MANIFEST_DIR")).join("../domain/tests/data/P2_right_16.msh");
    fs::copy(mesh, folder.path().join("plate.msh")).expect("copied");
    let run = scene(
        folder.path(),
        "[domain.mesh]\nfile = \"plate.msh\"\n[upper]\ntension = \"1 + region\"\nload = \"-10*x^2 - 8\"\n\
         [lower]\nload = \"if(region == 1, 3, -2)\"\n[stop]\nlevels = 3\n[output]\nfields = \"all\"\n",
    );
    assert_eq!(run.code, 0, "{}", run.stderr);
    holds("mesh file", &run);
    fs::remove_file(folder.path().join("plate.msh")).expect("removed");
    let output = membranes(&["verify", run.out.to_str().expect("a path")]);
    let said = String::from_utf8(output.stderr).expect("text");
    assert_eq!(output.status.code(), Some(4), "{said}");
    assert!(said.contains("plate.msh` does not exist"), "{said}");
}

#[test]
fn the_line_the_object_and_the_code() {
    let run = run(&config("square"), &set(&["stop.levels=2"]));
    let out = run.out.to_str().expect("a path");
    let output = membranes(&["verify", out]);
    let line = String::from_utf8(output.stdout).expect("text");
    assert_eq!(output.status.code(), Some(0));
    assert!(
        line.starts_with("verified: ") && line.lines().count() == 1,
        "{line}"
    );
    assert!(
        line.contains("fields of 1 of 2 levels recomputed"),
        "{line}"
    );
    assert!(output.stderr.is_empty());
    let output = membranes(&["verify", out, "--json"]);
    let object: serde_json::Value =
        serde_json::from_slice(&output.stdout).expect("one JSON object");
    assert_eq!(object["verified"], true);
    assert_eq!(object["recomputed"], serde_json::json!([1]));
    // A run keeps the rest of its summary beside the checksums.
    let sums = run.summary()["checksums"]
        .as_object()
        .expect("checksums")
        .clone();
    let names: Vec<&str> = sums.keys().map(String::as_str).collect();
    assert_eq!(
        names,
        ["history.csv", "level_0001.vtu", "scene.toml", "series.pvd"]
    );
    assert_eq!(run.summary()["machine"]["os"], std::env::consts::OS);
}

#[test]
fn folders_that_hold_no_run() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().to_str().expect("a path");
    for (folder, code, word) in [
        (path, 2, "summary.json"),
        ("no-such-folder", 2, "does not exist"),
        (
            concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml"),
            2,
            "not a folder",
        ),
    ] {
        let output = membranes(&["verify", folder]);
        let said = String::from_utf8(output.stderr).expect("text");
        assert_eq!(output.status.code(), Some(code), "{said}");
        assert!(
            said.contains(word) && said.matches("error:").count() == 1,
            "{said}"
        );
    }
    fs::write(folder.path().join("summary.json"), "{").expect("written");
    assert_eq!(membranes(&["verify", path]).status.code(), Some(4));
}
