//! True errors against a known solution.
//!
//! ```text
//! |u_i - u_ih|_1,   |sigma - sigma_h|_1,   |||u - u_h||| = (sum_i (mu_i grad(u_i - u_ih), grad(u_i - u_ih)))^(1/2)
//! ```
//!
//! The exact gradients are fields, the discrete ones are constant on every triangle, and the tension is the field itself, not its element mean. The
//! integrals are adaptive ([`fem_core::integrate`](mod@fem_core::integrate)): seven points on a triangle where the error is smooth,
//! quarters of quarters along free boundaries, tension jumps and towards corners. Each membrane and sigma is integrated on
//! its own, so that each has the points it needs and no more.

use std::sync::Arc;

use fem_core::integrate::{Control, Integrand, Judgement, Piece, integrate, squared_error};
use fem_core::quadrature::{POINTS, affine_misfit};
use fem_core::{ElementValues, Field, FieldError, Mesh, Samples};

use crate::exact::{Exact, Gradient};
use crate::gradients::gradients;

/// Errors of a discrete solution against a known one.
#[derive(Clone, PartialEq, Debug)]
pub struct TrueErrors {
    /// |u_i - u_ih|_(1,K)^2, one entry a triangle and membrane.
    pub displacement_squared: [Vec<f64>; 2],
    /// sum_i (mu_i grad(u_i - u_ih), grad(u_i - u_ih))_K, one entry a triangle.
    pub energy_squared: Vec<f64>,
    /// |sigma - sigma_h|_(1,K)^2, one entry a triangle, if sigma is known.
    pub sigma_squared: Option<Vec<f64>>,
    /// |||u - u_h|||, in the unit of the energy norm.
    pub energy: f64,
    /// |u_1 - u_1h|_1 and |u_2 - u_2h|_1, in the unit of a displacement.
    pub h1: [f64; 2],
    /// (|u_1 - u_1h|_1^2 + |u_2 - u_2h|_1^2)^(1/2).
    pub h1_total: f64,
    /// |sigma - sigma_h|_1, in the unit of a force, if sigma is known.
    pub sigma: Option<f64>,
}

/// Integrates the errors of nodal displacements and of a nodal Riesz representative sigma_h, one entry a vertex each.
///
/// `tension` holds the tensions, `tension_mean` their element means; `sigma` is not looked at when the exact one is not known.
///
/// Measured relative accuracy of the totals: 1e-7 where the solution is smooth, 5e-5 with kinks along free boundaries and at re-entrant corners, 4e-4
/// where a tension jumps by 10^4 inside elements.
///
/// # Errors
/// A value of an exact gradient or a tension that is not finite.
pub fn true_errors(
    mesh: &Mesh,
    tension_mean: &[ElementValues; 2],
    displacement: &[Vec<f64>; 2],
    sigma: &[f64],
    exact: &Exact,
    tension: &[Arc<dyn Field>; 2],
) -> Result<TrueErrors, FieldError> {
    let mut energy_squared = vec![0.0; mesh.triangle_count()];
    let mut squares = |i: usize| -> Result<Vec<f64>, FieldError> {
        let discrete = gradients(mesh, &displacement[i]);
        let gradient = &exact.displacement[i];
        let error = |weight| SquaredError::integrate(mesh, gradient, &discrete, weight);
        let (plain, weighted) = match tension[i].constant() {
            Some(mu) => {
                let plain = error(Weight::One)?.plain;
                let weighted = plain.iter().map(|e| mu * e).collect();
                (plain, weighted)
            }
            None => {
                let field = tension[i].as_ref();
                let result = error(Weight::Judged(field))?;
                if spread(tension_mean[i].stored()) <= LARGEST_SPREAD {
                    (result.plain, result.weighted)
                } else {
                    // Where the tension is small the energy hardly sees the displacement: that needs its own points.
                    (error(Weight::One)?.plain, result.weighted)
                }
            }
        };
        for (sum, e) in energy_squared.iter_mut().zip(&weighted) {
            *sum += e;
        }
        Ok(plain)
    };
    let displacement_squared = [squares(0)?, squares(1)?];
    let sigma_squared = match &exact.sigma {
        Some(gradient) => {
            let discrete = gradients(mesh, sigma);
            Some(SquaredError::integrate(mesh, gradient, &discrete, Weight::One)?.plain)
        }
        None => None,
    };
    let total = |squares: &[f64]| squares.iter().sum::<f64>();
    let squares = [0, 1].map(|i| total(&displacement_squared[i]));
    Ok(TrueErrors {
        energy: total(&energy_squared).sqrt(),
        h1: squares.map(f64::sqrt),
        h1_total: (squares[0] + squares[1]).sqrt(),
        sigma: sigma_squared.as_deref().map(|s| total(s).sqrt()),
        displacement_squared,
        energy_squared,
        sigma_squared,
    })
}

