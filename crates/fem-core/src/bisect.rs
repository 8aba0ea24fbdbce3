//! Newest-vertex bisection with conforming closure, one pass over flat arrays.
//!
//! A triangle (v0, v1, v2) is bisected at the midpoint p of its refinement edge (v0, v1) into (v2, v0, p) and (v1, v2, p), whose newest
//! vertex is p; both stay counter-clockwise. A pass marks edges instead of recursing: if any edge of a triangle is split, its
//! refinement edge is too. Every triangle then has one to four children, known from three bits, and takes the
//! place of its parent in the order, so that the leaves always lie along a space-filling curve: it enters an
//! even triangle at v0 and leaves at v1, an odd one the other way round.
//!
//! The cost of a pass is linear in the number of triangles, the closure linear in what it splits.

use crate::error::MeshError;
use crate::index::{TriangleId, VertexId};
use crate::mesh::{Mesh, TRIANGLE_LIMIT, signed_area};
use crate::topology::{Birth, Neighbour, Topology};

/// How far a marked triangle is divided.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Children {
    /// Only the refinement edge is bisected.
    Two,
    /// All three edges are bisected.
    #[default]
    Four,
}

/// What a refinement did.
#[derive(Clone, Debug)]
pub struct Refinement {
    /// Number of vertices before; the new ones follow, and their births are in the mesh's genealogy.
    pub old_vertices: usize,
    /// The parent of every triangle of the refined mesh, a number in the old one.
    pub parent: Vec<TriangleId>,
    /// Edges looked at by the closure: a measure of its work.
    pub closure_steps: usize,
}

/// Split bits of a triangle: bit `i` stands for the edge opposite to local vertex `i`; bit 2 is the refinement edge.
const REFINEMENT_EDGE: usize = 2;

impl Mesh {
    /// Refines the marked triangles, and as many others as conformity needs.
    ///
    /// The mesh is left as it was when an error is returned.
    ///
    /// # Errors
    /// [`MeshError::CoordinatesExhausted`] when an edge is so short that its midpoint is not distinct from its ends in double
    /// precision or a child would have no area; [`MeshError::TooLarge`] beyond 2^30 - 1 triangles.
    pub fn refine(
        &mut self,
        marked: &[TriangleId],
        children: Children,
    ) -> Result<Refinement, MeshError> {
        let (split, closure_steps) = self.closure(marked, children);
        let plan = Plan::new(&self.topology, split)?;
        let points = plan.points(self)?;
        let (triangles, parent) = plan.triangles(self);
        let mut all_points = std::mem::take(&mut self.points);
        let old_vertices = all_points.len();
        all_points.extend_from_slice(&points);
        for (v, &parent) in triangles.iter().zip(&parent) {
            let area = signed_area(v.map(|i| all_points[i.index()]));
            if plan.split[parent.index()] != 0 && area.is_nan() | (area <= 0.0) {
                let error = exhausted(all_points[v[0].index()], all_points[v[1].index()]);
                all_points.truncate(old_vertices);
                self.points = all_points;
                return Err(error);
            }
        }
        let genealogy = plan.genealogy(&self.topology);
        let boundary = plan.boundary(&self.topology);
        let neighbours = plan.neighbours(&self.topology);
        let generation = plan.generation(&self.topology);
        self.region = parent.iter().map(|p| self.region[p.index()]).collect();
        self.points = all_points;
        self.topology = Topology {
            triangles,
            neighbours,
            generation,
            boundary,
            genealogy,
        };
        Ok(Refinement {
            old_vertices,
            parent,
            closure_steps,
        })
    }

    /// Refines every triangle once.
    ///
    /// # Errors
    /// As [`Mesh::refine`].
    pub fn refine_uniformly(&mut self, children: Children) -> Result<Refinement, MeshError> {
        let all: Vec<_> = self.triangle_ids().collect();
        self.refine(&all, children)
    }

