//! Changed claims of history and summary, and changes that only a checksum sees: refused, and for the right reason.

use std::fs;

use super::folder::Copy;
use super::{LAST, disk, found, honest, random, said};
use crate::run::membranes;

#[test]
fn numbers_of_the_last_level_in_history_and_summary() {
    for name in [
        "contact_area",
        "energy",
        "energy_norm",
        "eta_K",
        "eta_e_sum",
        "residual",
        "certified",
        "bound_711",
        "bound_711_repaired",
        "contact_area_error",
        "contact_jaccard",
        "contact_hausdorff",
        "oscillation",
        "error_bound",
        "relative_bound",
        "true_error",
        "effectivity",
        "sigma_error",
        "h1_error",
        "contact_force",
        "max_action",
    ] {
        let both = [
            format!("`history.csv`: `{name}` is"),
            format!("`summary.json`: `{name}` is"),
        ];
        let change = |c: &Copy| c.scale_column(2, name, 1.0 + 2e-9);
        found(name, change, &[&both[0], &both[1]]);
    }
    for (name, value) in [
        ("vertices", "1000"),
        ("triangles", "1000"),
        ("unknowns", "1000"),
        ("contact_vertices", "7"),
        ("kkt_residual", "1e-9"),
        ("bound_kind", "residual"),
        ("bound_kind", "rt0"),
        ("certified", "0.1"),
        ("eta_alg", "1e-9"),
        ("true_error", ""),
    ] {
        let change = |c: &Copy| {
            c.column(2, name, value);
            if value.is_empty() {
                c.summary(|s| s[name] = serde_json::Value::Null);
            }
        };
        found(name, change, &[&format!("`history.csv`: `{name}`")]);
    }
    // A bound that is claimed in all its places.
    let change = |c: &Copy| {
        c.scale_column(2, "error_bound", 0.9);
        for file in [LAST, "edges_0002.vtp"] {
            c.reals(file, "error_bound", |v| v[0] *= 0.9);
        }
    };
    found(
        "bound",
        change,
        &[
            "`level_0002.vtu`: `error_bound`",
            "`summary.json`: `error_bound`",
        ],
    );
    // A level in between.
    let change = |c: &Copy| c.scale_column(1, "energy", 1.0 + 2e-9);
    found("before", change, &["`history.csv`: `energy` is"]);
}

