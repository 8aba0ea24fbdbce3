//! Incidence without coordinates: triangles, neighbours, generations and the genealogy of vertices.

use crate::index::{TriangleId, VertexId};

/// The triangle behind an edge, with the number that the edge has there; or the boundary.
///
/// Packed as `triangle << 2 | face`, so that a mesh may have up to 2^30 - 1 triangles.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Neighbour(u32);

impl Neighbour {
    /// The edge lies on the boundary.
    pub const BOUNDARY: Neighbour = Neighbour(u32::MAX);

    /// Triangle `triangle`, seen through its edge opposite to local vertex `face`.
    #[inline]
    pub fn new(triangle: TriangleId, face: usize) -> Self {
        debug_assert!(face < 3 && triangle.0 < (1 << 30) - 1);
        Neighbour(triangle.0 << 2 | face as u32)
    }

    /// The place `place` (`part << 2 | face`) counted from triangle `first`.
    #[inline]
    pub(crate) fn at(first: TriangleId, place: u32) -> Self {
        debug_assert!(place & 3 < 3 && first.0 + (place >> 2) < (1 << 30) - 1);
        Neighbour((first.0 << 2) + place)
    }

    /// Whether this is the boundary or a triangle with a higher number than `triangle`.
    #[inline]
    pub(crate) fn is_behind(self, triangle: TriangleId) -> bool {
        self.0 >> 2 > triangle.0
    }

    /// Triangle and local edge number, or `None` at the boundary.
    #[inline]
    pub fn get(self) -> Option<(TriangleId, usize)> {
        (self != Self::BOUNDARY).then_some((TriangleId(self.0 >> 2), (self.0 & 3) as usize))
    }
}

/// How a vertex came to be: the edge that was bisected and what stood on its two sides.
///
/// This table is the hierarchy: transfer between levels and multigrid need nothing else.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Birth {
    /// Ends (a, b) of the bisected edge; `NONE` for a vertex of the initial mesh.
    pub parents: [VertexId; 2],
    /// Vertices (c, d) opposite to that edge at the moment of bisection; `NONE` beyond the boundary.
    pub opposite: [VertexId; 2],
    /// 0 for a vertex of the initial mesh, else 1 + the largest level among a, b, c, d.
    pub level: u16,
}

impl Birth {
    /// A vertex of the initial mesh.
    pub const INITIAL: Birth = Birth {
        parents: [VertexId::NONE; 2],
        opposite: [VertexId::NONE; 2],
        level: 0,
    };
}

/// An edge with a triangle on both sides.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct InteriorEdge {
    /// Its ends.
    pub vertices: [VertexId; 2],
    /// The two triangles, the lower number first.
    pub triangles: [TriangleId; 2],
    /// The local number of the edge in each: the local vertex that it is opposite to.
    pub faces: [usize; 2],
}

/// Triangles and their incidence.
///
/// Triangle `[v0, v1, v2]` is counter-clockwise, its refinement edge is (v0, v1) and v2 is its newest
/// vertex. Face `i` is the edge opposite to local vertex `i`, from local vertex `i+1` to `i+2`.
/// The triangles are stored along a space-filling curve in each triangle of the initial mesh.
#[derive(Clone, Debug, Default)]
pub struct Topology {
    pub(crate) triangles: Vec<[VertexId; 3]>,
    pub(crate) neighbours: Vec<[Neighbour; 3]>,
    pub(crate) generation: Vec<u16>,
    pub(crate) boundary: Vec<bool>,
    pub(crate) genealogy: Vec<Birth>,
}

impl Topology {
    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.genealogy.len()
    }

    /// Number of triangles.
    pub fn triangle_count(&self) -> usize {
        self.triangles.len()
    }

    /// Vertices of every triangle, counter-clockwise, the refinement edge first.
    pub fn triangles(&self) -> &[[VertexId; 3]] {
        &self.triangles
    }

    /// Neighbours of every triangle; entry `i` lies behind the edge opposite to local vertex `i`.
    pub fn neighbours(&self) -> &[[Neighbour; 3]] {
        &self.neighbours
    }

    /// Number of bisections between a triangle and its ancestor in the initial mesh.
    pub fn generation(&self) -> &[u16] {
        &self.generation
    }

    /// Whether a vertex lies on the boundary.
    pub fn boundary(&self) -> &[bool] {
        &self.boundary
    }

    /// The birth of every vertex.
    pub fn genealogy(&self) -> &[Birth] {
        &self.genealogy
    }

    /// Ends of face `face` of triangle `triangle`, in the triangle's own direction.
    #[inline]
    pub fn face(&self, triangle: TriangleId, face: usize) -> [VertexId; 2] {
        let v = self.triangles[triangle.index()];
        [v[(face + 1) % 3], v[(face + 2) % 3]]
    }

    /// Every interior edge once, in the order of its lower triangle, then of the face number there.
    pub fn interior_edges(&self) -> impl Iterator<Item = InteriorEdge> + '_ {
        self.neighbours
            .iter()
            .enumerate()
            .flat_map(move |(t, around)| {
                let t = TriangleId(t as u32);
                around.iter().enumerate().filter_map(move |(face, next)| {
                    let (other, other_face) = next.get()?;
                    (t < other).then(|| InteriorEdge {
                        vertices: self.face(t, face),
                        triangles: [t, other],
                        faces: [face, other_face],
                    })
                })
            })
    }
}
