//! From reconstructed fluxes to ||mu^(-1/2)(s_i + mu_i grad u_ih)||_K and ||f_i +- lambda_h - r_i - div s_i||_K.

use fem_core::integrate::{
    Control, Integrand, Judgement, Partition, Piece, Reference, WHOLE_PART, integrate,
    squared_error,
};
use fem_core::quadrature::{POINTS, affine_misfit};
use fem_core::{FieldError, Samples, TriangleId};

use super::action::contact_action;
use super::closed::{Fit, affine_on_cells};
use super::dual_rule::DualRule;
use super::fast::Roughs;
use super::moments::Moments;
use super::reconstruction::{Norms, Reconstruction};
use super::shares::{SIGN, Shares};
use super::{Given, POINCARE};

/// Accuracy of the integrals along jumps: a cut piece may be wrong by this part of the whole.
const CONTROL: Control = Control {
    tolerance: 1e-6,
    local: false,
    depth: 10,
    largest_share: 2.0,
};

/// Accuracy of the integrals elsewhere: a piece may be wrong by this part of what its element contributes.
const LOCAL_TOLERANCE: f64 = 1e-3;

/// An element's load is smooth if it differs from its best affine fit by at most this part of what the divergence leaves of the fit.
const SMOOTH: f64 = 0.01;

/// Evaluates the norms where data vary: in closed form where the data are constant in an element, by a bound as good where the load is smooth and the
/// membranes are apart, else by quadrature.
///
/// `squares` holds ||tau||^2 for every element and membrane. Where the tensions are constants and the loads smooth, seven samples of an element do;
/// else its six parts are sampled.
pub(super) fn norms(
    given: &Given<'_>,
    moments: &Moments,
    shares: &Shares,
    flux: &[[[f64; 2]; 2]],
    squares: &[[f64; 2]],
    fluxes: &dyn Reconstruction,
) -> Result<Vec<Norms>, FieldError> {
    let mesh = given.mesh;
    let mut norms = Vec::with_capacity(mesh.triangle_count());
    for (t, id) in mesh.triangle_ids().enumerate() {
        let area = mesh.shape(id).area;
        norms.push(Norms::uniform(given, shares, squares, fluxes, t, area));
    }
    let varying = given.tension.map(|f| f.constant().is_none());
    let exact = norms.clone();
    let mut known = vec![false; norms.len()];
    if varying == [false; 2] {
        for (t, id) in mesh.triangle_ids().enumerate() {
            known[t] = moments.uniform(given.loads, t);
            if !known[t]
                && let Some(squares) = smooth_remainder(given, shares, fluxes, t, mesh.area(id))
            {
                norms[t].remainder = squares;
                known[t] = true;
            }
        }
    }
    let reference = (varying == [false; 2]).then(|| Reference {
        area: fem_core::norms::area(mesh),
        magnitude: [exact.iter().flat_map(|n| n.misfit).sum(), 0.0],
    });
    for i in (0..2).filter(|&i| varying[i]) {
        norms.iter_mut().for_each(|n| n.misfit[i] = 0.0);
    }
    let mut sampled = Sampled {
        given,
        moments,
        shares,
        flux,
        fluxes,
        varying,
        rule: DualRule::new(),
        place: None,
        exact,
        known,
        reference,
        norms,
    };
    integrate(mesh, CONTROL, &mut sampled)?;
    Ok(sampled.norms)
}

