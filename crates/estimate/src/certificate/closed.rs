//! Norms over an element in closed form, of affine and quadratic functions less constants on the shares of the dual cells.

use super::element::Pair;
use super::frame::pairs;

/// The best affine fit of a function on an element.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fit {
    /// Its mean, which is that of the function.
    pub mean: f64,
    /// What it has beyond the mean at the three corners; the sum is 0.
    pub slope: [f64; 3],
    /// Squared distance of the function from the fit.
    pub bent: f64,
}

impl Fit {
    /// From the integrals of a function against the three hat functions, and its squared deviation from its mean.
    #[inline(always)]
    pub fn of(hats: [f64; 3], deviation: f64, area: f64) -> Fit {
        let over = 1.0 / area;
        let hats = hats.map(|m| m * over);
        let mean = hats[0] + hats[1] + hats[2];
        // The inverse of the mass matrix.
        let slope = hats.map(|m| 12.0 * m - 4.0 * mean);
        // The fit less its mean is orthogonal to what is left of the function.
        let bent = (deviation - area / 12.0 * squared(slope)).max(0.0);
        Fit { mean, slope, bent }
    }

    /// Values at the corners.
    #[inline(always)]
    pub fn corners(&self) -> [f64; 3] {
        self.slope.map(|s| self.mean + s)
    }
}

#[inline(always)]
pub(super) fn squared(v: [f64; 3]) -> f64 {
    v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
}

/// ||p - sum_k c_k chi_Dk||^2 on an element, for an affine function p by its values at the corners.
pub(super) fn affine_on_cells(p: [f64; 3], c: [f64; 3], area: f64) -> f64 {
    let mean = (p[0] + p[1] + p[2]) / 3.0;
    let (p, c) = (p.map(|p| p - mean), c.map(|c| c - mean));
    let mut sum = 0.0;
    for k in 0..3 {
        // The integrals of the hat functions over D_k are 22/108 and 7/108 of the area; the values of p sum to zero.
        let across = 15.0 / 108.0 * p[k];
        sum += p[k] * p[k] / 12.0 - 2.0 * c[k] * across + c[k] * c[k] / 3.0;
    }
    area * sum.max(0.0)
}

/// The same for the best affine fits of two functions, where every c_k is 3 (p, phi_k)/|K|, and the squared distances of the functions from the fits. `hats` are
/// the integrals of the functions against the three hat functions, `deviation` their squared deviations from their means.
///
/// What p has beyond its mean at the corners is 12 times what (p, phi_k)/|K| has; c_k has a quarter of that.
#[inline(always)]
pub(super) fn balanced_affine(hats: [Pair; 3], deviation: Pair, area: f64) -> (Pair, Pair) {
    let (d1, d2) = (hats[1] - hats[0], hats[2] - hats[0]);
    let spread = (d1 * (d1 - d2) + d2 * d2) * (1.0 / area);
    let bent = deviation - spread * 8.0;
    (spread * (10.0 / 3.0), bent.positive())
}

/// ||a sum_k theta_k (phi_k - chi_Dk)||^2 for a constant a.
#[inline]
pub(super) fn balanced_constant(theta: [f64; 3], a: f64, area: f64) -> f64 {
    5.0 / 108.0 * area * a * a * pairs(theta)
}

