//! The discrete problem of two membranes in unilateral contact, and its solvers.
//!
//! [`solve()`] takes a [`DiscreteProblem`] and, from the second mesh on, a [`Start`] carried over from the mesh before; it
//! returns a [`Solution`] that has been judged by its relative KKT residual. Inside, from the bottom up: `cholesky` (faer's
//! factorisation), `interior` (the unknowns and the factor that is analysed once), `system` (the inequality in one or two
//! fields, vertex by vertex), `free` (the linear problem on a fixed contact set), `active_set` and its fallback `monotone`,
//! `multigrid` (cycles over the bisection
//! hierarchy), `interior_point` (clarabel), `reduce` (the smallest model and the way back), `level` (which model by which method, forces
//! and sigma).

#[cfg(test)]
extern crate self as contact;

mod active_set;
mod cholesky;
pub mod error;
mod free;
mod interior;
mod interior_point;
mod level;
mod monotone;
mod multigrid;
pub mod problem;
mod reduce;
pub mod settings;
pub mod solution;
mod solve;
pub mod start;
mod system;

pub use error::SolveError;
pub use multigrid::Workspace;
pub use problem::{DiscreteProblem, Tensions};
pub use settings::{Settings, Solver, Tolerance};
pub use solution::{
    Cycles, Reduction, Solution, SolveInfo, Status, kkt_residual, rounding_residual,
};
pub use solve::{
    ACTIVE_SET_LIMIT, INTERIOR_POINT_LIMIT, MULTIGRID_FROM, ROUNDING_LIMIT, add_sigma, solve,
    solve_in,
};
pub use start::Start;

#[cfg(test)]
#[path = "../tests/common/mod.rs"]
mod common;
#[cfg(test)]
mod hard_tests;