/// Evaluates the remainders of some elements by quadrature, in their order; the tensions are constants. `misfit` is the sum of the squared misfits of all
/// elements, which jumps are compared with.
pub(super) fn sampled_remainders(
    given: &Given<'_>,
    shares: &Shares,
    roughs: &Roughs,
    misfit: f64,
) -> Result<Vec<Norms>, FieldError> {
    let mesh = given.mesh;
    let mut known = vec![true; mesh.triangle_count()];
    let place = roughs.all().iter().map(|rough| rough.triangle).collect();
    let exact: Vec<Norms> = roughs
        .all()
        .iter()
        .map(|rough| {
            known[rough.triangle] = false;
            Norms {
                misfit: rough.misfit,
                ..Norms::default()
            }
        })
        .collect();
    let mut sampled = Sampled {
        given,
        moments: given.moments,
        shares,
        flux: &[],
        fluxes: roughs,
        varying: [false; 2],
        rule: DualRule::new(),
        place: Some(place),
        norms: exact.clone(),
        exact,
        known,
        reference: Some(Reference {
            area: fem_core::norms::area(mesh),
            magnitude: [misfit, 0.0],
        }),
    };
    integrate(mesh, CONTROL, &mut sampled)?;
    Ok(sampled.norms)
}

/// Bounds for the squared remainders of an element where the membranes are apart and both loads are smooth; `None` elsewhere.
///
/// With the best affine fit p of a load f, known from its moments, ||f - div s|| <= ||p - div s|| + ||f - p||. The divergence is affine plus constants on the
/// shares of the dual cells, so that the first norm has a closed form; the second one follows from ||f - f_h||, since p - f_h is orthogonal to f - p.
fn smooth_remainder(
    given: &Given<'_>,
    shares: &Shares,
    fluxes: &dyn Reconstruction,
    t: usize,
    area: f64,
) -> Option<[f64; 2]> {
    let v = given.mesh.triangles()[t].map(|j| j.index());
    if v.iter().any(|&j| shares[j].theta != 0.0) {
        return None;
    }
    let mut squares = [0.0; 2];
    for i in 0..2 {
        let hats = given.loads[i].moments(t, area);
        let fit = Fit::of(hats, given.loads[i].deviation_squared(t), area);
        let affine = fluxes.affine(t, i).unwrap_or([0.0; 3]);
        let constants = constants(fluxes, shares, t, i, v);
        let corners = fit.corners();
        let left = [0, 1, 2].map(|k| corners[k] - affine[k]);
        let square = affine_on_cells(left, constants, area);
        if fit.bent > SMOOTH * SMOOTH * square {
            return None;
        }
        squares[i] = (square.sqrt() + fit.bent.sqrt()).powi(2);
    }
    Some(squares)
}

/// What of the divergence of s_i (and of the action and the residual) is constant on the shares of the dual cells.
fn constants(
    fluxes: &dyn Reconstruction,
    shares: &Shares,
    t: usize,
    i: usize,
    corners: [usize; 3],
) -> [f64; 3] {
    let mut constants = fluxes.on_cells(t, i);
    if fluxes.lacks_cells() {
        for (c, j) in constants.iter_mut().zip(corners) {
            *c -= shares[j].cell.0[i];
        }
    }
    constants
}

/// Norms under way.
struct Sampled<'a> {
    given: &'a Given<'a>,
    moments: &'a Moments,
    shares: &'a Shares,
    flux: &'a [[[f64; 2]; 2]],
    fluxes: &'a dyn Reconstruction,
    /// Which tensions vary.
    varying: [bool; 2],
    rule: DualRule,
    /// The elements that `exact` and `norms` are of, increasing; all of them if there is no list.
    place: Option<Vec<usize>>,
    /// Closed forms, where they hold.
    exact: Vec<Norms>,
    /// Where both norms are known without samples, for all elements.
    known: Vec<bool>,
    /// What jumps are relative to: the whole, which is more than the elements that are sampled.
    reference: Option<Reference>,
    norms: Vec<Norms>,
}

/// A function sampled on a piece, less constants on the shares of the dual cells of an element.
struct Remainder {
    samples: [f64; POINTS],
    constants: [f64; 3],
}

