//! Commands, options, exit codes, and what is left behind.

use std::fs;

use serde_json::Value;

use crate::run::{config, membranes, run};

const HISTORY: &str = "level,vertices,triangles,unknowns,contact_vertices,contact_area,energy,energy_norm,eta_K,eta_e_sum,\
residual,certified,oscillation,error_bound,relative_bound,true_error,effectivity,sigma_error,solver,iterations,kkt_residual,\
seconds_refine,seconds_assemble,seconds_solve,seconds_estimate,seconds_total,peak_memory_mb,bound_kind,eta_alg,bound_711,\
bound_711_repaired,h1_error,contact_force,max_action,contact_area_error,contact_jaccard,contact_hausdorff,algebraic_error";

#[test]
fn a_run_leaves_the_files_of_the_contract_and_one_line() {
    let run = run(
        &config("disk"),
        &[
            "--set",
            "output.fields=\"all\"",
            "--set",
            "output.edges=true",
        ],
    );
    assert_eq!(run.code, 0, "{}", run.stderr);
    assert_eq!(run.stdout.trim().lines().count(), 1, "{}", run.stdout);
    for word in [
        "bound",
        "contact area",
        "contact force",
        "largest pressure",
        "smallest gap",
    ] {
        assert!(run.stdout.contains(word), "no {word}: {}", run.stdout);
    }
    let levels = run.summary()["levels"].as_u64().expect("a count") as usize;
    // A header, one line a level, and what the bound does not hold for.
    let lines: Vec<&str> = run.stderr.trim().lines().collect();
    assert_eq!(lines.len(), levels + 2, "{}", run.stderr);
    assert!(
        lines[levels + 1].starts_with("note: the bound holds for the polygon of the mesh"),
        "{}",
        run.stderr
    );
    let mut names: Vec<_> = fs::read_dir(&run.out)
        .expect("the folder")
        .map(|e| {
            e.expect("an entry")
                .file_name()
                .into_string()
                .expect("text")
        })
        .collect();
    names.sort();
    let mut expected: Vec<String> = (0..levels).map(|l| format!("edges_{l:04}.vtp")).collect();
    expected.push("history.csv".into());
    expected.extend((0..levels).map(|l| format!("level_{l:04}.vtu")));
    expected.extend([
        "scene.toml".into(),
        "series.pvd".into(),
        "summary.json".into(),
    ]);
    assert_eq!(names, expected);
    let history = fs::read_to_string(run.out.join("history.csv")).expect("a history");
    assert_eq!(history.lines().next(), Some(HISTORY));
    assert_eq!(history.lines().count(), levels + 1);
    // The summary repeats the last row under the same names.
    let summary = run.summary();
    for (name, cell) in run.history().last().expect("a row") {
        match &summary[name] {
            Value::Null => assert_eq!(cell, "", "{name}"),
            Value::String(s) => assert_eq!(cell, s, "{name}"),
            value => assert_eq!(cell.parse::<f64>().ok(), value.as_f64(), "{name}"),
        }
    }
}

#[test]
fn the_same_scene_gives_the_same_bytes() {
    let arguments = [
        "--set",
        "output.edges=true",
        "--set",
        "stop.relative_error=0.1",
    ];
    let (a, b) = (
        run(&config("two-diaphragms"), &arguments),
        run(&config("two-diaphragms"), &arguments),
    );
    let mut compared = 0;
    for entry in fs::read_dir(&a.out).expect("the folder") {
        let name = entry.expect("an entry").file_name();
        let (x, y) = (
            fs::read(a.out.join(&name)).expect("a file"),
            fs::read(b.out.join(&name)).expect("a file"),
        );
        let text = name.to_string_lossy();
        if !["summary.json", "history.csv"].contains(&&*text) {
            assert!(x == y, "{text} differs");
            compared += 1;
        }
    }
    assert_eq!(compared, 4);
    for (x, y) in a
        .history()
        .iter()
        .flatten()
        .zip(b.history().iter().flatten())
    {
        assert!(
            x == y || x.0.starts_with("seconds_") || x.0 == "peak_memory_mb",
            "{x:?} {y:?}"
        );
    }
    // The scene as it was run is itself a scene that gives the same.
    let again = run(&a.out.join("scene.toml"), &[]);
    assert_eq!(again.code, 0, "{}", again.stderr);
    assert_eq!(again.summary()["error_bound"], a.summary()["error_bound"]);
}

