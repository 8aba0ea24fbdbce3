//! One tag of a VTK XML file, and the array that it stands for.

use std::borrow::Cow;

use super::{Array, Values};
use crate::appended::Appended;
use crate::base64;

/// What a tag does to its element.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Kind {
    Open,
    Close,
    Empty,
}

/// A tag in parts.
pub(super) struct Tag<'a> {
    pub kind: Kind,
    pub name: &'a str,
    pub attributes: Vec<(&'a str, &'a str)>,
}

impl<'a> Tag<'a> {
    /// What stands between `<` and `>`.
    pub fn parse(inside: &'a str) -> Result<Tag<'a>, String> {
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

    /// Whether the file is of the form that is read here.
    pub fn check_header(&self, kind: &str) -> Result<(), String> {
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

    /// Whether the block behind the text is of that form.
    pub fn check_encoding(&self) -> Result<(), String> {
        match self.attribute("encoding") {
            Some("raw") if self.kind == Kind::Open => Ok(()),
            _ => Err("the appended data are not raw".into()),
        }
    }

    /// The bytes of an array of this name, from the text inside its element or from the block.
    fn data<'b>(
        &self,
        name: &str,
        text: &str,
        appended: Option<&mut Appended<'b>>,
    ) -> Result<Cow<'b, [u8]>, String> {
        match (self.attribute("format"), appended) {
            (Some("binary"), _) => {
                let mut bytes = base64::decode(text.trim().as_bytes())
                    .ok_or_else(|| format!("the array `{name}` is not valid base64"))?;
                let (head, data) = bytes
                    .split_first_chunk::<8>()
                    .ok_or_else(|| format!("the array `{name}` has no length"))?;
                if u64::from_le_bytes(*head) != data.len() as u64 {
                    return Err(format!("the array `{name}` is not as long as it says"));
                }
                bytes.drain(..8);
                Ok(Cow::Owned(bytes))
            }
            (Some("appended"), Some(block)) if text.trim().is_empty() => block
                .next(self.attribute("offset"))
                .map(Cow::Borrowed)
                .map_err(|why| format!("the array `{name}` {why}")),
            (Some("appended"), None) => Err(format!(
                "the array `{name}` is missing, since there are no appended data"
            )),
            _ => Err(format!(
                "the array `{name}` is neither in base64 nor appended"
            )),
        }
    }

    /// The array of this element: `text` stands inside it, `appended` behind the text of the file.
    pub fn array(
        &self,
        place: &str,
        text: &str,
        appended: Option<&mut Appended<'_>>,
    ) -> Result<Array, String> {
        let name = self.attribute("Name").ok_or("an array has no name")?;
        let data = self.data(name, text, appended)?;
        let data = &*data;
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
