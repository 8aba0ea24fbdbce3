//! VTK XML files as a run writes them, read without the crate that wrote them.
//!
//! One piece, arrays inline in base64 behind a 64-bit length, little endian, not compressed. This reader takes nothing else, and
//! every mistake in a file is a message: no length or number in it is believed before it was checked against the bytes that
//! are there. `vtkio`, which writes these files, keeps no field data when it reads.

use std::collections::HashMap;

use crate::base64;

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
        let text = std::str::from_utf8(bytes).map_err(|_| "it is not text".to_owned())?;
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
                    file.arrays.push(tag.array(place, data)?);
                    if tag.kind == Kind::Open {
                        rest = &rest[length..];
                    }
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

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Open,
    Close,
    Empty,
}

struct Tag<'a> {
    kind: Kind,
    name: &'a str,
    attributes: Vec<(&'a str, &'a str)>,
}

impl<'a> Tag<'a> {
    /// What stands between `<` and `>`.
    fn parse(inside: &'a str) -> Result<Tag<'a>, String> {
        let (kind, inside) = match (inside.strip_prefix('/'), inside.strip_suffix('/')) {
            (Some(rest), _) => (Kind::Close, rest),
            (None, Some(rest)) => (Kind::Empty, rest),
            (None, None) => (Kind::Open, inside),
        };
        let (name, mut rest) = inside
            .split_once(char::is_whitespace)
            .unwrap_or((inside, ""));
        let mut attributes = Vec::new();
        let broken = || format!("the tag `{name}` is malformed");
        loop {
            rest = rest.trim_start();
            if rest.is_empty() {
                break;
            }
            let (key, after) = rest.split_once("=\"").ok_or_else(broken)?;
            let (value, after) = after.split_once('"').ok_or_else(broken)?;
            attributes.push((key, value));
            rest = after;
        }
        Ok(Tag {
            kind,
            name,
            attributes,
        })
    }

    fn attribute(&self, name: &str) -> Option<&'a str> {
        let found = self.attributes.iter().find(|(key, _)| *key == name);
        found.map(|(_, value)| *value)
    }

    fn check_header(&self, kind: &str) -> Result<(), String> {
        for (name, expected) in [
            ("type", Some(kind)),
            ("byte_order", Some("LittleEndian")),
            ("header_type", Some("UInt64")),
            ("version", Some("1.0")),
            ("compressor", None),
        ] {
            let found = self.attribute(name);
            if found != expected {
                let [found, expected] = [found, expected].map(|v| v.unwrap_or("absent"));
                return Err(format!("`{name}` is `{found}` instead of `{expected}`"));
            }
        }
        Ok(())
    }

    fn array(&self, place: &str, text: &str) -> Result<Array, String> {
        let name = self.attribute("Name").ok_or("an array has no name")?;
        if self.attribute("format") != Some("binary") {
            return Err(format!("the array `{name}` is not in base64"));
        }
        let bytes = base64::decode(text.trim().as_bytes())
            .ok_or_else(|| format!("the array `{name}` is not valid base64"))?;
        let (head, data) = bytes
            .split_first_chunk::<8>()
            .ok_or_else(|| format!("the array `{name}` has no length"))?;
        if u64::from_le_bytes(*head) != data.len() as u64 {
            return Err(format!("the array `{name}` is not as long as it says"));
        }
        let values = match self.attribute("type") {
            Some("Float64") => numbers(data, f64::from_le_bytes).map(Values::Real),
            Some("Int64") => numbers(data, i64::from_le_bytes).map(Values::Integer),
            Some("Int32") => {
                numbers(data, |b| i64::from(i32::from_le_bytes(b))).map(Values::Integer)
            }
            Some("UInt8") => Some(Values::Integer(
                data.iter().map(|&b| i64::from(b)).collect(),
            )),
            // Nothing that is counted comes near 2^63; what does is out of range wherever it is used.
            Some("UInt64") => numbers(data, |b| {
                i64::try_from(u64::from_le_bytes(b)).unwrap_or(i64::MAX)
            })
            .map(Values::Integer),
            other => {
                let other = other.unwrap_or("absent");
                return Err(format!("the array `{name}` has the unknown type `{other}`"));
            }
        };
        let values = values.ok_or_else(|| format!("the array `{name}` ends inside a number"))?;
        let components = if name == "Points" { 3 } else { 1 };
        let tuples = values.len() / components;
        for (key, expected) in [
            ("NumberOfComponents", components),
            ("NumberOfTuples", tuples),
        ] {
            if self
                .attribute(key)
                .is_some_and(|v| v.parse() != Ok(expected))
            {
                return Err(format!("`{key}` of the array `{name}` is wrong"));
            }
        }
        let bound = |key: &str| match self.attribute(key).map(str::parse) {
            None => Ok(None),
            Some(Ok(value)) => Ok(Some(value)),
            Some(Err(_)) => Err(format!("`{key}` of the array `{name}` is no number")),
        };
        let range = bound("RangeMin")?.zip(bound("RangeMax")?);
        Ok(Array {
            place: place.to_owned(),
            name: name.to_owned(),
            values,
            range: range.map(|(low, high)| [low, high]),
        })
    }
}

/// The numbers in a row of bytes; `None` if the last one is not complete.
fn numbers<const N: usize, T>(data: &[u8], read: impl Fn([u8; N]) -> T) -> Option<Vec<T>> {
    let (chunks, rest) = data.as_chunks::<N>();
    rest.is_empty()
        .then(|| chunks.iter().map(|&c| read(c)).collect())
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
