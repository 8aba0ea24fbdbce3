//! The claims of `summary.json` beyond those of a level, of the rows of `history.csv`, and of `series.pvd`.

use adapt::output::folder::{HISTORY, SERIES, SUMMARY, level_file};
use adapt::output::pvd::write_series;
use adapt::output::summary::{OWN_SUM, own_sum};
use scene::Scene;
use serde_json::{Map, Value};

use crate::certificate;
use crate::columns::{COLUMNS, Recomputed};
use crate::error::VerifyError;
use crate::folder::Folder;
use crate::level::reduction;
use crate::number::{Number, sum};
use crate::report::Report;
use crate::tables::{Cell, Entry, History, compare};

/// Keys of the summary that are no columns.
const KEYS: [&str; 15] = [
    "outcome",
    "stopped_by",
    "levels",
    "exit_code",
    "scene",
    "title",
    "reduction",
    "wall_seconds",
    "smallest_gap",
    "totals",
    "versions",
    "machine",
    "not_representable",
    "checksums",
    OWN_SUM,
];

/// The checksum of the rest of the summary.
pub(crate) fn check_own_sum(summary: &Map<String, Value>, report: &mut Report) {
    let mut rest = summary.clone();
    let claimed = rest.shift_remove(OWN_SUM);
    let claimed = Cell::of_json(claimed.as_ref()).shown();
    report.same(SUMMARY, OWN_SUM, claimed, own_sum(&rest));
}

/// What can be compared without fields: the last row, sums over the rows, the title.
pub(crate) fn check_text(
    summary: &Map<String, Value>,
    scene: &Scene,
    history: &History,
    report: &mut Report,
) {
    let cell = |key: &str| Cell::of_json(summary.get(key));
    report.same(
        SUMMARY,
        "levels",
        cell("levels").shown(),
        history.len().to_string(),
    );
    let title = scene.title.clone().unwrap_or_else(|| "empty".into());
    report.same(SUMMARY, "title", cell("title").shown(), title);
    let last = history.len().saturating_sub(1);
    for (name, _) in COLUMNS {
        if let Some(row) = history.cell(last, name) {
            let (found, expected) = (cell(name), row.shown());
            let wrong = (found != *row).then(|| {
                let found = found.shown();
                format!("`{found}` is not the `{expected}` of the last row of `{HISTORY}`")
            });
            report.property(SUMMARY, name, wrong);
        }
    }
    let known = |key: &str| key == certificate::KEY || KEYS.contains(&key);
    let unknown = summary
        .keys()
        .find(|key| !known(key) && !COLUMNS.iter().any(|(name, _)| name == key));
    let unknown = unknown.map(|key| format!("`{key}` is not known to this version"));
    report.property(SUMMARY, "keys", unknown);
    let missing = KEYS
        .iter()
        .copied()
        .chain(COLUMNS.iter().map(|(name, _)| *name));
    let missing = missing.into_iter().find(|key| !summary.contains_key(*key));
    report.property(
        SUMMARY,
        "keys",
        missing.map(|key| format!("`{key}` is missing")),
    );
    totals(summary, history, report);
    let lost = summary.get("not_representable").and_then(Value::as_array);
    let given = |name: &&Value| {
        let Some(name) = name.as_str() else {
            return true;
        };
        let value = name
            .split('.')
            .try_fold(None::<&Value>, |at, key| match at {
                None => summary.get(key).map(Some),
                Some(inside) => inside.get(key).map(Some),
            });
        !matches!(value, Some(Some(Value::Null)))
    };
    let wrong = match lost {
        None => Some("it is no list".to_owned()),
        Some(list) => list
            .iter()
            .find(given)
            .map(|name| format!("{name} is no name of a null")),
    };
    report.property(SUMMARY, "not_representable", wrong);
}

