//! The one checker of everything that a mesh promises.

use crate::mesh::{Mesh, signed_area};
use crate::topology::Neighbour;

/// Checks every invariant of a mesh: O(N).
///
/// Areas are positive; neighbours name each other and run along the common edge in opposite directions; a boundary vertex is one with a boundary
/// edge; every vertex is used; parents are older than their child, and lie on the boundary together with it
/// (its edge was a boundary edge) exactly when there is no second opposite vertex; a straight child is the midpoint of its parents;
/// the level of a child is one more than the highest of the vertices around it.
///
/// # Errors
/// A sentence that says what is broken and where.
pub fn check(mesh: &Mesh) -> Result<(), String> {
    let n = mesh.vertex_count();
    let (triangles, neighbours) = (mesh.triangles(), mesh.neighbours());
    let lengths = [
        mesh.points().len(),
        mesh.boundary().len(),
        mesh.genealogy().len(),
    ];
    if lengths.iter().any(|&l| l != n) {
        return Err(format!("vertex arrays have lengths {lengths:?}"));
    }
    let lengths = [
        neighbours.len(),
        mesh.generation().len(),
        mesh.region().len(),
    ];
    if lengths.iter().any(|&l| l != triangles.len()) {
        return Err(format!(
            "triangle arrays have lengths {lengths:?}, not {}",
            triangles.len()
        ));
    }
    let mut used = vec![false; n];
    let mut edge_on_boundary = vec![false; n];
    for (t, id) in mesh.triangle_ids().enumerate() {
        let area = signed_area(mesh.corners(id));
        if area.is_nan() || area <= 0.0 {
            return Err(format!("triangle {t} has area {area}"));
        }
        triangles[t].iter().for_each(|v| used[v.index()] = true);
        for face in 0..3 {
            let [a, b] = mesh.face(id, face);
            match neighbours[t][face].get() {
                None => {
                    edge_on_boundary[a.index()] = true;
                    edge_on_boundary[b.index()] = true;
                }
                Some((other, g)) => {
                    if neighbours[other.index()][g] != Neighbour::new(id, face) {
                        return Err(format!(
                            "triangle {} does not name triangle {t} as its neighbour",
                            other.0
                        ));
                    }
                    if mesh.face(other, g) != [b, a] {
                        return Err(format!(
                            "triangles {t} and {} do not share an edge",
                            other.0
                        ));
                    }
                }
            }
        }
    }
    if let Some(v) = used.iter().position(|u| !u) {
        return Err(format!("vertex {v} is not used"));
    }
    if let Some(v) = (0..n).find(|&v| edge_on_boundary[v] != mesh.boundary()[v]) {
        return Err(format!("vertex {v} has the wrong boundary flag"));
    }
    check_genealogy(mesh)
}

fn check_genealogy(mesh: &Mesh) -> Result<(), String> {
    let genealogy = mesh.genealogy();
    for (p, birth) in genealogy.iter().enumerate() {
        let [a, b] = birth.parents;
        let [c, d] = birth.opposite;
        if !a.is_some() {
            if birth.level != 0 || b.is_some() || c.is_some() || d.is_some() {
                return Err(format!("initial vertex {p} has a history: {birth:?}"));
            }
            continue;
        }
        if a.index() >= p || b.index() >= p || !c.is_some() {
            return Err(format!("vertex {p} is born of {birth:?}"));
        }
        let around = [a, b, c, d]
            .into_iter()
            .filter(|q| q.is_some())
            .map(|q| genealogy[q.index()].level)
            .max();
        if around.map(|l| l + 1) != Some(birth.level) {
            return Err(format!(
                "vertex {p} has level {}, its surroundings {around:?}",
                birth.level
            ));
        }
        if d.is_some() == mesh.boundary()[p] {
            return Err(format!(
                "vertex {p}: boundary flag and second opposite vertex disagree"
            ));
        }
        let (x, y, m) = (
            mesh.points()[a.index()],
            mesh.points()[b.index()],
            mesh.points()[p],
        );
        let straight = [0.5 * (x[0] + y[0]), 0.5 * (x[1] + y[1])];
        if m != straight && !(mesh.boundary()[p] && mesh.curve().is_some()) {
            return Err(format!("vertex {p} is not the midpoint of its parents"));
        }
    }
    Ok(())
}
