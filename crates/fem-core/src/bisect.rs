//! Newest-vertex bisection with conforming closure, one pass over flat arrays.
//!
//! A triangle (v0, v1, v2) is bisected at the midpoint p of its refinement edge (v0, v1) into (v2, v0, p) and (v1, v2, p), whose newest
//! vertex is p; both stay counter-clockwise. A pass marks edges instead of recursing: if any edge of a triangle is split, its
//! refinement edge is too. Every triangle then has one to four children, known from three bits (module `parts`), and takes the
//! place of its parent in the order, so that the leaves always lie along a space-filling curve: it enters an
//! even triangle at v0 and leaves at v1, an odd one the other way round.
//!
//! The cost of a pass is linear in the number of triangles, the closure linear in what it splits. Three loops do it: one counts, one makes the
//! vertices, one the triangles; each writes its arrays from front to back.

mod children;

use crate::error::MeshError;
use crate::index::{TriangleId, VertexId};
use crate::mesh::{Mesh, TRIANGLE_LIMIT};
use crate::parts::{FACES, REFINEMENT_EDGE, TOUCHING};
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
    /// Which edges of every triangle of the old mesh were split: bit `i` stands for face `i`. 0 where the triangle stayed as it was.
    pub split: Vec<u8>,
    /// Edges looked at by the closure: a measure of its work.
    pub closure_steps: usize,
}

impl Mesh {
    /// This mesh with the marked triangles refined, and as many others as conformity needs.
    ///
    /// # Errors
    /// [`MeshError::CoordinatesExhausted`] when an edge is so short that its midpoint is not distinct from its ends in double
    /// precision or a child would have no area; [`MeshError::TooLarge`] beyond 2^30 - 1 triangles.
    pub fn refined(
        &self,
        marked: &[TriangleId],
        children: Children,
    ) -> Result<(Mesh, Refinement), MeshError> {
        self.refined_on(marked, children, 1)
    }

    /// [`Mesh::refined`] on at most `threads` threads; the result does not depend on their number.
    ///
    /// # Errors
    /// As there.
    pub fn refined_on(
        &self,
        marked: &[TriangleId],
        children: Children,
        threads: usize,
    ) -> Result<(Mesh, Refinement), MeshError> {
        let (split, closure_steps) = self.closure(marked, children);
        let plan = Plan::new(&self.topology, &split)?;
        let vertices = plan.vertices(self)?;
        let (mesh, parent) = plan.triangles(self, vertices, threads)?;
        let refinement = Refinement {
            old_vertices: self.vertex_count(),
            parent,
            split,
            closure_steps,
        };
        Ok((mesh, refinement))
    }

