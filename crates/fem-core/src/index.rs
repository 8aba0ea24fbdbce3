//! Typed `u32` indices: a vertex number cannot be used where a triangle number is meant.

/// Number of a vertex; indexes every array that has one entry a vertex.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct VertexId(pub u32);

/// Number of a triangle; indexes every array that has one entry a triangle.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct TriangleId(pub u32);

impl VertexId {
    /// Stands for "no vertex", for example beyond the boundary.
    pub const NONE: VertexId = VertexId(u32::MAX);

    /// The number as an array index.
    #[inline]
    pub fn index(self) -> usize {
        self.0 as usize
    }

    /// Whether this is a vertex at all.
    #[inline]
    pub fn is_some(self) -> bool {
        self != Self::NONE
    }
}

impl TriangleId {
    /// The number as an array index.
    #[inline]
    pub fn index(self) -> usize {
        self.0 as usize
    }
}
