//! Moments of the loads and of the action inside contact, element by element.
//!
//! lambda* = max(0, (mu_1 f_2 - mu_2 f_1)/(mu_1 + mu_2)) is the action that two membranes in contact exert on each other when the ratio of their
//! tensions is constant. All integrals here use the same points as the load vectors ([`fem_core::integrate::load_pair`]), so that
//! what cancels between loads and action cancels between their moments too.

use fem_core::integrate::{
    Integrand, Judgement, LOAD_CONTROL, Loads, Piece, integrate, judge_load,
};
use fem_core::quadrature::affine_fit;
use fem_core::{Field, FieldError, Mesh, Samples};

/// Integrals against the products phi_0^2, phi_1^2, phi_2^2, phi_1 phi_2, phi_2 phi_0, phi_0 phi_1 of the hat functions of an element.
pub(super) type Products = [f64; 6];

/// Position of phi_k phi_l in [`Products`].
#[inline]
pub(super) fn product(k: usize, l: usize) -> usize {
    if k == l { k } else { 6 - k - l }
}

/// (g, phi_k) from the products.
#[inline]
pub(super) fn against_hat(products: &Products, k: usize) -> f64 {
    products[product(k, 0)] + products[product(k, 1)] + products[product(k, 2)]
}

/// What is known of the data in every element; scaled.
#[derive(Clone, Debug)]
pub struct Moments {
    /// Of f_1 and f_2.
    pub(super) load: [Vec<Products>; 2],
    /// Of lambda*.
    pub(super) action: Vec<Products>,
    /// Whether all samples of loads and tensions in the element are equal.
    pub(super) uniform: Vec<bool>,
    /// Mean of 1/mu_i.
    pub(super) softness: [Vec<f64>; 2],
    /// A lower bound for mu_i, from its samples and their trend towards the corners.
    pub(super) stiffness_low: [Vec<f64>; 2],
    /// Number of elements in which the samples of a tension differ by more than a factor [`JUMP`].
    pub(super) jumps: usize,
    /// A value of f_i in the element, and the first two moments of f_i minus that value.
    spread: [Vec<[f64; 3]>; 2],
}

/// Quotient of the largest and the smallest sample of a tension in an element that counts as a jump inside.
pub const JUMP: f64 = 10.0;

/// The action inside contact.
#[inline]
pub(super) fn contact_action(tension: [f64; 2], load: [f64; 2]) -> f64 {
    let [m1, m2] = tension;
    // Written so that no product of tension and load can leave the range.
    let (first, second) = (m1 / (m1 + m2), m2 / (m1 + m2));
    (first * load[1] - second * load[0]).max(0.0)
}

impl Moments {
    /// Integrates over all elements; O(N), and no samples where all data are constants.
    ///
    /// `tension_mean` holds the means of the tensions over the elements.
    ///
    /// # Errors
    /// A value of a load or a tension that is not finite.
    pub fn of(
        mesh: &Mesh,
        load: [&dyn Field; 2],
        tension: [&dyn Field; 2],
        tension_mean: &[Vec<f64>; 2],
    ) -> Result<Moments, FieldError> {
        let count = mesh.triangle_count();
        let constants = [load[0], load[1], tension[0], tension[1]].map(|f| f.constant());
        let inverse = |mean: &Vec<f64>| mean.iter().map(|m| 1.0 / m).collect::<Vec<_>>();
        let mut result = Moments {
            load: [Vec::new(), Vec::new()],
            action: Vec::new(),
            uniform: vec![true; count],
            softness: [inverse(&tension_mean[0]), inverse(&tension_mean[1])],
            stiffness_low: tension_mean.clone(),
            jumps: 0,
            spread: [Vec::new(), Vec::new()],
        };
        if let [Some(f1), Some(f2), Some(m1), Some(m2)] = constants {
            let action = contact_action([m1, m2], [f1, f2]);
            let products = |value: f64| -> Vec<Products> {
                mesh.triangle_ids()
                    .map(|id| constant_products(mesh.shape(id).area, value))
                    .collect()
            };
            result.load = [products(f1), products(f2)];
            result.action = products(action);
            result.spread = [f1, f2].map(|f| vec![[f, 0.0, 0.0]; count]);
            return Ok(result);
        }
        result.load = [vec![[0.0; 6]; count], vec![[0.0; 6]; count]];
        result.action = vec![[0.0; 6]; count];
        result.spread = [vec![[0.0; 3]; count], vec![[0.0; 3]; count]];
        let varying = [tension[0], tension[1]].map(|f| f.constant().is_none());
        let mut range = [Vec::new(), Vec::new()];
        for i in 0..2 {
            if varying[i] {
                result.softness[i] = vec![0.0; count];
                result.stiffness_low[i] = vec![f64::INFINITY; count];
                range[i] = vec![NOTHING; count];
            }
        }
        let mut integrand = Sums {
            fields: [load[0], load[1], tension[0], tension[1]],
            varying,
            moments: result,
            first: vec![None; count],
            range,
        };
        integrate(mesh, LOAD_CONTROL, &mut integrand)?;
        let Sums {
            mut moments, range, ..
        } = integrand;
        let mut jump = vec![false; count];
        for i in (0..2).filter(|&i| varying[i]) {
            for t in 0..count {
                moments.softness[i][t] /= mesh.shape(fem_core::TriangleId(t as u32)).area;
                let [least, largest] = range[i][t];
                jump[t] |= largest > JUMP * least;
            }
        }
        moments.jumps = jump.iter().filter(|j| **j).count();
        Ok(moments)
    }