    /// The split bits of every triangle, and the number of edges looked at.
    fn closure(&self, marked: &[TriangleId], children: Children) -> (Vec<u8>, usize) {
        let mut split = vec![0u8; self.triangle_count()];
        let mut stack: Vec<(TriangleId, usize)> = Vec::new();
        let mut steps = 0;
        let faces: &[usize] = match children {
            Children::Two => &[REFINEMENT_EDGE],
            Children::Four => &[REFINEMENT_EDGE, 1, 0],
        };
        for &t in marked {
            for &face in faces {
                stack.push((t, face));
                while let Some((t, face)) = stack.pop() {
                    steps += 1;
                    let bits = &mut split[t.index()];
                    if *bits & 1 << face != 0 {
                        continue;
                    }
                    *bits |= 1 << face;
                    if face != REFINEMENT_EDGE && *bits & 1 << REFINEMENT_EDGE == 0 {
                        stack.push((t, REFINEMENT_EDGE));
                    }
                    if let Some(across) = self.topology.neighbours[t.index()][face].get() {
                        stack.push(across);
                    }
                }
            }
        }
        (split, steps)
    }
}

fn exhausted(p: [f64; 2], q: [f64; 2]) -> MeshError {
    let length = ((p[0] - q[0]).powi(2) + (p[1] - q[1]).powi(2)).sqrt();
    MeshError::CoordinatesExhausted {
        length,
        x: p[0],
        y: p[1],
    }
}

/// Numbers of everything that a pass makes, known before anything is written.
struct Plan<'a> {
    topology: &'a [[VertexId; 3]],
    around: &'a [[Neighbour; 3]],
    odd: Vec<bool>,
    split: Vec<u8>,
    /// First child of every triangle; one more entry with the total.
    child: Vec<u32>,
    /// First vertex born on an edge that a triangle owns; one more entry with the total.
    vertex: Vec<u32>,
}

impl<'a> Plan<'a> {
    fn new(topology: &'a Topology, split: Vec<u8>) -> Result<Self, MeshError> {
        let count = topology.triangle_count();
        let grown = count + split.iter().map(|b| b.count_ones() as usize).sum::<usize>();
        if grown > TRIANGLE_LIMIT {
            return Err(MeshError::TooLarge {
                triangles: grown,
                limit: TRIANGLE_LIMIT,
            });
        }
        let mut plan = Plan {
            topology: &topology.triangles,
            around: &topology.neighbours,
            odd: topology.generation.iter().map(|g| g & 1 == 1).collect(),
            split,
            child: vec![0; count + 1],
            vertex: vec![0; count + 1],
        };
        plan.vertex[0] = topology.vertex_count() as u32;
        for t in 0..count {
            plan.child[t + 1] = plan.child[t] + 1 + plan.split[t].count_ones();
            plan.vertex[t + 1] =
                plan.vertex[t] + (0..3).filter(|&f| plan.owns(t, f)).count() as u32;
        }
        Ok(plan)
    }

    fn is_split(&self, t: usize, face: usize) -> bool {
        self.split[t] & 1 << face != 0
    }

    /// Whether the vertex born on this edge is numbered by triangle `t`.
    fn owns(&self, t: usize, face: usize) -> bool {
        self.is_split(t, face)
            && self.around[t][face]
                .get()
                .is_none_or(|(n, _)| n.index() > t)
    }

    /// The vertex born on a split edge.
    fn midpoint(&self, t: usize, face: usize) -> VertexId {
        let (t, face) = match self.around[t][face].get() {
            Some((n, g)) if n.index() < t => (n.index(), g),
            _ => (t, face),
        };
        let before = (face + 1..3).filter(|&f| self.owns(t, f)).count() as u32;
        VertexId(self.vertex[t] + before)
    }

    /// The split edges that are numbered here, as (triangle, face), in the order of their vertices.
    fn owned(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        (0..self.topology.len()).flat_map(move |t| {
            (0..3)
                .rev()
                .filter(move |&f| self.owns(t, f))
                .map(move |f| (t, f))
        })
    }

