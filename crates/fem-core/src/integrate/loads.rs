//! Loads and tensions: their moments over elements.

use super::{Control, Integrand, Judgement, Piece, integrate};
use crate::field::{Constant, Field, FieldError, Samples};
use crate::mesh::Mesh;
use crate::quadrature::{POINTS, RulePoint, affine_misfit};

/// Integrals of one load over a mesh.
#[derive(Clone, Debug, Default)]
pub struct Loads {
    /// (f, phi_j) for every vertex, boundary included.
    pub nodal: Vec<f64>,
    /// Mean f_h of f over every triangle.
    pub mean: Vec<f64>,
    /// ||f - f_h||^2 over every triangle.
    pub deviation_squared: Vec<f64>,
}

/// The tolerance of loads: a piece cut by a jump is quartered until its area is about this share of the domain.
pub const LOAD_CONTROL: Control = Control {
    tolerance: 1e-7,
    local: false,
    depth: 14,
    largest_share: 1.0 / 16384.0,
};

/// Element means of tensions are wanted to ten digits where the tension is smooth.
const MEAN_CONTROL: Control = Control {
    tolerance: 1e-12,
    local: true,
    depth: 7,
    largest_share: 2.0,
};

/// Size of the quadrature error that a misfit of samples of size `largest` points to, for a function itself.
///
/// The misfit m is O(h^2) for smooth data, for which the rule's error is O(h^6) = O(m^3); for a jump both are of the size of the jump.
#[inline]
pub fn smooth_error(misfit: f64, largest: f64) -> f64 {
    if misfit == 0.0 {
        0.0
    } else {
        misfit * (misfit / largest) * (misfit / largest)
    }
}

/// Size of the quadrature error that a misfit of samples of size `largest` points to, for the square of a function.
///
/// A smooth function whose square is an error density is affine but for O(h) of its size, and its square is integrated with a relative error of
/// O(h^4), the fourth power of the relative misfit; a jump or a singularity leaves a misfit of its own size.
#[inline]
pub fn squared_error(misfit: f64, largest: f64) -> f64 {
    if misfit == 0.0 {
        0.0
    } else {
        (3.0 * misfit / largest).min(1.0).powi(4) * largest * largest
    }
}

/// The largest sample, and the quadrature error of their mean that their misfit points to.
fn size_and_error(rule: &[RulePoint; POINTS], samples: &[f64]) -> (f64, f64) {
    let largest = samples.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    (largest, smooth_error(affine_misfit(rule, samples), largest))
}

/// Integrates one load, see [`load_pair`].
///
/// # Errors
/// A value of the field that is not finite.
pub fn loads(mesh: &Mesh, field: &dyn Field) -> Result<Loads, FieldError> {
    load_pair(mesh, [field, &Constant(0.0)]).map(|[loads, _]| loads)
}

/// Integrates two loads against the hat functions: nodal loads, element means and deviations from them.
///
/// Both are sampled at the same points, as many as either needs: what cancels between the loads then cancels between their integrals too.
///
/// # Errors
/// A value of a field that is not finite.
pub fn load_pair(mesh: &Mesh, fields: [&dyn Field; 2]) -> Result<[Loads; 2], FieldError> {
    let count = mesh.triangle_count();
    if let [Some(f), Some(g)] = fields.map(|f| f.constant()) {
        return Ok([f, g].map(|f| constant_load(mesh, f)));
    }
    let none = || Moments {
        sums: vec![[0.0; 5]; count],
        base: vec![f64::NAN; count],
    };
    let mut pair = LoadPair {
        fields,
        moments: [none(), none()],
    };
    integrate(mesh, LOAD_CONTROL, &mut pair)?;
    let moments = pair.moments;
    Ok([0, 1].map(|i| match fields[i].constant() {
        Some(f) => constant_load(mesh, f),
        None => moments[i].loads(mesh),
    }))
}

fn constant_load(mesh: &Mesh, f: f64) -> Loads {
    let count = mesh.triangle_count();
    let mut moments = Moments {
        sums: Vec::with_capacity(count),
        base: vec![f; count],
    };
    for id in mesh.triangle_ids() {
        let third = mesh.shape(id).area * f / 3.0;
        moments.sums.push([third, third, third, 0.0, 0.0]);
    }
    moments.loads(mesh)
}

impl Moments {
    fn loads(&self, mesh: &Mesh) -> Loads {
        let count = mesh.triangle_count();
        let moments = self;
        let mut result = Loads {
            nodal: vec![0.0; mesh.vertex_count()],
            mean: Vec::with_capacity(count),
            deviation_squared: Vec::with_capacity(count),
        };
        for (t, id) in mesh.triangle_ids().enumerate() {
            let area = mesh.shape(id).area;
            let [m0, m1, m2, d1, d2] = moments.sums[t];
            for (v, m) in mesh.triangles()[t].iter().zip([m0, m1, m2]) {
                result.nodal[v.index()] += m;
            }
            result.mean.push(moments.base[t] + d1 / area);
            result
                .deviation_squared
                .push((d2 - d1 * d1 / area).max(0.0));
        }
        result
    }
}

