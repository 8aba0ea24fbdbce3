//! Integrals of data over elements, by a rule that follows jumps inside elements.
//!
//! Every element is sampled at the seven points of [`crate::quadrature`]. Where the samples do not look like
//! a smooth function, the element is quartered again and again, but only the quarters that still disagree: a jump along a curve costs points in
//! proportion to its length, a singular corner a logarithm. The tolerance is relative to the whole integral,
//! so that coarse meshes are integrated by many points and fine ones by seven.

use crate::field::{Field, FieldError, Samples};
use crate::mesh::{Mesh, Shape};
use crate::quadrature::{POINTS, RulePoint, affine_misfit, rule};

/// Something to be integrated over every element by [`integrate`].
pub trait Integrand {
    /// Number of values sampled at each point.
    fn components(&self) -> usize;

    /// Samples all components: `out[c * at.len() + k]` is component `c` at point `k`.
    ///
    /// # Errors
    /// A value that is not finite.
    fn sample(&mut self, at: Samples<'_>, out: &mut [f64]) -> Result<(), FieldError>;

    /// Judges the samples of one piece: a magnitude of the integral and an estimate of its quadrature error.
    fn judge(&self, piece: &Piece<'_>) -> Judgement;

    /// Forgets what was added for a triangle.
    fn clear(&mut self, triangle: usize);

    /// Adds the integral over a piece of `piece.triangle`.
    fn add(&mut self, piece: &Piece<'_>);
}

/// Samples on one element or a part of it.
#[derive(Clone, Copy, Debug)]
pub struct Piece<'a> {
    /// The element.
    pub triangle: usize,
    /// Area of the piece.
    pub area: f64,
    /// The rule.
    pub rule: &'a [RulePoint; POINTS],
    /// Barycentric coordinates of the points in the element.
    pub at: &'a [[f64; 3]; POINTS],
    values: &'a [f64],
    stride: usize,
    offset: usize,
}

impl<'a> Piece<'a> {
    /// The samples of one component.
    #[inline]
    pub fn values(&self, component: usize) -> &'a [f64] {
        let first = component * self.stride + self.offset;
        &self.values[first..first + POINTS]
    }
}

/// What [`Integrand::judge`] says of a piece.
#[derive(Clone, Copy, Debug)]
pub struct Judgement {
    /// Contribution to the magnitude that tolerances are relative to.
    pub magnitude: f64,
    /// Estimate of the quadrature error.
    pub error: f64,
}

/// How exactly [`integrate`] works.
#[derive(Clone, Copy, Debug)]
pub struct Control {
    /// Allowed error of a piece, relative to the magnitude of the whole integral (or of its element).
    pub tolerance: f64,
    /// Whether the tolerance is relative to the element's own magnitude instead of the whole.
    pub local: bool,
    /// How often an element may be quartered.
    pub depth: u32,
    /// Pieces larger than this share of the domain are quartered in any case.
    pub largest_share: f64,
}

struct Part {
    triangle: u32,
    depth: u32,
    corners: [[f64; 3]; 3],
}

const WHOLE: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// A piece is quartered only if its width exceeds this many spacings of the coordinates.
const SPACINGS: f64 = 64.0;

/// Pieces that are sampled together.
const BLOCK: usize = 64;

/// Integrates over every element of a mesh.
///
/// # Errors
/// Whatever the integrand's samples report.
pub fn integrate(
    mesh: &Mesh,
    control: Control,
    integrand: &mut dyn Integrand,
) -> Result<(), FieldError> {
    let rule = rule();
    let total_area = crate::norms::area(mesh);
    let mut sampler = Sampler::new(integrand.components());
    let count = mesh.triangle_count();
    let mut errors = vec![0.0; count];
    let mut magnitudes = vec![0.0; if control.local { count } else { 0 }];
    let mut magnitude = 0.0;
    let mut parts: Vec<Part> = Vec::with_capacity(BLOCK);
    for first in (0..count).step_by(BLOCK) {
        parts.clear();
        parts.extend((first..count.min(first + BLOCK)).map(|t| Part {
            triangle: t as u32,
            depth: 0,
            corners: WHOLE,
        }));
        sampler.run(
            mesh,
            &rule,
            &parts,
            integrand,
            &mut |integrand, piece, _| {
                let judgement = integrand.judge(piece);
                integrand.add(piece);
                magnitude += judgement.magnitude;
                if control.local {
                    magnitudes[piece.triangle] = judgement.magnitude;
                }
                errors[piece.triangle] = if piece.area > control.largest_share * total_area {
                    f64::INFINITY
                } else {
                    judgement.error
                };
            },
        )?;
    }
    // Below a few spacings of the coordinates' double precision the samples are noise, and quartering it would not end.
    let extent = mesh
        .points()
        .iter()
        .flatten()
        .fold(0.0f64, |m, x| m.max(x.abs()));
    let smallest = (SPACINGS * f64::EPSILON * extent).powi(2);
    let allowed = |t: usize| {
        control.tolerance
            * if control.local {
                magnitudes[t]
            } else {
                magnitude
            }
    };
    let mut stack: Vec<Part> = Vec::new();
    for t in 0..count {
        if errors[t] > allowed(t) && control.depth > 0 {
            integrand.clear(t);
            quarter(
                &Part {
                    triangle: t as u32,
                    depth: 0,
                    corners: WHOLE,
                },
                &mut stack,
            );
        }
        // Work the stack off whenever a block is full, so that it stays small.
        while stack.len() >= BLOCK || (t + 1 == count && !stack.is_empty()) {
            let keep = stack.len().saturating_sub(BLOCK);
            parts.clear();
            parts.extend(stack.drain(keep..));
            sampler.run(
                mesh,
                &rule,
                &parts,
                integrand,
                &mut |integrand, piece, part| {
                    let judgement = integrand.judge(piece);
                    let coarse = piece.area > control.largest_share * total_area;
                    let divisible = part.depth < control.depth && piece.area > smallest;
                    if divisible && (coarse || judgement.error > allowed(piece.triangle)) {
                        quarter(part, &mut stack);
                    } else {
                        integrand.add(piece);
                    }
                },
            )?;
        }
    }
    Ok(())
}

fn quarter(part: &Part, stack: &mut Vec<Part>) {
    let [a, b, c] = part.corners;
    let middle = |p: [f64; 3], q: [f64; 3]| {
        [
            0.5 * (p[0] + q[0]),
            0.5 * (p[1] + q[1]),
            0.5 * (p[2] + q[2]),
        ]
    };
    let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
    for corners in [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]] {
        stack.push(Part {
            triangle: part.triangle,
            depth: part.depth + 1,
            corners,
        });
    }
}

