//! Is it a mesh? Every initial mesh passes [`check`], whatever it was made from.
//!
//! The steps: indices and coordinates; orientation and area of each triangle (exact); the edges
//! (duplicates, folds, three or more triangles at one edge); the turn of the triangles around each
//! vertex; and along the boundary, where alone they can hide, hanging nodes and coincident edges.
//! `O(N log N)` in the number of triangles.
//!
//! What is not found: two pieces of the mesh that overlap without a common vertex.

mod defect;

use std::f64::consts::TAU;

pub use defect::MeshDefect;

use crate::RawMesh;
use crate::geometry::{Frame, Point, cross, orient};

/// A vertex within this distance of an edge, relative to the length of the edge, hangs in it.
const HANGING: f64 = 1e-12;

/// What an edge record keeps of its triangle: index, and whether it runs from the smaller vertex
/// index to the larger one.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct EdgeUse {
    /// Smaller vertex index in the high half, larger one in the low half.
    key: u64,
    triangle: u32,
    forward: bool,
}

impl EdgeUse {
    fn vertices(self) -> [u32; 2] {
        [(self.key >> 32) as u32, self.key as u32]
    }

    /// The vertices in the direction of the triangle.
    fn directed(self) -> [u32; 2] {
        let [a, b] = self.vertices();
        if self.forward { [a, b] } else { [b, a] }
    }
}

/// Checks that `mesh` is what [`RawMesh`] promises; reports the first defect found.
pub fn check(mesh: &RawMesh) -> Result<(), MeshDefect> {
    indices(mesh)?;
    let points = framed(mesh)?;
    areas(mesh, &points)?;
    let boundary = edges(mesh)?;
    turns(mesh, &points, &boundary)?;
    coincident_edges(mesh, &boundary)?;
    hanging_nodes(mesh, &points, &boundary)
}

fn indices(mesh: &RawMesh) -> Result<(), MeshDefect> {
    let count = mesh.triangles.len().max(mesh.points.len());
    if mesh.triangles.is_empty() {
        return Err(MeshDefect::NoTriangles);
    }
    if u32::try_from(count).is_err() {
        return Err(MeshDefect::TooLarge { count });
    }
    if mesh.regions.len() != mesh.triangles.len() {
        return Err(MeshDefect::Regions {
            regions: mesh.regions.len(),
            triangles: mesh.triangles.len(),
        });
    }
    let mut used = vec![false; mesh.points.len()];
    for (triangle, corners) in mesh.triangles.iter().enumerate() {
        for &vertex in corners {
            match used.get_mut(vertex as usize) {
                Some(flag) => *flag = true,
                None => return Err(MeshDefect::UnknownVertex { triangle, vertex }),
            }
        }
    }
    for (vertex, &value) in mesh.points.iter().enumerate() {
        if !value.iter().all(|x| x.is_finite()) {
            return Err(MeshDefect::NotFinite { vertex, value });
        }
        if !used[vertex] {
            return Err(MeshDefect::Unused { vertex, value });
        }
    }
    Ok(())
}

/// The points at order one, where orientation is exact.
fn framed(mesh: &RawMesh) -> Result<Vec<Point>, MeshDefect> {
    match Frame::new(&mesh.points) {
        Ok(frame) => Ok(mesh.points.iter().map(|&p| frame.enter(p)).collect()),
        Err(0.0) => Err(MeshDefect::ZeroArea {
            triangle: 0,
            corners: mesh.corners(0),
        }),
        Err(extent) => Err(MeshDefect::Extent { extent }),
    }
}

fn areas(mesh: &RawMesh, points: &[Point]) -> Result<(), MeshDefect> {
    for (triangle, corners) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = corners.map(|v| points[v as usize]);
        let area = orient(a, b, c);
        let corners = || mesh.corners(triangle);
        if area == 0.0 {
            return Err(MeshDefect::ZeroArea {
                triangle,
                corners: corners(),
            });
        }
        if area < 0.0 {
            return Err(MeshDefect::Clockwise {
                triangle,
                corners: corners(),
            });
        }
    }
    Ok(())
}