/// How one load is judged on a piece: by the misfit of its samples, for the integrals of [`load_pair`].
pub fn judge_load(piece: &Piece<'_>, component: usize) -> Judgement {
    let f = piece.values(component);
    let (_, error) = size_and_error(piece.rule, f);
    let magnitude: f64 = piece
        .rule
        .iter()
        .zip(f)
        .map(|(p, v)| p.weight * v.abs())
        .sum();
    Judgement {
        magnitude: magnitude * piece.area,
        error: error * piece.area,
    }
}

/// Moments of one load in every element.
struct Moments {
    /// (f, phi_k) for the three corners, then the first and second moment of f minus the base value.
    sums: Vec<[f64; 5]>,
    /// A value of f in the element; taken out of the second moment so that it does not cancel.
    base: Vec<f64>,
}

struct LoadPair<'a> {
    fields: [&'a dyn Field; 2],
    moments: [Moments; 2],
}

impl Integrand for LoadPair<'_> {
    fn components(&self) -> usize {
        2
    }

    fn sample(&mut self, at: Samples<'_>, out: &mut [f64]) -> Result<(), FieldError> {
        let (first, second) = out.split_at_mut(at.len());
        self.fields[0].sample(at, first)?;
        self.fields[1].sample(at, second)
    }

    fn judge(&self, piece: &Piece<'_>) -> Judgement {
        judge_load(piece, 0)
    }

    fn judge_second(&self, piece: &Piece<'_>) -> Judgement {
        judge_load(piece, 1)
    }

    fn clear(&mut self, triangle: usize) {
        for moments in &mut self.moments {
            moments.sums[triangle] = [0.0; 5];
            moments.base[triangle] = f64::NAN;
        }
    }

    fn add(&mut self, piece: &Piece<'_>) {
        for (i, moments) in self.moments.iter_mut().enumerate() {
            let f = piece.values(i);
            let base = &mut moments.base[piece.triangle];
            if base.is_nan() {
                *base = f[0];
            }
            let sums = &mut moments.sums[piece.triangle];
            for ((p, at), v) in piece.rule.iter().zip(piece.at).zip(f) {
                let w = p.weight * piece.area;
                let d = v - *base;
                sums[0] += w * at[0] * v;
                sums[1] += w * at[1] * v;
                sums[2] += w * at[2] * v;
                sums[3] += w * d;
                sums[4] += w * d * d;
            }
        }
    }
}

/// The mean of a field over every triangle, to ten digits where it is smooth.
///
/// # Errors
/// A value of the field that is not finite.
pub fn means(mesh: &Mesh, field: &dyn Field) -> Result<Vec<f64>, FieldError> {
    if let Some(value) = field.constant() {
        return Ok(vec![value; mesh.triangle_count()]);
    }
    let count = mesh.triangle_count();
    let mut sums = FieldMeans {
        field,
        shares: vec![0.0; count],
        base: vec![f64::NAN; count],
        area: areas(mesh),
    };
    integrate(mesh, MEAN_CONTROL, &mut sums)?;
    Ok(sums
        .base
        .iter()
        .zip(&sums.shares)
        .map(|(b, s)| b + s)
        .collect())
}

fn areas(mesh: &Mesh) -> Vec<f64> {
    mesh.triangle_ids().map(|t| mesh.shape(t).area).collect()
}

struct FieldMeans<'a> {
    field: &'a dyn Field,
    shares: Vec<f64>,
    base: Vec<f64>,
    area: Vec<f64>,
}

impl Integrand for FieldMeans<'_> {
    fn components(&self) -> usize {
        1
    }

    fn sample(&mut self, at: Samples<'_>, out: &mut [f64]) -> Result<(), FieldError> {
        self.field.sample(at, out)
    }

    fn judge(&self, piece: &Piece<'_>) -> Judgement {
        let f = piece.values(0);
        let (largest, error) = size_and_error(piece.rule, f);
        let share = piece.area / self.area[piece.triangle];
        Judgement {
            magnitude: largest * share,
            error: share * error,
        }
    }

    fn clear(&mut self, triangle: usize) {
        self.shares[triangle] = 0.0;
        self.base[triangle] = f64::NAN;
    }

    fn add(&mut self, piece: &Piece<'_>) {
        let f = piece.values(0);
        let base = &mut self.base[piece.triangle];
        if base.is_nan() {
            *base = f[0];
        }
        let share = piece.area / self.area[piece.triangle];
        for (p, v) in piece.rule.iter().zip(f) {
            self.shares[piece.triangle] += p.weight * share * (v - *base);
        }
    }
}
