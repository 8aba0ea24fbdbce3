//! Moments of the action inside contact, element by element, and what is to be known of the tensions.
//!
//! lambda* = max(0, (mu_1 f_2 - mu_2 f_1)/(mu_1 + mu_2)) is the action that two membranes in contact exert on each other when the ratio of their
//! tensions is constant. All integrals here use the same points as the load vectors ([`fem_core::integrate::load_pair`]), so that
//! what cancels between loads and action cancels between their moments too.

use fem_core::integrate::{
    Integrand, Judgement, LOAD_CONTROL, Loads, Piece, Reference, integrate, judge_load,
};
use fem_core::quadrature::affine_fit;
use fem_core::{Field, FieldError, Mesh, Samples, TriangleId};

use super::action::{Action, Products, affine_action, contact_action, product};
use super::data::{deviation, hats};

/// Where the moments of an element are among those that are kept.
#[derive(Clone, Debug)]
enum Integrals {
    /// Loads and lambda* are constants; lambda* is this one.
    Constant(f64),
    /// The place of every element, [`NOWHERE`] where it was not sampled, and the products of f_1, f_2 and lambda* there.
    Each(Vec<u32>, Vec<[Products; 3]>),
}

/// The place of an element that was not sampled.
const NOWHERE: u32 = u32::MAX;

/// Position of lambda* beside the loads.
const ACTION: usize = 2;

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

/// What is known of the action inside contact and of the tensions in every element; scaled. Nothing is stored of constants.
///
/// Where both tensions are constants, elements apart from the contact set are not sampled: there the loads say all.
#[derive(Clone, Debug)]
pub struct Moments {
    /// Of the loads and of lambda*.
    products: Integrals,
    /// Mean of 1/mu_i.
    pub(super) softness: [Values; 2],
    /// A lower bound for mu_i, from its samples and their trend towards the corners.
    pub(super) stiffness_low: [Values; 2],
    /// Number of elements in which the samples of a tension differ by more than a factor [`JUMP`].
    pub(super) jumps: usize,
    /// Whether not all samples of loads and tensions in the element are equal; empty unless a tension varies.
    varied: Vec<bool>,
    /// Whether all elements are sampled or need not be.
    complete: bool,
    /// What the elements are judged by.
    reference: Reference,
}

/// Quotient of the largest and the smallest sample of a tension in an element that counts as a jump inside.
pub const JUMP: f64 = 10.0;

