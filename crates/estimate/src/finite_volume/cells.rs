//! Integrals of functions that are constant on the dual cells.

use fem_core::integrate::{Control, Integrand, Judgement, Piece, integrate, squared_error};
use fem_core::quadrature::affine_misfit;
use fem_core::{Field, FieldError, Mesh, Samples};

use super::quarter::{Place, Quartered};

/// A piece cut by a jump of the exact action is quartered until its error is this share of the square of the norm.
const CONTROL: Control = Control {
    tolerance: 1e-7,
    local: false,
    depth: 20,
    largest_share: 1.0 / 2000.0,
};

/// Errors below this share of the action are resolved no further: what the samples show there may be the rounding of a formula.
const FLOOR: f64 = 1e-8;

/// ||exact - sum_j l_j chi_Dj||.
pub(super) fn l2_error(mesh: &Mesh, action: &[f64], exact: &dyn Field) -> Result<f64, FieldError> {
    let mut points = mesh.points().to_vec();
    let mut middle = std::collections::HashMap::with_capacity(2 * mesh.triangle_count());
    let (mut triangles, mut region, mut value) = (Vec::new(), Vec::new(), Vec::new());
    for ((id, v), tag) in mesh.triangle_ids().zip(mesh.triangles()).zip(mesh.region()) {
        let corners = mesh.corners(id);
        let mean = |k: usize| (corners[0][k] + corners[1][k] + corners[2][k]) / 3.0;
        let centre = points.len() as u32;
        points.push([mean(0), mean(1)]);
        let v = v.map(|j| j.0);
        let edge = [0, 1, 2].map(|k| {
            let (a, b) = (v[k], v[(k + 1) % 3]);
            *middle.entry((a.min(b), a.max(b))).or_insert_with(|| {
                let (p, q) = (corners[k], corners[(k + 1) % 3]);
                points.push([0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1])]);
                points.len() as u32 - 1
            })
        });
        for k in 0..3 {
            triangles.extend([[v[k], edge[k], centre], [v[k], centre, edge[(k + 2) % 3]]]);
            region.extend([*tag; 2]);
            value.extend([action[v[k] as usize]; 2]);
        }
    }
    let fine = Mesh::new(points, &triangles, &region, None)
        // The six parts of every triangle of a mesh are triangles of a mesh again.
        .expect("sub-triangles of a mesh are a mesh");
    let mut error = SquaredError {
        exact,
        square: vec![0.0; value.len()],
        value,
    };
    integrate(&fine, CONTROL, &mut error)?;
    Ok(error.square.iter().sum::<f64>().sqrt())
}

struct SquaredError<'a> {
    exact: &'a dyn Field,
    /// l_j, one entry a sub-triangle.
    value: Vec<f64>,
    square: Vec<f64>,
}

impl Integrand for SquaredError<'_> {
    fn components(&self) -> usize {
        1
    }

    fn sample(&mut self, at: Samples<'_>, out: &mut [f64]) -> Result<(), FieldError> {
        self.exact.sample(at, out)
    }

    /// As for the errors of gradients: where the action is smooth the square is integrated with the fourth power of the relative misfit.
    fn judge(&self, piece: &Piece<'_>) -> Judgement {
        let l = self.value[piece.triangle];
        let values = piece.values(0);
        let (mut square, mut largest, mut floor) = (0.0, 0.0f64, l * l);
        for (point, v) in piece.rule.iter().zip(values) {
            square += point.weight * (v - l) * (v - l);
            largest = largest.max((v - l).abs());
            floor += point.weight * v * v;
        }
        let misfit = affine_misfit(piece.rule, values);
        Judgement {
            magnitude: piece.area * (square + FLOOR * FLOOR * floor),
            error: piece.area * squared_error(misfit, largest),
        }
    }

    fn clear(&mut self, triangle: usize) {
        self.square[triangle] = 0.0;
    }

    fn add(&mut self, piece: &Piece<'_>) {
        let l = self.value[piece.triangle];
        let points = piece.rule.iter().zip(piece.values(0));
        let sum: f64 = points.map(|(p, v)| p.weight * (v - l) * (v - l)).sum();
        self.square[piece.triangle] += piece.area * sum;
    }
}

/// (sum_j l_j chi_Dj, psi_k) for the hat functions psi_k of the fine mesh, exactly.
pub(super) fn loads(coarse: &Mesh, fine: &Quartered, action: &[f64]) -> Vec<f64> {
    let table: Vec<[[f64; 3]; 3]> = fine.places.iter().map(shares).collect();
    let mut sums = vec![0.0; fine.mesh.vertex_count()];
    let groups = fine.triangles.chunks_exact(table.len());
    for ((id, v), group) in coarse.triangle_ids().zip(coarse.triangles()).zip(groups) {
        let area = coarse.shape(id).area;
        let l = v.map(|j| action[j.index()]);
        for (corners, shares) in group.iter().zip(&table) {
            for (k, corner) in corners.iter().enumerate() {
                let sum: f64 = (0..3).map(|a| l[a] * shares[a][k]).sum();
                sums[*corner as usize] += area * sum;
            }
        }
    }
    sums
}

/// Entry (a, k): the integral of the hat function of corner k of a fine triangle over the dual cell of corner a of the
/// coarse one, over the coarse area.
fn shares(triangle: &[Place; 3]) -> [[f64; 3]; 3] {
    let whole = area(triangle);
    [0, 1, 2].map(|a| {
        // The dual cell of corner a is where its barycentric coordinate is the largest.
        let mut polygon = triangle.to_vec();
        for b in [(a + 1) % 3, (a + 2) % 3] {
            polygon = clip(&polygon, |p| p[a] - p[b]);
        }
        let mut result = [0.0; 3];
        for i in 1..polygon.len().saturating_sub(1) {
            let part = [polygon[0], polygon[i], polygon[i + 1]];
            let size = area(&part);
            for (k, sum) in result.iter_mut().enumerate() {
                let hat =
                    |p: &Place| area(&[*p, triangle[(k + 1) % 3], triangle[(k + 2) % 3]]) / whole;
                *sum += size * part.iter().map(hat).sum::<f64>() / 3.0;
            }
        }
        result
    })
}

/// The share of a triangle in the area of the coarse one.
fn area([a, b, c]: &[Place; 3]) -> f64 {
    let d = |p: &Place, k: usize| p[k] - a[k];
    d(b, 1) * d(c, 2) - d(b, 2) * d(c, 1)
}

/// The part of a convex polygon where an affine function is not negative.
fn clip(polygon: &[Place], f: impl Fn(&Place) -> f64) -> Vec<Place> {
    let mut result = Vec::with_capacity(polygon.len() + 1);
    for (i, p) in polygon.iter().enumerate() {
        let q = &polygon[(i + 1) % polygon.len()];
        let (u, v) = (f(p), f(q));
        if u >= 0.0 {
            result.push(*p);
        }
        if (u > 0.0 && v < 0.0) || (u < 0.0 && v > 0.0) {
            let s = u / (u - v);
            result.push([0, 1, 2].map(|k| p[k] + s * (q[k] - p[k])));
        }
    }
    result
}
