//! Runs in which something was changed: refused, and for the right reason.

use std::fs;
use std::sync::OnceLock;

use super::folder::Copy;
use crate::run::{Run, config, membranes, run};

/// Three levels on the disk with everything written.
fn honest() -> &'static Run {
    static RUN: OnceLock<Run> = OnceLock::new();
    // Nothing is said without a change, so that whatever is said is about the change.
    RUN.get_or_init(|| {
        let run = disk("stop.levels=3");
        assert_eq!(said(&Copy::of(&run.out)), [""; 0]);
        run
    })
}

fn disk(stop: &str) -> Run {
    let keys = ["output.fields=\"all\"", "output.edges=true", stop];
    let arguments: Vec<&str> = keys.iter().flat_map(|key| ["--set", key]).collect();
    run(&config("disk"), &arguments)
}

/// The fields of the last level.
const LAST: &str = "level_0002.vtu";

/// What is said about a changed copy.
fn said(copy: &Copy) -> Vec<String> {
    let report = verify::verify(&copy.path()).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(report.holds(), report.failures.is_empty());
    report.failures.iter().map(ToString::to_string).collect()
}

/// A change with checksums that fit must be found by what it claims.
fn found(name: &str, change: impl FnOnce(&Copy), expected: &[&str]) {
    let copy = Copy::of(&honest().out);
    change(&copy);
    copy.fit();
    let said = said(&copy);
    assert!(
        !said.iter().any(|s| s.contains("SHA-256")),
        "{name}: {said:#?}"
    );
    for words in expected {
        assert!(
            said.iter().any(|s| s.contains(words)),
            "{name}: no `{words}` in {said:#?}"
        );
    }
    println!("{name}: {}", said.join("; "));
}

/// An interior vertex of the last level with an open gap, and one in contact.
fn vertices(copy: &Copy) -> (usize, usize) {
    let (gap, contact) = (copy.read(LAST, "gap"), copy.bytes_of(LAST, "contact"));
    let force = copy.read(LAST, "action_force");
    let radius: Vec<f64> = copy
        .read(LAST, "Points")
        .chunks(3)
        .map(|p| p[0].hypot(p[1]))
        .collect();
    let open = (0..gap.len())
        .find(|&j| gap[j] > 0.0 && radius[j] < 0.95)
        .expect("one");
    let closed = (0..gap.len())
        .find(|&j| contact[j] == 1 && force[j] > 0.0)
        .expect("one");
    (open, closed)
}

#[test]
fn nodal_values() {
    for (array, factor) in [("u1", 1.0 + 1e-8), ("u2", 1.0 - 1e-8), ("u1", 1.001)] {
        let change = |c: &Copy| {
            let (open, _) = vertices(c);
            let mut moved = 0.0;
            c.reals(LAST, array, |u| {
                moved = u[open] * (factor - 1.0);
                u[open] *= factor;
            });
            let sign = if array == "u1" { 1.0 } else { -1.0 };
            c.reals(LAST, "gap", |w| w[open] += sign * moved);
        };
        found(array, change, &["`kkt_residual` is"]);
    }
    let largest = |v: &[f64]| {
        (0..v.len())
            .max_by(|&i, &j| v[i].total_cmp(&v[j]))
            .expect("one")
    };
    let change = |c: &Copy| {
        c.reals(LAST, "sigma", |s| {
            let j = largest(s);
            s[j] *= 1.0 + 1e-9;
        });
    };
    found(
        "sigma",
        change,
        &["`action_force = (grad sigma, grad phi_j)` at vertex"],
    );
    let change = |c: &Copy| {
        c.reals(LAST, "sigma", |s| {
            s.iter_mut().for_each(|s| *s *= 1.0 + 3e-9)
        });
    };
    found("all of sigma", change, &["`sigma`: it is wrong by"]);
    let change = |c: &Copy| {
        let (_, closed) = vertices(c);
        c.reals(LAST, "action_force", |z| z[closed] *= 1.0 + 1e-6);
        c.reals(LAST, "action", |l| l[closed] *= 1.0 + 1e-6);
    };
    found(
        "action_force",
        change,
        &["`kkt_residual` is", "`contact_force` is"],
    );
    let change = |c: &Copy| {
        let (_, closed) = vertices(c);
        c.reals(LAST, "action", |l| l[closed] *= 1.0 + 1e-6);
    };
    found("action", change, &["`action` at vertex"]);
    let change = |c: &Copy| {
        let (open, _) = vertices(c);
        c.reals(LAST, "gap", |w| w[open] *= 1.0 + 1e-12);
    };
    found("gap", change, &["`gap` at vertex"]);
}

#[test]
fn signs_zeros_and_boundary_values() {
    let change = |c: &Copy| {
        let (_, closed) = vertices(c);
        c.integer::<1>(LAST, "contact", closed, 0);
    };
    found(
        "out of contact",
        change,
        &[
            "`action_force = 0 without contact`",
            "`contact_vertices` is",
        ],
    );
    let change = |c: &Copy| {
        let (open, _) = vertices(c);
        c.integer::<1>(LAST, "contact", open, 1);
    };
    found(
        "into contact",
        change,
        &["`gap = 0 in contact`", "`contact_area` is"],
    );
    let change = |c: &Copy| {
        let (open, _) = vertices(c);
        c.integer::<1>(LAST, "contact", open, 2);
    };
    found("a third kind", change, &["`contact is 0 or 1`"]);
    let change = |c: &Copy| {
        let (_, closed) = vertices(c);
        c.reals(LAST, "u2", |u| u[closed] += 1e-14);
        c.reals(LAST, "gap", |w| w[closed] -= 1e-14);
    };
    found("penetration", change, &["`gap >= 0` at vertex"]);
    let change = |c: &Copy| {
        let (_, closed) = vertices(c);
        c.reals(LAST, "action_force", |z| z[closed] = -z[closed]);
    };
    found("pull", change, &["`action_force >= 0` at vertex"]);
    // The first vertex of the disk is its centre, the second lies on the circle.
    let change = |c: &Copy| {
        c.reals(LAST, "u1", |u| u[1] += 1e-10);
        c.reals(LAST, "gap", |w| w[1] += 1e-10);
    };
    found("height", change, &["`u1 on the boundary` at vertex 1 is"]);
    let change = |c: &Copy| c.reals(LAST, "sigma", |s| s[1] = 1e-10);
    found(
        "sigma at the rim",
        change,
        &["`sigma = 0 on the boundary` at vertex 1"],
    );
}

