//! VTK XML files as a run writes them, read without the crate that wrote them.
//!
//! One piece, arrays behind a 64-bit length, inline in base64 or as raw bytes behind the text, little endian, not compressed. This
//! reader takes nothing else, and every mistake in a file is a message: no length or number in it is believed before it was checked
//! against the bytes that are there. `vtkio` keeps no field data when it reads, and reads no raw bytes.

mod tag;

use std::collections::HashMap;

use self::tag::{Kind, Tag};
use crate::appended::Appended;

/// The numbers of an array.
#[derive(Clone, PartialEq, Debug)]
pub(crate) enum Values {
    /// Float64.
    Real(Vec<f64>),
    /// Int64, Int32, UInt8 and UInt64, the latter below 2^63.
    Integer(Vec<i64>),
}

impl Values {
    fn len(&self) -> usize {
        match self {
            Values::Real(values) => values.len(),
            Values::Integer(values) => values.len(),
        }
    }
}

/// An array with the element that it stands in.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Array {
    /// Name of the enclosing element, for example `PointData`.
    pub place: String,
    /// Its name.
    pub name: String,
    /// Its numbers, components of a tuple next to each other.
    pub values: Values,
    /// Smallest and largest number as the file states them beside the array.
    pub range: Option<[f64; 2]>,
}

/// A file in parts.
#[derive(Clone, PartialEq, Debug, Default)]
pub(crate) struct VtkFile {
    arrays: Vec<Array>,
    /// Attributes of the piece: `NumberOfPoints` and others.
    counts: HashMap<String, usize>,
}

impl VtkFile {
    /// Reads a file whose data set is a `kind`: `UnstructuredGrid` or `PolyData`.
    ///
    /// # Errors
    /// What is wrong with the file, in words.
    pub fn parse(bytes: &[u8], kind: &str) -> Result<VtkFile, String> {
        let (text, mut appended) = Appended::split(bytes)?;
        let text = std::str::from_utf8(text).map_err(|_| "it is not text".to_owned())?;
        let mut file = VtkFile::default();
        let mut open: Vec<&str> = Vec::new();
        let mut pieces = 0;
        let mut rest = text;
        let mut finished = false;
        while let Some(start) = rest.find('<') {
            let (between, tagged) = rest.split_at(start);
            if finished || !between.trim().is_empty() {
                return Err("there is text where none belongs".into());
            }
            let end = tagged.find('>').ok_or("it ends inside a tag")?;
            let tag = Tag::parse(&tagged[1..end])?;
            rest = &tagged[end + 1..];
            match tag.kind {
                Kind::Close => {
                    if open.pop() != Some(tag.name) {
                        return Err(format!("`</{}>` closes nothing", tag.name));
                    }
                    finished = open.is_empty();
                    continue;
                }
                Kind::Open | Kind::Empty => {}
            }
            match (tag.name, open.as_slice()) {
                ("VTKFile", []) => tag.check_header(kind)?,
                (name, ["VTKFile"]) if name == kind => {}
                ("FieldData", ["VTKFile", data]) if *data == kind => {}
                ("Piece", ["VTKFile", data]) if *data == kind => {
                    pieces += 1;
                    for (name, value) in &tag.attributes {
                        let count = value
                            .parse()
                            .map_err(|_| format!("`{name}` is `{value}`"))?;
                        file.counts.insert((*name).to_owned(), count);
                    }
                }
                ("DataArray", [.., place]) if open.len() > 2 => {
                    let length = rest.find('<').ok_or("it ends inside an array")?;
                    let data = if tag.kind == Kind::Empty {
                        ""
                    } else {
                        &rest[..length]
                    };
                    file.arrays.push(tag.array(place, data, appended.as_mut())?);
                    if tag.kind == Kind::Open {
                        rest = &rest[length..];
                    }
                }
                ("AppendedData", ["VTKFile"]) => {
                    tag.check_encoding()?;
                    let block = appended.take().ok_or("there are appended data twice")?;
                    rest = std::str::from_utf8(block.tail())
                        .map_err(|_| "there are bytes behind the last array".to_owned())?;
                }
                (_, ["VTKFile", data, "Piece"]) if *data == kind => {}
                _ => return Err(format!("`<{}>` does not belong there", tag.name)),
            }
            if tag.kind == Kind::Open {
                open.push(tag.name);
            }
        }
        if !finished || !rest.trim().is_empty() {
            return Err("it is cut off".into());
        }
        if pieces != 1 {
            return Err(format!("it has {pieces} pieces instead of one"));
        }
        let mut seen = std::collections::HashSet::new();
        match file
            .arrays
            .iter()
            .find(|a| !seen.insert((&a.place, &a.name)))
        {
            Some(twice) => Err(format!("the array `{}` is there twice", twice.name)),
            None => Ok(file),
        }
    }