/// What tells where the action matters.
#[derive(Clone, Copy)]
pub struct Near<'a> {
    /// Action forces, one a vertex.
    pub force: &'a [f64],
    /// What the discrete problem knows of the loads, from the same points as the moments.
    pub loads: &'a [Loads; 2],
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
        Moments::made(reference, mesh, load, tension, None)
    }

    /// Integrates where it matters for a pair with these action forces, one a vertex; see [`Moments::cover`].
    ///
    /// # Errors
    /// A value of a load or a tension that is not finite.
    pub fn near(
        reference: &Reference,
        mesh: &Mesh,
        load: [&dyn Field; 2],
        tension: [&dyn Field; 2],
        near: Near<'_>,
    ) -> Result<Moments, FieldError> {
        Moments::made(reference, mesh, load, tension, Some(near))
    }

    fn made(
        reference: &Reference,
        mesh: &Mesh,
        load: [&dyn Field; 2],
        tension: [&dyn Field; 2],
        near: Option<Near<'_>>,
    ) -> Result<Moments, FieldError> {
        let mut moments = Moments::empty(reference, mesh, load, tension);
        if moments.complete {
            moments.sample(mesh, load, tension, |_| true)?;
        } else {
            moments.cover(mesh, load, tension, near)?;
        }
        Ok(moments)
    }

    /// Integrates over the elements that action forces make matter and that were not sampled yet, which is what [`super::Grade::Rt0`] needs; without
    /// forces over all, for [`super::Grade::Rt1`].
    ///
    /// # Errors
    /// A value of a load that is not finite.
    pub fn cover(
        &mut self,
        mesh: &Mesh,
        load: [&dyn Field; 2],
        tension: [&dyn Field; 2],
        near: Option<Near<'_>>,
    ) -> Result<(), FieldError> {
        let missing = self.missing(mesh, tension, near);
        if missing.is_empty() {
            return Ok(());
        }
        let mut new = vec![false; mesh.triangle_count()];
        for &t in &missing {
            new[t] = true;
        }
        self.complete |= near.is_none();
        self.sample(mesh, load, tension, |t| new[t])
    }

    /// The elements that were not sampled, touch a vertex with a force (or one on the boundary that such a vertex may lend its share to) and have no affine
    /// action; without forces all that were not sampled.
    pub(super) fn missing(
        &self,
        mesh: &Mesh,
        tension: [&dyn Field; 2],
        near: Option<Near<'_>>,
    ) -> Vec<usize> {
        let Integrals::Each(place, _) = &self.products else {
            return Vec::new();
        };
        if self.complete {
            return Vec::new();
        }
        let unseen = |t: usize| place[t] == NOWHERE;
        let Some(Near { force, loads }) = near else {
            return (0..mesh.triangle_count()).filter(|&t| unseen(t)).collect();
        };
        let (triangles, boundary) = (mesh.triangles(), mesh.boundary());
        let pressed = |j: usize| force[j] > 0.0 && !boundary[j];
        // Shares go along the boundary as far as there are gaps to close: all of it may be reached.
        let any = triangles.iter().any(|v| {
            let v = v.map(|j| j.index());
            v.iter().any(|&j| boundary[j]) && v.iter().any(|&j| pressed(j))
        });
        let matters = |j: usize| pressed(j) || (any && boundary[j]);
        let constant = tension.map(|f| f.constant());
        let known = |t: usize| {
            let [Some(m1), Some(m2)] = constant else {
                return false;
            };
            let area = mesh.area(TriangleId(t as u32));
            affine_action([m1, m2], area, &hats(loads, t, area), deviation(loads, t)).is_some()
        };
        triangles
            .iter()
            .enumerate()
            .filter(|(_, v)| v.iter().any(|j| matters(j.index())))
            .map(|(t, _)| t)
            .filter(|&t| unseen(t) && !known(t))
            .collect()
    }

    /// Nothing known yet but what is constant.
    fn empty(
        reference: &Reference,
        mesh: &Mesh,
        load: [&dyn Field; 2],
        tension: [&dyn Field; 2],
    ) -> Moments {
        let count = mesh.triangle_count();
        let [f1, f2] = load.map(|f| f.constant());
        let [m1, m2] = tension.map(|f| f.constant());
        let products = match [f1, f2, m1, m2] {
            [Some(f1), Some(f2), Some(m1), Some(m2)] => {
                Integrals::Constant(contact_action([m1, m2], [f1, f2]))
            }
            _ => Integrals::Each(vec![NOWHERE; count], Vec::new()),
        };
        let per_element = |constant: Option<f64>, of: fn(f64) -> f64, begin: f64| match constant {
            Some(value) => Values::Constant(of(value)),
            None => Values::Each(vec![begin; count]),
        };
        let varies = m1.is_none() || m2.is_none();
        Moments {
            complete: varies || matches!(products, Integrals::Constant(_)),
            products,
            softness: [m1, m2].map(|m| per_element(m, |m| 1.0 / m, 0.0)),
            stiffness_low: [m1, m2].map(|m| per_element(m, |m| m, f64::INFINITY)),
            jumps: 0,
            varied: vec![false; if varies { count } else { 0 }],
            reference: *reference,
        }
    }

    /// Integrates over the elements that are wanted.
    fn sample(
        &mut self,
        mesh: &Mesh,
        load: [&dyn Field; 2],
        tension: [&dyn Field; 2],
        wanted: impl Fn(usize) -> bool,
    ) -> Result<(), FieldError> {
        let Integrals::Each(place, products) = &mut self.products else {
            return Ok(());
        };
        let count = mesh.triangle_count();
        for (t, place) in place.iter_mut().enumerate().filter(|(t, _)| wanted(*t)) {
            debug_assert_eq!(*place, NOWHERE, "triangle {t} is sampled again");
            *place = products.len() as u32;
            products.push([[0.0; 6]; 3]);
        }
        let constant = tension.map(|f| f.constant());
        let varying = constant.map(|c| c.is_none());
        let range = varying.map(|v| vec![NOTHING; if v { count } else { 0 }]);
        let mut integrand = Sums {
            fields: [load[0], load[1], tension[0], tension[1]],
            constant,
            varying,
            first: vec![None; self.varied.len()],
            wanted: &wanted,
            moments: self,
            range,
        };
        integrate(mesh, LOAD_CONTROL, &mut integrand)?;
        let range = integrand.range;
        if varying == [false; 2] {
            return Ok(());
        }
        let mut jump = vec![false; count];
        for i in (0..2).filter(|&i| varying[i]) {
            for t in 0..count {
                self.softness[i].each()[t] /= mesh.shape(fem_core::TriangleId(t as u32)).area;
                let [least, largest] = range[i][t];
                jump[t] |= largest > JUMP * least;
            }
        }
        self.jumps = jump.iter().filter(|j| **j).count();
        Ok(())
    }

    /// (g, phi_k phi_l) over element `t` of this area for g = f_1, f_2 or lambda*; 0 where it was not sampled, and |K|/6 times a constant if k = l,
    /// |K|/12 if not.
    #[inline]
    fn product(&self, which: usize, t: usize, area: f64, k: usize, l: usize) -> f64 {
        match &self.products {
            Integrals::Constant(value) => value * area / if k == l { 6.0 } else { 12.0 },
            Integrals::Each(place, products) => products
                .get(place[t] as usize)
                .map_or(0.0, |p| p[which][product(k, l)]),
        }
    }

    /// lambda* where it is the same everywhere, known by the constants that it is made from.
    #[inline]
    pub(super) fn constant_action(&self) -> Option<f64> {
        match &self.products {
            Integrals::Constant(value) => Some(*value),
            Integrals::Each(..) => None,
        }
    }

    /// lambda* in an element as it was sampled.
    #[inline]
    pub(super) fn action(&self, t: usize) -> Action<'_> {
        match &self.products {
            Integrals::Constant(value) => Action::Affine([*value; 3]),
            Integrals::Each(place, products) => products
                .get(place[t] as usize)
                .map_or(Action::Unknown, |p| Action::Sampled(&p[ACTION])),
        }
    }

    /// (lambda*, phi_k phi_l) over element `t` of this area.
    #[inline]
    pub fn action_product(&self, t: usize, area: f64, k: usize, l: usize) -> f64 {
        self.product(ACTION, t, area, k, l)
    }

    /// (f_i, phi_k phi_l) over a sampled element; from `mean` where all data are constants.
    #[inline]
    pub fn load_product(
        &self,
        i: usize,
        t: usize,
        area: f64,
        mean: f64,
        (k, l): (usize, usize),
    ) -> f64 {
        match &self.products {
            Integrals::Constant(_) => mean * area / if k == l { 6.0 } else { 12.0 },
            Integrals::Each(..) => self.product(i, t, area, k, l),
        }
    }

    /// Whether all data are constant in an element.
    #[inline]
    pub(super) fn uniform(&self, loads: &[Loads; 2], t: usize) -> bool {
        match self.varied.get(t) {
            Some(varied) => !varied,
            None => loads.iter().all(|f| f.deviation_squared(t) == 0.0),
        }
    }

    /// The products of an element that is sampled.
    fn each(&mut self, t: usize) -> &mut [Products] {
        match &mut self.products {
            Integrals::Each(place, products) => products
                .get_mut(place[t] as usize)
                .map_or(&mut [], |p| &mut p[..]),
            Integrals::Constant(_) => &mut [],
        }
    }

    /// Whether all data are constant in every element.
    pub(super) fn all_uniform(&self, loads: &[Loads; 2]) -> bool {
        loads.iter().all(|f| f.same().is_some()) && !self.varied.contains(&true)
    }
}

