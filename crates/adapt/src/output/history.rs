//! `history.csv`: one row a level.

use std::io::{self, Write};

use super::columns::{COLUMNS, Entry};
use crate::record::LevelRecord;

/// Writes the heading and one row for each level.
///
/// Numbers stand in the shortest decimal form that reads back as the same double; a column that does not apply, and a
/// number that is infinite or none, is empty. Lines end with a line feed.
///
/// # Errors
/// Those of `writer`.
pub fn write_history(writer: &mut impl Write, levels: &[LevelRecord]) -> io::Result<()> {
    let names: Vec<&str> = COLUMNS.iter().map(|column| column.name).collect();
    writeln!(writer, "{}", names.join(","))?;
    for level in levels {
        let row: Vec<String> = COLUMNS
            .iter()
            .map(|column| text((column.entry)(level)))
            .collect();
        writeln!(writer, "{}", row.join(","))?;
    }
    Ok(())
}

fn text(entry: Entry) -> String {
    match entry {
        Entry::Empty => String::new(),
        Entry::Count(count) => count.to_string(),
        Entry::Number(number) => shortest(number),
        Entry::Name(name) => name.to_string(),
    }
}

/// The shorter of the plain and the exponent form; both read back exactly. Empty for what is not finite.
fn shortest(number: f64) -> String {
    if !number.is_finite() {
        return String::new();
    }
    let (plain, exponent) = (format!("{number}"), format!("{number:e}"));
    if exponent.len() < plain.len() {
        exponent
    } else {
        plain
    }
}

#[cfg(test)]
mod tests {
    use super::shortest;

    #[test]
    fn numbers_are_short_and_read_back_exactly() {
        assert_eq!(shortest(0.1), "0.1");
        assert_eq!(shortest(1.0), "1");
        assert_eq!(shortest(-0.0), "-0");
        assert_eq!(shortest(1e-9), "1e-9");
        assert_eq!(shortest(1e300), "1e300");
        assert_eq!(shortest(f64::NAN), "");
        assert_eq!(shortest(f64::NEG_INFINITY), "");
        // A walk through doubles of every size.
        let mut bits = 1u64;
        while bits < f64::INFINITY.to_bits() {
            let number = f64::from_bits(bits);
            let back: f64 = shortest(number).parse().unwrap();
            assert_eq!(back.to_bits(), bits);
            bits += 0x0003_5a7b_39c1_d2e5;
        }
    }
}
