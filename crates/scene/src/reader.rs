//! Reading the tree: sections with known keys, and typed values.

use crate::source::{At, Fault, Place};
use crate::tree::{Entry, Node, Value};
use crate::types::Number;

/// A section whose keys have been checked.
pub(crate) struct Section<'a> {
    name: &'a str,
    entries: &'a [Entry],
}

impl<'a> Section<'a> {
    /// The section `name` (empty for the top of the file) with its keys, all of which must be among `known`.
    pub fn new(name: &'a str, entries: &'a [Entry], known: &[&str]) -> Result<Self, Fault> {
        for entry in entries {
            if !known.contains(&entry.key.as_str()) {
                return Err(unknown_key(name, entry, known));
            }
        }
        Ok(Section { name, entries })
    }

    /// The entry of a key.
    pub fn entry(&self, key: &str) -> Option<&'a Entry> {
        self.entries.iter().find(|entry| entry.key == key)
    }

    /// The dotted name of a key.
    pub fn path(&self, key: &str) -> String {
        join(self.name, key)
    }

    /// The entries of a section below this one.
    pub fn below(&self, key: &str) -> Result<Option<&'a [Entry]>, Fault> {
        match self.entry(key) {
            None => Ok(None),
            Some(entry) => match &entry.node.value {
                Value::Table(entries) => Ok(Some(entries)),
                other => {
                    let path = self.path(key);
                    let message = format!("`{path}` is a section, not {}", other.kind());
                    let hint = format!("write `[{path}]` on a line of its own, its keys below it");
                    Err(Fault::at(&entry.node.place, message).hint(hint))
                }
            },
        }
    }

    /// A value, read by `read`.
    pub fn get<T>(
        &self,
        key: &str,
        read: impl FnOnce(&'a Node, &str) -> Result<T, Fault>,
    ) -> Result<Option<At<T>>, Fault> {
        self.entry(key)
            .map(|entry| {
                Ok(At {
                    value: read(&entry.node, &self.path(key))?,
                    place: entry.node.place.clone(),
                })
            })
            .transpose()
    }

    /// A value that must be there; `place` is blamed if it is not.
    pub fn require<T>(
        &self,
        key: &str,
        place: &Place,
        hint: &str,
        read: impl FnOnce(&'a Node, &str) -> Result<T, Fault>,
    ) -> Result<At<T>, Fault> {
        self.get(key, read)?
            .ok_or_else(|| Fault::at(place, format!("`{}` is missing", self.path(key))).hint(hint))
    }
}

fn join(section: &str, key: &str) -> String {
    if section.is_empty() {
        key.to_owned()
    } else {
        format!("{section}.{key}")
    }
}

fn unknown_key(section: &str, entry: &Entry, known: &[&str]) -> Fault {
    let is_section = matches!(entry.node.value, Value::Table(_));
    let what = if is_section { "section" } else { "key" };
    let message = match (entry.key_place.source, is_section) {
        (0, true) => format!("unknown section [{}]", join(section, &entry.key)),
        (0, false) if section.is_empty() => format!("unknown key `{}`", entry.key),
        (0, false) => format!("unknown key `{}` in [{section}]", entry.key),
        _ => format!("unknown {what} `{}` in `--set`", join(section, &entry.key)),
    };
    let valid = match section {
        "" => format!("valid at the top: {}", known.join(", ")),
        "domain" => format!("valid domains: {}", known.join(", ")),
        _ => format!("valid keys: {}", known.join(", ")),
    };
    let hint = match nearest(&entry.key, known) {
        Some(near) => format!(
            "did you mean `{}`? {valid}",
            join_shown(section, near, &entry.key_place)
        ),
        None => valid,
    };
    Fault::at(&entry.key_place, message).hint(hint)
}

/// Overrides name keys in full, files by their last part.
fn join_shown(section: &str, key: &str, place: &Place) -> String {
    if place.source == 0 {
        key.to_owned()
    } else {
        join(section, key)
    }
}

/// The known name that `name` was probably meant to be.
pub(crate) fn nearest<'k>(name: &str, known: &[&'k str]) -> Option<&'k str> {
    let lower = name.to_lowercase();
    let allowed = 1 + name.chars().count() / 4;
    known
        .iter()
        .map(|known| (strsim::damerau_levenshtein(&lower, known), *known))
        .filter(|(distance, known)| {
            // More than half of the known name must be right.
            *distance <= allowed && 2 * distance < known.len()
        })
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, known)| known)
}

