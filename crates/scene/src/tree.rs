//! The scene as a tree of values with their places: the file's TOML with the overrides put in.

use toml::de::{DeTable, DeValue};

use crate::overrides::Override;
use crate::source::{Fault, Place, Sources};

/// A value and where it was written.
#[derive(Clone, Debug)]
pub(crate) struct Node {
    pub value: Value,
    pub place: Place,
}

/// A TOML value; integers are numbers like all others.
#[derive(Clone, Debug)]
pub(crate) enum Value {
    Text(String),
    Number(f64),
    Boolean(bool),
    Date,
    Array(Vec<Node>),
    Table(Vec<Entry>),
}

/// A key with its value. Entries stand in the order of the text.
#[derive(Clone, Debug)]
pub(crate) struct Entry {
    pub key: String,
    pub key_place: Place,
    pub node: Node,
}

impl Value {
    /// What messages call it.
    pub fn kind(&self) -> &'static str {
        match self {
            Value::Text(_) => "a string",
            Value::Number(_) => "a number",
            Value::Boolean(_) => "a boolean",
            Value::Date => "a date",
            Value::Array(_) => "an array",
            Value::Table(_) => "a section",
        }
    }
}

/// Parses the scene file and puts the overrides in.
pub(crate) fn read(sources: &Sources<'_>, overrides: &[Override]) -> Result<Vec<Entry>, Fault> {
    let document = DeTable::parse(sources.text).map_err(|error| {
        let place = Place::in_file(error.span().unwrap_or(0..0));
        Fault::at(&place, lower_first(error.message()))
    })?;
    let mut root = table(document.get_ref(), 0, 0);
    for set in overrides {
        put(&mut root, set, 0)?;
    }
    Ok(root)
}

/// The value of an override as a tree; `offset` is where its text begins in the argument.
pub(crate) fn override_value(text: &str, offset: usize, source: usize) -> Node {
    match DeValue::parse(text) {
        Ok(value) => node(
            value.get_ref(),
            value.span().start..value.span().end,
            source,
            offset,
        ),
        Err(_) => Node {
            value: Value::Text(text.to_owned()),
            place: Place {
                source,
                span: offset..offset + text.len(),
            },
        },
    }
}

/// A message of the TOML parser in the style of the others.
fn lower_first(message: &str) -> String {
    let mut chars = message.trim_end_matches('.').chars();
    match chars.next() {
        Some(first) => first.to_lowercase().chain(chars).collect(),
        None => String::new(),
    }
}

fn table(table: &DeTable<'_>, source: usize, offset: usize) -> Vec<Entry> {
    let mut entries: Vec<Entry> = table
        .iter()
        .map(|(key, value)| Entry {
            key: key.get_ref().to_string(),
            key_place: Place {
                source,
                span: key.span().start + offset..key.span().end + offset,
            },
            node: node(value.get_ref(), value.span(), source, offset),
        })
        .collect();
    entries.sort_by_key(|entry| entry.key_place.span.start);
    entries
}

fn node(value: &DeValue<'_>, span: std::ops::Range<usize>, source: usize, offset: usize) -> Node {
    let value = match value {
        DeValue::String(text) => Value::Text(text.to_string()),
        DeValue::Integer(integer) => Value::Number(
            i128::from_str_radix(integer.as_str(), integer.radix())
                .map_or(f64::INFINITY, |i| i as f64),
        ),
        DeValue::Float(float) => Value::Number(float.as_str().parse().unwrap_or(f64::NAN)),
        DeValue::Boolean(b) => Value::Boolean(*b),
        DeValue::Datetime(_) => Value::Date,
        DeValue::Array(items) => Value::Array(
            items
                .iter()
                .map(|item| node(item.get_ref(), item.span(), source, offset))
                .collect(),
        ),
        DeValue::Table(inner) => Value::Table(table(inner, source, offset)),
    };
    Node {
        value,
        place: Place {
            source,
            span: span.start + offset..span.end + offset,
        },
    }
}

/// Sets the value that the names from `depth` on lead to; sections that are missing are made.
fn put(entries: &mut Vec<Entry>, set: &Override, depth: usize) -> Result<(), Fault> {
    let name = &set.path[depth];
    let at = match entries.iter().position(|entry| &entry.key == name) {
        Some(at) => at,
        None => {
            entries.push(Entry {
                key: name.clone(),
                key_place: set.key_place.clone(),
                node: Node {
                    value: Value::Table(Vec::new()),
                    place: set.key_place.clone(),
                },
            });
            entries.len() - 1
        }
    };
    let entry = &mut entries[at];
    if depth + 1 == set.path.len() {
        entry.node = set.node.clone();
        return Ok(());
    }
    match &mut entry.node.value {
        Value::Table(inner) => put(inner, set, depth + 1),
        _ => {
            let prefix = set.path[..=depth].join(".");
            Err(Fault::at(
                &set.key_place,
                format!("`{prefix}` is a value, it has no keys"),
            ))
        }
    }
}