/// Buffers for a block of pieces.
struct Sampler {
    x: Vec<f64>,
    y: Vec<f64>,
    region: Vec<f64>,
    at: Vec<[[f64; 3]; POINTS]>,
    area: Vec<f64>,
    values: Vec<f64>,
    components: usize,
}

impl Sampler {
    fn new(components: usize) -> Self {
        Sampler {
            x: vec![0.0; BLOCK * POINTS],
            y: vec![0.0; BLOCK * POINTS],
            region: vec![0.0; BLOCK * POINTS],
            at: vec![[[0.0; 3]; POINTS]; BLOCK],
            area: vec![0.0; BLOCK],
            values: vec![0.0; BLOCK * POINTS * components],
            components,
        }
    }

    fn run(
        &mut self,
        mesh: &Mesh,
        rule: &[RulePoint; POINTS],
        parts: &[Part],
        integrand: &mut dyn Integrand,
        visit: &mut dyn FnMut(&mut dyn Integrand, &Piece<'_>, &Part),
    ) -> Result<(), FieldError> {
        let n = parts.len() * POINTS;
        for (k, part) in parts.iter().enumerate() {
            let t = part.triangle as usize;
            let corners = mesh.corners(crate::TriangleId(part.triangle));
            // Quarters of quarters: the area follows exactly from the depth.
            self.area[k] = Shape::new(corners).area * 0.25f64.powi(part.depth as i32);
            for (q, point) in rule.iter().enumerate() {
                let mut at = [0.0; 3];
                for i in 0..3 {
                    for j in 0..3 {
                        at[j] += point.at[i] * part.corners[i][j];
                    }
                }
                self.at[k][q] = at;
                let i = k * POINTS + q;
                self.x[i] = at[0] * corners[0][0] + at[1] * corners[1][0] + at[2] * corners[2][0];
                self.y[i] = at[0] * corners[0][1] + at[1] * corners[1][1] + at[2] * corners[2][1];
                self.region[i] = f64::from(mesh.region()[t]);
            }
        }
        let samples = Samples {
            x: &self.x[..n],
            y: &self.y[..n],
            region: &self.region[..n],
        };
        let values = &mut self.values[..n * self.components];
        integrand.sample(samples, values)?;
        for (k, part) in parts.iter().enumerate() {
            let piece = Piece {
                triangle: part.triangle as usize,
                area: self.area[k],
                rule,
                at: &self.at[k],
                values: &self.values[..n * self.components],
                stride: n,
                offset: k * POINTS,
            };
            visit(integrand, &piece, part);
        }
        Ok(())
    }
}

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
const LOAD_CONTROL: Control = Control {
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

/// The largest sample, and the quadrature error of their mean that their misfit points to.
fn size_and_error(rule: &[RulePoint; POINTS], samples: &[f64]) -> (f64, f64) {
    let largest = samples.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    (largest, smooth_error(affine_misfit(rule, samples), largest))
}

/// Integrates a load against the hat functions: nodal loads, element means and deviations from them.
///
/// # Errors
/// A value of the field that is not finite.
pub fn loads(mesh: &Mesh, field: &dyn Field) -> Result<Loads, FieldError> {
    let count = mesh.triangle_count();
    let mut moments = LoadMoments {
        field,
        sums: vec![[0.0; 5]; count],
        base: vec![f64::NAN; count],
    };
    match field.constant() {
        Some(f) => {
            for (t, id) in mesh.triangle_ids().enumerate() {
                let third = mesh.shape(id).area * f / 3.0;
                moments.base[t] = f;
                moments.sums[t] = [third, third, third, 0.0, 0.0];
            }
        }
        None => integrate(mesh, LOAD_CONTROL, &mut moments)?,
    }
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
    Ok(result)
}

struct LoadMoments<'a> {
    field: &'a dyn Field,
    /// (f, phi_k) for the three corners, then the first and second moment of f minus the base value.
    sums: Vec<[f64; 5]>,
    /// A value of f in the element; taken out of the second moment so that it does not cancel.
    base: Vec<f64>,
}

impl Integrand for LoadMoments<'_> {
    fn components(&self) -> usize {
        1
    }

    fn sample(&mut self, at: Samples<'_>, out: &mut [f64]) -> Result<(), FieldError> {
        self.field.sample(at, out)
    }

    fn judge(&self, piece: &Piece<'_>) -> Judgement {
        let f = piece.values(0);
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

    fn clear(&mut self, triangle: usize) {
        self.sums[triangle] = [0.0; 5];
        self.base[triangle] = f64::NAN;
    }

    fn add(&mut self, piece: &Piece<'_>) {
        let f = piece.values(0);
        let base = &mut self.base[piece.triangle];
        if base.is_nan() {
            *base = f[0];
        }
        let sums = &mut self.sums[piece.triangle];
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
