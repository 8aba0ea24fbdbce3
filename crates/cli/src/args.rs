//! What the user typed, and what that asks for.

use std::ffi::OsString;
use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Args, Parser, Subcommand};

use crate::failure::WRONG_INPUT;

/// What is to be done.
#[derive(Clone, Debug, PartialEq)]
pub enum Task {
    /// `membranes run`.
    Run(RunArgs),
    /// `membranes check`.
    Check(CheckArgs),
    /// `membranes verify`.
    Verify(VerifyArgs),
    /// Something that later versions do.
    Later(String),
}

/// Adaptive finite elements for the unilateral contact between two elastic membranes.
#[derive(Parser, Debug)]
#[command(name = "membranes", version, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand, Debug)]
enum Command {
    /// Solve a scene adaptively and write the results
    Run(RunArgs),
    /// Read a scene, build its initial mesh, say what will be modelled, and write nothing
    Check(CheckArgs),
    /// Recompute every claim of a finished run from its files alone
    #[command(after_help = EXIT_CODES_OF_VERIFY)]
    Verify(VerifyArgs),
    #[command(hide = true, disable_help_flag = true)]
    Study(Rest),
    #[command(hide = true, disable_help_flag = true)]
    Plot(Rest),
    #[command(hide = true, disable_help_flag = true)]
    Schema(Rest),
    #[command(hide = true, disable_help_flag = true)]
    New(Rest),
    #[command(hide = true, disable_help_flag = true)]
    Completions(Rest),
}

/// Commands that are typed; for suggestions.
const COMMANDS: [&str; 8] = [
    "run",
    "check",
    "study",
    "verify",
    "plot",
    "schema",
    "new",
    "completions",
];

/// Arguments of `membranes run`.
#[derive(Args, Clone, Debug, PartialEq)]
pub struct RunArgs {
    /// The scene file
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,
    /// Folder of the results [default: runs/NAME, the scene being NAME.toml]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Override a key of the scene by its dotted name, for example stop.vertices=50000
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Replace the files of an earlier run
    #[arg(long)]
    pub force: bool,
    /// No progress on standard error
    #[arg(long)]
    pub quiet: bool,
    /// Print the summary as a JSON object instead of the final line
    #[arg(long)]
    pub json: bool,
    /// Threads that may be used; the results are the same to the byte [default: all cores]
    #[arg(long, value_name = "N")]
    pub threads: Option<NonZeroUsize>,
    #[arg(long, hide = true)]
    resume: bool,
}

/// Arguments of `membranes check`.
#[derive(Args, Clone, Debug, PartialEq)]
pub struct CheckArgs {
    /// The scene file
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,
    /// Override a key of the scene by its dotted name, for example domain.disk.size=0.1
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Print a JSON object
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `membranes verify`.
#[derive(Args, Clone, Debug, PartialEq)]
pub struct VerifyArgs {
    /// The folder of a finished run
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
    /// Print a JSON object instead of the final line
    #[arg(long)]
    pub json: bool,
    #[arg(long, hide = true, value_name = "N")]
    threads: Option<String>,
}

/// What `membranes verify --help` ends with.
const EXIT_CODES_OF_VERIFY: &str = "Exit codes: 0 every claim holds, 1 a claim fails, 2 DIR is no finished run, 4 a file cannot be read";

#[derive(Args, Debug)]
struct Rest {
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, hide = true)]
    _rest: Vec<OsString>,
}

/// Understands the arguments; on help, version and mistakes everything is said and only the exit code is left.
pub fn parse(arguments: impl IntoIterator<Item = OsString>) -> Result<Task, u8> {
    understand(arguments).map_err(|error| {
        // Nothing is left to say when this fails too.
        let _ = error.print();
        u8::try_from(error.exit_code()).unwrap_or(WRONG_INPUT)
    })
}

