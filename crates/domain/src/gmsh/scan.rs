//! Reads the numbers of a mesh file one after the other, ASCII or binary, and knows where it is.
//!
//! Data come in rows. In ASCII a row is one line (blank lines before it are skipped), in binary it
//! is only a place to report.

use super::error::{Flaw, GmshFault, Place};

/// How numbers are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Encoding {
    Ascii,
    Binary { big_endian: bool, size_bytes: usize },
}

/// A position in a mesh file.
#[derive(Clone, Debug)]
pub(crate) struct Scanner<'a> {
    bytes: &'a [u8],
    pos: usize,
    /// Line of `pos`; only kept up to date in text.
    line: usize,
    /// Where the current row starts.
    row: usize,
    /// Name of the current section.
    section: &'a str,
    pub encoding: Encoding,
}

pub(crate) type Scan<T> = Result<T, Flaw>;

fn is_blank(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | b'\r')
}

/// The beginning of some text, for messages.
pub(crate) fn excerpt(bytes: &[u8]) -> String {
    const MOST: usize = 40;
    let line = bytes.split(|&b| b == b'\n').next().unwrap_or_default();
    let text = String::from_utf8_lossy(&line[..line.len().min(MOST)]);
    let text: String = text
        .trim()
        .chars()
        .map(|c| if c.is_control() { '.' } else { c })
        .collect();
    if line.len() > MOST {
        text + "..."
    } else {
        text
    }
}

