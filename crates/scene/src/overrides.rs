//! Overrides `KEY=VALUE` from the command line.

use toml_edit::{DocumentMut, InlineTable, Item, Table, Value};

use crate::source::{Fault, Place};
use crate::tree::{self, Node};

/// One override, taken apart.
#[derive(Clone, Debug)]
pub(crate) struct Override {
    /// The names of the key.
    pub path: Vec<String>,
    /// Where the key stands in the argument.
    pub key_place: Place,
    /// The value as text.
    pub text: String,
    /// The value.
    pub node: Node,
}

/// Takes the arguments apart. The value is read as TOML, else as a string.
pub(crate) fn parse(arguments: &[String]) -> Result<Vec<Override>, Fault> {
    arguments
        .iter()
        .enumerate()
        .map(|(k, argument)| one(argument, k + 1))
        .collect()
}

fn one(argument: &str, source: usize) -> Result<Override, Fault> {
    let whole = Place {
        source,
        span: 0..argument.len(),
    };
    let malformed =
        |message: &str| Fault::at(&whole, message).hint("write `--set stop.vertices=50000`");
    let Some((key, value)) = argument.split_once('=') else {
        return Err(malformed("an override needs the form `KEY=VALUE`"));
    };
    let path: Vec<String> = key.split('.').map(|name| name.trim().to_owned()).collect();
    let is_name = |name: &String| {
        !name.is_empty()
            && name
                .chars()
                .all(|c| c.is_alphanumeric() || c == '_' || c == '-')
    };
    if key.trim().is_empty() {
        return Err(malformed("the key before `=` is missing"));
    }
    if !path.iter().all(is_name) {
        return Err(malformed(&format!("`{}` is no key", key.trim())));
    }
    let start = key.len() - key.trim_start().len();
    let text = value.trim();
    let offset = key.len() + 1 + (value.len() - value.trim_start().len());
    Ok(Override {
        path,
        key_place: Place {
            source,
            span: start..key.trim_end().len().max(start),
        },
        text: text.to_owned(),
        node: tree::override_value(text, offset, source),
    })
}

/// The text of the scene with the overrides put in; comments and order stay as they are.
pub(crate) fn apply(text: &str, overrides: &[Override]) -> String {
    if overrides.is_empty() {
        return text.to_owned();
    }
    let mut document: DocumentMut = match text.parse() {
        Ok(document) => document,
        // The same text has been parsed before: this cannot happen, and if it does nothing is lost.
        Err(_) => return text.to_owned(),
    };
    for set in overrides {
        let mut item: &mut Item = document.as_item_mut();
        for name in &set.path[..set.path.len() - 1] {
            if item.get(name).is_none() {
                item[name.as_str()] = if item.is_inline_table() {
                    Item::Value(Value::InlineTable(InlineTable::new()))
                } else {
                    let mut made = Table::new();
                    made.set_implicit(true);
                    Item::Table(made)
                };
            }
            item = &mut item[name.as_str()];
        }
        let value: Value = set
            .text
            .parse()
            .unwrap_or_else(|_| Value::from(set.text.as_str()));
        let last = set.path[set.path.len() - 1].as_str();
        match item.get_mut(last).and_then(Item::as_value_mut) {
            Some(old) => {
                let decor = old.decor().clone();
                *old = value;
                *old.decor_mut() = decor;
            }
            None => item[last] = Item::Value(value),
        }
    }
    document.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn applied(text: &str, arguments: &[&str]) -> String {
        let arguments: Vec<String> = arguments.iter().map(|a| a.to_string()).collect();
        apply(text, &parse(&arguments).unwrap())
    }

    #[test]
    fn comments_and_order_stay() {
        let text = "# head\n[stop]  # when\nvertices = 10 # few\n\n[domain.disk]\nradius = 2\n";
        assert_eq!(
            applied(text, &["stop.vertices=50_000", "domain.disk.radius = 2*g"]),
            "# head\n[stop]  # when\nvertices = 50_000 # few\n\n[domain.disk]\nradius = \"2*g\"\n"
        );
    }

    #[test]
    fn missing_keys_and_sections_are_made() {
        let text = "[domain.disk]\n";
        let made = applied(
            text,
            &["stop.levels=3", "title=A \"b\"", "domain.disk.size=0.5"],
        );
        let back: toml_edit::DocumentMut = made.parse().unwrap();
        assert_eq!(back["stop"]["levels"].as_integer(), Some(3));
        assert_eq!(back["title"].as_str(), Some("A \"b\""));
        assert_eq!(back["domain"]["disk"]["size"].as_float(), Some(0.5));
    }

    #[test]
    fn inline_and_dotted_sections_are_followed() {
        let text = "stop = { levels = 3 }\ndomain.disk.radius = 2\nsolve = {}\n";
        let made = applied(
            text,
            &[
                "stop.vertices=7",
                "domain.disk.size=1",
                "solve.a.b=1",
                "stop={levels=4}",
            ],
        );
        let back: toml_edit::DocumentMut = made.parse().unwrap();
        assert_eq!(back["stop"]["levels"].as_integer(), Some(4));
        assert!(back["stop"].get("vertices").is_none());
        assert_eq!(back["domain"]["disk"]["size"].as_integer(), Some(1));
        assert_eq!(back["solve"]["a"]["b"].as_integer(), Some(1));
    }

    #[test]
    fn a_value_that_is_no_toml_is_a_string() {
        assert_eq!(
            applied("", &["solve.solver=active-set"]),
            "[solve]\nsolver = \"active-set\"\n"
        );
        assert_eq!(applied("", &["title="]), "title = \"\"\n");
    }

    #[test]
    fn malformed_overrides_are_refused() {
        for argument in ["", "stop.levels", "=3", "stop..levels=3", ".=1", "a b=1"] {
            let fault = parse(&[argument.to_owned()]).unwrap_err();
            assert!(fault.hint.is_some(), "{argument}");
        }
    }
}