/// Checks the edges and returns those of only one triangle.
fn edges(mesh: &RawMesh) -> Result<Vec<EdgeUse>, MeshDefect> {
    let mut uses: Vec<EdgeUse> = Vec::with_capacity(3 * mesh.triangles.len());
    for (triangle, &[a, b, c]) in mesh.triangles.iter().enumerate() {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            uses.push(EdgeUse {
                key: u64::from(from.min(to)) << 32 | u64::from(from.max(to)),
                triangle: triangle as u32,
                forward: from < to,
            });
        }
    }
    uses.sort_unstable();
    let mut boundary = Vec::new();
    for group in uses.chunk_by(|x, y| x.key == y.key) {
        match group {
            [only] => boundary.push(*only),
            [x, y] if x.forward != y.forward => {}
            _ => return Err(bad_edge(mesh, group)),
        }
    }
    Ok(boundary)
}

/// What is wrong with an edge of three or more triangles, or of two on the same side.
fn bad_edge(mesh: &RawMesh, group: &[EdgeUse]) -> MeshDefect {
    let sorted = |t: u32| {
        let mut corners = mesh.triangles[t as usize];
        corners.sort_unstable();
        corners
    };
    for (i, x) in group.iter().enumerate() {
        for y in &group[..i] {
            if sorted(x.triangle) == sorted(y.triangle) {
                return MeshDefect::Duplicate {
                    triangles: [y.triangle as usize, x.triangle as usize],
                    corners: mesh.corners(x.triangle as usize),
                };
            }
        }
    }
    let edge = group[0].vertices().map(|v| mesh.points[v as usize]);
    match group {
        [x, y, z, ..] => MeshDefect::SharedEdge {
            triangles: [x, y, z].map(|u| u.triangle as usize),
            edge,
        },
        _ => MeshDefect::Fold {
            triangles: [0, group.len() - 1].map(|k| group[k].triangle as usize),
            edge,
        },
    }
}

/// The triangles around a vertex turn once at most; less at the boundary.
fn turns(mesh: &RawMesh, points: &[Point], boundary: &[EdgeUse]) -> Result<(), MeshDefect> {
    let mut turn = vec![0.0; points.len()];
    for corners in &mesh.triangles {
        let p = corners.map(|v| points[v as usize]);
        for k in 0..3 {
            let (o, a, b) = (p[k], p[(k + 1) % 3], p[(k + 2) % 3]);
            let dot = (a[0] - o[0]) * (b[0] - o[0]) + (a[1] - o[1]) * (b[1] - o[1]);
            turn[corners[k] as usize] += cross(o, a, b).atan2(dot);
        }
    }
    let mut open = vec![false; points.len()];
    for edge in boundary {
        for v in edge.vertices() {
            open[v as usize] = true;
        }
    }
    // An interior vertex turns a whole number of times; at the boundary any excess is an overlap
    // (a slit of opening zero turns exactly once).
    let worst = |v: usize| turn[v] > TAU * if open[v] { 1.0 + 1e-6 } else { 1.5 };
    match (0..points.len()).find(|&v| worst(v)) {
        None => Ok(()),
        Some(v) => {
            let here = |corners: &[u32; 3]| corners.contains(&(v as u32));
            Err(MeshDefect::Overlap {
                triangle: mesh.triangles.iter().rposition(here).unwrap_or(0),
                at: mesh.points[v],
            })
        }
    }
}

/// Two boundary edges with equal end points but different vertices.
fn coincident_edges(mesh: &RawMesh, boundary: &[EdgeUse]) -> Result<(), MeshDefect> {
    // Adding zero makes -0 equal to 0 to the bit.
    let bits = |v: u32| mesh.points[v as usize].map(|x| (x + 0.0).to_bits());
    let mut places: Vec<([[u64; 2]; 2], u32)> = boundary
        .iter()
        .map(|edge| {
            let mut ends = edge.vertices().map(bits);
            ends.sort_unstable();
            (ends, edge.triangle)
        })
        .collect();
    places.sort_unstable();
    match places.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        None => Ok(()),
        Some(pair) => Err(MeshDefect::CoincidentEdges {
            triangles: [pair[0].1 as usize, pair[1].1 as usize],
            edge: pair[0].0.map(|p| p.map(f64::from_bits)),
        }),
    }
}

