//! Checksums of files: SHA-256 (FIPS 180-4) of the bytes as they are written.

use std::io::{self, Write};
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::thread::{Scope, ScopedJoinHandle};

use sha2::{Digest, Sha256};

/// Bytes that go to another thread at a time; what is shorter stays on this one.
const BLOCK: usize = 1 << 18;

/// Blocks that may wait there.
const WAITING: usize = 4;

/// Writes `content` to `inner`; the checksum of everything that was written, 64 hexadecimal digits.
///
/// With more than one thread allowed, long contents are summed up on another one while they are written on this one.
///
/// # Errors
/// Those of `content` and `inner`.
pub fn summed(
    inner: &mut dyn Write,
    threads: usize,
    content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> io::Result<String> {
    if threads <= 1 {
        let mut summed = Summed::new(inner);
        content(&mut summed)?;
        return Ok(summed.finish());
    }
    std::thread::scope(|scope| {
        let mut beside = Beside {
            inner,
            scope,
            block: Vec::new(),
            other: None,
        };
        content(&mut beside)?;
        beside.finish()
    })
}

/// A stream whose checksum is made on another thread.
struct Beside<'a, 'scope, 'env> {
    inner: &'a mut dyn Write,
    scope: &'scope Scope<'scope, 'env>,
    /// What was written and not yet passed on.
    block: Vec<u8>,
    other: Option<Other<'scope>>,
}

/// The thread, begun with the first full block.
struct Other<'scope> {
    full: SyncSender<Vec<u8>>,
    /// Blocks that were summed up, to be filled again.
    empty: Receiver<Vec<u8>>,
    sum: ScopedJoinHandle<'scope, String>,
}

/// Sums up blocks in the order in which they come, and hands them back.
fn sum_of(full: &Receiver<Vec<u8>>, empty: &Sender<Vec<u8>>) -> String {
    let mut sum = Sha256::new();
    for block in full {
        sum.update(&block);
        // At the end nobody wants it any more.
        let _ = empty.send(block);
    }
    hexadecimal(&sum.finalize())
}

impl Beside<'_, '_, '_> {
    fn pass_on(&mut self) -> io::Result<()> {
        let scope = self.scope;
        let other = self.other.get_or_insert_with(|| {
            let (full, taken) = sync_channel(WAITING);
            let (done, empty) = channel();
            let sum = scope.spawn(move || sum_of(&taken, &done));
            Other { full, empty, sum }
        });
        let mut next = other.empty.try_recv().unwrap_or_default();
        next.clear();
        let block = std::mem::replace(&mut self.block, next);
        let sent = other.full.send(block);
        sent.map_err(|_| given_up())
    }

    fn finish(mut self) -> io::Result<String> {
        if self.other.is_some() {
            self.pass_on()?;
        }
        match self.other {
            None => Ok(checksum(&self.block)),
            Some(Other { full, sum, .. }) => {
                drop(full);
                sum.join().map_err(|_| given_up())
            }
        }
    }
}

/// The other thread ended before its time.
fn given_up() -> io::Error {
    io::Error::other("the checksum was given up")
}

impl Write for Beside<'_, '_, '_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let taken = self.inner.write(bytes)?;
        self.block.extend_from_slice(&bytes[..taken]);
        if self.block.len() >= BLOCK {
            self.pass_on()?;
        }
        Ok(taken)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

/// A stream that keeps the checksum of what passes through it.
struct Summed<'a> {
    inner: &'a mut dyn Write,
    sum: Sha256,
}

impl<'a> Summed<'a> {
    /// A stream to `inner`.
    fn new(inner: &'a mut dyn Write) -> Self {
        Summed {
            inner,
            sum: Sha256::new(),
        }
    }

    /// The checksum of everything that was taken, 64 hexadecimal digits.
    fn finish(self) -> String {
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
        for length in [24, BLOCK - 1, BLOCK, 3 * BLOCK + 5, 9 * BLOCK] {
            let text: Vec<u8> = (0..length).map(|i| (i * i / 7) as u8).collect();
            for threads in [1, 2] {
                let mut slow = Slow(Vec::new());
                let sum = summed(&mut slow, threads, |writer| {
                    text.chunks(1000)
                        .try_for_each(|part| writer.write_all(part))
                });
                assert_eq!(sum.unwrap(), checksum(&text), "{length} {threads}");
                assert!(slow.0 == text);
            }
        }
    }

    #[test]
    fn an_error_on_the_way_is_the_result() {
        for threads in [1, 2] {
            let failed = summed(&mut io::sink(), threads, |writer| {
                writer.write_all(&vec![7; 3 * BLOCK])?;
                Err(io::ErrorKind::StorageFull.into())
            });
            assert_eq!(failed.unwrap_err().kind(), io::ErrorKind::StorageFull);
        }
    }
}