/// ||q - sum_k c_k chi_Dk||^2 for the quadratic function q = p + theta a, all three of them affine and given at the corners, where c_k is 3/|K| times
/// (p + theta_k a, phi_k), so that both have the same mean.
#[inline(always)]
pub(super) fn balanced_quadratic(p: &Fit, theta: [f64; 3], a: [f64; 3], area: f64) -> f64 {
    // Bernstein coefficients of q at the corners and, numbered by the corner opposite, on the edges; the mean of p is left out.
    let s = p.slope;
    let mut b = [0, 1, 2].map(|k| s[k] + theta[k] * a[k]);
    let mut m = [0, 1, 2].map(|k| {
        let (l, n) = ((k + 1) % 3, (k + 2) % 3);
        0.5 * (s[l] + s[n] + theta[l] * a[n] + theta[n] * a[l])
    });
    let all = a[0] + a[1] + a[2];
    let mut c = [0, 1, 2].map(|k| 0.25 * (s[k] + theta[k] * (all + a[k])));
    let mean = (b[0] + b[1] + b[2] + m[0] + m[1] + m[2]) / 6.0;
    for values in [&mut b, &mut m, &mut c] {
        values.iter_mut().for_each(|v| *v -= mean);
    }
    let sum = b[0] + b[1] + b[2];
    let mixed = b[0] * m[0] + b[1] * m[1] + b[2] * m[2];
    // Means of the products of phi_k phi_l; the means of q and of the constants are 0 by now.
    let own = (10.0 * squared(b) - 8.0 * mixed + 4.0 * squared(m) - 6.0 * sum * sum) / 180.0;
    // int over D_k of phi_k^2, phi_l^2, phi_k phi_l, phi_l phi_n: 170, 23, 47 and 14, in parts of 1296.
    let across: f64 = (0..3).map(|k| c[k] * (147.0 * b[k] - 66.0 * m[k])).sum();
    area * (own - across / 648.0 + squared(c) / 3.0).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::super::dual_rule::DualRule;
    use super::*;
    use crate::testing::close;
    use fem_core::quadrature::{POINTS, RulePoint, rule};

    const AREA: f64 = 0.3;

    fn at(values: [f64; 3], point: &RulePoint) -> f64 {
        (0..3).map(|k| values[k] * point.at[k]).sum()
    }

    fn integral(samples: &[f64; POINTS]) -> f64 {
        let points = rule();
        AREA * points
            .iter()
            .zip(samples)
            .map(|(p, s)| p.weight * s)
            .sum::<f64>()
    }

    fn hats(samples: &[f64; POINTS]) -> [f64; 3] {
        let points = rule();
        [0, 1, 2].map(|k| integral(&std::array::from_fn(|q| points[q].at[k] * samples[q])))
    }

    /// A quadratic function, and what is known of it.
    fn quadratic() -> ([f64; POINTS], Fit) {
        let samples = rule().map(|p| 1.5 - p.at[1] + 0.7 * p.at[2] + 0.4 * p.at[1] * p.at[2]);
        let mean = integral(&samples) / AREA;
        let deviation = integral(&samples.map(|s| (s - mean).powi(2)));
        (samples, Fit::of(hats(&samples), deviation, AREA))
    }

    #[test]
    fn the_fit_is_orthogonal_to_what_it_leaves() {
        let (samples, fit) = quadratic();
        let points = rule();
        let rest: [f64; POINTS] =
            std::array::from_fn(|q| samples[q] - at(fit.corners(), &points[q]));
        assert!(hats(&rest).iter().all(|m| m.abs() < 1e-15));
        assert!(fit.bent > 1e-5);
        close(fit.bent, integral(&rest.map(|r| r * r)), 1e-11);
    }

    #[test]
    fn balanced_norms_are_those_of_the_samples() {
        let (_, fit) = quadratic();
        let points = rule();
        let norm = |theta: [f64; 3], a: [f64; 3]| {
            let samples = points.map(|p| at(fit.corners(), &p) + at(theta, &p) * at(a, &p));
            let constants = [0, 1, 2].map(|k| {
                let own = points.map(|p| at(fit.corners(), &p) + theta[k] * at(a, &p));
                3.0 / AREA * hats(&own)[k]
            });
            (
                AREA * DualRule::new().square(&samples, constants).0,
                constants,
            )
        };
        let (wanted, constants) = norm([0.0; 3], [0.0; 3]);
        let (samples, _) = quadratic();
        let deviation = integral(&samples.map(|s| (s - fit.mean).powi(2)));
        let pairs = hats(&samples).map(|m| Pair([m, -2.0 * m]));
        let pair = Pair([deviation, 4.0 * deviation]);
        let (square, bent) = balanced_affine(pairs, pair, AREA);
        for (factor, i) in [(1.0, 0), (4.0, 1)] {
            close(square.0[i], factor * wanted, 1e-12);
            close(bent.0[i], factor * fit.bent, 1e-10);
        }
        close(
            affine_on_cells(fit.corners(), constants, AREA),
            wanted,
            1e-12,
        );
        for (theta, a) in [
            ([0.3, 0.9, 1.0], [2.0, 0.1, 1.7]),
            ([-1.0; 3], [1.0, 0.4, 0.2]),
            ([1.0, 0.0, 0.25], [3.0; 3]),
        ] {
            let (wanted, _) = norm(theta, a);
            close(balanced_quadratic(&fit, theta, a, AREA), wanted, 1e-12);
        }
        let constant = Fit {
            slope: [0.0; 3],
            ..fit
        };
        let theta = [0.2, 0.7, 1.0];
        close(
            balanced_constant(theta, 1.3, AREA),
            balanced_quadratic(&constant, theta, [1.3; 3], AREA),
            1e-12,
        );
        // Large equal values cancel.
        let high = Fit { mean: 1e9, ..fit };
        assert_eq!(
            balanced_quadratic(&high, [0.5; 3], [1.0; 3], AREA),
            balanced_quadratic(&fit, [0.5; 3], [1.0; 3], AREA)
        );
    }
}
