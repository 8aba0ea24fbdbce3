//! The adaptive loop: solve, estimate, mark, refine; and what watches it.

pub mod output;
pub mod problem;
pub mod record;
pub mod settings;

pub use problem::Problem;
pub use record::LevelRecord;
pub use settings::Settings;