#[test]
fn stopping_rules_and_exit_codes() {
    let code = |arguments: &[&str]| {
        let run = run(&config("square"), arguments);
        let summary = run.summary();
        (
            run.code,
            summary["outcome"].as_str().expect("text").to_owned(),
            summary["stopped_by"].as_str().expect("text").to_owned(),
        )
    };
    assert_eq!(code(&[]), (0, "goal".into(), "relative_error".into()));
    assert_eq!(
        code(&["--set", "stop.levels=3"]),
        (5, "limit".into(), "levels".into())
    );
    assert_eq!(
        code(&["--set", "stop.vertices=300"]),
        (5, "limit".into(), "vertices".into())
    );
    assert_eq!(
        code(&["--set", "stop.seconds=1e-9"]),
        (5, "limit".into(), "seconds".into())
    );
    assert_eq!(
        code(&["--set", "stop.error=1.0"]),
        (0, "goal".into(), "error".into())
    );
    // Without an accuracy goal a limit is what was asked for.
    let folder = tempfile::tempdir().expect("a temporary folder");
    let scene = folder.path().join("limit.toml");
    let text = fs::read_to_string(config("square")).expect("a scene");
    fs::write(
        &scene,
        text.replace("relative_error = 0.03\nvertices = 100_000", "levels = 2"),
    )
    .expect("written");
    let limited = run(&scene, &[]);
    assert_eq!(
        (limited.code, limited.summary()["outcome"].as_str()),
        (0, Some("limit")),
        "{}",
        limited.stderr
    );
    assert_eq!(limited.summary()["levels"], 2);
}

#[test]
fn a_zero_solution_ends_the_run() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let scene = folder.path().join("flat.toml");
    for (upper, lower) in [("0", "0"), ("-1", "1")] {
        fs::write(&scene, format!("[domain.rectangle]\nlower = [0, 0]\nupper = [1, 1]\n[upper]\nload = {upper}\n[lower]\nload = {lower}\n")).expect("written");
        let flat = run(&scene, &["--set", "stop.relative_error=0.01"]);
        assert_eq!(flat.code, 0, "{}", flat.stderr);
        assert_eq!(flat.summary()["levels"], 1, "{upper}");
    }
}

#[test]
fn a_load_that_the_mesh_does_not_see_is_no_goal() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let scene = folder.path().join("waves.toml");
    // The load has mean zero over every initial triangle and against every initial hat function.
    for (height, goal) in [
        ("100", "relative_error = 0.1"),
        ("x + 1", "relative_error = 0.1"),
        ("x + 1", "error = 1.0"),
    ] {
        fs::write(
            &scene,
            format!(
                "[domain.rectangle]\nlower = [0, 0]\nupper = [2, 2]\nsize = 0.5\n\
                 [upper]\nload = \"1000*sin(8*pi*x)*sin(8*pi*y)\"\nboundary = \"{height}\"\n\
                 [stop]\n{goal}\nlevels = 3\n"
            ),
        )
        .expect("written");
        let run = run(&scene, &[]);
        assert_eq!(run.code, 5, "{height}, {goal}: {}", run.stdout);
        assert_eq!(run.summary()["levels"], 3);
    }
}

#[test]
fn estimators_that_were_not_asked_for_leave_no_trace() {
    let run = run(
        &config("no-contact"),
        &[
            "--set",
            "estimate.also=[]",
            "--set",
            "stop.relative_error=0.2",
        ],
    );
    assert_eq!(run.code, 0, "{}", run.stderr);
    let summary = run.summary();
    assert!(summary["eta_K"].is_null() && summary["eta_e_sum"].is_null());
    assert!(summary["residual"].is_null() && summary["certified"].is_f64());
    let text = fs::read_dir(&run.out)
        .expect("the folder")
        .map(|e| e.expect("an entry").path())
        .find(|p| p.extension().is_some_and(|e| e == "vtu"))
        .map(|p| fs::read(p).expect("a file"))
        .expect("a .vtu");
    let text = String::from_utf8_lossy(&text);
    assert!(
        !text.contains("\"eta_K\"")
            && !text.contains("\"residual\"")
            && text.contains("\"certified\"")
    );
}

#[test]
fn the_paper_estimator_can_drive() {
    let run = run(
        &config("square"),
        &[
            "--set",
            "estimate.estimator=\"paper\"",
            "--set",
            "stop.relative_error=0.5",
        ],
    );
    assert_eq!(run.code, 0, "{}", run.stderr);
    let s = run.summary();
    let value = |key: &str| s[key].as_f64().unwrap_or_else(|| panic!("no {key}"));
    assert_eq!(s["bound_kind"], "paper");
    let bound = (value("eta_K").powi(2) + value("oscillation").powi(2)).sqrt();
    assert!((value("error_bound") / bound - 1.0).abs() < 1e-14);
}