    /// An attribute of the piece, for example `NumberOfPoints`.
    ///
    /// # Errors
    /// That it is missing.
    pub fn count(&self, name: &str) -> Result<usize, String> {
        let found = self.counts.get(name).copied();
        found.ok_or_else(|| format!("`{name}` is missing"))
    }

    /// Every array.
    pub fn arrays(&self) -> &[Array] {
        &self.arrays
    }

    fn find(&self, place: &str, name: &str) -> Option<&Array> {
        self.arrays
            .iter()
            .find(|a| a.place == place && a.name == name)
    }

    /// An array of doubles, none of them infinite or not a number; `Ok(None)` if it is not there.
    ///
    /// # Errors
    /// That it has another type, another length or a value that is not finite.
    pub fn real(&self, place: &str, name: &str, length: usize) -> Result<Option<Vec<f64>>, String> {
        match self.find(place, name).map(|a| &a.values) {
            None => Ok(None),
            Some(Values::Integer(_)) => Err(format!("the array `{name}` does not hold Float64")),
            Some(Values::Real(values)) => {
                check_length(name, values.len(), length)?;
                match values.iter().position(|v| !v.is_finite()) {
                    Some(k) => Err(format!("value {k} of `{name}` is {}", values[k])),
                    None => Ok(Some(values.clone())),
                }
            }
        }
    }

    /// An array of integers; `Ok(None)` if it is not there.
    ///
    /// # Errors
    /// That it has another type or length.
    pub fn integer(
        &self,
        place: &str,
        name: &str,
        length: usize,
    ) -> Result<Option<Vec<i64>>, String> {
        match self.find(place, name).map(|a| &a.values) {
            None => Ok(None),
            Some(Values::Real(_)) => Err(format!("the array `{name}` does not hold integers")),
            Some(Values::Integer(values)) => {
                check_length(name, values.len(), length)?;
                Ok(Some(values.clone()))
            }
        }
    }
}

fn check_length(name: &str, found: usize, expected: usize) -> Result<(), String> {
    if found == expected {
        Ok(())
    } else {
        Err(format!(
            "the array `{name}` has {found} values instead of {expected}"
        ))
    }
}

