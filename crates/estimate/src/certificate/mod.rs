//! The certificate: a bound of the energy error without unknown constants.
//!
//! For u_h with u_1h >= u_2h, any action lambda_h >= 0 in L2 and fluxes s_i in H(div), with e = u - u_h and C = (lambda_h, u_1h - u_2h):
//!
//! ```text
//! |||e||| <= eta/2 + (eta^2/4 + C)^(1/2)                                                                         (B1)
//! eta^2 = sum_i sum_K ( ||mu_i^(-1/2)(s_i + mu_i grad u_ih)||_K + C_K mu_{i,K,min}^(-1/2) ||f_i +- lambda_h - r_i - div s_i||_K )^2
//! eta replaced by eta + eta_alg,   eta_alg = (d/pi) (sum_i mu_{i,min}^(-1) sum_j rho_ij^2/|D_j|)^(1/2)
//! ```
//!
//! where the divergence of s_i has the element means of f_i +- lambda_h - r_i, rho_ij = F_ij +- z_j - (A_i u_ih)_j are the residuals of the rows, r_i = sum_j
//! rho_ij chi_Dj/|D_j|, d is the width of the domain, and C_K = h_K/3.8317 the sharp constant of Poincare's inequality
//! on triangles (j_11, the first zero of the Bessel function J_1; Laugesen, Siudeja 2010). Nothing is assumed of the solver.
//!
//! The steps: moments of the data, shares of the forces (`shares`), fluxes of one of two grades (`rt0`, `rt1`), norms (`misfit`). With constant tensions the first
//! grade has all of it in one pass over blocks of triangles (`blocks`, `fast`), and keeps nothing of an element but its own part of the bound.

mod action;
mod blocks;
mod boundary;
mod closed;
mod data;
mod dual_rule;
mod element;
mod fan;
mod fast;
mod frame;
mod misfit;
mod moments;
mod reconstruction;
mod ring;
mod rt0;
mod rt1;
mod shares;

use fem_core::integrate::Loads;
use fem_core::{ElementValues, Field, FieldError, Mesh, TriangleId};

use action::Action;
pub use boundary::{BoundaryOscillation, boundary_oscillation};
use data::{General, Loaded, Plain};
use misfit::norms;
pub use moments::{JUMP, Moments, Near};
use reconstruction::{Norms, Reconstruction};
use shares::{Share, Shares};

/// How the fluxes are reconstructed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Grade {
    /// RT0 on the six triangles between the medians of every element; no linear systems.
    Rt0,
    /// RT1, one small system for every vertex.
    Rt1,
}

/// C_K = h_K divided by this: 3.8317, rounded down, the first positive zero of the Bessel function J_1.
pub const POINCARE: f64 = 3.831_705_970_207_512;

/// What a certificate is made from, in scaled units.
#[derive(Clone, Copy)]
pub struct Given<'a> {
    /// The mesh.
    pub mesh: &'a Mesh,
    /// Loads f_1, f_2.
    pub load: [&'a dyn Field; 2],
    /// Tensions mu_1, mu_2.
    pub tension: [&'a dyn Field; 2],
    /// Moments of both.
    pub moments: &'a Moments,
    /// What the discrete problem knows of the loads, from the same points as the moments.
    pub loads: &'a [Loads; 2],
    /// Means of the tensions over the elements.
    pub tension_mean: &'a [ElementValues; 2],
    /// Displacements with u_1h >= u_2h at every vertex.
    pub displacement: &'a [Vec<f64>; 2],
    /// Action forces; what is negative counts as 0.
    pub force: &'a [f64],
    /// At most so many threads; the number does not show.
    pub threads: usize,
}

impl Given<'_> {
    /// u_1h - u_2h at a vertex.
    fn gap(&self, j: usize) -> f64 {
        self.displacement[0][j] - self.displacement[1][j]
    }
}

