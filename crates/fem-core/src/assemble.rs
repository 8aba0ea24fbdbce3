//! Stiffness matrices and nodal sums of first-order elements.

use std::sync::Arc;

use crate::mesh::Mesh;
use crate::sparse::{Pattern, SymmetricMatrix};

/// The stiffness matrix with entries `sum_K c_K (grad phi_i, grad phi_j)_K`, boundary vertices included.
///
/// `coefficient` holds one value a triangle: the mean of the tension (first-order elements need no more). The diagonal is minus
/// the sum of the rest of its row, so that constants lie in the kernel to rounding.
pub fn stiffness(
    mesh: &Mesh,
    pattern: &Arc<Pattern>,
    coefficient: impl Fn(usize) -> f64,
) -> SymmetricMatrix {
    let mut matrix = SymmetricMatrix::zeros(pattern.clone());
    let values = matrix.values_mut();
    let mut add = |i: usize, j: usize, a: f64| {
        // Both vertices belong to one triangle, so the pattern has the entry.
        if let Some(at) = pattern.position(i, j) {
            values[at] += a;
        }
    };
    for (t, id) in mesh.triangle_ids().enumerate() {
        let shape = mesh.shape(id);
        let v = mesh.triangles()[t];
        let c = coefficient(t) * shape.area;
        for face in 0..3 {
            let (k, l) = ((face + 1) % 3, (face + 2) % 3);
            let (g, h) = (shape.gradients[k], shape.gradients[l]);
            let a = c * (g[0] * h[0] + g[1] * h[1]);
            let (i, j) = (v[k].index(), v[l].index());
            add(i, j, a);
            add(j, i, a);
            add(i, i, -a);
            add(j, j, -a);
        }
    }
    matrix
}

/// Area |D_j| of every vertex's barycentric dual cell: a third of its patch.
pub fn dual_areas(mesh: &Mesh) -> Vec<f64> {
    let mut area = vec![0.0; mesh.vertex_count()];
    for (t, id) in mesh.triangle_ids().enumerate() {
        let third = mesh.area(id) / 3.0;
        for v in mesh.triangles()[t] {
            area[v.index()] += third;
        }
    }
    area
}