impl Sampled<'_> {
    /// Where an element is in `exact` and `norms`.
    #[inline]
    fn place(&self, t: usize) -> usize {
        match &self.place {
            None => t,
            Some(all) => all.binary_search(&t).unwrap_or_else(|next| next),
        }
    }

    /// f_i +- lambda_h - r_i - div s_i: what is sampled at the points of a piece, and what is constant on the dual cells.
    fn remainder(&self, piece: &Piece<'_>, i: usize) -> Remainder {
        let t = piece.triangle;
        let v = self.given.mesh.triangles()[t].map(|j| j.index());
        let constants = constants(self.fluxes, self.shares, t, i, v);
        let share = v.map(|j| SIGN[i] * self.shares[j].theta);
        let (load, action) = (piece.values(i), piece.values(ACTION));
        let affine = self.fluxes.affine(t, i).unwrap_or([0.0; 3]);
        let fitted = self.fluxes.action(t);
        let mut samples = [0.0; POINTS];
        for (k, at) in piece.at.iter().enumerate() {
            let value = |v: [f64; 3]| at[0] * v[0] + at[1] * v[1] + at[2] * v[2];
            let action = fitted.map_or(action[k], value);
            samples[k] = load[k] + value(share) * action - value(affine);
        }
        Remainder { samples, constants }
    }

    /// Square of the remainder over a piece, and an estimate of the error of that.
    fn judged_remainder(&self, piece: &Piece<'_>, i: usize) -> (f64, f64) {
        let Remainder { samples, constants } = self.remainder(piece, i);
        if piece.part == WHOLE_PART {
            let (square, misfit) = self.rule.square(&samples, constants);
            let largest = constants
                .iter()
                .flat_map(|c| samples.iter().map(move |s| (s - c).abs()))
                .fold(0.0f64, f64::max);
            // The quadratic fit is wrong by about its misfit. One number says little of a jump: for smooth samples the square of the affine
            // misfit over their range is as small, for a jump all three are of its size.
            let affine = affine_misfit(piece.rule, &samples);
            let (low, high) = samples
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &s| {
                    (l.min(s), h.max(s))
                });
            let bent = if affine == 0.0 {
                0.0
            } else {
                affine * (affine / (high - low))
            };
            let misfit = 3.0 * misfit.max(bent);
            let error = misfit * (2.0 * largest + misfit);
            return (piece.area * square, piece.area * error);
        }
        let c = constants[piece.part / 2];
        judged(piece, &samples.map(|s| s - c))
    }

    /// mu_i^(-1/2) (s_i + mu_i grad u_ih) at the points of a piece.
    fn misfit(&self, piece: &Piece<'_>, i: usize) -> [[f64; POINTS]; 2] {
        let t = piece.triangle;
        let mean = self.given.tension_mean[i][t];
        let q = self.flux[t][i];
        let mut out = [[0.0; POINTS]; 2];
        let taus = self.fluxes.tau(t, i, piece.part, piece.at);
        for (k, tau) in taus.iter().enumerate() {
            let mu = piece.values(TENSION + i)[k];
            let (excess, root) = ((mu - mean) / mean, mu.sqrt());
            for c in 0..2 {
                out[c][k] = (tau[c] + excess * q[c]) / root;
            }
        }
        out
    }

    /// Weight of the remainder beside the misfit: C_K^2/mu_i.
    fn weight(&self, t: usize, i: usize) -> f64 {
        let shape = self.given.mesh.shape(TriangleId(t as u32));
        (shape.diameter() / POINCARE).powi(2) / self.moments.stiffness_low[i].at(t)
    }

    /// What the closed form of the misfit says of a piece.
    fn share_of_misfit(&self, piece: &Piece<'_>) -> f64 {
        let [first, second] = self.exact[self.place(piece.triangle)].misfit;
        let area = self
            .given
            .mesh
            .shape(TriangleId(piece.triangle as u32))
            .area;
        (first + second) * piece.area / area
    }
}

/// Component of the samples that holds lambda*.
const ACTION: usize = 2;

/// Component that holds mu_1, with mu_2 after it; both only where a tension varies.
const TENSION: usize = 3;

fn sum(piece: &Piece<'_>, values: &[f64; POINTS]) -> f64 {
    let sum: f64 = piece
        .rule
        .iter()
        .zip(values)
        .map(|(p, v)| p.weight * v * v)
        .sum();
    piece.area * sum
}

