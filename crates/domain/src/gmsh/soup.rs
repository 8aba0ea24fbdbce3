//! From nodes and triangles as a file has them to a checked mesh.

use std::collections::HashMap;

use super::error::{Flaw, GmshFault, Place};
use crate::check::check;
use crate::geometry::{Frame, orient};
use crate::{MeshDefect, RawMesh};

/// Heights may differ by this much, relative to the extent of the mesh.
const FLAT: f64 = 1e-10;

/// A node of a file.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Node {
    pub tag: u64,
    pub position: [f64; 3],
    /// Line or offset of the tag.
    pub tag_at: usize,
    /// Line or offset of the coordinates.
    pub at: usize,
}

/// A triangle of a file.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Triangle {
    pub tag: u64,
    pub nodes: [u64; 3],
    pub region: i32,
    /// Line or offset.
    pub at: usize,
}

/// The nodes and triangles of a file, in its order.
#[derive(Clone, Debug, Default)]
pub(crate) struct Soup {
    pub nodes: Vec<Node>,
    pub triangles: Vec<Triangle>,
}

impl Soup {
    /// The mesh of the triangles: unused nodes dropped, clockwise triangles turned, everything
    /// else in the order of the file. `place` turns positions in the file into places.
    pub fn into_mesh(self, place: &dyn Fn(usize) -> Place) -> Result<RawMesh, Flaw> {
        let flaw = |at: usize, fault| Flaw {
            place: place(at),
            fault,
        };
        let defect = |defect: MeshDefect| {
            let name = |t: usize| format!("element {}", self.triangles[t].tag);
            let message = defect.describe(&name);
            Flaw {
                place: defect
                    .triangle()
                    .map_or(Place::File, |t| place(self.triangles[t].at)),
                fault: GmshFault::Defect { defect, message },
            }
        };
        if self.triangles.is_empty() {
            return Err(defect(MeshDefect::NoTriangles));
        }
        let count = self.nodes.len().max(self.triangles.len());
        if u32::try_from(count).is_err() {
            return Err(defect(MeshDefect::TooLarge { count }));
        }
        let mut index = HashMap::with_capacity(self.nodes.len());
        for (i, node) in self.nodes.iter().enumerate() {
            if index.insert(node.tag, i as u32).is_some() {
                return Err(flaw(
                    node.tag_at,
                    GmshFault::DuplicateNode { node: node.tag },
                ));
            }
            if !node.position.iter().all(|x| x.is_finite()) {
                let (node, value) = (node.tag, node.position);
                return Err(flaw(
                    self.nodes[i].at,
                    GmshFault::NodeNotFinite { node, value },
                ));
            }
        }

        let mut triangles = Vec::with_capacity(self.triangles.len());
        let mut used = vec![false; self.nodes.len()];
        for triangle in &self.triangles {
            let mut corners = [0; 3];
            for (corner, node) in corners.iter_mut().zip(triangle.nodes) {
                *corner = *index.get(&node).ok_or_else(|| {
                    let element = triangle.tag;
                    flaw(triangle.at, GmshFault::UnknownNode { element, node })
                })?;
                used[*corner as usize] = true;
            }
            triangles.push(corners);
        }

        let mut number = vec![u32::MAX; self.nodes.len()];
        let mut kept = Vec::new();
        for (i, node) in self.nodes.iter().enumerate() {
            if used[i] {
                number[i] = kept.len() as u32;
                kept.push(*node);
            }
        }
        for corner in triangles.iter_mut().flatten() {
            *corner = number[*corner as usize];
        }
        let points: Vec<[f64; 2]> = kept
            .iter()
            .map(|n| [n.position[0], n.position[1]])
            .collect();
        flat(&kept).map_err(|(at, fault)| flaw(at, fault))?;
        if let Ok(frame) = Frame::new(&points) {
            for corners in &mut triangles {
                let [a, b, c] = corners.map(|v| frame.enter(points[v as usize]));
                if orient(a, b, c) < 0.0 {
                    corners.swap(1, 2);
                }
            }
        }
        let mesh = RawMesh {
            points,
            triangles,
            regions: self.triangles.iter().map(|t| t.region).collect(),
        };
        check(&mesh).map_err(defect)?;
        Ok(mesh)
    }
}

/// Checks that the nodes lie in a plane z = const.
fn flat(nodes: &[Node]) -> Result<(), (usize, GmshFault)> {
    let span = |k: usize| {
        let (low, high) = nodes.iter().fold((f64::MAX, f64::MIN), |(low, high), n| {
            (low.min(n.position[k]), high.max(n.position[k]))
        });
        high - low
    };
    let tolerance = FLAT * span(0).max(span(1));
    let first = &nodes[0];
    match nodes.iter().find(|n| {
        let rise = (n.position[2] - first.position[2]).abs();
        rise > 0.0 && rise > tolerance
    }) {
        None => Ok(()),
        Some(node) => Err((
            node.at,
            GmshFault::NotPlanar {
                node: node.tag,
                z: node.position[2],
                other: first.tag,
                other_z: first.position[2],
            },
        )),
    }
}
