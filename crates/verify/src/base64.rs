//! Base64 (RFC 4648, section 4) as VTK writes arrays: no line breaks, padded.

/// The bytes of a text; `None` where it is not base64.
pub(crate) fn decode(text: &[u8]) -> Option<Vec<u8>> {
    if !text.len().is_multiple_of(4) {
        return None;
    }
    let padding = text.iter().rev().take_while(|&&c| c == b'=').count();
    if padding > 2 {
        return None;
    }
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3);
    let digits = &text[..text.len() - padding];
    for group in digits.chunks(4) {
        let mut word = 0u32;
        for &digit in group {
            word = word << 6 | value(digit)?;
        }
        // A last group of two or three digits holds one or two bytes; what is left over must be zero.
        let spare = 4 - group.len() as u32;
        word <<= 6 * spare;
        let kept = 3 - spare as usize;
        let [_, rest @ ..] = word.to_be_bytes();
        if rest[kept..].iter().any(|&b| b != 0) {
            return None;
        }
        bytes.extend_from_slice(&rest[..kept]);
    }
    Some(bytes)
}

fn value(digit: u8) -> Option<u32> {
    Some(u32::from(match digit {
        b'A'..=b'Z' => digit - b'A',
        b'a'..=b'z' => digit - b'a' + 26,
        b'0'..=b'9' => digit - b'0' + 52,
        b'+' => 62,
        b'/' => 63,
        _ => return None,
    }))
}

#[cfg(test)]
mod tests {
    use super::decode;

    #[test]
    fn the_examples_of_the_standard() {
        for (text, bytes) in [
            ("", ""),
            ("Zg==", "f"),
            ("Zm8=", "fo"),
            ("Zm9v", "foo"),
            ("Zm9vYg==", "foob"),
            ("Zm9vYmE=", "fooba"),
            ("Zm9vYmFy", "foobar"),
        ] {
            assert_eq!(decode(text.as_bytes()).as_deref(), Some(bytes.as_bytes()));
        }
        assert_eq!(decode(b"+/+/").as_deref(), Some(&[251, 255, 191][..]));
    }

    #[test]
    fn what_is_not_base64_is_refused() {
        for text in [
            "Z", "Zg", "Zg=", "Zg===", "====", "Z===", "Zm9\n", "Zh==", "Zm9=", "Z=g=",
        ] {
            assert_eq!(decode(text.as_bytes()), None, "{text}");
        }
    }
}