/// Boundary vertices in the interior of boundary edges.
fn hanging_nodes(mesh: &RawMesh, points: &[Point], boundary: &[EdgeUse]) -> Result<(), MeshDefect> {
    let mut vertices: Vec<u32> = boundary.iter().flat_map(|e| e.vertices()).collect();
    vertices.sort_unstable();
    vertices.dedup();
    let mut tree = Tree { points, vertices };
    tree.build();
    let reach = points
        .iter()
        .flatten()
        .fold(0.0f64, |acc, x| acc.max(x.abs()));
    for edge in boundary {
        let [i, j] = edge.directed();
        let (a, b) = (points[i as usize], points[j as usize]);
        let length2 = (b[0] - a[0]).powi(2) + (b[1] - a[1]).powi(2);
        let length = length2.sqrt();
        let near = HANGING * length + 4.0 * f64::EPSILON * reach;
        let own = mesh.triangles[edge.triangle as usize];
        let hangs = |v: u32| {
            let p = points[v as usize];
            let along = (p[0] - a[0]) * (b[0] - a[0]) + (p[1] - a[1]) * (b[1] - a[1]);
            let t = along / length2;
            !own.contains(&v)
                && p != a
                && p != b
                && t > HANGING
                && t < 1.0 - HANGING
                && orient(a, b, p).abs() <= near * length
        };
        if let Some(v) = tree.near_segment(a, b, near, &hangs) {
            return Err(MeshDefect::HangingNode {
                triangle: edge.triangle as usize,
                edge: [i, j].map(|v| mesh.points[v as usize]),
                at: mesh.points[v as usize],
            });
        }
    }
    Ok(())
}

/// A k-d tree over some vertices, stored as their order: the middle of each range splits it.
struct Tree<'a> {
    points: &'a [Point],
    vertices: Vec<u32>,
}

impl Tree<'_> {
    fn build(&mut self) {
        let points = self.points;
        let mut ranges = vec![(0, self.vertices.len(), 0)];
        while let Some((from, to, axis)) = ranges.pop() {
            if to - from > 1 {
                let middle = (to - from) / 2;
                self.vertices[from..to].select_nth_unstable_by(middle, |&v, &w| {
                    points[v as usize][axis].total_cmp(&points[w as usize][axis])
                });
                ranges.push((from, from + middle, 1 - axis));
                ranges.push((from + middle + 1, to, 1 - axis));
            }
        }
    }

    /// Some vertex with `hit`, of those within about `slack` of the segment `a b`.
    ///
    /// Each range is visited with the piece of the segment (as an interval of its parameter) that
    /// lies on its side of the splits above.
    fn near_segment(
        &self,
        a: Point,
        b: Point,
        slack: f64,
        hit: &dyn Fn(u32) -> bool,
    ) -> Option<u32> {
        let mut ranges = vec![(0, self.vertices.len(), 0, 0.0, 1.0)];
        while let Some((from, to, axis, t0, t1)) = ranges.pop() {
            if from >= to || t0 > t1 {
                continue;
            }
            let middle = from + (to - from) / 2;
            let vertex = self.vertices[middle];
            if hit(vertex) {
                return Some(vertex);
            }
            let split = self.points[vertex as usize][axis];
            let below = clip(a[axis], b[axis], split + slack, t0, t1);
            let above = clip(-a[axis], -b[axis], slack - split, t0, t1);
            ranges.push((from, middle, 1 - axis, below.0, below.1));
            ranges.push((middle + 1, to, 1 - axis, above.0, above.1));
        }
        None
    }
}

/// The part of `[t0, t1]` where `a + t (b - a) <= limit`, a little enlarged against rounding.
fn clip(a: f64, b: f64, limit: f64, t0: f64, t1: f64) -> (f64, f64) {
    const ROUND_OFF: f64 = 1e-9;
    let slope = b - a;
    if slope == 0.0 {
        return if a <= limit { (t0, t1) } else { (1.0, 0.0) };
    }
    let t = (limit - a) / slope;
    if slope > 0.0 {
        (t0, t1.min(t + ROUND_OFF))
    } else {
        (t0.max(t - ROUND_OFF), t1)
    }
}

#[cfg(test)]
mod tests;
