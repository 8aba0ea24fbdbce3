//! From reconstructed fluxes to ||mu^(-1/2)(s_i + mu_i grad u_ih)||_K and ||f_i +- lambda_h - r_i - div s_i||_K.

use fem_core::integrate::{Control, Integrand, Judgement, Partition, Piece, integrate};
use fem_core::quadrature::{POINTS, affine_misfit};
use fem_core::{FieldError, Mesh, Samples};

use super::Given;
use super::fan::Corner;
use super::moments::{Moments, contact_action};
use super::shares::{SIGN, Shares};

/// Products of the two edges a, b that leave a corner counter-clockwise, and the area of the element.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    pub aa: f64,
    pub ab: f64,
    pub bb: f64,
    pub area: f64,
}

/// A frame with the normal of its first edge.
pub(super) struct CornerFrame {
    pub products: Frame,
    /// The first edge turned by a right angle counter-clockwise: its normal times its length.
    pub first_normal: [f64; 2],
}

impl Frame {
    /// The frame of a corner.
    #[inline]
    pub fn of(mesh: &Mesh, corner: Corner) -> CornerFrame {
        let v = mesh.triangles()[corner.index()];
        let k = corner.corner();
        let [p, q, r] = [0, 1, 2].map(|l| mesh.points()[v[(k + l) % 3].index()]);
        let a = [q[0] - p[0], q[1] - p[1]];
        let b = [r[0] - p[0], r[1] - p[1]];
        CornerFrame {
            products: Frame {
                aa: a[0] * a[0] + a[1] * a[1],
                ab: a[0] * b[0] + a[1] * b[1],
                bb: b[0] * b[0] + b[1] * b[1],
                area: 0.5 * (a[0] * b[1] - a[1] * b[0]),
            },
            first_normal: [-a[1], a[0]],
        }
    }
}

/// The sum over the three pairs of (p_k - p_l)^2.
#[inline]
pub(super) fn pairs(p: [f64; 3]) -> f64 {
    let d = [p[0] - p[1], p[1] - p[2], p[2] - p[0]];
    d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
}

/// What the two grades have to tell about their fluxes.
pub(super) trait Reconstruction {
    /// ||f_i +- lambda_h - r_i - div s_i||_K^2 where loads and tensions are constant in the element.
    fn uniform_remainder(
        &self,
        triangle: usize,
        membrane: usize,
        area: f64,
        shares: &Shares,
    ) -> f64;

    /// Whether [`Reconstruction::subtracted`] is the divergence with the parts +-kappa_j - rho_ij/|D_j| of the dual cells.
    fn includes_cells(&self) -> bool;

    /// The divergence of s_i at a point of a part of the element, with or without the parts of the dual cells.
    fn subtracted(&self, triangle: usize, membrane: usize, part: usize, at: [f64; 3]) -> f64;

    /// s_i + mu_iK grad u_ih at a point of a part of the element.
    fn tau(&self, triangle: usize, membrane: usize, part: usize, at: [f64; 3]) -> [f64; 2];
}

/// The two norms on every element, squared: misfit (with the weight 1/mu_i) and remainder, for both membranes.
#[derive(Clone, Copy, Default, Debug)]
pub(super) struct Norms {
    pub misfit: [f64; 2],
    pub remainder: [f64; 2],
}

/// Accuracy of the integrals; they are upper parts of a bound, and 1e-5 of it is enough.
const CONTROL: Control = Control {
    tolerance: 1e-6,
    local: false,
    depth: 10,
    largest_share: 2.0,
};

/// Evaluates the norms: in closed form where the data are constant in an element, else by quadrature on its six parts.
///
/// `squares` holds ||tau||^2 for every element and membrane.
pub(super) fn norms(
    given: &Given<'_>,
    moments: &Moments,
    shares: &Shares,
    flux: &[Vec<[f64; 2]>; 2],
    squares: &[[f64; 2]],
    fluxes: &dyn Reconstruction,
) -> Result<Vec<Norms>, FieldError> {
    let mesh = given.mesh;
    let mut norms = vec![Norms::default(); mesh.triangle_count()];
    for (t, (id, norms)) in mesh.triangle_ids().zip(&mut norms).enumerate() {
        let area = mesh.shape(id).area;
        for i in 0..2 {
            norms.misfit[i] = squares[t][i] / given.tension_mean[i][t];
            if moments.uniform[t] {
                norms.remainder[i] = fluxes.uniform_remainder(t, i, area, shares);
            }
        }
    }
    if moments.uniform.iter().all(|u| *u) {
        return Ok(norms);
    }
    let varying = given.tension.map(|f| f.constant().is_none());
    let exact = norms.clone();
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
        exact,
        norms,
    };
    integrate(mesh, CONTROL, &mut sampled)?;
    Ok(sampled.norms)
}

/// Norms under way.
struct Sampled<'a> {
    given: &'a Given<'a>,
    moments: &'a Moments,
    shares: &'a Shares,
    flux: &'a [Vec<[f64; 2]>; 2],
    fluxes: &'a dyn Reconstruction,
    /// Which tensions vary.
    varying: [bool; 2],
    /// Closed forms, where they hold.
    exact: Vec<Norms>,
    norms: Vec<Norms>,
}