    /// The load vectors, means and deviations, as [`fem_core::integrate::load_pair`] finds them.
    pub fn loads(&self, mesh: &Mesh) -> [Loads; 2] {
        [0, 1].map(|i| {
            let mut loads = Loads {
                nodal: vec![0.0; mesh.vertex_count()],
                mean: Vec::with_capacity(mesh.triangle_count()),
                deviation_squared: Vec::with_capacity(mesh.triangle_count()),
            };
            for (t, id) in mesh.triangle_ids().enumerate() {
                for (k, v) in mesh.triangles()[t].iter().enumerate() {
                    loads.nodal[v.index()] += against_hat(&self.load[i][t], k);
                }
                let area = mesh.shape(id).area;
                let [base, first, second] = self.spread[i][t];
                loads.mean.push(base + first / area);
                loads
                    .deviation_squared
                    .push((second - first * first / area).max(0.0));
            }
            loads
        })
    }
}

/// Products of the hat functions times a constant: |K|/6 on the diagonal, |K|/12 beside it.
#[inline]
fn constant_products(area: f64, value: f64) -> Products {
    let twelfth = value * area / 12.0;
    let sixth = 2.0 * twelfth;
    [sixth, sixth, sixth, twelfth, twelfth, twelfth]
}

/// The integrals under way.
struct Sums<'a> {
    /// f_1, f_2, mu_1, mu_2.
    fields: [&'a dyn Field; 4],
    varying: [bool; 2],
    moments: Moments,
    /// The first samples met in an element.
    first: Vec<Option<[f64; 4]>>,
    /// The least and the largest sample of a tension that varies.
    range: [Vec<[f64; 2]>; 2],
}

/// The range of no samples.
const NOTHING: [f64; 2] = [f64::INFINITY, 0.0];

impl Integrand for Sums<'_> {
    fn components(&self) -> usize {
        4
    }

    fn sample(&mut self, at: Samples<'_>, out: &mut [f64]) -> Result<(), FieldError> {
        for (field, out) in self.fields.iter().zip(out.chunks_mut(at.len().max(1))) {
            field.sample(at, out)?;
        }
        Ok(())
    }

    // Judged as the load vectors are, so that the points are the same.
    fn judge(&self, piece: &Piece<'_>) -> Judgement {
        judge_load(piece, 0)
    }

    fn judge_second(&self, piece: &Piece<'_>) -> Judgement {
        judge_load(piece, 1)
    }

    fn clear(&mut self, t: usize) {
        let moments = &mut self.moments;
        moments.load[0][t] = [0.0; 6];
        moments.load[1][t] = [0.0; 6];
        moments.action[t] = [0.0; 6];
        moments.uniform[t] = true;
        moments.spread[0][t] = [0.0; 3];
        moments.spread[1][t] = [0.0; 3];
        self.first[t] = None;
        for i in (0..2).filter(|&i| self.varying[i]) {
            moments.softness[i][t] = 0.0;
            moments.stiffness_low[i][t] = f64::INFINITY;
            self.range[i][t] = NOTHING;
        }
    }

    fn add(&mut self, piece: &Piece<'_>) {
        let t = piece.triangle;
        let values = [0, 1, 2, 3].map(|c| piece.values(c));
        let first = *self.first[t].get_or_insert([0, 1, 2, 3].map(|c| values[c][0]));
        let moments = &mut self.moments;
        for (k, (point, at)) in piece.rule.iter().zip(piece.at).enumerate() {
            let sample = [0, 1, 2, 3].map(|c| values[c][k]);
            moments.uniform[t] &= sample == first;
            let weight = point.weight * piece.area;
            let [f1, f2, m1, m2] = sample;
            let action = contact_action([m1, m2], [f1, f2]);
            for i in 0..2 {
                let [base, one, two] = &mut moments.spread[i][t];
                *base = first[i];
                let d = sample[i] - first[i];
                *one += weight * d;
                *two += weight * d * d;
            }
            let shapes = [
                at[0] * at[0],
                at[1] * at[1],
                at[2] * at[2],
                at[1] * at[2],
                at[2] * at[0],
                at[0] * at[1],
            ];
            for (p, shape) in shapes.iter().enumerate() {
                let w = weight * shape;
                moments.load[0][t][p] += w * f1;
                moments.load[1][t][p] += w * f2;
                moments.action[t][p] += w * action;
            }
            for (i, mu) in [(0, m1), (1, m2)] {
                if self.varying[i] {
                    moments.softness[i][t] += weight / mu;
                    let [least, largest] = &mut self.range[i][t];
                    (*least, *largest) = (least.min(mu), largest.max(mu));
                }
            }
        }
        for i in (0..2).filter(|&i| self.varying[i]) {
            let low = &mut moments.stiffness_low[i][t];
            *low = low.min(lowest(piece, values[2 + i]));
        }
    }
}

/// A lower bound for a positive field over a piece: the lowest sample, and lower where the affine trend of the samples points to less
/// at a corner; never below half the lowest sample, where no trend is to be trusted.
fn lowest(piece: &Piece<'_>, samples: &[f64]) -> f64 {
    let least = samples.iter().copied().fold(f64::INFINITY, f64::min);
    let fit = affine_fit(piece.rule, samples);
    let trend = fit.corners.iter().copied().fold(f64::INFINITY, f64::min) - fit.misfit;
    least.min(trend.max(0.5 * least))
}
