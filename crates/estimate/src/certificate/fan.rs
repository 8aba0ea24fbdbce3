//! The triangles around every vertex, counter-clockwise.

use fem_core::{Mesh, Neighbour, TriangleId};

/// A triangle seen from one of its corners.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Corner {
    /// The triangle.
    pub triangle: u32,
    /// Local number of the vertex in it.
    pub local: u8,
}

impl Corner {
    /// The triangle as an array index.
    #[inline]
    pub fn index(self) -> usize {
        self.triangle as usize
    }

    /// Local number of the vertex.
    #[inline]
    pub fn corner(self) -> usize {
        usize::from(self.local)
    }
}

/// The corner after one in its triangle.
const NEXT: [usize; 3] = [1, 2, 0];

/// The next corner around the same vertex counter-clockwise, if the boundary is not between.
#[inline(always)]
pub(super) fn after(neighbours: &[[Neighbour; 3]], at: Corner) -> Option<Corner> {
    // The second edge lies opposite to the next corner.
    let (TriangleId(triangle), face) = neighbours[at.index()][NEXT[at.corner()]].get()?;
    let local = NEXT[face] as u8;
    Some(Corner { triangle, local })
}

/// The next corner clockwise.
#[inline]
pub(super) fn before(neighbours: &[[Neighbour; 3]], at: Corner) -> Option<Corner> {
    let (TriangleId(triangle), face) = neighbours[at.index()][NEXT[NEXT[at.corner()]]].get()?;
    let local = NEXT[NEXT[face]] as u8;
    Some(Corner { triangle, local })
}

/// The triangles around a vertex, in counter-clockwise order. The first edge of a triangle leads from the vertex to the next corner, its
/// second edge to the one after; the second edge of one triangle is the first of the next.
#[derive(Clone, Default, Debug)]
pub(super) struct Fan {
    /// The triangles with the local number of the vertex.
    pub corners: Vec<Corner>,
    /// Whether the last triangle is followed by the first: the vertex is an interior one.
    pub closed: bool,
}

/// One corner to begin with for every fan: for every interior vertex any, for a boundary vertex the first one
/// after the boundary (several, if pieces of the domain meet in that vertex only); O(N).
pub(super) fn beginnings(mesh: &Mesh) -> Vec<Corner> {
    let mut seen = vec![false; mesh.vertex_count()];
    let mut result = Vec::with_capacity(mesh.vertex_count());
    for (t, (v, around)) in mesh.triangles().iter().zip(mesh.neighbours()).enumerate() {
        for local in 0..3 {
            let vertex = v[local].index();
            let begins = if mesh.boundary()[vertex] {
                // The edge to the next corner lies opposite to the one after.
                around[(local + 2) % 3].get().is_none()
            } else {
                !std::mem::replace(&mut seen[vertex], true)
            };
            if begins {
                result.push(Corner {
                    triangle: t as u32,
                    local: local as u8,
                });
            }
        }
    }
    result
}

impl Fan {
    /// Walks around the vertex from one of the [`beginnings`].
    #[inline]
    pub fn walk(&mut self, mesh: &Mesh, first: Corner) {
        self.corners.clear();
        let mut at = first;
        loop {
            self.corners.push(at);
            match after(mesh.neighbours(), at) {
                None => {
                    self.closed = false;
                    return;
                }
                Some(next) => at = next,
            }
            if at == first {
                self.closed = true;
                return;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{four_triangles, two_triangles};

    #[test]
    fn around_the_centre_and_along_the_boundary() {
        for mesh in [four_triangles(), two_triangles()] {
            let mut visits = vec![[0; 3]; mesh.triangle_count()];
            let mut fan = Fan::default();
            for first in beginnings(&mesh) {
                fan.walk(&mesh, first);
                let vertex = |c: Corner| mesh.triangles()[c.index()][c.corner()];
                assert_eq!(fan.closed, !mesh.boundary()[vertex(first).index()]);
                for pair in fan.corners.windows(2) {
                    assert_eq!(vertex(pair[0]), vertex(pair[1]));
                    let end =
                        |c: Corner, k: usize| mesh.triangles()[c.index()][(c.corner() + k) % 3];
                    assert_eq!(end(pair[0], 2), end(pair[1], 1));
                    assert_eq!(after(mesh.neighbours(), pair[0]), Some(pair[1]));
                    assert_eq!(before(mesh.neighbours(), pair[1]), Some(pair[0]));
                }
                for corner in &fan.corners {
                    visits[corner.index()][corner.corner()] += 1;
                }
            }
            assert!(visits.iter().flatten().all(|&n| n == 1));
        }
    }
}
