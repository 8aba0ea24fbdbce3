//! Multigrid: steps, contraction, agreement with the direct method, bad shapes, deep meshes. Counts, not seconds.

#[path = "../common/mod.rs"]
mod common;
mod measure;
mod problems;