    /// Number of the part of triangle `t` that holds the named end of the named half.
    ///
    /// The half with v0 is cut further if face 1 is split, the one with v1 if face 0 is. `at` is the local vertex
    /// that the wanted child contains (any of the half when the half is not cut further).
    fn part(&self, t: usize, left: bool, at: usize) -> u32 {
        let (left_cut, right_cut) = (self.is_split(t, 1) as u32, self.is_split(t, 0) as u32);
        let offset = match (self.odd[t], left) {
            // Even triangles run v0 -> v2 -> v1, odd ones v1 -> v2 -> v0.
            (false, true) => left_cut * (at == 2) as u32,
            (false, false) => 1 + left_cut + right_cut * (at == 1) as u32,
            (true, false) => right_cut * (at == 2) as u32,
            (true, true) => 1 + right_cut + left_cut * (at == 0) as u32,
        };
        self.child[t] + offset
    }

    /// The child of `t` that touches face `face` near local vertex `at`, and the local number of that edge there.
    fn outer(&self, t: usize, face: usize, at: usize) -> Neighbour {
        let (child, face) = if self.split[t] == 0 {
            (self.child[t], face)
        } else {
            let left = match face {
                1 => true,
                0 => false,
                _ => at == 0,
            };
            let cut = self.is_split(t, if left { 1 } else { 0 });
            let local = match (face, left, cut) {
                (2, true, false) => 0,
                (2, false, false) => 1,
                (2, _, true) => 2,
                (_, _, false) => 2,
                (1, _, true) => (at == 0) as usize,
                (_, _, true) => (at == 2) as usize,
            };
            (self.part(t, left, at), local)
        };
        Neighbour::new(TriangleId(child), face)
    }