/// Square and quadrature error of a component whose square is integrated, as for true errors: smooth ones are affine but for O(h) of their size.
fn judged(piece: &Piece<'_>, values: &[f64; POINTS]) -> (f64, f64) {
    let largest = values.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let misfit = affine_misfit(piece.rule, values);
    let error = piece.area * squared_error(misfit, largest);
    (sum(piece, values), error)
}

/// An error that does not matter beside the element's own contribution counts as none.
fn relevant(magnitude: f64, error: f64) -> Judgement {
    Judgement {
        magnitude,
        error: if error <= LOCAL_TOLERANCE * magnitude {
            0.0
        } else {
            error
        },
    }
}

impl Integrand for Sampled<'_> {
    fn components(&self) -> usize {
        if self.varying == [false; 2] {
            TENSION
        } else {
            TENSION + 2
        }
    }

    fn reference(&self) -> Option<Reference> {
        self.reference
    }

    fn partition(&self) -> Partition {
        if self.varying == [false; 2] {
            Partition::WholeThenDual
        } else {
            Partition::Dual
        }
    }

    fn skips(&self, triangle: usize) -> bool {
        self.known[triangle]
    }

    fn sample(&mut self, at: Samples<'_>, out: &mut [f64]) -> Result<(), FieldError> {
        let n = at.len();
        let (loads, rest) = out.split_at_mut(2 * n);
        let (action, tensions) = rest.split_at_mut(n);
        for i in 0..2 {
            self.given.load[i].sample(at, &mut loads[i * n..(i + 1) * n])?;
        }
        if let [Some(m1), Some(m2)] = self.given.tension.map(|f| f.constant()) {
            let (first, second) = (m1 / (m1 + m2), m2 / (m1 + m2));
            for k in 0..n {
                action[k] = (first * loads[n + k] - second * loads[k]).max(0.0);
            }
            return Ok(());
        }
        for i in 0..2 {
            self.given.tension[i].sample(at, &mut tensions[i * n..(i + 1) * n])?;
        }
        for k in 0..n {
            action[k] = contact_action([tensions[k], tensions[n + k]], [loads[k], loads[n + k]]);
        }
        Ok(())
    }

    fn judge(&self, piece: &Piece<'_>) -> Judgement {
        let t = piece.triangle;
        let (mut magnitude, mut error) = (self.share_of_misfit(piece), 0.0);
        if !self.moments.uniform(self.given.loads, t) {
            for i in 0..2 {
                let (square, wrong) = self.judged_remainder(piece, i);
                let weight = self.weight(t, i);
                magnitude += weight * square;
                error += weight * wrong;
            }
        }
        relevant(magnitude, error)
    }

    fn judge_second(&self, piece: &Piece<'_>) -> Judgement {
        let (mut magnitude, mut error) = (0.0, 0.0);
        for i in (0..2).filter(|&i| self.varying[i]) {
            for component in self.misfit(piece, i) {
                let (square, wrong) = judged(piece, &component);
                magnitude += square;
                error += wrong;
            }
        }
        relevant(magnitude, error)
    }

    fn clear(&mut self, t: usize) {
        let place = self.place(t);
        let norms = &mut self.norms[place];
        if !self.moments.uniform(self.given.loads, t) {
            norms.remainder = [0.0; 2];
        }
        for i in (0..2).filter(|&i| self.varying[i]) {
            norms.misfit[i] = 0.0;
        }
    }

    fn add(&mut self, piece: &Piece<'_>) {
        let t = piece.triangle;
        let place = self.place(t);
        for i in 0..2 {
            if !self.moments.uniform(self.given.loads, t) {
                self.norms[place].remainder[i] += self.judged_remainder(piece, i).0;
            }
            if self.varying[i] {
                let [x, y] = self.misfit(piece, i);
                self.norms[place].misfit[i] += sum(piece, &x) + sum(piece, &y);
            }
        }
    }
}
