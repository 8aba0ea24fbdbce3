//! The parameters that a formula may name.

use crate::error::ScopeError;
use crate::function;
use std::collections::BTreeMap;

/// The parameters known to a formula besides `x`, `y`, `region`, `pi` and `e`: names with constant values, put in when
/// the formula is parsed.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Scope {
    values: BTreeMap<String, f64>,
}

impl Scope {
    /// A scope without parameters.
    pub fn new() -> Self {
        Self::default()
    }

    /// Defines a parameter; a second definition of a name replaces the first for formulas parsed from then on.
    ///
    /// # Errors
    ///
    /// [`ScopeError`] when the name is reserved or no identifier, or the value is not finite.
    pub fn define(&mut self, name: &str, value: f64) -> Result<(), ScopeError> {
        let owned = || name.to_owned();
        if function::is_reserved(name) {
            return Err(ScopeError::Reserved { name: owned() });
        }
        if !is_identifier(name) {
            return Err(ScopeError::Invalid { name: owned() });
        }
        if !value.is_finite() {
            return Err(ScopeError::NotFinite {
                name: owned(),
                value,
            });
        }
        self.values.insert(owned(), value);
        Ok(())
    }

    /// The value of a parameter; none when it is not defined.
    pub fn get(&self, name: &str) -> Option<f64> {
        self.values.get(name).copied()
    }

    /// The names defined, in alphabetical order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.values.keys().map(String::as_str)
    }
}

fn is_identifier(name: &str) -> bool {
    let mut bytes = name.bytes();
    bytes
        .next()
        .is_some_and(|first| first.is_ascii_alphabetic() || first == b'_')
        && bytes.all(|byte| byte.is_ascii_alphanumeric() || byte == b'_')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_defined_name_is_found_and_replaced() {
        let mut scope = Scope::new();
        assert_eq!(scope.get("g"), None);
        scope.define("g", 0.05).unwrap();
        scope.define("_g2", -1.0).unwrap();
        scope.define("g", 2.0).unwrap();
        assert_eq!(scope.get("g"), Some(2.0));
        assert_eq!(scope.names().collect::<Vec<_>>(), ["_g2", "g"]);
    }

    #[test]
    fn names_of_the_language_are_reserved() {
        for name in [
            "x", "y", "region", "pi", "e", "if", "sin", "log", "step", "atan2",
        ] {
            let refused = Scope::new().define(name, 1.0);
            assert!(
                matches!(refused, Err(ScopeError::Reserved { .. })),
                "{name}"
            );
        }
    }

    #[test]
    fn odd_names_and_values_are_refused() {
        for name in ["", "2g", "a-b", "a b", "µ", "g."] {
            let refused = Scope::new().define(name, 1.0);
            assert!(matches!(refused, Err(ScopeError::Invalid { .. })), "{name}");
        }
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let refused = Scope::new().define("g", value);
            assert!(
                matches!(refused, Err(ScopeError::NotFinite { .. })),
                "{value}"
            );
        }
    }
}
