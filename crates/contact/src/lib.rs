//! The discrete problem of two membranes in unilateral contact, and its solvers.

pub mod problem;
pub mod settings;
pub mod solution;

pub use problem::{DiscreteProblem, Tensions};
pub use settings::{Settings, Solver, Tolerance};
pub use solution::{Reduction, Solution, SolveInfo, Status, kkt_residual};
