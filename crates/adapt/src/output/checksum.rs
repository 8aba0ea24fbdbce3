//! Checksums of files: SHA-256 (FIPS 180-4) of the bytes as they are written.

use std::io::{self, Write};

use sha2::{Digest, Sha256};

/// A stream that keeps the checksum of what passes through it.
pub struct Summed<'a> {
    inner: &'a mut dyn Write,
    sum: Sha256,
}

impl<'a> Summed<'a> {
    /// A stream to `inner`.
    pub fn new(inner: &'a mut dyn Write) -> Self {
        Summed {
            inner,
            sum: Sha256::new(),
        }
    }

    /// The checksum of everything that was taken, 64 hexadecimal digits.
    pub fn finish(self) -> String {
        hexadecimal(&self.sum.finalize())
    }
}

impl Write for Summed<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let taken = self.inner.write(bytes)?;
        self.sum.update(&bytes[..taken]);
        Ok(taken)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

/// The checksum of bytes at hand, 64 hexadecimal digits.
pub fn checksum(bytes: &[u8]) -> String {
    hexadecimal(&Sha256::digest(bytes))
}

fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Takes three bytes at a time.
    struct Slow(Vec<u8>);

    impl Write for Slow {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let taken = bytes.len().min(3);
            self.0.extend_from_slice(&bytes[..taken]);
            Ok(taken)
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn the_example_of_the_standard() {
        let expected = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(checksum(b"abc"), expected);
    }

    #[test]
    fn what_passes_through_is_what_counts() {
        let text = b"twenty-three bytes of it";
        let mut slow = Slow(Vec::new());
        let mut summed = Summed::new(&mut slow);
        summed.write_all(text).unwrap();
        assert_eq!(summed.finish(), checksum(text));
        assert_eq!(slow.0, text);
    }
}