#[test]
fn a_folder_that_is_not_empty_is_kept_unless_forced() {
    let first = run(
        &config("square"),
        &["--set", "stop.levels=2", "--set", "output.fields=\"all\""],
    );
    fs::write(first.out.join("notes.txt"), "mine").expect("written");
    let out = first.out.to_str().expect("a path");
    let scene = config("square");
    let arguments = [
        "run",
        scene.to_str().expect("a path"),
        "--out",
        out,
        "--set",
        "stop.levels=1",
    ];
    let refused = membranes(&arguments);
    assert_eq!(refused.status.code(), Some(2));
    assert!(first.out.join("level_0001.vtu").exists());
    let forced = membranes(&[&arguments[..], &["--force"]].concat());
    assert_eq!(
        forced.status.code(),
        Some(5),
        "{}",
        String::from_utf8_lossy(&forced.stderr)
    );
    assert!(
        !first.out.join("level_0001.vtu").exists(),
        "a level of the older run is left"
    );
    assert_eq!(
        fs::read_to_string(first.out.join("notes.txt")).expect("kept"),
        "mine"
    );
}

#[test]
fn a_folder_that_cannot_be_written_is_exit_code_4() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("file");
    fs::write(&file, "").expect("written");
    let out = file.join("below");
    let scene = config("no-contact");
    let result = membranes(&[
        "run",
        scene.to_str().expect("a path"),
        "--out",
        out.to_str().expect("a path"),
    ]);
    assert!(
        matches!(result.status.code(), Some(2 | 4)),
        "{:?}",
        result.status
    );
    assert_eq!(
        String::from_utf8_lossy(&result.stderr)
            .matches("error:")
            .count(),
        1
    );
}

#[test]
fn quiet_and_json() {
    let quiet = run(
        &config("no-contact"),
        &["--quiet", "--json", "--set", "stop.relative_error=0.2"],
    );
    assert_eq!(quiet.stderr, "");
    let object: Value = serde_json::from_str(&quiet.stdout).expect("one JSON object");
    assert_eq!(object["outcome"], "goal");
    assert_eq!(object["error_bound"], quiet.summary()["error_bound"]);
}

#[test]
fn check_says_what_will_be_modelled_and_writes_nothing() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_membranes"))
        .args([
            "check",
            fs::canonicalize(config("two-diaphragms"))
                .expect("a path")
                .to_str()
                .expect("a path"),
        ])
        .current_dir(folder.path())
        .output()
        .expect("starts");
    let text = String::from_utf8(output.stdout).expect("text");
    assert_eq!(output.status.code(), Some(0), "{text}");
    for word in ["two-field", "active-set", "residual", "vertices"] {
        assert!(text.contains(word), "no {word}: {text}");
    }
    assert_eq!(fs::read_dir(folder.path()).expect("the folder").count(), 0);
}

#[test]
fn version() {
    let output = membranes(&["--version"]);
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(
        String::from_utf8_lossy(&output.stdout),
        format!("membranes {}\n", env!("CARGO_PKG_VERSION"))
    );
}

#[test]
fn coordinates_that_run_out_keep_the_last_good_level() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let scene = folder.path().join("point.toml");
    // All load sits at a point far from the origin: refinement goes on until the edges there cannot be halved.
    fs::write(
        &scene,
        "[domain.rectangle]\nlower = [1e12, 1e12]\nupper = [1000000000001, 1000000000001]\nsize = 0.5\n\
         [upper]\nload = \"min(1e30, hypot(x - 1e12 - 0.3, y - 1e12 - 0.7)^(-1.99))\"\n[lower]\nload = 0\n\
         [mark]\nstrategy = \"maximum\"\ntheta = 0.99\nchildren = 2\n[output]\nfields = \"last\"\n[stop]\nlevels = 1000\nrelative_error = 1e-12\n",
    )
    .expect("written");
    let run = run(&scene, &[]);
    assert_eq!(run.code, 3, "{}", run.stderr);
    assert!(run.stderr.contains("cannot be bisected"), "{}", run.stderr);
    let summary = run.summary();
    assert_eq!(summary["outcome"], "failed");
    let last = summary["level"].as_u64().expect("a level");
    assert!(run.out.join(format!("level_{last:04}.vtu")).exists());
}
