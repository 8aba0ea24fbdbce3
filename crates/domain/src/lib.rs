//! From shapes and mesh files to raw initial meshes.
//!
//! Four sources give a [`RawMesh`]: [`rectangle`], [`disk`], [`polygon()`] (constrained Delaunay
//! triangulation with refinement) and [`gmsh::read`] (MSH 2.2 and 4.1). Whatever the source, the
//! mesh has passed [`check`](check::check): counter-clockwise triangles, no unused points,
//! conforming. Nothing in this crate knows about refinement edges or finite elements.
//!
//! Scaling: multiplying every length of the input by the same power of two multiplies every
//! coordinate of the mesh by it, bit for bit, and changes nothing else. A domain may be anything
//! from `2^-500` to `2^500` across.

pub mod check;
pub mod error;
pub mod geometry;
pub mod gmsh;
mod polygon;
mod quality;
mod shapes;

pub use error::{DomainError, GmshError, GmshFault, MeshDefect, Part, Place};
pub use polygon::polygon;
pub use quality::{ANGLE_LIMIT, Quality, quality};
pub use shapes::{Disk, disk, rectangle};

/// The most triangles that an initial mesh may have.
pub const MAX_TRIANGLES: f64 = 1e8;

/// A mesh before it has a topology: points, triangles, and a tag on each triangle.
///
/// Triangles are counter-clockwise triples of 0-based indices into `points`; every point belongs
/// to at least one triangle; two triangles meet in nothing, a common vertex, or a common edge.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RawMesh {
    /// Coordinates `[x, y]`, one entry a vertex.
    pub points: Vec<[f64; 2]>,
    /// Vertex indices of the triangles, counter-clockwise.
    pub triangles: Vec<[u32; 3]>,
    /// Physical tag of each triangle, 0 where there is none; as long as `triangles`.
    pub regions: Vec<i32>,
}

impl RawMesh {
    /// The three corners of triangle `index`.
    ///
    /// # Panics
    ///
    /// If `index`, or a vertex index of that triangle, is out of range.
    pub fn corners(&self, index: usize) -> [[f64; 2]; 3] {
        self.triangles[index].map(|vertex| self.points[vertex as usize])
    }
}