/// Up to this quotient of the largest and smallest element mean of a tension, one set of points serves the seminorm and the energy.
const LARGEST_SPREAD: f64 = 16.0;

/// Accuracy of the integrals; measured in `tests/true_errors.rs`.
const CONTROL: Control = Control {
    tolerance: 1e-6,
    local: false,
    depth: 30,
    largest_share: 1.0 / 300.0,
};

/// Errors below this share of the exact gradient are resolved no further: what the samples show there may be the rounding of a formula.
const FLOOR: f64 = 1e-8;

fn spread(mean: &[f64]) -> f64 {
    let (low, high) = mean
        .iter()
        .fold((f64::INFINITY, 0.0f64), |(l, h), &m| (l.min(m), h.max(m)));
    high / low
}

/// The weight inside an integral.
#[derive(Clone, Copy)]
enum Weight<'a> {
    /// No weight.
    One,
    /// A tension; it decides where points are needed.
    Judged(&'a dyn Field),
}

/// Integrals of |grad v - grad v_h|^2, without weight and with it.
struct SquaredError<'a> {
    gradient: &'a Gradient,
    discrete: &'a [[f64; 2]],
    weight: Weight<'a>,
    plain: Vec<f64>,
    weighted: Vec<f64>,
}

impl<'a> SquaredError<'a> {
    fn integrate(
        mesh: &Mesh,
        gradient: &'a Gradient,
        discrete: &'a [[f64; 2]],
        weight: Weight<'a>,
    ) -> Result<Self, FieldError> {
        let weighted = match weight {
            Weight::One => Vec::new(),
            Weight::Judged(_) => vec![0.0; discrete.len()],
        };
        let mut integrand = SquaredError {
            gradient,
            discrete,
            weight,
            plain: vec![0.0; discrete.len()],
            weighted,
        };
        integrate(mesh, CONTROL, &mut integrand)?;
        Ok(integrand)
    }
}

impl Integrand for SquaredError<'_> {
    fn components(&self) -> usize {
        match self.weight {
            Weight::One => 2,
            Weight::Judged(_) => 3,
        }
    }

    fn sample(&mut self, at: Samples<'_>, out: &mut [f64]) -> Result<(), FieldError> {
        let (x, rest) = out.split_at_mut(at.len());
        let (y, mu) = rest.split_at_mut(at.len());
        self.gradient[0].sample(at, x)?;
        self.gradient[1].sample(at, y)?;
        match self.weight {
            Weight::One => Ok(()),
            Weight::Judged(field) => field.sample(at, mu),
        }
    }

    /// The error density is |v|^2 with v = mu^(1/2) (grad v - grad v_h). For a smooth error v is affine but for O(h) of its size, and |v|^2
    /// is integrated with a relative error of O(h^4), the fourth power of the relative misfit; a jump or a singularity leaves a misfit of the size of v.
    fn judge(&self, piece: &Piece<'_>) -> Judgement {
        let [dx, dy] = self.discrete[piece.triangle];
        let mut v = [[0.0; POINTS]; 2];
        let (mut square, mut largest, mut floor) = (0.0, 0.0f64, 0.0);
        for (k, point) in piece.rule.iter().enumerate() {
            let root = match self.weight {
                Weight::One => 1.0,
                Weight::Judged(_) => piece.values(2)[k].sqrt(),
            };
            let (gx, gy) = (piece.values(0)[k], piece.values(1)[k]);
            let (x, y) = (root * (gx - dx), root * (gy - dy));
            (v[0][k], v[1][k]) = (x, y);
            let norm = x * x + y * y;
            square += point.weight * norm;
            largest = largest.max(norm);
            floor += point.weight * root * root * (gx * gx + gy * gy);
        }
        let largest = largest.sqrt();
        let misfit = affine_misfit(piece.rule, &v[0]) + affine_misfit(piece.rule, &v[1]);
        Judgement {
            magnitude: piece.area * (square + FLOOR * FLOOR * floor),
            error: piece.area * squared_error(misfit, largest),
        }
    }

    fn clear(&mut self, triangle: usize) {
        self.plain[triangle] = 0.0;
        if let Some(sum) = self.weighted.get_mut(triangle) {
            *sum = 0.0;
        }
    }

    fn add(&mut self, piece: &Piece<'_>) {
        let [dx, dy] = self.discrete[piece.triangle];
        let (mut plain, mut weighted) = (0.0, 0.0);
        for (k, point) in piece.rule.iter().enumerate() {
            let (x, y) = (piece.values(0)[k] - dx, piece.values(1)[k] - dy);
            let share = point.weight * (x * x + y * y);
            plain += share;
            if let Weight::Judged(_) = self.weight {
                weighted += share * piece.values(2)[k];
            }
        }
        self.plain[piece.triangle] += piece.area * plain;
        if let Some(sum) = self.weighted.get_mut(piece.triangle) {
            *sum += piece.area * weighted;
        }
    }
}