fn understand(arguments: impl IntoIterator<Item = OsString>) -> Result<Task, clap::Error> {
    let command = Cli::try_parse_from(arguments)
        .map_err(with_suggestion)?
        .command;
    let later = |name: &str| Ok(Task::Later(format!("membranes {name}")));
    match command {
        Command::Run(run) if run.resume => Ok(Task::Later("--resume".into())),
        Command::Run(run) => Ok(Task::Run(run)),
        Command::Check(check) => Ok(Task::Check(check)),
        Command::Verify(verify) if verify.threads.is_some() => Ok(Task::Later("--threads".into())),
        Command::Verify(verify) => Ok(Task::Verify(verify)),
        Command::Study(_) => later("study"),
        Command::Plot(_) => later("plot"),
        Command::Schema(_) => later("schema"),
        Command::New(_) => later("new"),
        Command::Completions(_) => later("completions"),
    }
}

/// Adds the nearest command to the message about an unknown one; clap finds it only when the beginning is right.
fn with_suggestion(mut error: clap::Error) -> clap::Error {
    if error.kind() == ErrorKind::InvalidSubcommand
        && error.get(ContextKind::SuggestedSubcommand).is_none()
        && let Some(ContextValue::String(typed)) = error.get(ContextKind::InvalidSubcommand)
    {
        let near = COMMANDS
            .into_iter()
            .map(|known| (strsim::damerau_levenshtein(typed, known), known))
            .filter(|(distance, known)| 2 * distance <= known.len().max(2))
            .min_by_key(|(distance, _)| *distance);
        if let Some((_, known)) = near {
            let suggestion = ContextValue::Strings(vec![known.to_owned()]);
            error.insert(ContextKind::SuggestedSubcommand, suggestion);
        }
    }
    error
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> Result<Task, i32> {
        understand(text.split_whitespace().map(OsString::from)).map_err(|e| e.exit_code())
    }

    #[test]
    fn clap_accepts_the_definitions() {
        use clap::CommandFactory;
        Cli::command().debug_assert();
    }

    #[test]
    fn runs_and_checks() {
        let Ok(Task::Run(run)) = parsed("membranes run a.toml --set b=1 --out d --set c=2 --force")
        else {
            panic!("a run")
        };
        assert_eq!(run.scene, PathBuf::from("a.toml"));
        assert_eq!(run.set, ["b=1", "c=2"]);
        assert_eq!(run.out, Some(PathBuf::from("d")));
        assert!(run.force && !run.quiet && !run.json);
        assert_eq!(run.threads, None);
        let threads = parsed("membranes run a.toml --threads 3");
        assert!(matches!(threads, Ok(Task::Run(r)) if r.threads == NonZeroUsize::new(3)));
        assert!(matches!(parsed("membranes check a.toml --json"), Ok(Task::Check(c)) if c.json));
        let verify = parsed("membranes verify runs/a --json");
        assert!(matches!(verify, Ok(Task::Verify(v)) if v.json && v.folder.ends_with("runs/a")));
    }

    #[test]
    fn later_commands_are_known_by_name() {
        let later = |text: &str| match parsed(text) {
            Ok(Task::Later(what)) => what,
            other => panic!("{other:?}"),
        };
        assert_eq!(later("membranes study a.toml --out d"), "membranes study");
        assert_eq!(later("membranes verify d --threads 2"), "--threads");
        assert_eq!(later("membranes plot --help"), "membranes plot");
        assert_eq!(later("membranes run a.toml --resume"), "--resume");
    }

    #[test]
    fn mistakes_are_exit_code_2() {
        for text in [
            "membranes",
            "membranes rnu a.toml",
            "membranes run",
            "membranes verify",
            "membranes verify a b",
            "membranes run a --nope",
            "membranes run a --threads 0",
            "membranes run a --threads many",
        ] {
            assert_eq!(parsed(text), Err(2), "{text}");
        }
        assert_eq!(parsed("membranes --version"), Err(0));
    }
}
