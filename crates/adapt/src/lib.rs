//! The adaptive loop: solve, estimate, mark, refine; and what watches it.
//!
//! - [`mod@run`]: the loop itself, its reasons to stop and the [`Observer`] trait;
//! - [`level`]: one level: mesh, discrete problem, solution, estimates, and the step to the next;
//! - [`mod@discretise`]: from the data to the discrete problem on a mesh;
//! - [`estimates`]: indicators, errors and bounds of a level; `forecast`: what is known of a certificate before it is made;
//! - [`assurance`]: what the certificate holds for, in words;
//! - [`mod@mark`]: which triangles are refined;
//! - [`problem`], [`settings`]: what goes in; [`record`]: the numbers that come out of a level;
//! - [`recorder`], [`output`]: the observer that writes files, and the files.

pub mod assurance;
pub mod discretise;
pub mod estimates;
mod forecast;
pub mod level;
pub mod mark;
pub mod output;
pub mod problem;
pub mod record;
pub mod recorder;
pub mod run;
pub mod settings;

pub use assurance::Assurance;
pub use discretise::{Before, DataError, discretise, discretise_carried, moments};
pub use estimates::{Estimates, given};
pub use level::Level;
pub use mark::mark;
pub use problem::Problem;
pub use record::LevelRecord;
pub use recorder::{Finish, Recorder};
pub use run::{LevelError, Observer, Outcome, Reason, RunError, run};
pub use settings::Settings;
