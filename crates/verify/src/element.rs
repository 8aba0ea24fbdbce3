//! Triangles as this crate sees them: plain geometry, one small struct a triangle.

use fem_core::Mesh;

/// A triangle with the gradients of its hat functions.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Element {
    /// Its vertices, counter-clockwise.
    pub vertices: [usize; 3],
    /// Its area |K|.
    pub area: f64,
    /// Gradients of the hat functions of its vertices.
    pub hat: [[f64; 2]; 3],
    /// Its diameter h_K.
    pub diameter: f64,
}

impl Element {
    /// The gradient of the first-order function with these nodal values.
    pub fn gradient(&self, values: &[f64]) -> [f64; 2] {
        let [a, b, c] = self.vertices.map(|j| values[j]);
        // The gradients of the hats sum to zero, so a common height drops out.
        [0, 1].map(|k| (b - a) * self.hat[1][k] + (c - a) * self.hat[2][k])
    }
}

/// Every triangle of a mesh.
pub(crate) fn elements(mesh: &Mesh) -> Vec<Element> {
    let points = mesh.points();
    let element = |corner: &[fem_core::VertexId; 3]| {
        let vertices = corner.map(|v| v.index());
        let p = vertices.map(|j| points[j]);
        let side = |i: usize, j: usize| [p[j][0] - p[i][0], p[j][1] - p[i][1]];
        let (ab, ac) = (side(0, 1), side(0, 2));
        let double = ab[0] * ac[1] - ab[1] * ac[0];
        // The hat of a vertex has the opposite side, turned by a right angle, over the doubled area.
        let hat = [side(1, 2), side(2, 0), ab].map(|s| [-s[1] / double, s[0] / double]);
        let diameter = [ab, ac, side(1, 2)]
            .iter()
            .fold(0.0f64, |h, s| h.max(s[0].hypot(s[1])));
        Element {
            vertices,
            area: double / 2.0,
            hat,
            diameter,
        }
    };
    mesh.triangles().iter().map(element).collect()
}

/// An edge with a triangle on both sides, seen from the first of them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Edge {
    /// Its ends, counter-clockwise around the first triangle.
    pub ends: [usize; 2],
    /// The triangles.
    pub sides: [usize; 2],
    /// h_e n, n from the first triangle to the second.
    pub normal: [f64; 2],
}

impl Edge {
    /// h_e [w . n]_e = h_e (w' - w) . n of a field that is constant on every triangle, and the sum of its absolute terms.
    pub fn jump(&self, field: &[[f64; 2]]) -> (f64, f64) {
        let [n, m] = self.normal;
        let [w, v] = self.sides.map(|t| field[t]);
        let jump = (v[0] - w[0]) * n + (v[1] - w[1]) * m;
        let terms = (v[0].abs() + w[0].abs()) * n.abs() + (v[1].abs() + w[1].abs()) * m.abs();
        (jump, terms)
    }
}

/// Every interior edge, in the order of the mesh.
pub(crate) fn edges(mesh: &Mesh) -> Vec<Edge> {
    let edge = |e: fem_core::InteriorEdge| {
        let ends = e.vertices.map(|v| v.index());
        let [p, q] = ends.map(|j| mesh.points()[j]);
        Edge {
            ends,
            sides: e.triangles.map(|t| t.index()),
            normal: [q[1] - p[1], p[0] - q[0]],
        }
    };
    mesh.interior_edges().map(edge).collect()
}
