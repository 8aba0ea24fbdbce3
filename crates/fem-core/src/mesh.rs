//! A mesh: topology with coordinates, regions and the curve that new boundary vertices are put on.

use std::ops::Deref;

use crate::error::MeshError;
use crate::index::{TriangleId, VertexId};
use crate::topology::{Birth, Neighbour, Topology};

/// The largest number of triangles that packed neighbours can name.
pub(crate) const TRIANGLE_LIMIT: usize = (1 << 30) - 1;

/// A circle that carries the whole boundary.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Circle {
    /// Centre.
    pub center: [f64; 2],
    /// Radius.
    pub radius: f64,
}

impl Circle {
    /// The point of the circle nearest to `p`; `p` must not be the centre.
    pub fn project(&self, p: [f64; 2]) -> [f64; 2] {
        let d = [p[0] - self.center[0], p[1] - self.center[1]];
        let r = self.radius / (d[0] * d[0] + d[1] * d[1]).sqrt();
        [self.center[0] + d[0] * r, self.center[1] + d[1] * r]
    }
}

/// Coordinates-dependent facts of one triangle.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Shape {
    /// Corner points, counter-clockwise.
    pub corners: [[f64; 2]; 3],
    /// Area, positive.
    pub area: f64,
    /// Gradients of the three hat functions.
    pub gradients: [[f64; 2]; 3],
    /// Length of the edge opposite to each corner.
    pub lengths: [f64; 3],
}

impl Shape {
    /// The shape of the triangle with these counter-clockwise corners.
    #[inline]
    pub fn new(corners: [[f64; 2]; 3]) -> Self {
        let [a, b, c] = corners;
        let edges = [
            [c[0] - b[0], c[1] - b[1]],
            [a[0] - c[0], a[1] - c[1]],
            [b[0] - a[0], b[1] - a[1]],
        ];
        let twice = edges[2][0] * -edges[1][1] + edges[2][1] * edges[1][0];
        // The hat function of corner i falls from 1 to 0 towards the opposite edge e_i: its gradient is e_i turned
        // by a right angle, over twice the area.
        let gradients = edges.map(|e| [-e[1] / twice, e[0] / twice]);
        let lengths = edges.map(|e| (e[0] * e[0] + e[1] * e[1]).sqrt());
        Shape {
            corners,
            area: 0.5 * twice,
            gradients,
            lengths,
        }
    }

    /// The diameter h_K: the longest edge.
    #[inline]
    pub fn diameter(&self) -> f64 {
        self.lengths[0].max(self.lengths[1]).max(self.lengths[2])
    }

    /// The gradient of the affine function with these corner values.
    #[inline]
    pub fn gradient(&self, values: [f64; 3]) -> [f64; 2] {
        let g = &self.gradients;
        // Differences first: a large common value must not cost digits.
        let (d1, d2) = (values[1] - values[0], values[2] - values[0]);
        [d1 * g[1][0] + d2 * g[2][0], d1 * g[1][1] + d2 * g[2][1]]
    }

    /// The unit normal of the edge opposite to corner `face`, outward.
    #[inline]
    pub fn normal(&self, face: usize) -> [f64; 2] {
        let (i, j) = ((face + 1) % 3, (face + 2) % 3);
        let [p, q] = [self.corners[i], self.corners[j]];
        let l = self.lengths[face];
        [(q[1] - p[1]) / l, (p[0] - q[0]) / l]
    }
}

/// A conforming triangulation of a planar domain.
///
/// Dereferences to its [`Topology`].
#[derive(Clone, Debug)]
pub struct Mesh {
    pub(crate) topology: Topology,
    pub(crate) points: Vec<[f64; 2]>,
    pub(crate) region: Vec<i32>,
    pub(crate) curve: Option<Circle>,
}

impl Deref for Mesh {
    type Target = Topology;

    #[inline]
    fn deref(&self) -> &Topology {
        &self.topology
    }
}

impl Mesh {
    /// Builds an initial mesh from points and triangles of any orientation.
    ///
    /// `regions` holds a tag for each triangle, or is empty for all 0. Vertices keep their numbers and triangles theirs; inside
    /// a triangle the vertices are rotated (and turned to counter-clockwise) so that the longest edge comes first and
    /// is the refinement edge. Ties are broken by the vertex numbers, so that the edges are totally ordered; going from a triangle
    /// to the neighbour behind its refinement edge then climbs in that order, and the closure of every
    /// bisection ends (no compatible labelling is needed; Karkulik, Pavlicek, Praetorius 2013).
    ///
    /// # Errors
    /// [`MeshError`] when there are no triangles, a triangle has no area, names a vertex that does not exist, more than two triangles
    /// meet at an edge, or a vertex is used by none.
    pub fn new(
        points: Vec<[f64; 2]>,
        triangles: &[[u32; 3]],
        regions: &[i32],
        curve: Option<Circle>,
    ) -> Result<Mesh, MeshError> {
        Mesh::build(points, triangles, regions, curve, longest_edge_first)
    }