/// A guaranteed bound and where it comes from.
#[derive(Clone, PartialEq, Debug)]
pub struct Certificate {
    /// Which fluxes.
    pub grade: Grade,
    /// (eta_K^2 + C on K)^(1/2), one entry a triangle: roots, in the unit of the energy norm.
    pub local: Vec<f64>,
    /// eta, in the unit of the energy norm.
    pub eta: f64,
    /// C = (lambda_h, u_1h - u_2h), an energy.
    pub contact: f64,
    /// eta_alg, in the unit of the energy norm.
    pub algebraic: f64,
    /// (B1), in the unit of the energy norm.
    pub bound: f64,
    /// Number of triangles in which samples of a tension differ by more than a factor [`JUMP`].
    pub jumps: usize,
}

impl Certificate {
    /// (B1) with an estimate of the algebraic error in place of eta_alg: 0 if the rows hold to rounding. Guaranteed only so far as the estimate is.
    pub fn predicted(&self, algebraic: f64) -> f64 {
        bound(self.eta + algebraic, self.contact)
    }
}

/// (B1).
fn bound(eta: f64, contact: f64) -> f64 {
    0.5 * eta + (0.25 * eta * eta + contact).sqrt()
}

/// Certifies a discrete solution, or any other pair that does not penetrate; O(N).
///
/// `poincare` divides h_K in C_K, [`POINCARE`] or pi.
///
/// # Errors
/// A value of a load or a tension that is not finite.
pub fn certify(given: &Given<'_>, grade: Grade, poincare: f64) -> Result<Certificate, FieldError> {
    match grade {
        Grade::Rt0 => Prepared::of(given)?.certify(given, poincare),
        Grade::Rt1 => {
            let mut room = None;
            let given = &covered(given, grade, &mut room)?;
            let shares = Shares::of(given, &General(given));
            let flux = fluxes(given);
            let (fluxes, squares) = rt1::equilibrate(given, &shares, &flux);
            summed(given, grade, poincare, &shares, &flux, &squares, &fluxes)
        }
    }
}

/// The first part of a certificate of grade [`Grade::Rt0`], which tells eta_alg, and far cheaper than the rest.
pub struct Prepared {
    shares: Shares,
    /// Moments that lack nothing, where those given did.
    moments: Option<Moments>,
}

impl Prepared {
    /// Divides the forces and evaluates the residuals of the rows; O(N).
    ///
    /// # Errors
    /// A value of a load that is not finite.
    pub fn of(given: &Given<'_>) -> Result<Prepared, FieldError> {
        let mut moments = None;
        let given = &covered(given, Grade::Rt0, &mut moments)?;
        let shares = match (Plain::of(given), Loaded::of(given)) {
            (Some(data), _) => Shares::of(given, &data),
            (None, Some(data)) => Shares::of(given, &data),
            (None, None) => Shares::of(given, &General(given)),
        };
        Ok(Prepared { shares, moments })
    }

    /// eta_alg, in the unit of the energy norm.
    pub fn algebraic(&self) -> f64 {
        self.shares.algebraic
    }

    /// The certificate of what this was prepared from; O(N).
    ///
    /// # Errors
    /// A value of a load or a tension that is not finite.
    pub fn certify(&self, given: &Given<'_>, poincare: f64) -> Result<Certificate, FieldError> {
        let moments = self.moments.as_ref().unwrap_or(given.moments);
        let given = &Given { moments, ..*given };
        let shares = &self.shares;
        if let Some(data) = Plain::of(given) {
            return fast::certify(given, &data, shares, poincare);
        }
        if let Some(data) = Loaded::of(given) {
            return fast::certify(given, &data, shares, poincare);
        }
        let (fluxes, squares) = rt0::equilibrate(given, &General(given), shares);
        let flux = self::fluxes(given);
        let grade = Grade::Rt0;
        summed(given, grade, poincare, shares, &flux, &squares, &fluxes)
    }
}

