//! Multigrid: steps, contraction, agreement with the direct methods, bad shapes, deep meshes. Counts, not seconds.

mod agreement;
#[path = "../common/mod.rs"]
mod common;
mod imported;
mod measure;
mod problems;
mod shapes;
mod steps;
