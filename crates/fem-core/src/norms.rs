//! Norms of first-order functions.

use crate::mesh::Mesh;

/// Area of the whole domain.
pub fn area(mesh: &Mesh) -> f64 {
    mesh.triangle_ids().map(|t| mesh.area(t)).sum()
}

/// The square of the seminorm `|v|_1` of the first-order function with these nodal values, weighted by one coefficient a triangle.
pub fn weighted_seminorm_squared(
    mesh: &Mesh,
    values: &[f64],
    coefficient: impl Fn(usize) -> f64,
) -> f64 {
    let mut sum = 0.0;
    for (t, id) in mesh.triangle_ids().enumerate() {
        let shape = mesh.shape(id);
        let g = shape.gradient(mesh.triangles()[t].map(|v| values[v.index()]));
        sum += coefficient(t) * shape.area * (g[0] * g[0] + g[1] * g[1]);
    }
    sum
}
