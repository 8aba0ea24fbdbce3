//! The conditions that a discrete solution fulfils (section 5 of the paper), by plain sums over elements.
//!
//! With the interior vertices j, d_ij = sum_K mu_iK |K| |grad phi_j|^2, d_j = d_1j/(1 + d_1j/d_2j) and U the largest displacement (1 if all are
//! zero), the relative KKT residual is the largest of
//!
//! ```text
//! |F_ij +- z_j - sum_K mu_iK |K| grad u_ih . grad phi_j| / (d_ij U)   (i = 1, 2),      |min(w_j, z_j/d_j)| / U
//! ```

use crate::data::Discrete;
use crate::number::{Number, TOLERANCE, largest};
use crate::report::Report;

/// Rounding of the terms of a nodal residual, in units of the last place.
const UNITS: f64 = 64.0;

/// Feasibility and complementarity: signs and zeros, which must hold exactly, and the heights.
pub(crate) fn check(level: &Discrete<'_>, file: &str, report: &mut Report) {
    let count = level.vertices();
    let mut everywhere = |claim: &str, wrong: &dyn Fn(usize) -> bool| {
        report.everywhere(file, claim, "vertex", count, wrong);
    };
    everywhere("u1 >= u2", &|j| level.gap(j) < 0.0);
    everywhere("action_force >= 0", &|j| level.force[j] < 0.0);
    everywhere("action_force = 0 without contact", &|j| !level.contact[j] && level.force[j] != 0.0);
    everywhere("contact only where gap = 0", &|j| level.contact[j] && level.gap(j) != 0.0);
    everywhere("contact = 0 on the boundary", &|j| level.contact[j] && !level.is_interior(j));
    everywhere("sigma = 0 on the boundary", &|j| !level.is_interior(j) && level.sigma[j] != 0.0);
    for (i, claim) in ["u1 = g1 on the boundary", "u2 = g2 on the boundary"].into_iter().enumerate() {
        let (u, g) = (&level.displacement[i], &level.heights[i]);
        let slack = 1e-3 * TOLERANCE * largest(g);
        everywhere(claim, &|j| !level.is_interior(j) && !((u[j] - g[j]).abs() <= slack));
    }
}

/// The relative KKT residual, with the part of it that rounding may leave.
pub(crate) fn kkt_residual(level: &Discrete<'_>) -> Number {
    let count = level.vertices();
    let unit = largest(&level.displacement[0]).max(largest(&level.displacement[1]));
    let unit = if unit == 0.0 { 1.0 } else { unit };
    let (mut worst, mut rounding) = (0.0f64, 0.0f64);
    let mut diagonals = Vec::with_capacity(2);
    for (i, sign) in [(0, 1.0), (1, -1.0)] {
        let u = &level.displacement[i];
        let load = &level.loads[i].nodal;
        let mut rest: Vec<f64> = (0..count).map(|j| load[j] + sign * level.force[j]).collect();
        let mut terms: Vec<f64> = (0..count).map(|j| load[j].abs() + level.force[j]).collect();
        let mut diagonal = vec![0.0; count];
        for (e, mu) in level.elements.iter().zip(&level.tension[i]) {
            let weight = mu * e.area;
            let [gx, gy] = e.gradient(u);
            for (k, &j) in e.vertices.iter().enumerate() {
                let [hx, hy] = e.hat[k];
                rest[j] -= weight * (gx * hx + gy * hy);
                diagonal[j] += weight * (hx * hx + hy * hy);
                for (l, &m) in e.vertices.iter().enumerate() {
                    terms[j] += weight * (e.hat[l][0] * hx + e.hat[l][1] * hy).abs() * u[m].abs();
                }
            }
        }
        for j in (0..count).filter(|&j| level.is_interior(j)) {
            worst = worst.max(rest[j].abs() / diagonal[j] / unit);
            rounding = rounding.max(terms[j] / diagonal[j] / unit);
        }
        diagonals.push(diagonal);
    }
    for j in (0..count).filter(|&j| level.is_interior(j)) {
        let [d1, d2] = [diagonals[0][j], diagonals[1][j]];
        let d = d1 / (1.0 + d1 / d2);
        worst = worst.max(level.gap(j).min(level.force[j] / d).abs() / unit);
    }
    Number {
        value: worst,
        slack: TOLERANCE * worst + UNITS * f64::EPSILON * rounding,
        exponent: 0,
    }
}
