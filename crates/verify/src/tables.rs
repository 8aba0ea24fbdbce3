//! The history and the summary: what stands in their cells.

use adapt::output::columns::COLUMNS;
use serde_json::Value;

use crate::number::Number;
use crate::report::{Report, show};

/// A cell of the history or a value of the summary.
#[derive(Clone, PartialEq, Debug)]
pub(crate) enum Cell {
    /// Empty, or null.
    Empty,
    /// A number.
    Number(f64),
    /// Anything else.
    Text(String),
}

impl Cell {
    fn of_text(text: &str) -> Cell {
        match text.parse() {
            _ if text.is_empty() => Cell::Empty,
            Ok(number) => Cell::Number(number),
            Err(_) => Cell::Text(text.to_owned()),
        }
    }

    /// The cell of a JSON value; of none, empty.
    pub fn of_json(value: Option<&Value>) -> Cell {
        match value {
            None | Some(Value::Null) => Cell::Empty,
            Some(Value::String(text)) => Cell::Text(text.clone()),
            Some(value) => match value.as_f64() {
                Some(number) => Cell::Number(number),
                None => Cell::Text(value.to_string()),
            },
        }
    }

    /// As in the file.
    pub fn shown(&self) -> String {
        match self {
            Cell::Empty => "empty".into(),
            Cell::Number(number) => show(*number),
            Cell::Text(text) => text.clone(),
        }
    }

    /// The number, if it is one.
    pub fn number(&self) -> Option<f64> {
        match self {
            Cell::Number(number) => Some(*number),
            _ => None,
        }
    }
}

/// The history: one row a level, one cell a column.
pub(crate) struct History {
    rows: Vec<Vec<Cell>>,
}

impl History {
    /// Reads the rows below the names.
    ///
    /// # Errors
    /// What is wrong with the file, in words.
    pub fn parse(bytes: &[u8]) -> Result<History, String> {
        let text = std::str::from_utf8(bytes).map_err(|_| "it is not text".to_owned())?;
        let mut lines = text.lines();
        let names: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
        if !names.iter().copied().eq(COLUMNS.iter().map(|c| c.name)) {
            return Err(
                "its first line does not hold the names of the columns of this version".into(),
            );
        }
        let mut rows = Vec::new();
        for (k, line) in lines.enumerate() {
            let row: Vec<Cell> = line.split(',').map(Cell::of_text).collect();
            if row.len() != COLUMNS.len() {
                return Err(format!(
                    "row {k} has {} cells instead of {}",
                    row.len(),
                    COLUMNS.len()
                ));
            }
            rows.push(row);
        }
        if !text.ends_with('\n') {
            return Err("its last line does not end".into());
        }
        Ok(History { rows })
    }

    /// Number of levels.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// A cell; `None` beyond the last row or for an unknown name.
    pub fn cell(&self, level: usize, name: &str) -> Option<&Cell> {
        let column = COLUMNS.iter().position(|c| c.name == name)?;
        self.rows.get(level)?.get(column)
    }

    /// A text; none where the cell is empty or a number.
    pub fn text(&self, level: usize, name: &str) -> Option<&str> {
        match self.cell(level, name)? {
            Cell::Text(text) => Some(text),
            _ => None,
        }
    }

    /// A number; none where the cell is empty or no number.
    pub fn number(&self, level: usize, name: &str) -> Option<f64> {
        self.cell(level, name)?.number()
    }
}

/// What should stand in a cell.
#[derive(Clone, PartialEq, Debug)]
pub(crate) enum Entry {
    /// Nothing.
    Empty,
    /// One of these counts.
    Count(Vec<usize>),
    /// A number.
    Number(Number),
    /// A name.
    Name(&'static str),
    /// Something that cannot be recomputed: a time, memory, the way of the solver.
    Covered,
}

impl From<Option<Number>> for Entry {
    fn from(number: Option<Number>) -> Self {
        number.map_or(Entry::Empty, Entry::Number)
    }
}

/// Compares a cell with what should stand in it.
pub(crate) fn compare(report: &mut Report, file: &str, name: &str, cell: &Cell, entry: &Entry) {
    let shown = cell.shown();
    match (entry, cell) {
        (Entry::Covered, _) => {}
        (Entry::Number(expected), Cell::Number(claimed)) => {
            report.number(file, name, *claimed, *expected);
        }
        // No file can hold it.
        (Entry::Number(expected), Cell::Empty) if !expected.physical().is_finite() => {
            report.claims += 1;
        }
        (Entry::Number(expected), _) => {
            report.same(file, name, shown, show(expected.physical()));
        }
        (Entry::Count(counts), _) => {
            let found = cell.number();
            let fits = counts.iter().any(|&n| found == Some(n as f64));
            let list: Vec<String> = counts.iter().map(usize::to_string).collect();
            let recomputed = if fits {
                shown.clone()
            } else {
                list.join("` or `")
            };
            report.same(file, name, shown, recomputed);
        }
        (Entry::Name(expected), _) => report.same(file, name, shown, (*expected).to_owned()),
        (Entry::Empty, _) => report.same(file, name, shown, "empty".to_owned()),
    }
}