#[test]
fn what_the_summary_says_of_the_run() {
    let change = |c: &Copy| {
        c.summary(|s| {
            s["outcome"] = "goal".into();
            s["stopped_by"] = "relative_error".into();
            s["exit_code"] = 0.into();
        });
    };
    found("goal", change, &["`relative_error` does not hold"]);
    for (key, value, words) in [
        (
            "outcome",
            serde_json::json!("goal"),
            "`outcome` is `goal`, recomputed `limit`",
        ),
        ("exit_code", 0.into(), "`exit_code` is `0`, recomputed `5`"),
        ("stopped_by", "vertices".into(), "`vertices` does not hold"),
        ("stopped_by", "patience".into(), "`patience` is no rule"),
        ("levels", 4.into(), "`levels` is `4`, recomputed `3`"),
        ("title", "A proof".into(), "`title`"),
        (
            "reduction",
            "two-field".into(),
            "`reduction` is `two-field`, recomputed `constant-tensions`",
        ),
        ("smallest_gap", 1e-3.into(), "`smallest_gap` is"),
        (
            "solver",
            "clarabel".into(),
            "of the last row of `history.csv`",
        ),
        ("iterations", 77.into(), "of the last row of `history.csv`"),
        (
            "wall_seconds",
            1e-9.into(),
            "less than the seconds of the last level",
        ),
        (
            "not_representable",
            serde_json::json!(["energy"]),
            "`not_representable`",
        ),
        (
            "certificate",
            serde_json::json!({ "guaranteed": true }),
            "`certificate.guaranteed`: it should be false",
        ),
        ("certificate", serde_json::Value::Null, "it is missing"),
        ("remark", "honest".into(), "`remark` is not known"),
    ] {
        let change = |c: &Copy| c.summary(|s| s[key] = value);
        found(key, change, &[words]);
    }
    for (key, value, words) in [
        ("guaranteed", serde_json::json!(true), "it should be false"),
        ("caveats", serde_json::json!([]), "away from the circle"),
        ("bound", serde_json::json!(0.01), "`bound` is 1e-2"),
        (
            "proof",
            serde_json::json!("obvious"),
            "`proof` is not known",
        ),
    ] {
        let change = |c: &Copy| c.summary(|s| s["certificate"][key] = value);
        found(key, change, &[words]);
    }
    let change = |c: &Copy| c.summary(|s| s["totals"]["seconds_solve"] = 5.0.into());
    found("totals", change, &["`totals.seconds_solve` is"]);
    let change = |c: &Copy| c.replace("series.pvd", "level_0001", "level_0000");
    found("series", change, &["`series.pvd`: `levels`"]);
    // A scene that would have stopped before, and one with other loads.
    let change = |c: &Copy| c.replace("scene.toml", "vertices = 100_000", "vertices = 82");
    found(
        "rule",
        change,
        &[
            "`vertices` holds on level 1",
            "`vertices` holds before `levels`",
        ],
    );
    let change = |c: &Copy| c.replace("scene.toml", "-10*g", "-10.0000001*g");
    found("load", change, &["`kkt_residual` is", "`f1_h` at triangle"]);
    let change = |c: &Copy| c.replace("scene.toml", "radius = 1.0", "radius = 1.0000001");
    found("domain", change, &["not on the circle"]);
}

#[test]
fn changes_that_only_a_checksum_sees() {
    let refused = |name: &str, change: &dyn Fn(&Copy), words: &str| {
        let copy = Copy::of(&honest().out);
        change(&copy);
        let said = said(&copy);
        assert!(said.iter().any(|s| s.contains(words)), "{name}: {said:#?}");
    };
    let sum = |file: &str| format!("`{file}`: `SHA-256` is");
    refused(
        "a time",
        &|c| c.scale_column(0, "seconds_solve", 2.0),
        &sum("history.csv"),
    );
    refused(
        "a comment",
        &|c| c.replace("scene.toml", "# Two", "# Few"),
        &sum("scene.toml"),
    );
    refused(
        "a space",
        &|c| c.replace("series.pvd", "  <Coll", "<Coll"),
        &sum("series.pvd"),
    );
    refused(
        "a load",
        &|c| c.replace("scene.toml", "-10*g", "-11*g"),
        &sum("scene.toml"),
    );
    for key in ["seconds_output", "peak_memory_mb"] {
        refused(
            key,
            &|c| c.summary(|s| s["totals"][key] = 0.5.into()),
            "`summary.json`: `checksum` is",
        );
    }
    refused(
        "a machine",
        &|c| c.summary(|s| s["machine"]["cores"] = 64.into()),
        "`summary.json`: `checksum` is",
    );
    refused(
        "a bit",
        &|c| c.reals(LAST, "sigma", |s| s[0] = s[0].next_up()),
        &sum(LAST),
    );
    let remove = |c: &Copy, name: &str| fs::remove_file(c.file(name)).expect("removed");
    for name in [
        "level_0001.vtu",
        "edges_0000.vtp",
        "series.pvd",
        "history.csv",
        "scene.toml",
    ] {
        refused(
            name,
            &|c| remove(c, name),
            &format!("`{name}`: `file`: it is missing"),
        );
    }
    let swap = |c: &Copy| {
        fs::rename(c.file("level_0000.vtu"), c.file("level.tmp")).expect("renamed");
        fs::rename(c.file("level_0001.vtu"), c.file("level_0000.vtu")).expect("renamed");
        fs::rename(c.file("level.tmp"), c.file("level_0001.vtu")).expect("renamed");
    };
    refused("swapped levels", &swap, &sum("level_0001.vtu"));
    found(
        "swapped levels",
        swap,
        &["`level_0001.vtu`: `level` is `0`, recomputed `1`"],
    );
    let add = |c: &Copy| {
        fs::copy(c.file(LAST), c.file("level_0003.vtu")).expect("copied");
    };
    refused(
        "one more level",
        &add,
        "`level_0003.vtu`: `file`: a run of this scene does not write it",
    );
    let cut = |c: &Copy| c.halve(LAST);
    refused("half a file", &cut, &sum(LAST));
    refused(
        "half a file",
        &cut,
        "`level_0002.vtu`: `format`: the array `certified` is cut off",
    );
    let edges = "edges_0002.vtp";
    refused(
        "half a file of edges",
        &|c| c.halve(edges),
        "`edges_0002.vtp`: `format`: it ends inside an array",
    );
    let forget = |c: &Copy| {
        c.summary(|s| {
            s["checksums"].as_object_mut().expect("some").remove(LAST);
        });
    };
    refused("a checksum", &forget, "the summary does not state it");
    refused(
        "all checksums",
        &|c| c.summary(|s| s["checksums"] = 0.into()),
        "`checksums`: there are none",
    );
}

