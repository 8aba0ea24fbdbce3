//! `summary.json`: the run in one object.

use serde_json::{Map, Value, json};

use super::checksum::checksum;
use super::columns::{COLUMNS, Entry, reduction_name};
use super::machine;
use crate::record::LevelRecord;

/// How a run ended.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Ending {
    /// The accuracy goal holds.
    Goal,
    /// A limit came first, or the scene set no goal.
    Limit,
    /// Someone stopped it.
    Interrupted,
    /// A numerical failure; the last good level is kept.
    Failed,
}

impl Ending {
    /// The name in files.
    pub fn name(self) -> &'static str {
        match self {
            Ending::Goal => "goal",
            Ending::Limit => "limit",
            Ending::Interrupted => "interrupted",
            Ending::Failed => "failed",
        }
    }
}

/// What the summary says beyond the levels themselves.
#[derive(Clone, Debug)]
pub struct Summary<'a> {
    /// How the run ended; `outcome`.
    pub ending: Ending,
    /// The rule that ended it, for example `relative_error`, or the message of the failure.
    pub stopped_by: String,
    /// Exit code of the program.
    pub exit_code: i32,
    /// Name of the scene file.
    pub scene: String,
    /// Title of the scene, if it has one.
    pub title: Option<String>,
    /// Every finished level; the last gives the columns.
    pub levels: &'a [LevelRecord],
    /// Wall seconds of the whole run.
    pub wall_seconds: f64,
    /// Wall seconds spent on files.
    pub seconds_output: f64,
    /// Peak resident memory at the end, in MiB.
    pub peak_memory_mb: Option<f64>,
    /// Whatever else is to be told. A name that the summary has already keeps its meaning.
    pub additions: Map<String, Value>,
}

impl Summary<'_> {
    /// The object, keys in a fixed order: how it ended; the columns of the last level under the names of the history;
    /// `smallest_gap`; `certificate` with `bound`, `guaranteed` and `caveats`; `totals` over the levels; `versions`, `machine`; the additions;
    /// `not_representable`; `checksum`, which is [`own_sum`].
    ///
    /// What does not apply is null. JSON has no infinity: such a number is null too, and its name is listed under
    /// `not_representable` (nested names with a dot).
    pub fn to_json(&self) -> Value {
        let mut object = Object::default();
        object.put("outcome", self.ending.name());
        object.put("stopped_by", self.stopped_by.as_str());
        object.put("levels", self.levels.len());
        object.put("exit_code", self.exit_code);
        object.put("scene", self.scene.as_str());
        object.put("title", self.title.as_deref());
        let last = self.levels.last();
        object.put("reduction", last.map(|l| reduction_name(l.reduction)));
        object.number("wall_seconds", Some(self.wall_seconds));
        for column in COLUMNS {
            match last.map_or(Entry::Empty, column.entry) {
                Entry::Empty => object.put(column.name, Value::Null),
                Entry::Count(count) => object.put(column.name, count),
                Entry::Name(name) => object.put(column.name, name),
                Entry::Number(number) => object.number(column.name, Some(number)),
            }
        }
        object.number("smallest_gap", last.map(|l| l.smallest_gap));
        let certificate = last.and_then(|l| Some((l.certified?, l.assurance.as_ref()?)));
        match certificate {
            None => object.put("certificate", Value::Null),
            Some((bound, assurance)) => {
                let mut certificate = Object::within("certificate");
                certificate.number("bound", Some(bound));
                certificate.put("guaranteed", assurance.guaranteed);
                certificate.put("caveats", assurance.caveats.clone());
                object.nest("certificate", certificate);
            }
        }

        let total = |stage: fn(&LevelRecord) -> f64| Some(self.levels.iter().map(stage).sum());
        let mut totals = Object::within("totals");
        totals.number("seconds_refine", total(|l| l.seconds_refine));
        totals.number("seconds_assemble", total(|l| l.seconds_assemble));
        totals.number("seconds_solve", total(|l| l.seconds_solve));
        totals.number("seconds_estimate", total(|l| l.seconds_estimate));
        totals.number("seconds_output", Some(self.seconds_output));
        totals.number("seconds_total", Some(self.wall_seconds));
        totals.number("peak_memory_mb", self.peak_memory_mb);
        object.nest("totals", totals);

        object.put(
            "versions",
            json!({ "membranes": env!("CARGO_PKG_VERSION") }),
        );
        object.put("machine", machine::describe());
        for (key, value) in &self.additions {
            if !object.map.contains_key(key) {
                object.put(key, value.clone());
            }
        }
        let lost = std::mem::take(&mut object.lost);
        object.put("not_representable", lost);
        let sum = own_sum(&object.map);
        object.put(OWN_SUM, sum);
        Value::Object(object.map)
    }

    /// The file: indented, with a final line feed.
    pub fn to_text(&self) -> String {
        format!("{:#}\n", self.to_json())
    }
}

/// The key of [`own_sum`].
pub const OWN_SUM: &str = "checksum";

/// SHA-256 of everything else in the summary, written as JSON without spaces and line feeds, in the order of the file.
pub fn own_sum(rest: &Map<String, Value>) -> String {
    checksum(Value::Object(rest.clone()).to_string().as_bytes())
}

/// A JSON object under construction, and the numbers that it could not hold.
#[derive(Default)]
struct Object {
    prefix: String,
    map: Map<String, Value>,
    lost: Vec<String>,
}

impl Object {
    fn within(name: &str) -> Self {
        Object {
            prefix: format!("{name}."),
            ..Object::default()
        }
    }

    fn put(&mut self, key: &str, value: impl Into<Value>) {
        self.map.insert(key.to_string(), value.into());
    }

    fn number(&mut self, key: &str, number: Option<f64>) {
        if number.is_some_and(|n| !n.is_finite()) {
            self.lost.push(format!("{}{key}", self.prefix));
        }
        // serde_json makes null of what is not finite.
        self.put(key, number);
    }

    fn nest(&mut self, key: &str, inner: Object) {
        self.lost.extend(inner.lost);
        self.put(key, inner.map);
    }
}