impl Sampled<'_> {
    /// f_i +- lambda_h - r_i - div s_i at the points of a piece.
    fn remainder(&self, piece: &Piece<'_>, i: usize) -> [f64; POINTS] {
        let t = piece.triangle;
        let v = self.given.mesh.triangles()[t].map(|j| j.index());
        let theta = v.map(|j| self.shares.theta[j]);
        let cell = if self.fluxes.includes_cells() {
            self.shares.cell(i, v[piece.part / 2])
        } else {
            0.0
        };
        let samples = [0, 1, 2, 3].map(|c| piece.values(c));
        let mut out = [0.0; POINTS];
        for (k, at) in piece.at.iter().enumerate() {
            let [f1, f2, m1, m2] = samples.map(|s| s[k]);
            let share = at[0] * theta[0] + at[1] * theta[1] + at[2] * theta[2];
            let action = share * contact_action([m1, m2], [f1, f2]);
            let load = if i == 0 { f1 } else { f2 };
            let divergence = self.fluxes.subtracted(t, i, piece.part, *at);
            out[k] = load + SIGN[i] * action + cell - divergence;
        }
        out
    }

    /// mu_i^(-1/2) (s_i + mu_i grad u_ih) at the points of a piece.
    fn misfit(&self, piece: &Piece<'_>, i: usize) -> [[f64; POINTS]; 2] {
        let t = piece.triangle;
        let mean = self.given.tension_mean[i][t];
        let q = self.flux[i][t];
        let mut out = [[0.0; POINTS]; 2];
        for (k, at) in piece.at.iter().enumerate() {
            let mu = piece.values(2 + i)[k];
            let tau = self.fluxes.tau(t, i, piece.part, *at);
            let (excess, root) = ((mu - mean) / mean, mu.sqrt());
            for c in 0..2 {
                out[c][k] = (tau[c] + excess * q[c]) / root;
            }
        }
        out
    }

    /// Weight of the remainder beside the misfit: C_K^2/mu_i.
    fn weight(&self, t: usize, i: usize) -> f64 {
        let shape = self.given.mesh.shape(fem_core::TriangleId(t as u32));
        (shape.diameter() / super::POINCARE).powi(2) / self.moments.stiffness_low[i][t]
    }
}

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
    let error = if misfit == 0.0 {
        0.0
    } else {
        (3.0 * misfit / largest).min(1.0).powi(4) * largest * largest
    };
    (sum(piece, values), piece.area * error)
}

impl Integrand for Sampled<'_> {
    fn components(&self) -> usize {
        4
    }

    fn partition(&self) -> Partition {
        Partition::Dual
    }

    fn skips(&self, triangle: usize) -> bool {
        self.varying == [false; 2] && self.moments.uniform[triangle]
    }

    fn sample(&mut self, at: Samples<'_>, out: &mut [f64]) -> Result<(), FieldError> {
        let [f1, f2] = self.given.load;
        let [m1, m2] = self.given.tension;
        for (field, out) in [f1, f2, m1, m2].iter().zip(out.chunks_mut(at.len().max(1))) {
            field.sample(at, out)?;
        }
        Ok(())
    }

    fn judge(&self, piece: &Piece<'_>) -> Judgement {
        let mut result = Judgement {
            magnitude: 0.0,
            error: 0.0,
        };
        let t = piece.triangle;
        if !self.moments.uniform[t] {
            for i in 0..2 {
                let (square, error) = judged(piece, &self.remainder(piece, i));
                let weight = self.weight(t, i);
                result.magnitude += weight * square;
                result.error += weight * error;
            }
        }
        // Beside a misfit that is far larger the remainder needs no digits of its own.
        for i in 0..2 {
            result.magnitude += self.exact[t].misfit[i] * piece.area
                / self.given.mesh.shape(fem_core::TriangleId(t as u32)).area;
        }
        result
    }

    fn judge_second(&self, piece: &Piece<'_>) -> Judgement {
        let mut result = Judgement {
            magnitude: 0.0,
            error: 0.0,
        };
        for i in (0..2).filter(|&i| self.varying[i]) {
            for component in self.misfit(piece, i) {
                let (square, error) = judged(piece, &component);
                result.magnitude += square;
                result.error += error;
            }
        }
        result
    }

    fn clear(&mut self, t: usize) {
        let norms = &mut self.norms[t];
        if !self.moments.uniform[t] {
            norms.remainder = [0.0; 2];
        }
        for i in (0..2).filter(|&i| self.varying[i]) {
            norms.misfit[i] = 0.0;
        }
    }

    fn add(&mut self, piece: &Piece<'_>) {
        let t = piece.triangle;
        for i in 0..2 {
            if !self.moments.uniform[t] {
                self.norms[t].remainder[i] += sum(piece, &self.remainder(piece, i));
            }
            if self.varying[i] {
                let [x, y] = self.misfit(piece, i);
                self.norms[t].misfit[i] += sum(piece, &x) + sum(piece, &y);
            }
        }
    }
}
