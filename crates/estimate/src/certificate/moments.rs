//! Moments of the loads and of the action inside contact, element by element.
//!
//! lambda* = max(0, (mu_1 f_2 - mu_2 f_1)/(mu_1 + mu_2)) is the action that two membranes in contact exert on each other when the ratio of their
//! tensions is constant. All integrals here use the same points as the load vectors ([`fem_core::integrate::load_pair`]), so that
//! what cancels between loads and action cancels between their moments too.

use fem_core::integrate::{
    Integrand, Judgement, LOAD_CONTROL, Piece, Reference, integrate, judge_load,
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

/// Moments of one function in every element.
#[derive(Clone, Debug)]
pub(super) enum Integrals {
    /// Those of a constant.
    Constant(f64),
    /// Those of anything else.
    Each(Vec<Products>),
}

impl Integrals {
    /// (g, phi_k phi_l) over element `t` of this area; |K|/6 times a constant if k = l, |K|/12 if not.
    #[inline]
    pub fn product(&self, t: usize, area: f64, k: usize, l: usize) -> f64 {
        match self {
            Integrals::Constant(value) => value * area / if k == l { 6.0 } else { 12.0 },
            Integrals::Each(all) => all[t][product(k, l)],
        }
    }

    /// (g, phi_k) over element `t` of this area.
    #[inline]
    pub fn hat(&self, t: usize, area: f64, k: usize) -> f64 {
        match self {
            Integrals::Constant(value) => value * area / 3.0,
            Integrals::Each(all) => {
                let p = &all[t];
                p[product(k, 0)] + p[product(k, 1)] + p[product(k, 2)]
            }
        }
    }

    fn each(&mut self) -> &mut [Products] {
        match self {
            Integrals::Constant(_) => &mut [],
            Integrals::Each(all) => all,
        }
    }
}

/// A value for every element.
#[derive(Clone, Debug)]
pub(super) enum Values {
    /// The same everywhere.
    Constant(f64),
    /// One each.
    Each(Vec<f64>),
}

impl Values {
    #[inline]
    pub fn at(&self, t: usize) -> f64 {
        match self {
            Values::Constant(value) => *value,
            Values::Each(all) => all[t],
        }
    }

    /// The least value.
    pub fn least(&self) -> f64 {
        match self {
            Values::Constant(value) => *value,
            Values::Each(all) => all.iter().copied().fold(f64::INFINITY, f64::min),
        }
    }

    fn each(&mut self) -> &mut [f64] {
        match self {
            Values::Constant(_) => &mut [],
            Values::Each(all) => all,
        }
    }
}

/// What is known of the data in every element; scaled. Nothing is stored of constants.
#[derive(Clone, Debug)]
pub struct Moments {
    /// Of f_1 and f_2.
    pub(super) load: [Integrals; 2],
    /// Of lambda*.
    pub(super) action: Integrals,
    /// Mean of 1/mu_i.
    pub(super) softness: [Values; 2],
    /// A lower bound for mu_i, from its samples and their trend towards the corners.
    pub(super) stiffness_low: [Values; 2],
    /// Number of elements in which the samples of a tension differ by more than a factor [`JUMP`].
    pub(super) jumps: usize,
    /// Whether all samples of loads and tensions in the element are equal; empty where all data are constants.
    varied: Vec<bool>,
    /// What the elements are judged by.
    reference: Reference,
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
    /// Integrates over all elements of an initial mesh, see [`Moments::relative_to`].
    ///
    /// # Errors
    /// A value of a load or a tension that is not finite.
    pub fn of(
        mesh: &Mesh,
        load: [&dyn Field; 2],
        tension: [&dyn Field; 2],
    ) -> Result<Moments, FieldError> {
        Moments::relative_to(&Reference::of(mesh, load)?, mesh, load, tension)
    }

    /// Integrates over all elements; O(N), and no samples where all data are constants. Elements are judged as those of
    /// [`fem_core::integrate::load_pair_relative_to`].
    ///
    /// # Errors
    /// A value of a load or a tension that is not finite.
    pub fn relative_to(
        reference: &Reference,
        mesh: &Mesh,
        load: [&dyn Field; 2],
        tension: [&dyn Field; 2],
    ) -> Result<Moments, FieldError> {
        let count = mesh.triangle_count();
        let constants = [load[0], load[1], tension[0], tension[1]].map(|f| f.constant());
        if let [Some(f1), Some(f2), Some(m1), Some(m2)] = constants {
            return Ok(Moments {
                load: [f1, f2].map(Integrals::Constant),
                action: Integrals::Constant(contact_action([m1, m2], [f1, f2])),
                softness: [m1, m2].map(|m| Values::Constant(1.0 / m)),
                stiffness_low: [m1, m2].map(Values::Constant),
                jumps: 0,
                varied: Vec::new(),
                reference: *reference,
            });
        }
        let zeros = || Integrals::Each(vec![[0.0; 6]; count]);
        let per_element = |i: usize, of: fn(f64) -> f64, begin: f64| match constants[2 + i] {
            Some(value) => Values::Constant(of(value)),
            None => Values::Each(vec![begin; count]),
        };
        let varying = [0, 1].map(|i| constants[2 + i].is_none());
        let result = Moments {
            load: [zeros(), zeros()],
            action: zeros(),
            softness: [0, 1].map(|i| per_element(i, |m| 1.0 / m, 0.0)),
            stiffness_low: [0, 1].map(|i| per_element(i, |m| m, f64::INFINITY)),
            jumps: 0,
            varied: vec![false; count],
            reference: *reference,
        };
        let range = varying.map(|v| vec![NOTHING; if v { count } else { 0 }]);
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
                moments.softness[i].each()[t] /= mesh.shape(fem_core::TriangleId(t as u32)).area;
                let [least, largest] = range[i][t];
                jump[t] |= largest > JUMP * least;
            }
        }
        moments.jumps = jump.iter().filter(|j| **j).count();
        Ok(moments)
    }

    /// Whether all data are constant in an element.
    #[inline]
    pub(super) fn uniform(&self, t: usize) -> bool {
        self.varied.is_empty() || !self.varied[t]
    }

    /// Whether all data are constant in every element.
    pub(super) fn all_uniform(&self) -> bool {
        !self.varied.contains(&true)
    }
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
    fn reference(&self) -> Option<Reference> {
        Some(self.moments.reference)
    }

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
        moments.load[0].each()[t] = [0.0; 6];
        moments.load[1].each()[t] = [0.0; 6];
        moments.action.each()[t] = [0.0; 6];
        moments.varied[t] = false;
        self.first[t] = None;
        for i in (0..2).filter(|&i| self.varying[i]) {
            moments.softness[i].each()[t] = 0.0;
            moments.stiffness_low[i].each()[t] = f64::INFINITY;
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
            moments.varied[t] |= sample != first;
            let weight = point.weight * piece.area;
            let [f1, f2, m1, m2] = sample;
            let action = contact_action([m1, m2], [f1, f2]);
            let shapes = [
                at[0] * at[0],
                at[1] * at[1],
                at[2] * at[2],
                at[1] * at[2],
                at[2] * at[0],
                at[0] * at[1],
            ];
            let [first, second] = &mut moments.load;
            for (integrals, value) in [(first, f1), (second, f2), (&mut moments.action, action)] {
                for (sum, shape) in integrals.each()[t].iter_mut().zip(&shapes) {
                    *sum += weight * shape * value;
                }
            }
            for (i, mu) in [(0, m1), (1, m2)] {
                if self.varying[i] {
                    moments.softness[i].each()[t] += weight / mu;
                    let [least, largest] = &mut self.range[i][t];
                    (*least, *largest) = (least.min(mu), largest.max(mu));
                }
            }
        }
        for i in (0..2).filter(|&i| self.varying[i]) {
            let low = &mut moments.stiffness_low[i].each()[t];
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