/// The integrals under way.
struct Sums<'a> {
    /// f_1, f_2, mu_1, mu_2.
    fields: [&'a dyn Field; 4],
    /// The tensions that are constants.
    constant: [Option<f64>; 2],
    varying: [bool; 2],
    moments: &'a mut Moments,
    /// The elements to be sampled.
    wanted: &'a dyn Fn(usize) -> bool,
    /// The first samples met in an element, where a tension varies.
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
        if self.varying == [false; 2] { 2 } else { 4 }
    }

    fn skips(&self, triangle: usize) -> bool {
        !(self.wanted)(triangle)
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
        let moments = &mut *self.moments;
        moments.each(t).fill([0.0; 6]);
        if let Some(first) = self.first.get_mut(t) {
            moments.varied[t] = false;
            *first = None;
        }
        for i in (0..2).filter(|&i| self.varying[i]) {
            moments.softness[i].each()[t] = 0.0;
            moments.stiffness_low[i].each()[t] = f64::INFINITY;
            self.range[i][t] = NOTHING;
        }
    }

    fn add(&mut self, piece: &Piece<'_>) {
        let t = piece.triangle;
        let loads = [0, 1].map(|c| piece.values(c));
        let tension = |i: usize, k: usize| match self.constant[i] {
            Some(value) => value,
            None => piece.values(2 + i)[k],
        };
        for (k, (point, at)) in piece.rule.iter().zip(piece.at).enumerate() {
            let [f1, f2] = loads.map(|v| v[k]);
            let [m1, m2] = [0, 1].map(|i| tension(i, k));
            let weight = point.weight * piece.area;
            let action = contact_action([m1, m2], [f1, f2]);
            let shapes = [
                at[0] * at[0],
                at[1] * at[1],
                at[2] * at[2],
                at[1] * at[2],
                at[2] * at[0],
                at[0] * at[1],
            ];
            for (sums, value) in self.moments.each(t).iter_mut().zip([f1, f2, action]) {
                for (sum, shape) in sums.iter_mut().zip(&shapes) {
                    *sum += weight * shape * value;
                }
            }
            if let Some(first) = self.first.get_mut(t) {
                let sample = [f1, f2, m1, m2];
                self.moments.varied[t] |= sample != *first.get_or_insert(sample);
            }
            for (i, mu) in [(0, m1), (1, m2)] {
                if self.varying[i] {
                    self.moments.softness[i].each()[t] += weight / mu;
                    let [least, largest] = &mut self.range[i][t];
                    (*least, *largest) = (least.min(mu), largest.max(mu));
                }
            }
        }
        for i in (0..2).filter(|&i| self.varying[i]) {
            let low = &mut self.moments.stiffness_low[i].each()[t];
            *low = low.min(lowest(piece, piece.values(2 + i)));
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
