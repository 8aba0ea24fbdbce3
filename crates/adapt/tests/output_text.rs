//! The history and the summary.

mod output_sample;

use std::path::Path;

use adapt::output::columns::COLUMNS;
use adapt::output::history::write_history;
use adapt::output::{Ending, RunFolder, Summary};
use adapt::record::LevelRecord;
use contact::Reduction;
use output_sample::record;
use serde_json::{Map, Value, json};

/// What scripts rely on.
const HEADING: &str = "level,vertices,triangles,unknowns,contact_vertices,contact_area,energy,\
energy_norm,eta_K,eta_e_sum,residual,certified,oscillation,error_bound,relative_bound,true_error,effectivity,\
sigma_error,solver,iterations,kkt_residual,seconds_refine,seconds_assemble,seconds_solve,seconds_estimate,\
seconds_total,peak_memory_mb,bound_kind,eta_alg,bound_711,bound_711_repaired,h1_error,contact_force,max_action,\
contact_area_error,contact_jaccard,contact_hausdorff,algebraic_error";

fn history(levels: &[LevelRecord]) -> String {
    let mut bytes = Vec::new();
    write_history(&mut bytes, levels).unwrap();
    String::from_utf8(bytes).unwrap()
}

fn summary(levels: &[LevelRecord]) -> Summary<'_> {
    Summary {
        ending: Ending::Goal,
        stopped_by: "relative_error".into(),
        exit_code: 0,
        scene: "disk.toml".into(),
        title: Some("Two membranes".into()),
        levels,
        wall_seconds: 4.5,
        seconds_output: 0.75,
        peak_memory_mb: Some(9.5),
        additions: Map::new(),
    }
}

#[test]
fn the_heading_is_the_one_that_scripts_rely_on() {
    assert_eq!(history(&[]), format!("{HEADING}\n"));
}

#[test]
fn a_row_holds_what_applies_and_nothing_else() {
    let text = history(&[record(0), record(1)]);
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), 3);
    assert_eq!(
        lines[2],
        "1,200,360,160,12,0.30000000000000004,-0.3333333333333333,1e-9,0.25,0.5,1e22,1.25,0,0.125,0.01,2,1.5,3,\
         active-set,5,1.5e-16,0.5,0.25,0.125,1,2,8.5,residual,0.03125,10,11,4,6,7,0.75,0.875,0.0625,0.015625"
    );
    let bare = LevelRecord {
        eta_k: None,
        eta_e_sum: None,
        bound_711: None,
        bound_711_repaired: None,
        contact_area_error: None,
        contact_jaccard: None,
        contact_hausdorff: None,
        residual: None,
        certified: None,
        eta_alg: None,
        algebraic_error: None,
        assurance: None,
        relative_bound: None,
        true_error: None,
        effectivity: None,
        sigma_error: None,
        h1_error: None,
        peak_memory_mb: None,
        energy: f64::NAN,
        max_action: f64::INFINITY,
        ..record(0)
    };
    let text = history(&[bare]);
    assert_eq!(
        text.lines().nth(1).unwrap(),
        "0,100,180,160,12,0.30000000000000004,,1e-9,,,,,0,0.125,,,,,active-set,5,1.5e-16,0.5,0.25,0.125,1,2,,\
         residual,,,,,6,,,,,"
    );
    for line in text.lines() {
        assert_eq!(line.split(',').count(), COLUMNS.len());
    }
}

#[test]
fn the_history_grows_level_by_level() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = RunFolder::prepare(folder.path(), false).unwrap();
    let levels: Vec<LevelRecord> = (0..3).map(record).collect();
    for count in 1..=3 {
        run.write_history(&levels[..count]).unwrap();
        let text = std::fs::read_to_string(folder.path().join("history.csv")).unwrap();
        assert_eq!(text, history(&levels[..count]));
    }
}

