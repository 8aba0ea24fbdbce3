//! Files that appear whole or not at all.

use std::ffi::{OsStr, OsString};
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use super::error::OutputError;

/// Ending of the name of every file under way.
pub(super) const TEMPORARY: &str = ".tmp";

/// Writes a file through `content` and puts it in its place in one step.
///
/// The bytes go to a file `.NAME.PROCESS-NUMBER.tmp` in the same folder, to the disk, and only then to their name: whoever
/// reads `path` sees the old file or the new one, also after a crash. An error or a panic removes the temporary file and
/// leaves an older file as it was.
///
/// # Errors
/// [`OutputError::Io`] with the name `path` and the first cause: the file cannot be created, `content` failed, or the bytes
/// do not reach the disk.
pub fn write_whole(
    path: &Path,
    content: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<(), OutputError> {
    write_and_rename(path, content).map_err(OutputError::io("write", path))
}

fn write_and_rename(
    path: &Path,
    content: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> io::Result<()> {
    let name = path.file_name().ok_or(io::ErrorKind::InvalidInput)?;
    let mut temporary = Temporary {
        path: path.with_file_name(temporary_name(name)),
        live: true,
    };
    let mut writer = BufWriter::with_capacity(1 << 16, File::create(&temporary.path)?);
    content(&mut writer)?;
    let file = writer.into_inner().map_err(|error| error.into_error())?;
    file.sync_all()?;
    drop(file);
    fs::rename(&temporary.path, path)?;
    temporary.live = false;
    Ok(())
}

/// Distinct for every file under way in this process; a leftover of an ended process with the same number is overwritten.
fn temporary_name(name: &OsStr) -> OsString {
    static NUMBER: AtomicU64 = AtomicU64::new(0);
    let number = NUMBER.fetch_add(1, Ordering::Relaxed);
    let mut temporary = OsString::from(".");
    temporary.push(name);
    temporary.push(format!(".{}-{number}{TEMPORARY}", std::process::id()));
    temporary
}

/// Removes the temporary file unless it found its place.
struct Temporary {
    path: PathBuf,
    live: bool,
}

impl Drop for Temporary {
    fn drop(&mut self) {
        if self.live {
            // The cause of the failure is under way to the caller; a second one would only hide it.
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// Writes bytes that are already there; see [`write_whole`].
///
/// # Errors
/// As [`write_whole`].
pub fn write_bytes(path: &Path, bytes: &[u8]) -> Result<(), OutputError> {
    write_whole(path, |writer| writer.write_all(bytes))
}
