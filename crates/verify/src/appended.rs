//! The block of raw bytes behind the text of a VTK XML file: `<AppendedData encoding="raw">`.
//!
//! It is no XML: the bytes may be any. So it is cut off before the text is read, and its end is found by the lengths in it.

/// The first bytes of its element.
const ELEMENT: &[u8] = b"<AppendedData";

/// Arrays behind each other, each behind its length.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Appended<'a> {
    /// What was not read yet, and whatever follows the block.
    rest: &'a [u8],
    /// Bytes of the block that were read.
    read: u64,
}

impl<'a> Appended<'a> {
    /// The text of a file up to the tag of the element, the tag included, and the block, if there is one.
    ///
    /// # Errors
    /// A block that does not begin as it must.
    pub fn split(bytes: &'a [u8]) -> Result<(&'a [u8], Option<Appended<'a>>), String> {
        let Some(start) = find(bytes, ELEMENT) else {
            return Ok((bytes, None));
        };
        let end = find(&bytes[start..], b">").ok_or("it ends inside a tag")?;
        let (text, rest) = bytes.split_at(start + end + 1);
        let rest = rest.trim_ascii_start();
        let rest = rest
            .strip_prefix(b"_")
            .ok_or("the appended data do not begin with `_`")?;
        Ok((text, Some(Appended { rest, read: 0 })))
    }

    /// The bytes of the next array, which must be the one at `offset`, so that every byte of the block belongs to one array.
    ///
    /// # Errors
    /// Another offset, or a length beyond the end of the file; without the name of the array.
    pub fn next(&mut self, offset: Option<&str>) -> Result<&'a [u8], String> {
        if offset.and_then(|o| o.parse().ok()) != Some(self.read) {
            let offset = offset.unwrap_or("absent");
            return Err(format!(
                "has the offset `{offset}` instead of `{}`",
                self.read
            ));
        }
        let cut = || "is cut off".to_owned();
        let (head, rest) = self.rest.split_first_chunk::<8>().ok_or_else(cut)?;
        let length = u64::from_le_bytes(*head);
        let data = usize::try_from(length).ok().and_then(|l| rest.get(..l));
        let data = data.ok_or_else(cut)?;
        self.rest = &rest[data.len()..];
        // Both are less than the length of a file.
        self.read += 8 + length;
        Ok(data)
    }

    /// What follows the last array.
    pub fn tail(&self) -> &'a [u8] {
        self.rest
    }
}

/// Where the bytes of `wanted` first stand.
fn find(bytes: &[u8], wanted: &[u8]) -> Option<usize> {
    bytes.windows(wanted.len()).position(|w| w == wanted)
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &[u8] = b"<a><AppendedData encoding=\"raw\">\n _\x02\0\0\0\0\0\0\0<_\0\0\0\0\0\0\0\0\n</AppendedData>";

    #[test]
    fn arrays_are_taken_one_after_the_other() {
        let (text, block) = Appended::split(FILE).unwrap();
        assert_eq!(text, b"<a><AppendedData encoding=\"raw\">");
        let mut block = block.unwrap();
        assert_eq!(block.next(Some("0")), Ok(&b"<_"[..]));
        for offset in [
            None,
            Some("0"),
            Some("9"),
            Some("11"),
            Some("-10"),
            Some("ten"),
        ] {
            assert!(block.clone().next(offset).is_err(), "{offset:?}");
        }
        assert_eq!(block.next(Some("10")), Ok(&b""[..]));
        assert_eq!(block.tail(), b"\n</AppendedData>");
        assert!(block.next(Some("18")).is_err(), "the text is no length");
    }

    #[test]
    fn a_file_without_a_block_and_one_that_is_cut() {
        assert!(matches!(
            Appended::split(b"<a></a>"),
            Ok((b"<a></a>", None))
        ));
        let underscore = FILE.iter().position(|&b| b == b'_').unwrap();
        for cut in 3 + ELEMENT.len()..=underscore {
            assert!(Appended::split(&FILE[..cut]).is_err(), "{cut}");
        }
        for cut in underscore + 1..underscore + 11 {
            let (_, block) = Appended::split(&FILE[..cut]).unwrap();
            assert!(block.unwrap().next(Some("0")).is_err(), "{cut}");
        }
    }
}
