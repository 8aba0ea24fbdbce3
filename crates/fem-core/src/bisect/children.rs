//! The triangles of a refined mesh, the last of the three loops.

use std::ops::Range;

use super::{Plan, Vertices, exhausted};
use crate::error::MeshError;
use crate::index::{TriangleId, VertexId};
use crate::mesh::{Mesh, signed_area};
use crate::parallel;
use crate::parts::{Link, PARTS};
use crate::topology::{Neighbour, Topology};

/// Everything of a refined mesh that has one entry a triangle, and the parents.
struct Triangles {
    corners: Vec<[VertexId; 3]>,
    neighbours: Vec<[Neighbour; 3]>,
    generation: Vec<u16>,
    region: Vec<i32>,
    parent: Vec<TriangleId>,
}

impl Triangles {
    fn with_capacity(room: usize) -> Self {
        Triangles {
            corners: Vec::with_capacity(room),
            neighbours: Vec::with_capacity(room),
            generation: Vec::with_capacity(room),
            region: Vec::with_capacity(room),
            parent: Vec::with_capacity(room),
        }
    }

    fn append(&mut self, more: &Triangles) {
        self.corners.extend_from_slice(&more.corners);
        self.neighbours.extend_from_slice(&more.neighbours);
        self.generation.extend_from_slice(&more.generation);
        self.region.extend_from_slice(&more.region);
        self.parent.extend_from_slice(&more.parent);
    }
}

impl Plan<'_> {
    /// Makes the triangles, and with them the refined mesh; the parent of each.
    pub(super) fn triangles(
        &self,
        mesh: &Mesh,
        vertices: Vertices,
        threads: usize,
    ) -> Result<(Mesh, Vec<TriangleId>), MeshError> {
        let Vertices {
            points,
            boundary,
            genealogy,
        } = vertices;
        // One stretch of the old triangles for every thread: where they are cut does not show. The first one has room for all.
        let count = self.entries.len();
        let threads = parallel::worthwhile(threads, count);
        let stretches = (0..threads).map(|k| count * k / threads..count * (k + 1) / threads);
        let children = parallel::map(threads, stretches.collect(), |stretch| {
            let before = |t: usize| {
                self.entries
                    .get(t)
                    .map_or(self.triangles, |e| e.child as usize)
            };
            let room = match stretch.start {
                0 => self.triangles,
                start => before(stretch.end) - before(start),
            };
            self.children(mesh, &points, stretch, room)
        });
        let mut all = Triangles::with_capacity(0);
        for (k, children) in children.into_iter().enumerate() {
            if k == 0 {
                all = children?;
            } else {
                all.append(&children?);
            }
        }
        let topology = Topology {
            triangles: all.corners,
            neighbours: all.neighbours,
            generation: all.generation,
            boundary,
            genealogy,
        };
        let refined = Mesh {
            topology,
            points,
            region: all.region,
            curve: mesh.curve,
        };
        Ok((refined, all.parent))
    }

    /// The children of a stretch of old triangles; `room` is how many are to be expected, or more.
    fn children(
        &self,
        mesh: &Mesh,
        points: &[[f64; 2]],
        stretch: Range<usize>,
        room: usize,
    ) -> Result<Triangles, MeshError> {
        let Triangles {
            corners: mut triangles,
            mut neighbours,
            mut generation,
            mut region,
            mut parent,
        } = Triangles::with_capacity(room);
        let mut next = stretch.start;
        while next < stretch.end {
            // Triangles that stay, up to the next that is split.
            let stay = self.entries[next..stretch.end]
                .iter()
                .position(|e| e.key & 7 != 0);
            let run = next..stay.map_or(stretch.end, |n| next + n);
            if !run.is_empty() {
                next = run.end;
                triangles.extend_from_slice(&self.old.triangles[run.clone()]);
                generation.extend_from_slice(&self.old.generation[run.clone()]);
                region.extend_from_slice(&mesh.region[run.clone()]);
                parent.extend(run.clone().map(|t| TriangleId(t as u32)));
                neighbours.extend(self.old.neighbours[run].iter().map(|around| {
                    let [a, b, c] = *around;
                    [
                        self.behind(a).0[0],
                        self.behind(b).0[0],
                        self.behind(c).0[0],
                    ]
                }));
                continue;
            }
            let t = next;
            next += 1;
            let entry = self.entries[t];
            let corners = self.old.triangles[t];
            let around = self.old.neighbours[t];
            let old_generation = self.old.generation[t];
            let mut vertex = [corners[0]; 8];
            vertex[..3].copy_from_slice(&corners);
            let mut outer = [Neighbour::BOUNDARY; 8];
            for face in 0..3 {
                let (ends, theirs) = self.behind(around[face]);
                outer[2 * face] = ends[0];
                outer[2 * face + 1] = ends[1];
                if entry.is_split(face) {
                    let mine = entry.owns(face);
                    vertex[3 + face] = if mine { entry.born(face) } else { theirs };
                }
            }
            let parts = &PARTS[(entry.key & 15) as usize];
            for part in 0..parts.count as usize & 7 {
                let [a, b, c] = parts.corners[part & 3];
                let corners = [
                    vertex[(a & 7) as usize],
                    vertex[(b & 7) as usize],
                    vertex[(c & 7) as usize],
                ];
                let [a, b, c] = [
                    points[corners[0].index()],
                    points[corners[1].index()],
                    points[corners[2].index()],
                ];
                let area = signed_area([a, b, c]);
                if area.is_nan() | (area <= 0.0) {
                    return Err(exhausted(a, b));
                }
                let mut around = [Neighbour::BOUNDARY; 3];
                for face in 0..3 {
                    around[face] = match parts.link(part & 3, face) {
                        Link::Inner(place) => Neighbour::at(TriangleId(entry.child), place),
                        Link::Outer(side) => outer[side],
                    };
                }
                triangles.push(corners);
                neighbours.push(around);
                generation.push(old_generation + parts.depth[part & 3] as u16);
                region.push(mesh.region[t]);
                parent.push(TriangleId(t as u32));
            }
        }
        Ok(Triangles {
            corners: triangles,
            neighbours,
            generation,
            region,
            parent,
        })
    }
}