    fn points(&self, mesh: &Mesh) -> Result<Vec<[f64; 2]>, MeshError> {
        let mut points =
            Vec::with_capacity((self.vertex[self.topology.len()] - self.vertex[0]) as usize);
        for (t, face) in self.owned() {
            let [a, b] = mesh.topology.face(TriangleId(t as u32), face);
            let (p, q) = (mesh.points[a.index()], mesh.points[b.index()]);
            let straight = [0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1])];
            let m = match mesh.curve {
                Some(circle) if self.around[t][face] == Neighbour::BOUNDARY => {
                    circle.project(straight)
                }
                _ => straight,
            };
            if m == p || m == q {
                return Err(exhausted(p, q));
            }
            points.push(m);
        }
        Ok(points)
    }

    fn triangles(&self, mesh: &Mesh) -> (Vec<[VertexId; 3]>, Vec<TriangleId>) {
        let total = self.child[self.topology.len()] as usize;
        let mut triangles = vec![[VertexId::NONE; 3]; total];
        let mut parent = vec![TriangleId(0); total];
        for (t, &v) in mesh.topology.triangles.iter().enumerate() {
            let first = self.child[t] as usize;
            parent[first..self.child[t + 1] as usize].fill(TriangleId(t as u32));
            if self.split[t] == 0 {
                triangles[first] = v;
                continue;
            }
            let [v0, v1, v2] = v;
            let p = self.midpoint(t, REFINEMENT_EDGE);
            let mut put = |left: bool, at: usize, v: [VertexId; 3]| {
                triangles[self.part(t, left, at) as usize] = v
            };
            if self.is_split(t, 1) {
                let q = self.midpoint(t, 1);
                put(true, 0, [v0, p, q]);
                put(true, 2, [p, v2, q]);
            } else {
                put(true, 0, [v2, v0, p]);
            }
            if self.is_split(t, 0) {
                let q = self.midpoint(t, 0);
                put(false, 1, [p, v1, q]);
                put(false, 2, [v2, p, q]);
            } else {
                put(false, 1, [v1, v2, p]);
            }
        }
        (triangles, parent)
    }

    fn neighbours(&self, topology: &Topology) -> Vec<[Neighbour; 3]> {
        let mut result = vec![[Neighbour::BOUNDARY; 3]; self.child[self.topology.len()] as usize];
        let mut link = |here: Neighbour, there: Neighbour| {
            if let Some((t, face)) = here.get() {
                result[t.index()][face] = there;
            }
        };
        for t in 0..topology.triangle_count() {
            for face in 0..3 {
                let Some((n, g)) = topology.neighbours[t][face].get() else {
                    continue;
                };
                let n = n.index();
                if self.is_split(t, face) {
                    // The ends in the neighbour's numbering: the edge runs the other way round there.
                    link(
                        self.outer(t, face, (face + 1) % 3),
                        self.outer(n, g, (g + 2) % 3),
                    );
                    link(
                        self.outer(t, face, (face + 2) % 3),
                        self.outer(n, g, (g + 1) % 3),
                    );
                } else {
                    link(
                        self.outer(t, face, (face + 1) % 3),
                        self.outer(n, g, (g + 1) % 3),
                    );
                }
            }
            if self.split[t] == 0 {
                continue;
            }
            let at = |left: bool, at: usize, face: usize| {
                Neighbour::new(TriangleId(self.part(t, left, at)), face)
            };
            let left = if self.is_split(t, 1) {
                let (near, far) = (at(true, 0, 0), at(true, 2, 1));
                link(near, far);
                link(far, near);
                at(true, 2, 2)
            } else {
                at(true, 0, 1)
            };
            let right = if self.is_split(t, 0) {
                let (near, far) = (at(false, 1, 1), at(false, 2, 0));
                link(near, far);
                link(far, near);
                at(false, 2, 2)
            } else {
                at(false, 1, 0)
            };
            link(left, right);
            link(right, left);
        }
        result
    }

    fn generation(&self, topology: &Topology) -> Vec<u16> {
        let mut generation = vec![0; self.child[self.topology.len()] as usize];
        for (t, &old) in topology.generation.iter().enumerate() {
            if self.split[t] == 0 {
                generation[self.child[t] as usize] = old;
                continue;
            }
            for (left, cut, ends) in [(true, 1, [0, 2]), (false, 0, [1, 2])] {
                let deeper = old + 1 + self.is_split(t, cut) as u16;
                for at in ends {
                    generation[self.part(t, left, at) as usize] = deeper;
                }
            }
        }
        generation
    }

    fn boundary(&self, topology: &Topology) -> Vec<bool> {
        let mut boundary = topology.boundary.clone();
        boundary.extend(
            self.owned()
                .map(|(t, face)| self.around[t][face] == Neighbour::BOUNDARY),
        );
        boundary
    }

    /// The vertex opposite to a split edge at the moment when it is bisected.
    fn opposite(&self, t: usize, face: usize) -> VertexId {
        if face == REFINEMENT_EDGE {
            self.topology[t][2]
        } else {
            self.midpoint(t, REFINEMENT_EDGE)
        }
    }

    fn genealogy(&self, topology: &Topology) -> Vec<Birth> {
        let mut genealogy = topology.genealogy.clone();
        let old = genealogy.len();
        for (t, face) in self.owned() {
            let across = self.around[t][face].get();
            genealogy.push(Birth {
                parents: topology.face(TriangleId(t as u32), face),
                opposite: [
                    self.opposite(t, face),
                    across.map_or(VertexId::NONE, |(n, g)| self.opposite(n.index(), g)),
                ],
                level: 0,
            });
        }
        set_levels(&mut genealogy, old);
        genealogy
    }
}

/// Sets the levels of the vertices from `old` on; parents are old, opposite vertices may be new themselves.
///
/// The opposite vertex of an edge that is not a refinement edge is the midpoint of one that comes before it in the bisection, so the
/// dependence has no cycles and the walk ends.
fn set_levels(genealogy: &mut [Birth], old: usize) {
    let mut stack = Vec::new();
    for p in old..genealogy.len() {
        stack.push(p);
        while let Some(&p) = stack.last() {
            if genealogy[p].level > 0 {
                stack.pop();
                continue;
            }
            let birth = genealogy[p];
            let waiting = birth
                .opposite
                .iter()
                .find(|q| q.is_some() && q.index() >= old && genealogy[q.index()].level == 0);
            match waiting {
                Some(q) => {
                    debug_assert!(stack.len() <= genealogy.len(), "cyclic births");
                    stack.push(q.index());
                }
                None => {
                    let around = birth.parents.iter().chain(&birth.opposite);
                    let top = around
                        .filter(|q| q.is_some())
                        .map(|q| genealogy[q.index()].level)
                        .max()
                        .unwrap_or(0);
                    genealogy[p].level = top + 1;
                    stack.pop();
                }
            }
        }
    }
}