#[test]
fn local_indicators() {
    for array in ["eta_K", "eta_e", "residual", "oscillation", "f1_h", "f2_h"] {
        let change = |c: &Copy| {
            c.reals(LAST, array, |v| {
                let most = v.iter().fold(0.0f64, |m, v| m.max(v.abs()));
                let k = v.iter().position(|v| v.abs() == most).expect("one");
                v[k] *= 1.0 + 1e-8;
            });
        };
        found(array, change, &[&format!("`{array}` at triangle")]);
    }
    let change = |c: &Copy| c.reals("edges_0002.vtp", "eta_e", |v| v[5] += 1e-8);
    found("edges", change, &["`edges_0002.vtp`: `eta_e` at edge 5"]);
    let generation = |c: &Copy| c.bytes_of(LAST, "generation")[4 * 7];
    for (array, more) in [("generation", 1), ("generation", -1), ("region", 1)] {
        let change = |c: &Copy| {
            let old = if array == "region" {
                0
            } else {
                i64::from(generation(c))
            };
            c.integer::<4>(LAST, array, 7, (old + more) as u64);
        };
        found(array, change, &[&format!("`{array}` at triangle 7")]);
    }
    // An array of the level before, whole.
    let change = |c: &Copy| c.reals("level_0001.vtu", "residual", |v| v.rotate_left(1));
    found(
        "another level",
        change,
        &["`level_0001.vtu`: `residual` at triangle"],
    );
}

#[test]
fn meshes() {
    let change = |c: &Copy| {
        let (open, _) = vertices(c);
        c.reals(LAST, "Points", |p| p[3 * open] += 1e-6);
    };
    found(
        "an inner point",
        change,
        &["`kkt_residual` is", "`edges_0002.vtp`: `points`"],
    );
    // Vertex 1 is (1, 0).
    let change = |c: &Copy| c.reals(LAST, "Points", |p| p[3] += 1e-9);
    found(
        "a boundary point",
        change,
        &[
            "is on the boundary and not on the circle",
            "`vertices of the initial mesh`",
        ],
    );
    let change = |c: &Copy| c.reals(LAST, "Points", |p| p[2] = 1.0);
    found(
        "out of the plane",
        change,
        &["point 0 is not in the plane z = 0"],
    );
    let change = |c: &Copy| c.reals(LAST, "Points", |p| p[0] = f64::NAN);
    found("no number", change, &["value 0 of `Points` is NaN"]);
    let change = |c: &Copy| c.integer::<8>(LAST, "connectivity", 4, 3);
    found("a corner", change, &["`level_0002.vtu`: `fields`"]);
    for wild in [1 << 20, 1 << 33, u64::MAX] {
        let change = |c: &Copy| c.integer::<8>(LAST, "connectivity", 4, wild);
        found("no such vertex", change, &["vertex"]);
    }
    let change = |c: &Copy| c.replace(LAST, "NumberOfPoints=\"", "NumberOfPoints=\"1");
    found("a count", change, &["instead of"]);
    let change = |c: &Copy| c.replace(LAST, "NumberOfCells=\"", "NumberOfCells=\"9999999999999999");
    found("a wild count", change, &["cells are too many"]);
    let change = |c: &Copy| c.replace(LAST, "Name=\"residual\"", "Name=\"residues\"");
    found("a name", change, &["`residues` is not known"]);
    let change = |c: &Copy| {
        c.replace(
            LAST,
            "Name=\"eta_K\" format=\"binary\" RangeMin=\"",
            "Name=\"eta_K\" format=\"binary\" RangeMin=\"1",
        )
    };
    found("a range", change, &["the range beside the array `eta_K`"]);
}

#[test]
fn numbers_of_the_last_level_in_history_and_summary() {
    for name in [
        "contact_area",
        "energy",
        "energy_norm",
        "eta_K",
        "eta_e_sum",
        "residual",
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
        ("bound_kind", "rt1"),
        ("certified", "0.1"),
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
        ("solver", "clarabel".into(), "repeats the last row"),
        ("iterations", 77.into(), "repeats the last row"),
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
            "not recomputed by this version",
        ),
        ("remark", "honest".into(), "`remark` is not known"),
    ] {
        let change = |c: &Copy| c.summary(|s| s[key] = value);
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
    let cut = |c: &Copy| c.text(LAST, |t| t[..t.len() / 2].to_owned());
    refused("half a file", &cut, &sum(LAST));
    refused(
        "half a file",
        &cut,
        "`level_0002.vtu`: `format`: it ends inside an array",
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
    copy.text(LAST, |t| t[..t.len() / 2].to_owned());
    copy.fit();
    let path = copy.path();
    let output = membranes(&["verify", path.to_str().expect("a path")]);
    assert_eq!(output.status.code(), Some(4));
}

/// No byte of a run can make the program stumble.
#[test]
fn random_bytes() {
    let mut state = 20_260_727u64;
    let mut random = |below: usize| {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        ((state >> 33) as usize) % below
    };
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