impl<'a> Scanner<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        Self {
            bytes,
            pos: 0,
            line: 1,
            row: 0,
            section: "MeshFormat",
            encoding: Encoding::Ascii,
        }
    }

    /// The place of the current row.
    pub fn place(&self) -> Place {
        self.place_at(self.row_position())
    }

    /// The place that [`Self::row_position`] stands for.
    pub fn place_at(&self, position: usize) -> Place {
        match self.encoding {
            Encoding::Ascii => Place::Line(position),
            Encoding::Binary { .. } => Place::Byte(position),
        }
    }

    /// The current row as a number: its line in ASCII, its offset in binary.
    pub fn row_position(&self) -> usize {
        match self.encoding {
            Encoding::Ascii => self.line,
            Encoding::Binary { .. } => self.row,
        }
    }

    pub fn flaw(&self, fault: GmshFault) -> Flaw {
        Flaw {
            place: self.place(),
            fault,
        }
    }

    fn truncated(&self) -> Flaw {
        self.flaw(GmshFault::Truncated {
            section: self.section.to_string(),
        })
    }

    /// What is left of the file.
    pub fn rest(&self) -> &'a [u8] {
        &self.bytes[self.pos..]
    }

    fn skip_white(&mut self) {
        while let Some(&byte) = self.bytes.get(self.pos) {
            if byte == b'\n' {
                self.line += 1;
            } else if !is_blank(byte) {
                break;
            }
            self.pos += 1;
        }
        self.row = self.pos;
    }

    /// The next line that is not blank, without white space around it; `None` at the end.
    pub fn text_line(&mut self) -> Option<&'a [u8]> {
        self.skip_white();
        let rest = self.rest();
        if rest.is_empty() {
            return None;
        }
        let end = rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
        self.pos += end;
        Some(rest[..end].trim_ascii_end())
    }

    /// Steps over the end of the line that [`Self::text_line`] gave: binary data start there.
    pub fn end_line(&mut self) {
        if self.bytes.get(self.pos) == Some(&b'\n') {
            self.pos += 1;
            self.line += 1;
        }
    }

    /// The next section's name, `None` at the end of the file.
    pub fn section(&mut self) -> Scan<Option<&'a str>> {
        let Some(line) = self.text_line() else {
            return Ok(None);
        };
        let name = line
            .strip_prefix(b"$")
            .and_then(|name| std::str::from_utf8(name).ok())
            .filter(|name| !name.is_empty() && name.bytes().all(|b| b.is_ascii_alphanumeric()));
        match name {
            Some(name) => {
                self.end_line();
                self.section = name;
                Ok(Some(name))
            }
            None => Err(self.flaw(GmshFault::NoSection {
                found: excerpt(line),
            })),
        }
    }

    /// Checks that section `name` ends here.
    pub fn end_section(&mut self, name: &'static str) -> Scan<()> {
        let Some(line) = self.text_line() else {
            return Err(self.truncated());
        };
        if line.strip_prefix(b"$End") == Some(name.as_bytes()) {
            return Ok(());
        }
        let found = excerpt(line);
        Err(self.flaw(GmshFault::SectionEnd {
            section: name,
            found,
        }))
    }

    /// Goes behind the end of the current section without looking at its content.
    pub fn skip_section(&mut self) -> Scan<()> {
        let end = format!("$End{}", self.section);
        let rest = self.rest();
        let Some(at) = find(rest, end.as_bytes()) else {
            return Err(self.truncated());
        };
        self.line += rest[..at].iter().filter(|&&b| b == b'\n').count();
        self.pos += at + end.len();
        Ok(())
    }

    /// Starts a row of numbers.
    pub fn begin_row(&mut self) {
        match self.encoding {
            Encoding::Ascii => self.skip_white(),
            Encoding::Binary { .. } => self.row = self.pos,
        }
    }

    /// Checks that the row ends here.
    pub fn end_row(&mut self) -> Scan<()> {
        if self.encoding == Encoding::Ascii {
            self.skip_blank();
            if let Some(&byte) = self.bytes.get(self.pos)
                && byte != b'\n'
            {
                let found = excerpt(self.rest());
                return Err(self.flaw(GmshFault::TooLong { found }));
            }
        }
        Ok(())
    }

    fn skip_blank(&mut self) {
        while self.bytes.get(self.pos).is_some_and(|&b| is_blank(b)) {
            self.pos += 1;
        }
    }

    /// The next word of the row.
    pub fn word(&mut self, what: &'static str) -> Scan<&'a str> {
        self.skip_blank();
        let rest = self.rest();
        let end = rest
            .iter()
            .position(|&b| b == b'\n' || is_blank(b))
            .unwrap_or(rest.len());
        if end == 0 {
            return Err(if rest.is_empty() {
                self.truncated()
            } else {
                self.flaw(GmshFault::TooShort { what })
            });
        }
        self.pos += end;
        std::str::from_utf8(&rest[..end]).map_err(|_| self.bad(what, excerpt(&rest[..end])))
    }

    fn bad(&self, what: &'static str, found: impl ToString) -> Flaw {
        let found = found.to_string();
        self.flaw(GmshFault::Number { what, found })
    }

    fn parse<T: std::str::FromStr>(&mut self, what: &'static str) -> Scan<T> {
        let word = self.word(what)?;
        word.parse().map_err(|_| self.bad(what, word))
    }

    fn take<const N: usize>(&mut self, big_endian: bool) -> Scan<[u8; N]> {
        let Some(found) = self.rest().first_chunk::<N>() else {
            return Err(self.truncated());
        };
        self.pos += N;
        let mut bytes = *found;
        if big_endian {
            bytes.reverse();
        }
        Ok(bytes)
    }

    /// The next `int`.
    pub fn int(&mut self, what: &'static str) -> Scan<i32> {
        match self.encoding {
            Encoding::Ascii => self.parse(what),
            Encoding::Binary { big_endian, .. } => Ok(i32::from_le_bytes(self.take(big_endian)?)),
        }
    }

    /// The next `size_t`.
    pub fn size(&mut self, what: &'static str) -> Scan<u64> {
        match self.encoding {
            Encoding::Ascii => self.parse(what),
            Encoding::Binary {
                big_endian,
                size_bytes: 4,
            } => Ok(u64::from(u32::from_le_bytes(self.take(big_endian)?))),
            Encoding::Binary { big_endian, .. } => Ok(u64::from_le_bytes(self.take(big_endian)?)),
        }
    }

    /// The next tag of a version 2.2 file: a positive `int`, in ASCII also a larger one.
    pub fn tag(&mut self, what: &'static str) -> Scan<u64> {
        let tag: i64 = match self.encoding {
            Encoding::Ascii => self.parse(what)?,
            Encoding::Binary { .. } => i64::from(self.int(what)?),
        };
        match u64::try_from(tag) {
            Ok(tag) if tag > 0 => Ok(tag),
            _ => Err(self.bad(what, tag)),
        }
    }

    /// The next `double`.
    pub fn double(&mut self, what: &'static str) -> Scan<f64> {
        match self.encoding {
            Encoding::Ascii => self.parse(what),
            Encoding::Binary { big_endian, .. } => Ok(f64::from_le_bytes(self.take(big_endian)?)),
        }
    }

    /// A count that stands on a line of its own, in text also in binary files.
    pub fn count_line(&mut self, what: &'static str) -> Scan<u64> {
        let Some(line) = self.text_line() else {
            return Err(self.truncated());
        };
        let number = std::str::from_utf8(line).ok().and_then(|s| s.parse().ok());
        let number = number.ok_or_else(|| self.bad(what, excerpt(line)))?;
        self.end_line();
        Ok(number)
    }

    /// Checks that the rest of the file can hold `count` items of at least `bytes` bytes each
    /// (2 in ASCII).
    pub fn claim(&self, count: u64, bytes: usize, what: &'static str) -> Scan<usize> {
        let least = match self.encoding {
            Encoding::Ascii => 2,
            Encoding::Binary { .. } => bytes.max(1),
        };
        // One more: the last line of a file may lack its end.
        match usize::try_from(count) {
            Ok(n) if n <= self.rest().len() / least + 1 => Ok(n),
            _ => Err(self.flaw(GmshFault::Count { what, count })),
        }
    }
}

/// Where `pattern` first occurs.
fn find(text: &[u8], pattern: &[u8]) -> Option<usize> {
    let first = *pattern.first()?;
    let mut from = 0;
    while let Some(at) = text[from..].iter().position(|&b| b == first) {
        from += at;
        if text[from..].starts_with(pattern) {
            return Some(from);
        }
        from += 1;
    }
    None
}
