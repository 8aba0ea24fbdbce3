//! The texts that a scene is made of, and places in them.

use std::ops::Range;

use crate::error::{Excerpt, Report, SceneError};

/// Where something was written: a span of bytes in the scene file or in an override.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
pub struct Place {
    /// 0 for the scene file, k for the k-th `--set`.
    pub source: usize,
    /// Bytes of that text.
    pub span: Range<usize>,
}

impl Place {
    /// A span of the scene file.
    pub fn in_file(span: Range<usize>) -> Self {
        Place { source: 0, span }
    }
}

/// What was written, with its place.
#[derive(Clone, Debug, PartialEq)]
pub struct At<T> {
    /// What was written.
    pub value: T,
    /// Where.
    pub place: Place,
}

/// An error before it is shown: its place is still a span of bytes.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Fault {
    pub place: Option<Place>,
    pub message: String,
    pub hint: Option<String>,
}

impl Fault {
    pub fn at(place: &Place, message: impl Into<String>) -> Self {
        Fault {
            place: Some(place.clone()),
            message: message.into(),
            hint: None,
        }
    }

    pub fn nowhere(message: impl Into<String>) -> Self {
        Fault {
            place: None,
            message: message.into(),
            hint: None,
        }
    }

    pub fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }

    pub fn maybe_hint(mut self, hint: Option<String>) -> Self {
        self.hint = hint;
        self
    }
}

/// The scene file's text and the overrides.
#[derive(Clone, Debug)]
pub(crate) struct Sources<'a> {
    /// The scene file as messages name it.
    pub name: String,
    /// Its text.
    pub text: &'a str,
    /// Overrides as typed, `KEY=VALUE`.
    pub overrides: &'a [String],
}

impl Sources<'_> {
    /// The text that `place` is a part of.
    pub fn text_of(&self, place: &Place) -> &str {
        match place.source {
            0 => self.text,
            k => &self.overrides[k - 1],
        }
    }

    /// What was written at `place`.
    pub fn written(&self, place: &Place) -> &str {
        self.text_of(place)
            .get(place.span.clone())
            .unwrap_or_default()
    }

    /// The part `within` (bytes of the decoded text) of a string that was written at `place`.
    pub fn inside(&self, place: &Place, within: Range<usize>) -> Place {
        let raw = self.written(place);
        let start = place.span.start;
        Place {
            source: place.source,
            span: start + raw_offset(raw, within.start)..start + raw_offset(raw, within.end),
        }
    }

    /// The error with file, line, column and the line itself.
    pub fn report(&self, fault: Fault) -> SceneError {
        let mut report = Report {
            file: self.name.clone(),
            message: fault.message,
            hint: fault.hint,
            ..Report::default()
        };
        if let Some(place) = fault.place {
            let excerpt = excerpt(self.text_of(&place), place.span.clone());
            if place.source == 0 {
                report.line = Some(excerpt.0);
                report.column = Some(excerpt.1.start + 1);
            } else {
                report.file = "--set".into();
            }
            report.excerpt = Some(excerpt.1);
        }
        SceneError::new(report)
    }
}

/// The line that a span begins on, counted from 1, and the part of the span on it, in characters.
fn excerpt(text: &str, span: Range<usize>) -> (usize, Excerpt) {
    let start = floor(text, span.start);
    let before = &text[..start];
    let line_start = before.rfind('\n').map_or(0, |k| k + 1);
    let line_end = text[start..].find('\n').map_or(text.len(), |k| start + k);
    let line = text[line_start..line_end].trim_end_matches('\r');
    let start = start.min(line_start + line.len());
    let end = floor(text, span.end).clamp(start, line_start + line.len());
    let number = before.matches('\n').count() + 1;
    let column = text[line_start..start].chars().count();
    let length = text[start..end].chars().count().max(1);
    (
        number,
        Excerpt {
            line: line.to_owned(),
            start: column,
            length,
        },
    )
}

/// The largest character boundary that is not behind `at`.
fn floor(text: &str, at: usize) -> usize {
    let mut at = at.min(text.len());
    while !text.is_char_boundary(at) {
        at -= 1;
    }
    at
}

/// The byte of a quoted string, as written, that byte `decoded` of its meaning comes from.
///
/// `raw` is the whole token with its quotes; a text without quotes means itself.
fn raw_offset(raw: &str, decoded: usize) -> usize {
    let basic = raw.starts_with('"');
    if !basic && !raw.starts_with('\'') {
        return decoded.min(raw.len());
    }
    let mut at = 1;
    if raw.starts_with("\"\"\"") || raw.starts_with("'''") {
        at = 3;
        let rest = &raw[at..];
        at += usize::from(rest.starts_with('\n')) + 2 * usize::from(rest.starts_with("\r\n"));
    }
    let mut meant = 0;
    while meant < decoded {
        let Some(c) = raw[at..].chars().next() else {
            break;
        };
        if !(basic && c == '\\') {
            at += c.len_utf8();
            meant += c.len_utf8();
            continue;
        }
        let escape = raw[at + 1..].chars().next().unwrap_or(' ');
        at += 1 + escape.len_utf8();
        let digits = match escape {
            'u' => 4,
            'U' => 8,
            'x' => 2,
            _ => 0,
        };
        if escape.is_whitespace() {
            // A backslash at the end of a line joins it with the next text.
            at += raw[at..].len() - raw[at..].trim_start().len();
        } else if digits == 0 {
            meant += 1;
        } else {
            let code = raw.get(at..at + digits).unwrap_or_default();
            let char = u32::from_str_radix(code, 16).ok().and_then(char::from_u32);
            meant += char.map_or(1, char::len_utf8);
            at = (at + digits).min(raw.len());
        }
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offsets_in_quoted_strings() {
        assert_eq!(raw_offset("'x + y'", 4), 5);
        assert_eq!(raw_offset("\"x + y\"", 0), 1);
        assert_eq!(raw_offset("\"\"\"\nx + y\"\"\"", 2), 6);
        assert_eq!(raw_offset("'''\r\nx'''", 0), 5);
        assert_eq!(raw_offset("\"\\tx\"", 1), 3);
        assert_eq!(raw_offset("\"\\u00e9x\"", 2), 7);
        assert_eq!(raw_offset("\"é + x\"", 5), 6);
        assert_eq!(raw_offset("\"\"\"a \\\n   b\"\"\"", 2), 5);
        assert_eq!(raw_offset("\"\"\"a \\\n   b\"\"\"", 3), 11);
        assert_eq!(raw_offset("x + y", 4), 4);
        assert_eq!(raw_offset("\"x\"", 9), 3);
    }

    #[test]
    fn columns_count_characters() {
        let text = "title = \"Größe\"\r\nload = \"é + q\"\n";
        let at = text.find('q').unwrap();
        let (line, excerpt) = excerpt(text, at..at + 1);
        assert_eq!((line, excerpt.start, excerpt.length), (2, 12, 1));
        assert_eq!(excerpt.line, "load = \"é + q\"");
    }

    #[test]
    fn spans_at_and_beyond_the_end_are_safe() {
        let (line, found) = excerpt("a = 1", 5..5);
        assert_eq!((line, found.start, found.length), (1, 5, 1));
        let (line, found) = excerpt("a\nb\n", 99..200);
        assert_eq!((line, found.start, found.length), (3, 0, 1));
        let (line, found) = excerpt("ab\ncd", 1..5);
        assert_eq!((line, found.start, found.length), (1, 1, 1));
    }
}