    /// Refines the marked triangles in place, as [`Mesh::refined`].
    ///
    /// # Errors
    /// As there; the mesh is then left as it was.
    pub fn refine(
        &mut self,
        marked: &[TriangleId],
        children: Children,
    ) -> Result<Refinement, MeshError> {
        let (mesh, refinement) = self.refined(marked, children)?;
        *self = mesh;
        Ok(refinement)
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
        let mut stack: Vec<Neighbour> = Vec::new();
        let mut steps = 0;
        let faces: &[usize] = match children {
            Children::Two => &FACES[..1],
            Children::Four => &FACES,
        };
        for &t in marked {
            for &face in faces {
                steps += 1;
                stack.push(Neighbour::new(t, face));
                while let Some((t, face)) = stack.pop().and_then(Neighbour::get) {
                    let bits = &mut split[t.index()];
                    if *bits & 1 << face != 0 {
                        continue;
                    }
                    *bits |= 1 << face;
                    if *bits & 1 << REFINEMENT_EDGE == 0 {
                        steps += 1;
                        stack.push(Neighbour::new(t, REFINEMENT_EDGE));
                    }
                    let across = self.topology.neighbours[t.index()][face];
                    if let Some((n, g)) = across.get() {
                        steps += 1;
                        // What is split already needs no second look.
                        if split[n.index()] & 1 << g == 0 {
                            stack.push(across);
                        }
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

/// What is known of an old triangle before anything is written.
#[derive(Clone, Copy)]
struct Entry {
    /// Its first child.
    child: u32,
    /// The first vertex born on an edge that it owns: of two triangles, the lower number numbers what is born between them.
    vertex: u32,
    /// The key into [`PARTS`]: split edges, and the parity of the generation in bit 3.
    key: u8,
    /// The split edges that it owns.
    owned: u8,
}

impl Entry {
    fn is_split(self, face: usize) -> bool {
        self.key & 1 << face != 0
    }

    fn owns(self, face: usize) -> bool {
        self.owned & 1 << face != 0
    }

    /// The vertex born on an owned edge; [`FACES`] gives the order.
    fn born(self, face: usize) -> VertexId {
        VertexId(self.vertex + ones(self.owned >> (face + 1)))
    }
}

/// Numbers of everything that a pass makes.
struct Plan<'a> {
    old: &'a Topology,
    entries: Vec<Entry>,
    vertices: usize,
    triangles: usize,
}

/// Everything of a refined mesh that has one entry a vertex.
struct Vertices {
    points: Vec<[f64; 2]>,
    boundary: Vec<bool>,
    genealogy: Vec<Birth>,
}

impl<'a> Plan<'a> {
    fn new(old: &'a Topology, split: &[u8]) -> Result<Self, MeshError> {
        let count = old.triangle_count();
        let triangles = count + split.iter().map(|&b| ones(b) as usize).sum::<usize>();
        if triangles > TRIANGLE_LIMIT {
            return Err(MeshError::TooLarge {
                triangles,
                limit: TRIANGLE_LIMIT,
            });
        }
        let mut entries = Vec::with_capacity(count);
        let (mut child, mut vertex) = (0, old.vertex_count() as u32);
        for (t, ((&split, around), generation)) in split
            .iter()
            .zip(&old.neighbours)
            .zip(&old.generation)
            .enumerate()
        {
            let mut later = 0;
            for face in 0..3 {
                later |= (around[face].is_behind(TriangleId(t as u32)) as u8) << face;
            }
            let owned = split & later;
            entries.push(Entry {
                child,
                vertex,
                key: split | ((generation & 1) as u8) << 3,
                owned,
            });
            child += 1 + ones(split);
            vertex += ones(owned);
        }
        Ok(Plan {
            old,
            entries,
            vertices: vertex as usize,
            triangles,
        })
    }

    /// The vertex born on a split edge.
    #[inline(always)]
    fn midpoint(&self, t: usize, face: usize) -> VertexId {
        let entry = self.entries[t];
        if entry.owns(face) {
            return entry.born(face);
        }
        match self.old.neighbours[t][face].get() {
            Some((n, g)) => self.entries[n.index()].born(g),
            None => VertexId::NONE,
        }
    }

    /// The vertex opposite to a split edge at the moment when it is bisected.
    #[inline(always)]
    fn opposite(&self, t: usize, face: usize) -> VertexId {
        if face == REFINEMENT_EDGE {
            self.old.triangles[t][2]
        } else {
            self.midpoint(t, REFINEMENT_EDGE)
        }
    }

    /// What lies behind a face of the old mesh, near each of its ends, and the vertex born on it, should the triangle there own it.
    #[inline(always)]
    fn behind(&self, next: Neighbour) -> ([Neighbour; 2], VertexId) {
        let Some((n, face)) = next.get() else {
            return ([Neighbour::BOUNDARY; 2], VertexId::NONE);
        };
        let entry = self.entries[n.index()];
        // The edge runs the other way round there.
        let [end, start] = TOUCHING[((entry.key & 15) << 2) as usize | face & 3];
        let at = |place| Neighbour::at(TriangleId(entry.child), place as u32);
        ([at(start), at(end)], entry.born(face))
    }

    /// Makes the vertices.
    fn vertices(&self, mesh: &Mesh) -> Result<Vertices, MeshError> {
        let old = self.old.vertex_count();
        let mut points = grown(&mesh.points, self.vertices);
        let mut boundary = grown(&self.old.boundary, self.vertices);
        let mut genealogy = grown(&self.old.genealogy, self.vertices);
        for (t, entry) in self.entries.iter().enumerate() {
            if entry.owned == 0 {
                continue;
            }
            for face in FACES {
                if !entry.owns(face) {
                    continue;
                }
                let parents = self.old.face(TriangleId(t as u32), face);
                let [p, q] = parents.map(|v| points[v.index()]);
                let straight = [0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1])];
                let across = self.old.neighbours[t][face].get();
                let m = match mesh.curve {
                    Some(circle) if across.is_none() => circle.project(straight),
                    _ => straight,
                };
                if m == p || m == q {
                    return Err(exhausted(p, q));
                }
                let opposite = [
                    self.opposite(t, face),
                    across.map_or(VertexId::NONE, |(n, g)| self.opposite(n.index(), g)),
                ];
                let mut birth = Birth {
                    parents,
                    opposite,
                    level: 0,
                };
                // Where the edge is the refinement edge on both sides, nothing around it is new.
                if face == REFINEMENT_EDGE && across.is_none_or(|(_, g)| g == REFINEMENT_EDGE) {
                    birth.level = level(&genealogy, &birth);
                }
                points.push(m);
                boundary.push(across.is_none());
                genealogy.push(birth);
            }
        }
        set_levels(&mut genealogy, old);
        Ok(Vertices {
            points,
            boundary,
            genealogy,
        })
    }
}

/// Number of ones among three bits; not every processor that this is compiled for counts them in one step.
#[inline(always)]
fn ones(bits: u8) -> u32 {
    0b11_10_10_01_10_01_01_00 >> (2 * bits) & 3
}

/// A copy with room for `count` entries.
fn grown<T: Copy>(old: &[T], count: usize) -> Vec<T> {
    let mut new = Vec::with_capacity(count);
    new.extend_from_slice(old);
    new
}

/// One more than the largest level around a birth.
#[inline]
fn level(genealogy: &[Birth], birth: &Birth) -> u16 {
    let of = |v: VertexId| genealogy[v.index()].level;
    let [c, d] = birth.opposite;
    let far = if d.is_some() { of(d) } else { 0 };
    1 + of(birth.parents[0])
        .max(of(birth.parents[1]))
        .max(of(c))
        .max(far)
}

/// Sets the levels that are still 0 from vertex `old` on; parents are old, opposite vertices may be new themselves.
///
/// The opposite vertex of an edge that is not a refinement edge is the midpoint of one that comes before it in the bisection, so the
/// dependence has no cycles and the walk ends. On most meshes that midpoint has its level already and nothing is walked.
fn set_levels(genealogy: &mut [Birth], old: usize) {
    let mut stack = Vec::new();
    for p in old..genealogy.len() {
        let birth = genealogy[p];
        if birth.level > 0 {
            continue;
        }
        let known =
            |q: VertexId| !q.is_some() | (q.index() < old) || genealogy[q.index()].level > 0;
        if known(birth.opposite[0]) && known(birth.opposite[1]) {
            genealogy[p].level = level(genealogy, &birth);
            continue;
        }
        stack.push(p);
        while let Some(&p) = stack.last() {
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
                    genealogy[p].level = level(genealogy, &birth);
                    stack.pop();
                }
            }
        }
    }
}
