//! Cuts a formula into tokens.

use crate::error::ParseError;
use crate::function::{Binary, Unary};
use std::ops::Range;

/// What a token is; its text is the source at its span.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Kind {
    Number(f64),
    Name,
    /// An operator between operands; `+` and `-` may be signs too.
    Infix(Binary),
    /// An operator only before an operand.
    Prefix(Unary),
    Open,
    Close,
    Comma,
    End,
    /// No token: the complaint to make when the parser gets here.
    Bad(Box<ParseError>),
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Token {
    pub(crate) kind: Kind,
    pub(crate) span: Range<usize>,
}

pub(crate) struct Lexer<'s> {
    source: &'s str,
    at: usize,
}

/// Operators, the longer before those they begin with.
const OPERATORS: [(&str, Kind); 17] = [
    ("<=", Kind::Infix(Binary::Le)),
    (">=", Kind::Infix(Binary::Ge)),
    ("==", Kind::Infix(Binary::Eq)),
    ("!=", Kind::Infix(Binary::Ne)),
    ("&&", Kind::Infix(Binary::And)),
    ("||", Kind::Infix(Binary::Or)),
    ("<", Kind::Infix(Binary::Lt)),
    (">", Kind::Infix(Binary::Gt)),
    ("+", Kind::Infix(Binary::Add)),
    ("-", Kind::Infix(Binary::Sub)),
    ("*", Kind::Infix(Binary::Mul)),
    ("/", Kind::Infix(Binary::Div)),
    ("^", Kind::Infix(Binary::Pow)),
    ("!", Kind::Prefix(Unary::Not)),
    ("(", Kind::Open),
    (")", Kind::Close),
    (",", Kind::Comma),
];

/// What people write that is not of the language, the longer first, and what to say to it.
const MISTAKES: [(&str, &str, &str); 22] = [
    ("**", "`**` is not an operator", "write `^` for a power"),
    ("=<", "`=<` is not an operator", "write `<=`"),
    ("=>", "`=>` is not an operator", "write `>=`"),
    ("<>", "`<>` is not an operator", "write `!=`"),
    ("=", "`=` is not an operator", "write `==` to compare"),
    ("&", "`&` is not an operator", "write `&&` for and"),
    (
        "|",
        "`|` is not an operator",
        "write `||` for or, `abs(...)` for the absolute value",
    ),
    (
        "?",
        "`?` is not an operator",
        "write `if(condition, then, else)`",
    ),
    (
        "%",
        "`%` is not an operator",
        "write `a - b*floor(a/b)` for a remainder",
    ),
    (";", "unexpected `;`", "separate arguments with `,`"),
    ("[", "unexpected `[`", "group with `(` and `)`"),
    ("]", "unexpected `]`", "group with `(` and `)`"),
    ("{", "unexpected `{`", "group with `(` and `)`"),
    ("}", "unexpected `}`", "group with `(` and `)`"),
    ("²", "unexpected character `²`", "write `^2`"),
    ("³", "unexpected character `³`", "write `^3`"),
    ("π", "unexpected character `π`", "write `pi`"),
    ("×", "unexpected character `×`", "write `*`"),
    ("·", "unexpected character `·`", "write `*`"),
    (
        "−",
        "unexpected character `−`",
        "write `-`, the plain minus sign",
    ),
    ("≤", "unexpected character `≤`", "write `<=`"),
    ("≥", "unexpected character `≥`", "write `>=`"),
];

impl<'s> Lexer<'s> {
    pub(crate) fn new(source: &'s str) -> Self {
        Self { source, at: 0 }
    }

    /// The next token; at the end, and behind a bad one, `End` for ever.
    pub(crate) fn next(&mut self) -> Token {
        let blank = self.rest().len() - self.rest().trim_start().len();
        self.at += blank;
        let start = self.at;
        let (kind, length) = self.token();
        self.at += length;
        Token {
            kind,
            span: start..self.at,
        }
    }

    fn rest(&self) -> &'s str {
        &self.source[self.at..]
    }

    fn token(&self) -> (Kind, usize) {
        let rest = self.rest();
        let Some(first) = rest.chars().next() else {
            return (Kind::End, 0);
        };
        let second = rest.as_bytes().get(1);
        if first.is_ascii_digit() || (first == '.' && second.is_some_and(u8::is_ascii_digit)) {
            return self.number();
        }
        if first.is_ascii_alphabetic() || first == '_' {
            let more = |c: char| c.is_ascii_alphanumeric() || c == '_';
            return (Kind::Name, rest.find(|c| !more(c)).unwrap_or(rest.len()));
        }
        let mistake = |(text, message, hint): &(&str, &str, &str)| {
            let bad = ParseError::new(self.at..self.at + text.len(), *message).hint(*hint);
            (Kind::Bad(Box::new(bad)), text.len())
        };
        // `==` is an operator, and `=` alone is not: operators first, but for the two that begin with a shorter one.
        let begins = |entry: &&(&str, &str, &str)| rest.starts_with(entry.0);
        if let Some(found) = MISTAKES
            .iter()
            .filter(|entry| matches!(entry.0, "**" | "<>"))
            .find(begins)
        {
            return mistake(found);
        }
        if let Some((text, kind)) = OPERATORS.iter().find(|(text, _)| rest.starts_with(text)) {
            return (kind.clone(), text.len());
        }
        if let Some(found) = MISTAKES.iter().find(begins) {
            return mistake(found);
        }
        let length = first.len_utf8();
        let message = format!("unexpected character `{}`", first.escape_debug());
        let bad = ParseError::new(self.at..self.at + length, message);
        (Kind::Bad(Box::new(bad)), length)
    }

    /// Digits with at most one point, and an exponent if digits follow it.
    fn number(&self) -> (Kind, usize) {
        let bytes = self.rest().as_bytes();
        let digits = |from: usize| {
            bytes[from..]
                .iter()
                .take_while(|byte| byte.is_ascii_digit())
                .count()
        };
        let mut length = digits(0);
        if bytes.get(length) == Some(&b'.') {
            length += 1;
            length += digits(length);
        }
        let mantissa = length;
        if matches!(bytes.get(length), Some(b'e' | b'E')) {
            let sign = usize::from(matches!(bytes.get(length + 1), Some(b'+' | b'-')));
            let start = length + 1 + sign;
            if bytes.get(start).is_some_and(u8::is_ascii_digit) {
                length = start + digits(start);
            }
        }
        let text = &self.rest()[..length];
        let vanishes = |value: f64| {
            value == 0.0
                && bytes[..mantissa]
                    .iter()
                    .any(|byte| (b'1'..=b'9').contains(byte))
        };
        match text.parse::<f64>() {
            Ok(value) if value.is_finite() && !vanishes(value) => (Kind::Number(value), length),
            _ => {
                let bad = ParseError::new(
                    self.at..self.at + length,
                    format!("the number `{text}` is out of range"),
                )
                .hint("the size of a number is between about 5e-324 and 1.8e308");
                (Kind::Bad(Box::new(bad)), length)
            }
        }
    }
}
