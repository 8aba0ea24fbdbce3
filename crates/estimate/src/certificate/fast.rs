//! The certificate by grade (a) where the tensions are constants: bounds in closed form, and samples only where those are not sharp.
//!
//! With the best affine fit p of a load f, known from its moments, ||f +- theta lambda_h - div s|| <= ||p +- theta lambda_h - div s|| + ||f - p||. Where the
//! action inside contact is affine too, the first norm is one of a quadratic function less constants on the shares of the dual cells. The second one follows from
//! ||f - f_h||, since p - f_h is orthogonal to f - p.

use fem_core::FieldError;
use fem_core::parallel::BLOCK;

use super::action::Action;
use super::blocks::{Blocks, Sink};
use super::closed::{Fit, balanced_affine, balanced_constant, balanced_quadratic};
use super::data::Data;
use super::element::{Element, Pair};
use super::misfit::sampled_remainders;
use super::reconstruction::{Norms, Reconstruction};
use super::shares::{SIGN, Shares};
use super::{Certificate, Given, Grade, finished};

/// An element is sampled if eta_K^2 might be smaller by more than this part of what the closed forms give, so that they cost less than half of that part of
/// the bound.
const SHARP: f64 = 0.005;

/// An element whose remainders are to be sampled.
pub(super) struct Rough {
    pub triangle: usize,
    /// ||tau||^2 over mu_i.
    pub misfit: [f64; 2],
    /// The action inside contact at the corners, if that is affine.
    pub action: Option<[f64; 3]>,
    /// 3 m_iKj/|K|.
    balance: [[f64; 2]; 3],
    /// C_K mu_i^(-1/2).
    factor: [f64; 2],
    /// C on the element.
    overlap: f64,
}

/// The elements to be sampled, in their order.
pub(super) struct Roughs(Vec<Rough>);

impl Roughs {
    pub fn all(&self) -> &[Rough] {
        &self.0
    }

    fn at(&self, triangle: usize) -> Option<&Rough> {
        let place = self
            .0
            .binary_search_by_key(&triangle, |r| r.triangle)
            .ok()?;
        self.0.get(place)
    }
}

impl Reconstruction for Roughs {
    fn uniform_remainder(&self, _: usize, _: usize, _: f64, _: &Shares) -> f64 {
        0.0
    }

    fn lacks_cells(&self) -> bool {
        false
    }

    fn on_cells(&self, triangle: usize, membrane: usize) -> [f64; 3] {
        match self.at(triangle) {
            Some(rough) => rough.balance.map(|b| b[membrane]),
            None => [0.0; 3],
        }
    }

    fn action(&self, triangle: usize) -> Option<[f64; 3]> {
        self.at(triangle)?.action
    }
}

/// Sums over a block, and what it writes.
struct Bounds<'a, D> {
    blocks: &'a Blocks<'a, D>,
    /// 1/mu_i.
    softness: Pair,
    /// C_K mu_i^(-1/2) over h_K.
    factor: Pair,
    local: &'a mut [f64],
    first: usize,
    /// Of eta_K^2, but for rough elements.
    square: f64,
    contact: f64,
    /// Of the misfits.
    misfit: f64,
    rough: Vec<Rough>,
}