/// The seconds of the stages are sums over the rows; the run took at least until its last level.
fn totals(summary: &Map<String, Value>, history: &History, report: &mut Report) {
    let total = |key: &str| {
        summary
            .get("totals")
            .and_then(|t| t.get(key))
            .and_then(Value::as_f64)
    };
    for stage in ["refine", "assemble", "solve", "estimate"].map(|s| format!("seconds_{s}")) {
        let rows: Option<Vec<f64>> = (0..history.len())
            .map(|l| history.number(l, &stage))
            .collect();
        let claim = format!("totals.{stage}");
        match (total(&stage), rows) {
            (Some(claimed), Some(rows)) => {
                let expected = Number::plain(sum(rows), 0);
                report.number(SUMMARY, &claim, claimed, expected);
            }
            _ => report.property(SUMMARY, &claim, Some("it is no sum of numbers".into())),
        }
    }
    let wall = summary.get("wall_seconds").and_then(Value::as_f64);
    let same = wall.is_some() && wall == total("seconds_total");
    let wrong = (!same).then(|| "it is not `wall_seconds`".to_owned());
    report.property(SUMMARY, "totals.seconds_total", wrong);
    let last = history.len().saturating_sub(1);
    let until = history.number(last, "seconds_total");
    let early = wall.zip(until).is_none_or(|(wall, until)| wall < until);
    let wrong = early.then(|| "it is less than the seconds of the last level".to_owned());
    report.property(SUMMARY, "wall_seconds", wrong);
}

/// The numbers of the last level.
pub(crate) fn check_numbers(
    summary: &Map<String, Value>,
    level: &Recomputed<'_>,
    report: &mut Report,
) {
    let lost: Vec<&str> = summary
        .get("not_representable")
        .and_then(Value::as_array)
        .map(|list| list.iter().filter_map(Value::as_str).collect())
        .unwrap_or_default();
    let gap = Entry::Number(level.smallest_gap());
    let entries = COLUMNS.iter().map(|(name, entry)| (*name, entry(level)));
    for (name, entry) in entries.chain([("smallest_gap", gap)]) {
        compare(
            report,
            SUMMARY,
            name,
            &Cell::of_json(summary.get(name)),
            &entry,
        );
        let infinite = matches!(&entry, Entry::Number(n) if !n.physical().is_finite());
        if infinite != lost.contains(&name) {
            let wrong =
                format!("`{name}` is listed though it is a number, or is not and should be");
            report.property(SUMMARY, "not_representable", Some(wrong));
        }
    }
    let entry = Entry::Name(reduction(level));
    compare(
        report,
        SUMMARY,
        "reduction",
        &Cell::of_json(summary.get("reduction")),
        &entry,
    );
}

/// Level numbers of the rows, the counts of the first level, and vertices that become no fewer.
pub(crate) fn check_rows(history: &History, scene: &Scene, report: &mut Report) {
    let some = (history.len() == 0).then(|| "it has no level".to_owned());
    report.property(HISTORY, "rows", some);
    let number = |l: usize, name: &str| history.number(l, name);
    let wrong = (0..history.len()).find(|&l| number(l, "level") != Some(l as f64));
    let wrong = wrong.map(|l| format!("row {l} is not that of level {l}"));
    report.property(HISTORY, "level", wrong);
    for name in ["vertices", "seconds_total"] {
        let falls = (1..history.len()).find(|&l| {
            let pair = number(l - 1, name).zip(number(l, name));
            pair.is_none_or(|(before, after)| after < before)
        });
        let falls = falls.map(|l| format!("level {l} has less than the level before"));
        report.property(HISTORY, name, falls);
    }
    let initial = &scene.problem.mesh;
    for (name, count) in [
        ("vertices", initial.vertex_count()),
        ("triangles", initial.triangle_count()),
    ] {
        if let Some(cell) = history.cell(0, name) {
            compare(report, HISTORY, name, cell, &Entry::Count(vec![count]));
        }
    }
}

/// ParaView's index names the levels that have fields, and no others.
///
/// # Errors
/// It cannot be read.
pub(crate) fn check_series(
    folder: &Folder,
    levels: &[usize],
    report: &mut Report,
) -> Result<(), VerifyError> {
    let Some(content) = folder.read(SERIES)? else {
        // Whether it should be there is a question of names.
        return Ok(());
    };
    let names: Vec<(usize, String)> = levels.iter().map(|&l| (l, level_file(l))).collect();
    let mut expected = Vec::new();
    // Writing to memory does not fail.
    let written = write_series(
        &mut expected,
        names.iter().map(|(l, name)| (*l, name.as_str())),
    );
    let wrong = (written.is_err() || content.bytes != expected)
        .then(|| "it is not the index of the levels that have fields".to_owned());
    report.property(SERIES, "levels", wrong);
    Ok(())
}