#[test]
fn the_summary_repeats_the_last_row_under_the_same_names() {
    let levels = [record(0), record(1)];
    let object = summary(&levels).to_json();
    let row = history(&levels);
    let row: Vec<&str> = row.lines().nth(2).unwrap().split(',').collect();
    for (name, text) in HEADING.split(',').zip(row) {
        let value = &object[name];
        match value {
            Value::Null => assert_eq!(text, "", "{name}"),
            Value::String(string) => assert_eq!(text, string, "{name}"),
            Value::Number(number) => assert_eq!(
                number.as_f64().unwrap().to_bits(),
                text.parse::<f64>().unwrap().to_bits(),
                "{name}"
            ),
            other => panic!("{name}: {other}"),
        }
        assert!(object.as_object().unwrap().contains_key(name), "{name}");
    }
    assert_eq!(object["outcome"], "goal");
    assert_eq!(object["stopped_by"], "relative_error");
    assert_eq!(object["levels"], 2);
    assert_eq!(object["exit_code"], 0);
    assert_eq!(object["scene"], "disk.toml");
    assert_eq!(object["title"], "Two membranes");
    assert_eq!(object["reduction"], "two-field");
    assert_eq!(object["wall_seconds"], 4.5);
    assert_eq!(object["smallest_gap"], 0.0);
    assert_eq!(
        object["certificate"],
        json!({ "bound": 1.25, "guaranteed": true, "caveats": ["one"] })
    );
    assert_eq!(
        object["totals"],
        json!({
            "seconds_refine": 1.0, "seconds_assemble": 0.5, "seconds_solve": 0.25, "seconds_estimate": 2.0,
            "seconds_output": 0.75, "seconds_total": 4.5, "peak_memory_mb": 9.5
        })
    );
    assert_eq!(object["versions"]["membranes"], env!("CARGO_PKG_VERSION"));
    assert!(object["machine"]["cores"].as_u64().unwrap() >= 1);
    assert_eq!(object["machine"]["arch"], std::env::consts::ARCH);
    assert_eq!(object["not_representable"], json!([]));
}

#[test]
fn a_number_that_json_cannot_hold_is_null_and_named() {
    let levels = [LevelRecord {
        energy: f64::NAN,
        smallest_gap: f64::NEG_INFINITY,
        seconds_solve: f64::INFINITY,
        true_error: None,
        ..record(0)
    }];
    let object = summary(&levels).to_json();
    assert_eq!(object["energy"], Value::Null);
    assert_eq!(object["true_error"], Value::Null);
    assert_eq!(
        object["not_representable"],
        json!([
            "energy",
            "seconds_solve",
            "smallest_gap",
            "totals.seconds_solve"
        ])
    );
}

#[test]
fn a_run_without_a_level_has_a_summary() {
    let object = Summary {
        ending: Ending::Failed,
        exit_code: 3,
        title: None,
        ..summary(&[])
    }
    .to_json();
    assert_eq!(object["outcome"], "failed");
    assert_eq!(object["levels"], 0);
    assert_eq!(object["reduction"], Value::Null);
    assert_eq!(object["error_bound"], Value::Null);
    assert_eq!(object["totals"]["seconds_solve"], 0.0);
}

#[test]
fn additions_come_along_and_replace_nothing() {
    let mut additions = Map::new();
    additions.insert("threads".into(), 2.into());
    additions.insert("outcome".into(), "other".into());
    let object = Summary {
        additions,
        ..summary(&[])
    }
    .to_json();
    assert_eq!(object["threads"], 2);
    assert_eq!(object["outcome"], "goal");
}

#[test]
fn the_file_is_the_object() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = RunFolder::prepare(folder.path(), false).unwrap();
    let levels = [record(0)];
    run.write_summary(&summary(&levels)).unwrap();
    let text = std::fs::read_to_string(folder.path().join(Path::new("summary.json"))).unwrap();
    assert!(text.ends_with("}\n"));
    let read: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(read, summary(&levels).to_json());
}

#[test]
fn every_ending_and_reduction_has_its_name() {
    let endings = [
        Ending::Goal,
        Ending::Limit,
        Ending::Interrupted,
        Ending::Failed,
    ];
    assert_eq!(
        endings.map(Ending::name),
        ["goal", "limit", "interrupted", "failed"]
    );
    let reductions = [
        Reduction::NoContact,
        Reduction::FullContact,
        Reduction::ConstantTensions,
        Reduction::ConstantRatio,
        Reduction::TwoField,
    ];
    assert_eq!(
        reductions.map(adapt::output::columns::reduction_name),
        [
            "no-contact",
            "full-contact",
            "constant-tensions",
            "constant-ratio",
            "two-field"
        ]
    );
}
