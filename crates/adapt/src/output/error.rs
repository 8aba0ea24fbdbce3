//! What can go wrong between a run and its folder.

use std::io;
use std::path::{Path, PathBuf};

/// A folder that must not be touched, or a file that could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// The folder holds something, and nobody said that it may be replaced.
    #[error("the folder `{}` is not empty", path.display())]
    DirectoryNotEmpty {
        /// The folder.
        path: PathBuf,
    },
    /// The name that a folder should have belongs to something else.
    #[error("`{}` is not a folder", path.display())]
    NotADirectory {
        /// The name.
        path: PathBuf,
    },
    /// The system refused.
    #[error("could not {action} `{}`: {cause}", path.display())]
    Io {
        /// What was tried: `write`, `read`, `create` or `remove`.
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        cause: io::Error,
    },
}

impl OutputError {
    /// Whether the user chose a folder that does not do (and nothing was written), rather than the system failing.
    pub fn is_user_error(&self) -> bool {
        !matches!(self, OutputError::Io { .. })
    }

    /// For `map_err`: the system refused to do `action` to `path`.
    pub(crate) fn io(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> OutputError {
        let path = path.to_path_buf();
        move |cause| OutputError::Io {
            action,
            path,
            cause,
        }
    }
}
