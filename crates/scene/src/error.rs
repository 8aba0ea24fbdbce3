//! What is wrong with a scene, and where.

use std::fmt;

/// Why a scene cannot be used. `Display` is the whole message, several lines without a final newline.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneError {
    report: Box<Report>,
}

/// The parts of a [`SceneError`].
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Report {
    /// The file at fault as the user named it, or `--set`.
    pub file: String,
    /// Its line, from 1; none where the error has no place.
    pub line: Option<usize>,
    /// Column on that line, from 1, in characters.
    pub column: Option<usize>,
    /// The line itself.
    pub excerpt: Option<Excerpt>,
    /// What is wrong: lower case, no final stop.
    pub message: String,
    /// What to do instead.
    pub hint: Option<String>,
    /// Whose fault it is.
    pub kind: Kind,
}

/// Whose fault an error is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Kind {
    /// The scene, the mesh or the command line is wrong.
    #[default]
    Input,
    /// A file that exists could not be read.
    Reading,
}

/// A line of text and the part of it that is at fault.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Excerpt {
    /// The line without its end.
    pub line: String,
    /// Characters before the part.
    pub start: usize,
    /// Characters of the part, at least 1.
    pub length: usize,
}

/// Longest piece of a line that is shown.
const WIDTH: usize = 100;

impl SceneError {
    /// An error from its parts.
    pub fn new(report: Report) -> Self {
        SceneError {
            report: Box::new(report),
        }
    }

    /// The parts of the error.
    pub fn report(&self) -> &Report {
        &self.report
    }

    /// Whether a file could not be read, as opposed to a mistake in what was read.
    pub fn is_reading(&self) -> bool {
        self.report.kind == Kind::Reading
    }
}

impl std::error::Error for SceneError {}

impl fmt::Display for SceneError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let report = &self.report;
        write!(f, "error: {}\n  --> {}", report.message, report.file)?;
        if let Some(line) = report.line {
            write!(f, ":{line}")?;
        }
        if let (Some(_), Some(column)) = (report.line, report.column) {
            write!(f, ":{column}")?;
        }
        if let Some(excerpt) = &report.excerpt {
            let number = report
                .line
                .map(|line| format!("{line} "))
                .unwrap_or_default();
            let margin = " ".repeat(number.len().max(3));
            let (line, pad, carets) = excerpt.shown();
            write!(
                f,
                "\n{margin}|\n{number:<width$}| {line}",
                width = margin.len()
            )?;
            write!(f, "\n{margin}| {pad}{carets}")?;
        }
        if let Some(hint) = &report.hint {
            write!(f, "\nhint: {hint}")?;
        }
        Ok(())
    }
}

impl Excerpt {
    /// The line (a window of it when it is long), what goes below it before the carets, and the carets.
    fn shown(&self) -> (String, String, String) {
        let chars: Vec<char> = self.line.chars().collect();
        let first = if chars.len() <= WIDTH || self.start < WIDTH / 2 {
            0
        } else {
            self.start - WIDTH / 4
        };
        let last = chars.len().min(first + WIDTH);
        let mut line: String = chars[first..last].iter().collect();
        let start = self.start.clamp(first, last);
        // Tabs stay tabs, so that the carets stand where the text does.
        let mut pad: String = chars[first..start]
            .iter()
            .map(|&c| if c == '\t' { '\t' } else { ' ' })
            .collect();
        if first > 0 {
            line.insert_str(0, "...");
            pad.insert_str(0, "   ");
        }
        if last < chars.len() {
            line.push_str("...");
        }
        let length = self.length.min((last - start).max(1));
        (line, pad, "^".repeat(length))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_with_everything() {
        let error = SceneError::new(Report {
            file: "plate.toml".into(),
            line: Some(12),
            column: Some(1),
            excerpt: Some(Excerpt {
                line: "tenson = 2.0".into(),
                start: 0,
                length: 6,
            }),
            message: "unknown key `tenson` in [upper]".into(),
            hint: Some("did you mean `tension`?".into()),
            kind: Kind::Input,
        });
        let expected = "error: unknown key `tenson` in [upper]\n  --> plate.toml:12:1\n   |\n12 | tenson = 2.0\n   | ^^^^^^\nhint: did you mean `tension`?";
        assert_eq!(error.to_string(), expected);
    }

    #[test]
    fn long_lines_are_cut_around_the_place() {
        let excerpt = Excerpt {
            line: format!("{}q{}", "\t".repeat(5), "x".repeat(200)),
            start: 5,
            length: 1,
        };
        let (line, pad, carets) = excerpt.shown();
        assert!(line.ends_with("xx...") && line.chars().count() == WIDTH + 3);
        assert_eq!((pad.as_str(), carets.as_str()), ("\t\t\t\t\t", "^"));
        let excerpt = Excerpt {
            line: "y".repeat(300),
            start: 290,
            length: 500,
        };
        let (line, pad, carets) = excerpt.shown();
        assert!(line.starts_with("...yy") && !line.ends_with('.'));
        assert_eq!(pad.len() + carets.len(), line.len());
    }
}