impl<D: Data> Bounds<'_, D> {
    /// Squares of ||p +- theta lambda_h - div s|| and of ||f - p|| in an element with an action, and C on it. No bounds where the action is sampled.
    #[inline(never)]
    fn pressed(&self, t: usize, area: f64) -> (Option<(Pair, Pair)>, f64) {
        let Blocks {
            given,
            data,
            shares,
            ..
        } = self.blocks;
        let v = given.mesh.triangles()[t].map(|j| j.index());
        let (hats, deviation) = (data.hats(t, area), data.deviation(t));
        let action = data.action(t, area, &hats);
        let theta = v.map(|j| shares[j].theta);
        let bounds = match action {
            _ if theta == [0.0; 3] => Some(balanced_affine(hats, deviation, area)),
            Action::Affine([value, ..]) if D::SAME => {
                let square = balanced_constant(theta, value, area);
                Some((Pair([square; 2]), Pair::default()))
            }
            Action::Affine(a) => {
                let fits = [0, 1].map(|i| Fit::of(hats.map(|m| m.0[i]), deviation.0[i], area));
                let closed = [0, 1].map(|i| {
                    let theta = theta.map(|t| SIGN[i] * t);
                    balanced_quadratic(&fits[i], theta, a, area)
                });
                Some((Pair(closed), Pair(fits.map(|fit| fit.bent))))
            }
            _ => None,
        };
        let overlap = super::contact_term(given, shares, v, area, action);
        (bounds, overlap)
    }

    /// Notes an element that is to be sampled.
    #[cold]
    fn note(&mut self, t: usize, element: &Element, misfit: Pair, factor: Pair, overlap: f64) {
        let data = self.blocks.data;
        let hats = data.hats(t, element.area);
        let action = match data.action(t, element.area, &hats) {
            Action::Affine(a) => Some(a),
            _ => None,
        };
        self.rough.push(Rough {
            triangle: t,
            misfit: misfit.0,
            action,
            balance: self.blocks.balance(t, element.area),
            factor: factor.0,
            overlap,
        });
    }
}

impl<D: Data> Sink for Bounds<'_, D> {
    #[inline(always)]
    fn element(&mut self, t: usize, element: &Element, beta: [Pair; 3]) {
        let misfit = element.squares(beta) * self.softness;
        self.misfit += misfit.sum();
        let place = t - self.first;
        let (bounds, overlap) = if element.pressed {
            self.pressed(t, element.area)
        } else if D::SAME {
            // No remainders.
            let own = misfit.sum();
            self.square += own;
            self.local[place] = own.sqrt();
            return;
        } else {
            let data = self.blocks.data;
            let (hats, deviation) = (data.hats(t, element.area), data.deviation(t));
            (Some(balanced_affine(hats, deviation, element.area)), 0.0)
        };
        self.contact += overlap;
        let root = misfit.root();
        let factor = self.factor * element.diameter_squared.sqrt();
        if let Some((closed, bent)) = bounds {
            let (closed, left) = (closed.root(), bent.root());
            let upper = root + factor * (closed + left);
            let lower = root + factor * (closed - left).positive();
            let own = (upper * upper).sum();
            if D::SAME || own - (lower * lower).sum() <= SHARP * own {
                self.square += own;
                self.local[place] = (own + overlap).sqrt();
                return;
            }
        }
        self.note(t, element, misfit, factor, overlap);
    }
}

/// Certifies by grade (a) with constant tensions.
pub(super) fn certify<D: Data>(
    given: &Given<'_>,
    data: &D,
    shares: &Shares,
    poincare: f64,
) -> Result<Certificate, FieldError> {
    let mut local = vec![0.0; given.mesh.triangle_count()];
    let Pair(tension) = data.tension(0);
    let blocks = Blocks::new(given, data, shares);
    let sinks = local
        .chunks_mut(BLOCK)
        .enumerate()
        .map(|(number, local)| Bounds {
            blocks: &blocks,
            softness: Pair(tension.map(|mu| 1.0 / mu)),
            factor: Pair(tension.map(|mu| 1.0 / (poincare * mu.sqrt()))),
            local,
            first: number * BLOCK,
            square: 0.0,
            contact: 0.0,
            misfit: 0.0,
            rough: Vec::new(),
        })
        .collect();
    let (mut square, mut contact, mut misfit) = (0.0, 0.0, 0.0);
    let mut roughs = Roughs(Vec::new());
    for bounds in blocks.pass(sinks) {
        square += bounds.square;
        contact += bounds.contact;
        misfit += bounds.misfit;
        roughs.0.extend(bounds.rough);
    }
    if !roughs.0.is_empty() {
        let norms = sampled_remainders(given, shares, &roughs, misfit)?;
        for (rough, Norms { remainder, .. }) in roughs.all().iter().zip(norms) {
            let part = |i: usize| rough.misfit[i].sqrt() + rough.factor[i] * remainder[i].sqrt();
            let own = part(0).powi(2) + part(1).powi(2);
            square += own;
            local[rough.triangle] = (own + rough.overlap).sqrt();
        }
    }
    Ok(finished(given, Grade::Rt0, shares, local, square, contact))
}