impl Array {
    /// Whether the smallest and largest number are those that the file states beside the array.
    pub fn range_holds(&self) -> bool {
        let Some([low, high]) = self.range else {
            return true;
        };
        let within = |values: &mut dyn Iterator<Item = f64>| {
            let found = values.fold(None, |range: Option<[f64; 2]>, v| {
                let [l, h] = range.unwrap_or([v, v]);
                Some([l.min(v), h.max(v)])
            });
            found.is_none_or(|found| found == [low, high])
        };
        match &self.values {
            Values::Real(values) => within(&mut values.iter().copied()),
            Values::Integer(values) => within(&mut values.iter().map(|&v| v as f64)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = "<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\"><PolyData><FieldData>\
        <DataArray type=\"Int64\" Name=\"level\" format=\"binary\">CAAAAAAAAAABAAAAAAAAAA==</DataArray></FieldData>\
        <Piece NumberOfPoints=\"7\"><CellData/><Points></Points></Piece></PolyData></VTKFile>\n";

    /// A file with an array of doubles and one of bytes behind its text; the bytes look like the end of it.
    fn raw() -> Vec<u8> {
        let head = "<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n<PolyData><FieldData>\
            <DataArray type=\"Float64\" Name=\"bound\" format=\"appended\" offset=\"0\"/></FieldData>\
            <Piece NumberOfPoints=\"7\"><CellData><DataArray type=\"UInt8\" Name=\"flag\" format=\"appended\" offset=\"24\"/></CellData>\
            </Piece></PolyData>\n<AppendedData encoding=\"raw\">\n_";
        [
            head.as_bytes(),
            &16u64.to_le_bytes(),
            &0.1f64.to_le_bytes(),
            &(-2.5f64).to_le_bytes(),
            &7u64.to_le_bytes(),
            b"\n</App_",
            b"\n</AppendedData>\n</VTKFile>\n",
        ]
        .concat()
    }

    fn changed(from: &str, to: &str) -> Result<VtkFile, String> {
        let raw = raw();
        let at = raw.windows(from.len()).position(|w| w == from.as_bytes());
        let at = at.expect("the text");
        let bytes = [&raw[..at], to.as_bytes(), &raw[at + from.len()..]].concat();
        VtkFile::parse(&bytes, "PolyData")
    }

    #[test]
    fn a_small_file_with_appended_data() {
        let file = VtkFile::parse(&raw(), "PolyData").unwrap();
        assert_eq!(file.count("NumberOfPoints"), Ok(7));
        let bound = file.real("FieldData", "bound", 2);
        assert_eq!(bound, Ok(Some(vec![0.1, -2.5])));
        let flag = b"\n</App_".iter().map(|&b| i64::from(b)).collect();
        assert_eq!(file.integer("CellData", "flag", 7), Ok(Some(flag)));
    }

    #[test]
    fn what_is_wrong_with_appended_data_is_said() {
        for (from, to, why) in [
            (
                "offset=\"24\"",
                "offset=\"16\"",
                "the array `flag` has the offset `16` instead of `24`",
            ),
            (
                "offset=\"0\"",
                "",
                "the array `bound` has the offset `absent` instead of `0`",
            ),
            (
                "encoding=\"raw\"",
                "encoding=\"base64\"",
                "the appended data are not raw",
            ),
            ("\"raw\">", "\"raw\"/>", "the appended data are not raw"),
            ("\n_", "\n", "the appended data do not begin with `_`"),
            ("\x07\0", "\x07\x01", "the array `flag` is cut off"),
            ("\x07\0", "\x06\0", "there is text where none belongs"),
            ("<AppendedData", "<AppendedDates", "it is not text"),
            (
                "type=\"UInt8\"",
                "type=\"Int32\"",
                "the array `flag` ends inside a number",
            ),
            (
                "\"bound\" format=\"appended\"",
                "\"bound\" format=\"ascii\"",
                "the array `bound` is neither in base64 nor appended",
            ),
            (
                "</AppendedData>\n",
                "</AppendedData><AppendedData encoding=\"raw\">_",
                "there are appended data twice",
            ),
            ("</AppendedData>\n", "", "`</VTKFile>` closes nothing"),
            (
                "</VTKFile>\n",
                "</VTKFile>\n<!",
                "there is text where none belongs",
            ),
        ] {
            assert_eq!(changed(from, to), Err(why.to_owned()), "{from} to {to}");
        }
    }

    #[test]
    fn every_cut_and_every_changed_byte_of_appended_data_is_a_message_or_another_file() {
        let raw = raw();
        let whole = VtkFile::parse(&raw, "PolyData").unwrap();
        let end = raw.len() - 1;
        for cut in 0..end {
            assert!(VtkFile::parse(&raw[..cut], "PolyData").is_err(), "{cut}");
        }
        let text = raw.windows(2).position(|w| w == b"<A").expect("a block");
        let cut = VtkFile::parse(&raw[..text], "PolyData");
        let why = "the array `bound` is missing, since there are no appended data";
        assert_eq!(cut, Err(why.to_owned()));
        let mut accepted = 0;
        for at in 0..end {
            for byte in [0, b'<', b'>', b'"', b'9', b'=', b'/', 255] {
                let mut bytes = raw.clone();
                bytes[at] = byte;
                accepted +=
                    usize::from(VtkFile::parse(&bytes, "PolyData").is_ok_and(|f| f == whole));
            }
        }
        assert!(accepted < 120, "{accepted}");
    }

    #[test]
    fn a_small_file() {
        let file = VtkFile::parse(FILE.as_bytes(), "PolyData").unwrap();
        assert_eq!(file.count("NumberOfPoints"), Ok(7));
        assert!(file.count("NumberOfCells").is_err());
        assert_eq!(file.integer("FieldData", "level", 1), Ok(Some(vec![1])));
        assert_eq!(file.integer("PointData", "level", 1), Ok(None));
        assert!(file.integer("FieldData", "level", 2).is_err());
        assert!(file.real("FieldData", "level", 1).is_err());
        assert!(VtkFile::parse(FILE.as_bytes(), "UnstructuredGrid").is_err());
    }

    #[test]
    fn every_cut_and_every_changed_byte_is_a_message_or_another_file() {
        let whole = VtkFile::parse(FILE.as_bytes(), "PolyData").unwrap();
        let end = FILE.trim_end().len();
        for cut in 0..end {
            assert!(
                VtkFile::parse(&FILE.as_bytes()[..cut], "PolyData").is_err(),
                "{cut}"
            );
        }
        let mut accepted = 0;
        for at in 0..end {
            for byte in [0, b'<', b'>', b'"', b'9', b'=', b'/', 255] {
                let mut bytes = FILE.as_bytes().to_vec();
                bytes[at] = byte;
                accepted +=
                    usize::from(VtkFile::parse(&bytes, "PolyData").is_ok_and(|f| f == whole));
            }
        }
        // Bytes that are replaced by themselves, and little else.
        assert!(accepted < 120, "{accepted}");
    }
}