/// The same with moments that lack nothing that a grade wants: made in `room`, unless they are there.
fn covered<'a>(
    given: &Given<'a>,
    grade: Grade,
    room: &'a mut Option<Moments>,
) -> Result<Given<'a>, FieldError> {
    let near = (grade == Grade::Rt0).then_some(Near {
        force: given.force,
        loads: given.loads,
    });
    let (mesh, tension) = (given.mesh, given.tension);
    if given.moments.missing(mesh, tension, near).is_empty() {
        return Ok(*given);
    }
    let moments = room.insert(given.moments.clone());
    moments.cover(mesh, given.load, tension, near)?;
    Ok(Given { moments, ..*given })
}

/// The fluxes mu_iK grad u_ih of every element.
fn fluxes(given: &Given<'_>) -> Vec<[[f64; 2]; 2]> {
    let mesh = given.mesh;
    let of = |id: TriangleId| {
        let v = mesh.triangles()[id.index()].map(|j| j.index());
        let shape = mesh.shape(id);
        [0, 1].map(|i| {
            let g = shape.gradient(v.map(|j| given.displacement[i][j]));
            let mu = given.tension_mean[i][id.index()];
            [mu * g[0], mu * g[1]]
        })
    };
    mesh.triangle_ids().map(of).collect()
}

/// Norms and sums over the elements.
fn summed(
    given: &Given<'_>,
    grade: Grade,
    poincare: f64,
    shares: &Shares,
    flux: &[[[f64; 2]; 2]],
    squares: &[[f64; 2]],
    fluxes: &dyn Reconstruction,
) -> Result<Certificate, FieldError> {
    let (mesh, moments) = (given.mesh, given.moments);
    let norms = match moments.all_uniform(given.loads) {
        true => None,
        false => Some(norms(given, moments, shares, flux, squares, fluxes)?),
    };
    let mut local = Vec::with_capacity(mesh.triangle_count());
    let (mut square, mut contact) = (0.0, 0.0);
    for (t, id) in mesh.triangle_ids().enumerate() {
        let shape = mesh.shape(id);
        let constant = shape.diameter() / poincare;
        let Norms { misfit, remainder } = match &norms {
            Some(norms) => norms[t],
            None => Norms::uniform(given, shares, squares, fluxes, t, shape.area),
        };
        let mut own = 0.0;
        for i in 0..2 {
            let low = moments.stiffness_low[i].at(t);
            own += (misfit[i].sqrt() + constant * (remainder[i] / low).sqrt()).powi(2);
        }
        let v = mesh.triangles()[t].map(|j| j.index());
        let overlap = contact_term(given, shares, v, shape.area, moments.action(t));
        square += own;
        contact += overlap;
        local.push((own + overlap).sqrt());
    }
    Ok(finished(given, grade, shares, local, square, contact))
}

/// The certificate from its sums: eta^2 and C.
fn finished(
    given: &Given<'_>,
    grade: Grade,
    shares: &Shares,
    local: Vec<f64>,
    square: f64,
    contact: f64,
) -> Certificate {
    let (eta, algebraic) = (square.sqrt(), shares.algebraic);
    Certificate {
        grade,
        local,
        eta,
        contact,
        algebraic,
        bound: bound(eta + algebraic, contact),
        jumps: given.moments.jumps,
    }
}

/// int_K lambda_h (u_1h - u_2h): (lambda* theta, w) from the moments, and 11|K|/54, 7|K|/108 for the hat functions on a dual cell.
#[inline]
fn contact_term(
    given: &Given<'_>,
    shares: &Shares,
    v: [usize; 3],
    area: f64,
    action: Action<'_>,
) -> f64 {
    let gap = v.map(|j| given.gap(j));
    if gap == [0.0; 3] {
        return 0.0;
    }
    let all: f64 = gap.iter().sum();
    let mut sum = 0.0;
    for k in 0..3 {
        let Share { theta, kappa, .. } = shares[v[k]];
        if theta > 0.0 {
            let part: f64 = (0..3).map(|l| action.product(area, k, l) * gap[l]).sum();
            sum += theta * part;
        }
        if kappa > 0.0 {
            sum += kappa * area / 108.0 * (22.0 * gap[k] + 7.0 * (all - gap[k]));
        }
    }
    sum.max(0.0)
}

#[cfg(test)]
mod tests;
