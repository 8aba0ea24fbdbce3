//! Why a folder could not be verified at all.

use std::io;
use std::path::PathBuf;

use fem_core::FieldError;

/// What keeps a verification from coming to a verdict.
#[derive(Debug, thiserror::Error)]
pub enum VerifyError {
    /// The folder holds no finished run.
    #[error("`{}` is no finished run: {why}", path.display())]
    NoRun {
        /// The folder.
        path: PathBuf,
        /// What is missing.
        why: &'static str,
    },
    /// The system refused to read.
    #[error("could not read `{}`: {cause}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        cause: io::Error,
    },
    /// A file is as it was written and cannot be understood all the same.
    #[error("could not read `{}`: {why}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        why: String,
    },
    /// The scene of the run cannot be built any more, for example since its mesh file is gone.
    #[error("the scene of the run cannot be built any more\n{0}")]
    Scene(String),
}

impl VerifyError {
    /// Whether the user named the wrong folder, rather than files being unreadable.
    pub fn is_user_error(&self) -> bool {
        matches!(self, VerifyError::NoRun { .. })
    }
}

/// Why the numbers of a level could not be recomputed: a claim that fails.
#[derive(Debug, thiserror::Error)]
pub(crate) enum LevelError {
    /// The file contradicts itself or the scene.
    #[error("{0}")]
    File(String),
    /// A value of the scene's data at a point of the mesh that is no number.
    #[error(transparent)]
    Data(#[from] FieldError),
}
