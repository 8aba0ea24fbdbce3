//! Error indicators and true errors of a discrete solution.

pub mod exact;

pub use exact::{Exact, Gradient};
