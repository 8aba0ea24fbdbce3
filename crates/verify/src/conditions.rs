//! The conditions that a discrete solution fulfils (section 5 of the paper), by plain sums over elements.
//!
//! With the interior vertices j, d_ij = sum_K mu_iK |K| |grad phi_j|^2, d_j = d_1j/(1 + d_1j/d_2j) and U the largest displacement (1 if all are
//! zero), the relative KKT residual is the largest of
//!
//! ```text
//! |F_ij +- z_j - sum_K mu_iK |K| grad u_ih . grad phi_j| / (d_ij U)   (i = 1, 2),      |min(w_j, z_j/d_j)| / U
//! ```

use fem_core::scale::times_power_of_two;

use crate::data::Discrete;
use crate::number::{Number, TOLERANCE, largest};
use crate::report::{Claim, Report, show};

/// Largest difference from the heights, relative to the largest of them: what another machine's functions may do.
const HEIGHT: f64 = 1e-12;

/// Rounding of the terms of a nodal residual, in units of the last place.
const UNITS: f64 = 64.0;

/// Feasibility and complementarity: signs and zeros, which must hold exactly, and the heights.
pub(crate) fn check(level: &Discrete<'_>, file: &str, report: &mut Report) {
    let count = level.vertices();
    let scale = level.scale;
    let mut everywhere =
        |claim: &str, value: &dyn Fn(usize) -> f64, wrong: &dyn Fn(usize) -> bool| {
            report.everywhere(file, claim, "vertex", count, |j| {
                wrong(j).then(|| (show(value(j)), None))
            });
        };
    let gap = |j: usize| times_power_of_two(level.gap(j), scale.displacement());
    let force = |j: usize| times_power_of_two(level.force[j], scale.force());
    let sigma = |j: usize| times_power_of_two(level.sigma[j], scale.force());
    let contact = |j: usize| f64::from(u8::from(level.contact[j]));
    everywhere("gap >= 0", &gap, &|j| level.gap(j) < 0.0);
    everywhere("action_force >= 0", &force, &|j| level.force[j] < 0.0);
    everywhere("action_force = 0 without contact", &force, &|j| {
        !level.contact[j] && level.force[j] != 0.0
    });
    everywhere("gap = 0 in contact", &gap, &|j| {
        level.contact[j] && level.gap(j) != 0.0
    });
    everywhere("contact = 0 on the boundary", &contact, &|j| {
        level.contact[j] && !level.is_interior(j)
    });
    everywhere("sigma = 0 on the boundary", &sigma, &|j| {
        !level.is_interior(j) && level.sigma[j] != 0.0
    });
    for (i, name) in ["u1 on the boundary", "u2 on the boundary"]
        .into_iter()
        .enumerate()
    {
        let (u, g) = (&level.displacement[i], &level.heights[i]);
        let slack = HEIGHT * largest(g);
        // Inside there is nothing to compare with.
        let expected: Vec<f64> = (0..count)
            .map(|j| if level.is_interior(j) { u[j] } else { g[j] })
            .collect();
        let claim = Claim {
            file,
            name,
            place: "vertex",
            claimed: &level.physical(u, scale.displacement()),
            recomputed: &expected,
            exponent: scale.displacement(),
        };
        report.values(&claim, |_| slack);
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
        let mut rest: Vec<f64> = (0..count)
            .map(|j| load[j] + sign * level.force[j])
            .collect();
        let mut terms: Vec<f64> = (0..count).map(|j| load[j].abs() + level.force[j]).collect();
        let mut diagonal = vec![0.0; count];
        for (t, e) in level.elements.iter().enumerate() {
            let mu = level.tension[i][t];
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{level, square};

    #[test]
    fn the_residual_of_one_free_vertex_by_hand() {
        // Four squares; the hat of the centre has the gradient 1 on six halves of them: (grad phi, grad phi) = 4 and (1, phi) = 1.
        let mesh = square(2);
        let at_centre = |v: f64| {
            let mut values = vec![0.0; 9];
            values[4] = v;
            values
        };
        // In contact at -1/20: 2 * 4 u = -1 + z and 3 * 4 u = 1 - z add up to 20 u = 0.
        let touching = level(
            &mesh,
            [at_centre(0.0), at_centre(0.0)],
            at_centre(1.0),
            at_centre(0.25),
        );
        let residual = kkt_residual(&touching);
        assert!(
            residual.value <= 1e-16 && residual.slack < 1e-12,
            "{residual:?}"
        );
        // Apart by 1/2 without a force: residuals |-1 - 8/4| / 8 and |1 + 12/4| / 12 over U = 1/4.
        let apart = level(
            &mesh,
            [at_centre(0.25), at_centre(-0.25)],
            at_centre(0.0),
            at_centre(0.0),
        );
        let residual = kkt_residual(&apart).value;
        assert!((residual - 3.0 / 8.0 * 4.0).abs() < 1e-14, "{residual}");
        let mut report = Report::default();
        check(&apart, "f", &mut report);
        assert!(report.holds());
    }

    #[test]
    fn wrong_signs_are_named() {
        let mesh = square(2);
        let at_centre = |v: f64| {
            let mut values = vec![0.0; 9];
            values[4] = v;
            values
        };
        let wrong = level(
            &mesh,
            [at_centre(-1.0), at_centre(1.0)],
            at_centre(-1.0),
            vec![1.0; 9],
        );
        let mut report = Report::default();
        check(&wrong, "f", &mut report);
        let claims: Vec<&str> = report.failures.iter().map(|f| f.claim.as_str()).collect();
        assert_eq!(
            claims,
            [
                "gap >= 0",
                "action_force >= 0",
                "action_force = 0 without contact",
                "sigma = 0 on the boundary"
            ]
        );
    }
}