    /// Builds an initial mesh whose triangles name their refinement edges: their first two vertices.
    ///
    /// # Errors
    /// As [`Mesh::new`], and [`MeshError::CyclicRefinementEdges`] when the chain of refinement edges runs in a circle, so that none of the
    /// triangles on it could be bisected first.
    pub fn with_refinement_edges(
        points: Vec<[f64; 2]>,
        triangles: &[[u32; 3]],
        regions: &[i32],
        curve: Option<Circle>,
    ) -> Result<Mesh, MeshError> {
        let mesh = Mesh::build(points, triangles, regions, curve, |v, _| v)?;
        match cycle(&mesh.topology.neighbours) {
            Some(triangle) => Err(MeshError::CyclicRefinementEdges { triangle }),
            None => Ok(mesh),
        }
    }

    fn build(
        points: Vec<[f64; 2]>,
        triangles: &[[u32; 3]],
        regions: &[i32],
        curve: Option<Circle>,
        refinement_edge_first: impl Fn([u32; 3], &[[f64; 2]]) -> [u32; 3],
    ) -> Result<Mesh, MeshError> {
        if triangles.is_empty() {
            return Err(MeshError::Empty);
        }
        if triangles.len() > TRIANGLE_LIMIT {
            return Err(MeshError::TooLarge {
                triangles: triangles.len(),
                limit: TRIANGLE_LIMIT,
            });
        }
        let n = points.len();
        let mut used = vec![false; n];
        let mut oriented = Vec::with_capacity(triangles.len());
        for (t, v) in triangles.iter().enumerate() {
            for &i in v {
                match used.get_mut(i as usize) {
                    Some(u) => *u = true,
                    None => {
                        return Err(MeshError::UnknownVertex {
                            triangle: t,
                            vertex: i,
                            vertices: n,
                        });
                    }
                }
            }
            let area = signed_area(v.map(|i| points[i as usize]));
            if !(area.is_finite() && area != 0.0) {
                return Err(MeshError::Degenerate { triangle: t, area });
            }
            let v = if area < 0.0 { [v[1], v[0], v[2]] } else { *v };
            oriented.push(refinement_edge_first(v, &points).map(VertexId));
        }
        if let Some(vertex) = used.iter().position(|u| !u) {
            return Err(MeshError::UnusedVertex { vertex });
        }
        let neighbours = neighbours(&oriented, n)?;
        let mut boundary = vec![false; n];
        for (v, around) in oriented.iter().zip(&neighbours) {
            for face in 0..3 {
                if around[face] == Neighbour::BOUNDARY {
                    boundary[v[(face + 1) % 3].index()] = true;
                    boundary[v[(face + 2) % 3].index()] = true;
                }
            }
        }
        let region = if regions.is_empty() {
            vec![0; oriented.len()]
        } else {
            regions.to_vec()
        };
        Ok(Mesh {
            topology: Topology {
                generation: vec![0; oriented.len()],
                triangles: oriented,
                neighbours,
                boundary,
                genealogy: vec![Birth::INITIAL; n],
            },
            points,
            region,
            curve,
        })
    }

    /// Incidence without coordinates.
    pub fn topology(&self) -> &Topology {
        &self.topology
    }

    /// Coordinates of the vertices.
    pub fn points(&self) -> &[[f64; 2]] {
        &self.points
    }

    /// Tag of every triangle, inherited in refinement; 0 where none was given.
    pub fn region(&self) -> &[i32] {
        &self.region
    }

    /// The circle that carries the boundary, if there is one.
    pub fn curve(&self) -> Option<Circle> {
        self.curve
    }

    /// Corner points of a triangle.
    #[inline]
    pub fn corners(&self, t: TriangleId) -> [[f64; 2]; 3] {
        self.topology.triangles[t.index()].map(|v| self.points[v.index()])
    }

    /// Area, gradients and lengths of a triangle.
    #[inline]
    pub fn shape(&self, t: TriangleId) -> Shape {
        Shape::new(self.corners(t))
    }

