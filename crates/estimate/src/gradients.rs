//! Gradients of first-order functions and their jumps.

use fem_core::{InteriorEdge, Mesh};

/// The constant gradient on every triangle of the function with these nodal values.
pub(crate) fn gradients(mesh: &Mesh, values: &[f64]) -> Vec<[f64; 2]> {
    mesh.triangle_ids()
        .zip(mesh.triangles())
        .map(|(id, v)| mesh.shape(id).gradient(v.map(|j| values[j.index()])))
        .collect()
}

/// h_e n: the normal of an interior edge, as long as the edge, from its first triangle to its second.
#[inline]
pub(crate) fn scaled_normal(mesh: &Mesh, edge: &InteriorEdge) -> [f64; 2] {
    // The ends run counter-clockwise around the first triangle, so the outward normal lies to their right.
    let [a, b] = edge.vertices.map(|v| mesh.points()[v.index()]);
    [b[1] - a[1], a[0] - b[0]]
}

/// h_e [w . n]_e = h_e (w|_K' - w|_K) . n for a field w that is constant on both triangles.
#[inline]
pub(crate) fn scaled_jump(normal: [f64; 2], first: [f64; 2], second: [f64; 2]) -> f64 {
    (second[0] - first[0]) * normal[0] + (second[1] - first[1]) * normal[1]
}
