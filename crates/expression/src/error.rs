//! What can go wrong: a formula that does not parse, a name that cannot be defined.

use std::ops::Range;

/// A formula that cannot be understood: where, why, and what to write instead.
///
/// Displayed as the message and, when there is one, the hint on a line of its own. `span` counts bytes of the source
/// and lies within it; at an unexpected end it is empty and sits behind the last byte.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{message}{}", .hint.as_ref().map(|hint| format!("\nhint: {hint}")).unwrap_or_default())]
pub struct ParseError {
    /// The bytes of the source that the message is about.
    pub span: Range<usize>,
    /// What is wrong: lower case, without a final stop.
    pub message: String,
    /// What to write instead, when that can be guessed.
    pub hint: Option<String>,
}

impl ParseError {
    pub(crate) fn new(span: Range<usize>, message: impl Into<String>) -> Self {
        Self {
            span,
            message: message.into(),
            hint: None,
        }
    }

    pub(crate) fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }
}

/// A parameter that cannot be defined.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ScopeError {
    /// The name belongs to the language: a variable, a constant or a function.
    #[error("`{name}` is a name of the expression language and cannot be redefined")]
    Reserved {
        /// The name refused.
        name: String,
    },
    /// The name is not a letter or `_` followed by letters, digits and `_` (all of ASCII).
    #[error(
        "`{name}` cannot be a name in an expression\nhint: use letters, digits and `_`, not beginning with a digit"
    )]
    Invalid {
        /// The name refused.
        name: String,
    },
    /// The value is infinite or not a number.
    #[error("the value of `{name}` is {value}, not a finite number")]
    NotFinite {
        /// The name refused.
        name: String,
        /// The value refused.
        value: f64,
    },
}