    /// Area of a triangle: the same bits as in its [`Shape`], which has roots and quotients besides.
    #[inline]
    pub fn area(&self, t: TriangleId) -> f64 {
        signed_area(self.corners(t))
    }

    /// Every triangle with its number.
    pub fn triangle_ids(&self) -> impl Iterator<Item = TriangleId> + use<> {
        (0..self.triangle_count() as u32).map(TriangleId)
    }

    /// Every edge on the boundary, as (triangle, face), in triangle order.
    pub fn boundary_edges(&self) -> impl Iterator<Item = (TriangleId, usize)> + '_ {
        self.topology
            .neighbours
            .iter()
            .enumerate()
            .flat_map(|(t, around)| {
                (0..3)
                    .filter(move |&f| around[f] == Neighbour::BOUNDARY)
                    .map(move |f| (TriangleId(t as u32), f))
            })
    }
}

/// Area of a triangle, negative when its corners run clockwise.
#[inline]
pub(crate) fn signed_area([a, b, c]: [[f64; 2]; 3]) -> f64 {
    0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
}

fn longest_edge_first(v: [u32; 3], points: &[[f64; 2]]) -> [u32; 3] {
    let key = |i: u32, j: u32| {
        let (p, q) = (points[i.min(j) as usize], points[i.max(j) as usize]);
        let d = [q[0] - p[0], q[1] - p[1]];
        (d[0] * d[0] + d[1] * d[1], i.max(j), i.min(j))
    };
    let mut best = 0;
    for k in 1..3 {
        if key(v[k], v[(k + 1) % 3]) > key(v[best], v[(best + 1) % 3]) {
            best = k;
        }
    }
    [v[best], v[(best + 1) % 3], v[(best + 2) % 3]]
}

/// A triangle on a closed chain of refinement edges, if there is one; O(N).
///
/// A triangle waits for the neighbour behind its refinement edge, unless that is the neighbour's refinement edge too.
fn cycle(neighbours: &[[Neighbour; 3]]) -> Option<usize> {
    // 0: not seen, else the number of the walk that saw it.
    let mut seen = vec![0u32; neighbours.len()];
    for start in 0..neighbours.len() {
        let walk = start as u32 + 1;
        let mut t = start;
        while seen[t] == 0 {
            seen[t] = walk;
            match neighbours[t][2].get() {
                Some((next, face)) if face != 2 => t = next.index(),
                _ => break,
            }
            if seen[t] == walk {
                return Some(t);
            }
        }
    }
    None
}

/// Finds the neighbours by sorting every edge into the bucket of its lower vertex; O(N).
fn neighbours(
    triangles: &[[VertexId; 3]],
    vertices: usize,
) -> Result<Vec<[Neighbour; 3]>, MeshError> {
    let edge = |t: usize, face: usize| {
        let v = &triangles[t];
        let (i, j) = (v[(face + 1) % 3].0, v[(face + 2) % 3].0);
        (i.min(j), i.max(j))
    };
    let mut start = vec![0u32; vertices + 1];
    for t in 0..triangles.len() {
        for face in 0..3 {
            start[edge(t, face).0 as usize + 1] += 1;
        }
    }
    for i in 0..vertices {
        start[i + 1] += start[i];
    }
    let mut fill = start.clone();
    let mut bucket = vec![(0u32, 0u32); 3 * triangles.len()];
    for t in 0..triangles.len() {
        for face in 0..3 {
            let (low, high) = edge(t, face);
            bucket[fill[low as usize] as usize] = (high, (t as u32) << 2 | face as u32);
            fill[low as usize] += 1;
        }
    }
    let mut result = vec![[Neighbour::BOUNDARY; 3]; triangles.len()];
    for low in 0..vertices {
        let edges = &mut bucket[start[low] as usize..start[low + 1] as usize];
        edges.sort_unstable();
        for group in edges.chunk_by(|a, b| a.0 == b.0) {
            let side = |k: usize| ((group[k].1 >> 2) as usize, (group[k].1 & 3) as usize);
            if group.len() == 1 {
                continue;
            }
            let ((s, f), (t, g)) = (side(0), side(1));
            // Neighbours run along their common edge in opposite directions.
            let opposed = triangles[s][(f + 1) % 3] == triangles[t][(g + 2) % 3];
            if group.len() > 2 || !opposed {
                return Err(MeshError::Overlap {
                    first: s,
                    second: t,
                    a: low as u32,
                    b: group[0].0,
                });
            }
            result[s][f] = Neighbour::new(TriangleId(t as u32), g);
            result[t][g] = Neighbour::new(TriangleId(s as u32), f);
        }
    }
    Ok(result)
}