fn wrong_type(node: &Node, path: &str, expected: &str) -> Fault {
    let found = node.value.kind();
    Fault::at(
        &node.place,
        format!("`{path}` must be {expected}, not {found}"),
    )
}

/// Text.
pub(crate) fn text(node: &Node, path: &str) -> Result<String, Fault> {
    match &node.value {
        Value::Text(text) => Ok(text.clone()),
        _ => Err(wrong_type(node, path, "a string")),
    }
}

/// Yes or no.
pub(crate) fn boolean(node: &Node, path: &str) -> Result<bool, Fault> {
    match &node.value {
        Value::Boolean(value) => Ok(*value),
        _ => Err(wrong_type(node, path, "`true` or `false`")),
    }
}

/// A finite number, or a formula that is not looked at here.
pub(crate) fn number(node: &Node, path: &str) -> Result<Number, Fault> {
    match &node.value {
        Value::Number(value) if value.is_finite() => Ok(Number::Value(*value)),
        Value::Number(value) => Err(Fault::at(
            &node.place,
            format!("`{path}` must be a finite number, not {value}"),
        )),
        Value::Text(text) => Ok(Number::Formula(text.clone())),
        _ => Err(wrong_type(
            node,
            path,
            "a number or an expression in quotes",
        )),
    }
}

/// A list of anything.
pub(crate) fn list<T>(
    node: &Node,
    path: &str,
    of: &str,
    mut item: impl FnMut(&Node, &str) -> Result<T, Fault>,
) -> Result<Vec<At<T>>, Fault> {
    let Value::Array(items) = &node.value else {
        let fault = wrong_type(node, path, &format!("an array of {of}"));
        return Err(match &node.value {
            Value::Text(text) => fault.hint(format!("write `[\"{text}\"]`")),
            _ => fault,
        });
    };
    items
        .iter()
        .enumerate()
        .map(|(k, node)| {
            Ok(At {
                value: item(node, &format!("{path}[{k}]"))?,
                place: node.place.clone(),
            })
        })
        .collect()
}

/// A point `[x, y]`.
pub(crate) fn point(node: &Node, path: &str) -> Result<[At<Number>; 2], Fault> {
    let expected = "a point `[x, y]`";
    let Value::Array(items) = &node.value else {
        return Err(wrong_type(node, path, expected));
    };
    let found = items.len();
    let Ok([x, y]) = <&[Node; 2]>::try_from(items.as_slice()) else {
        let message = format!("`{path}` must be {expected}, not an array of {found}");
        return Err(Fault::at(&node.place, message));
    };
    let coordinate = |node: &Node, k: usize| {
        Ok(At {
            value: number(node, &format!("{path}[{k}]"))?,
            place: node.place.clone(),
        })
    };
    Ok([coordinate(x, 0)?, coordinate(y, 1)?])
}

/// One of several names; `None` stands for a name that later versions know.
pub(crate) fn choice<T: Copy>(
    node: &Node,
    path: &str,
    names: &[(&str, Option<T>)],
) -> Result<T, Fault> {
    let valid: Vec<&str> = names
        .iter()
        .filter(|(_, value)| value.is_some())
        .map(|(name, _)| *name)
        .collect();
    let quoted: Vec<String> = valid.iter().map(|name| format!("\"{name}\"")).collect();
    let listed = format!("valid values: {}", quoted.join(", "));
    let Value::Text(text) = &node.value else {
        return Err(wrong_type(node, path, "a string").hint(listed));
    };
    match names.iter().find(|(name, _)| name == text) {
        Some((_, Some(value))) => Ok(*value),
        Some((_, None)) => {
            Err(not_in_this_version(&node.place, path, &format!("\"{text}\"")).hint(listed))
        }
        None => {
            let all: Vec<&str> = names.iter().map(|(name, _)| *name).collect();
            let hint = match nearest(text, &all) {
                Some(near) => format!("did you mean \"{near}\"? {listed}"),
                None => listed,
            };
            Err(Fault::at(&node.place, format!("unknown value \"{text}\" of `{path}`")).hint(hint))
        }
    }
}

/// The refusal of what later versions do.
pub(crate) fn not_in_this_version(place: &Place, path: &str, value: &str) -> Fault {
    Fault::at(place, format!("`{path} = {value}` is not in this version"))
}
