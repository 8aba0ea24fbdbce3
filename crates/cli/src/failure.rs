//! Messages on standard error, and exit codes.

use ::verify::VerifyError;
use adapt::output::OutputError;
use scene::SceneError;

/// A claim of a run does not hold.
pub const CLAIM_FAILS: u8 = 1;
/// The scene, the mesh or the command line is wrong; nothing was written.
pub const WRONG_INPUT: u8 = 2;
/// A numerical failure; the last good level is kept.
pub const NUMERICAL: u8 = 3;
/// Files could not be read or written.
pub const FILES: u8 = 4;
/// A limit came before the accuracy goal.
pub const LIMIT: u8 = 5;

/// Why a command did not succeed: one message and an exit code.
#[derive(Clone, Debug, PartialEq)]
pub struct Failure {
    /// The exit code.
    pub code: u8,
    /// The whole message.
    message: String,
}

impl Failure {
    /// A message in the usual form.
    pub fn new(code: u8, message: impl std::fmt::Display, hint: Option<&str>) -> Self {
        let hint = hint
            .map(|hint| format!("\nhint: {hint}"))
            .unwrap_or_default();
        Failure {
            code,
            message: format!("error: {message}{hint}"),
        }
    }

    /// The refusal of what later versions do.
    pub fn not_in_this_version(what: &str) -> Self {
        let hint = "the commands of this version are `membranes run`, `membranes check` and `membranes verify`";
        let hint = (!what.starts_with('-')).then_some(hint);
        Failure::new(
            WRONG_INPUT,
            format!("`{what}` is not in this version"),
            hint,
        )
    }

    /// Says it on standard error.
    pub fn print(&self) {
        tell(&self.message);
    }
}

impl From<SceneError> for Failure {
    fn from(error: SceneError) -> Self {
        Failure {
            code: if error.is_reading() {
                FILES
            } else {
                WRONG_INPUT
            },
            message: error.to_string(),
        }
    }
}

impl From<OutputError> for Failure {
    fn from(error: OutputError) -> Self {
        match &error {
            OutputError::DirectoryNotEmpty { .. } => {
                let hint = "choose another one with `--out`, or replace the files of an earlier run with `--force`";
                Failure::new(WRONG_INPUT, error, Some(hint))
            }
            _ if error.is_user_error() => Failure::new(
                WRONG_INPUT,
                error,
                Some("choose another folder with `--out`"),
            ),
            _ => Failure::new(FILES, error, None),
        }
    }
}

impl From<VerifyError> for Failure {
    fn from(error: VerifyError) -> Self {
        let (code, hint) = if error.is_user_error() {
            let hint = "give the folder that `membranes run` wrote: its `--out`, else `runs/NAME`";
            (WRONG_INPUT, Some(hint))
        } else {
            (FILES, None)
        };
        Failure::new(code, error, hint)
    }
}

/// Makes a panic, which is always a mistake of the program, say so in two lines.
pub fn report_panics() {
    std::panic::set_hook(Box::new(|info| {
        let payload = info.payload();
        let text = payload
            .downcast_ref::<&str>()
            .copied()
            .or_else(|| payload.downcast_ref::<String>().map(String::as_str))
            .unwrap_or("panic");
        let place = info
            .location()
            .map(|at| format!(" ({}:{})", at.file(), at.line()))
            .unwrap_or_default();
        tell(&format!("error: internal error: {text}{place}"));
        tell("hint: this is a mistake in the program; please report it with the scene");
    }));
}

/// Prints lines on standard error; a reader that has gone away is no reason to stop.
pub fn tell(text: &str) {
    use std::io::Write;
    let _ = writeln!(std::io::stderr().lock(), "{text}");
}

/// Prints the result of a command on standard output.
///
/// # Errors
/// Exit code 4 when it cannot be written; a reader that has gone away is no error.
pub fn say(text: &str) -> Result<(), Failure> {
    use std::io::Write;
    let mut out = std::io::stdout().lock();
    match writeln!(out, "{text}").and_then(|()| out.flush()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            let message = format!("could not write to standard output: {error}");
            Err(Failure::new(FILES, message, None))
        }
        _ => Ok(()),
    }
}
