//! What can be wrong with a mesh or with a wish to refine it.

/// A mesh that cannot be built or refined. Coordinates are the scaled ones the mesh is held in.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// There is nothing to compute on.
    #[error("the mesh has no triangles")]
    Empty,
    /// A triangle names a vertex that does not exist.
    #[error("triangle {triangle} names vertex {vertex}, but there are {vertices} vertices")]
    UnknownVertex {
        /// Triangle, counted from 0.
        triangle: usize,
        /// The number it names.
        vertex: u32,
        /// How many vertices there are.
        vertices: usize,
    },
    /// A vertex belongs to no triangle.
    #[error("vertex {vertex} belongs to no triangle")]
    UnusedVertex {
        /// Vertex, counted from 0.
        vertex: usize,
    },
    /// A triangle without area, or with coordinates that are not finite.
    #[error("triangle {triangle} has area {area}")]
    Degenerate {
        /// Triangle, counted from 0.
        triangle: usize,
        /// Its area.
        area: f64,
    },
    /// More than two triangles meet at an edge, or two of them lie on the same side of it.
    #[error("triangles {first} and {second} overlap at the edge from vertex {a} to vertex {b}")]
    Overlap {
        /// One triangle.
        first: usize,
        /// Another.
        second: usize,
        /// One end of the edge.
        a: u32,
        /// The other end.
        b: u32,
    },
    /// Given refinement edges that wait for each other.
    #[error("the refinement edges from triangle {triangle} on run in a circle")]
    CyclicRefinementEdges {
        /// A triangle on the circle, counted from 0.
        triangle: usize,
    },
    /// Too many triangles for 32-bit numbers.
    #[error("{triangles} triangles are more than the {limit} that a mesh can hold")]
    TooLarge {
        /// How many were asked for.
        triangles: usize,
        /// How many there may be.
        limit: usize,
    },
    /// Two vertices would coincide in double precision.
    #[error(
        "the edge of length {length:e} near ({x}, {y}) cannot be bisected: its midpoint is not \
         distinct from its ends in double precision"
    )]
    CoordinatesExhausted {
        /// Length of the edge.
        length: f64,
        /// An end of the edge.
        x: f64,
        /// An end of the edge.
        y: f64,
    },
}