#[test]
fn codes_and_messages_of_the_program() {
    let copy = Copy::of(&honest().out);
    copy.scale_column(2, "energy", 2.0);
    copy.fit();
    let path = copy.path();
    let path = path.to_str().expect("a path");
    let output = membranes(&["verify", path]);
    assert_eq!(output.status.code(), Some(1));
    let said = String::from_utf8(output.stderr).expect("text");
    assert_eq!(said.matches("error: `").count(), 2, "{said}");
    assert!(
        said.contains("recomputed `") && said.contains("difference `"),
        "{said}"
    );
    let line = String::from_utf8(output.stdout).expect("text");
    assert!(
        line.starts_with("not verified: 2 of ") && line.lines().count() == 1,
        "{line}"
    );
    let output = membranes(&["verify", path, "--json"]);
    let object: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(object["verified"], false);
    assert_eq!(object["failures"][0]["claim"], "energy");
    // A file that is as it was written, says its checksum, and cannot be read all the same.
    let copy = Copy::of(&honest().out);
    copy.halve(LAST);
    copy.fit();
    let path = copy.path();
    let output = membranes(&["verify", path.to_str().expect("a path")]);
    assert_eq!(output.status.code(), Some(4));
}

/// No byte of a run can make the program stumble.
#[test]
fn random_bytes() {
    let mut random = random();
    let run = disk("stop.levels=1");
    let names = [
        "level_0000.vtu",
        "edges_0000.vtp",
        "history.csv",
        "summary.json",
        "series.pvd",
    ];
    let mut seen = [0; 3];
    for round in 0..300 {
        let copy = Copy::of(&run.out);
        let name = names[round % names.len()];
        let mut bytes = fs::read(copy.file(name)).expect("a file");
        for _ in 0..=random(3) {
            let at = random(bytes.len());
            match random(4) {
                0 => bytes[at] = b"0123456789eE.-,\"<>/ =+A"[random(23)],
                1 => bytes[at] = random(256) as u8,
                2 => drop(bytes.remove(at)),
                _ => bytes.truncate(at + 1),
            }
        }
        fs::write(copy.file(name), bytes).expect("written");
        if name != "summary.json" {
            copy.fit();
        }
        let place = match verify::verify(&copy.path()) {
            Ok(report) if report.holds() => 0,
            Ok(_) => 1,
            Err(_) => 2,
        };
        seen[place] += 1;
    }
    println!("hold, fail, unreadable: {seen:?}");
    // A byte replaced by itself passes, as does a space in the summary.
    assert!(seen[0] < 10 && seen[1] > 60 && seen[2] > 60, "{seen:?}");
}
