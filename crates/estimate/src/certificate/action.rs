//! The action inside contact, lambda* = max(0, (mu_1 f_2 - mu_2 f_1)/(mu_1 + mu_2)), in one element.

use super::closed::{Fit, squared};
use super::element::Pair;

/// Integrals against the products phi_0^2, phi_1^2, phi_2^2, phi_1 phi_2, phi_2 phi_0, phi_0 phi_1 of the hat functions of an element.
pub(super) type Products = [f64; 6];

/// Position of phi_k phi_l in [`Products`].
#[inline]
pub(super) fn product(k: usize, l: usize) -> usize {
    if k == l { k } else { 6 - k - l }
}

/// The action inside contact in one element.
#[derive(Clone, Copy, Debug)]
pub(super) enum Action<'a> {
    /// Nothing is known, since nothing presses there.
    Unknown,
    /// Affine, by its values at the corners.
    Affine([f64; 3]),
    /// Any other, by its integrals.
    Sampled(&'a Products),
}

impl Action<'_> {
    /// (lambda*, phi_k phi_l) over an element of this area.
    #[inline]
    pub fn product(&self, area: f64, k: usize, l: usize) -> f64 {
        match self {
            Action::Unknown => 0.0,
            Action::Affine(a) => {
                let sum = a[0] + a[1] + a[2] + a[k] + a[l];
                sum * area / if k == l { 30.0 } else { 60.0 }
            }
            Action::Sampled(products) => products[product(k, l)],
        }
    }

    /// (lambda*, phi_k) for the three corners of an element of this area.
    #[inline(always)]
    pub fn hats(&self, area: f64) -> [f64; 3] {
        match self {
            Action::Unknown => [0.0; 3],
            Action::Affine(a) => {
                let sum = a[0] + a[1] + a[2];
                a.map(|own| (sum + own) * (area / 12.0))
            }
            Action::Sampled(p) => {
                [0, 1, 2].map(|k| p[product(k, 0)] + p[product(k, 1)] + p[product(k, 2)])
            }
        }
    }
}

/// The action is smooth in an element if what its affine fit leaves is at most this part of it.
const SMOOTH: f64 = 0.01;

/// The loads are smooth there if what their affine fits leave is at most this part of what contact leaves of them: that no longer cancels.
const LEFT: f64 = 0.005;

/// The action that stands for lambda* in an element with constant tensions where that is smooth and positive: its best affine fit, which the moments of the loads
/// and their squared deviations tell. `None` where that is not positive at a corner, or something is not smooth.
#[inline(always)]
pub(super) fn affine_action(
    tension: [f64; 2],
    area: f64,
    hats: &[Pair; 3],
    deviation: Pair,
) -> Option<[f64; 3]> {
    let share = parts(tension);
    let fit = |i: usize| Fit::of(hats.map(|m| m.0[i]), deviation.0[i], area);
    let fits = [fit(0), fit(1)];
    let [f, g] = fits.each_ref().map(Fit::corners);
    let corners = [0, 1, 2].map(|k| share[0] * g[k] - share[1] * f[k]);
    let square = |v: [f64; 3]| {
        let sum = v[0] + v[1] + v[2];
        area / 12.0 * (squared(v) + sum * sum)
    };
    let root = fits.each_ref().map(|fit| fit.bent.sqrt());
    let left = share[0] * root[1] + share[1] * root[0];
    // f_i +- lambda* is this part of the sum of both loads.
    let both = square([0, 1, 2].map(|k| f[k] + g[k])).sqrt();
    let smooth = left * left <= SMOOTH * SMOOTH * square(corners)
        && (0..2).all(|i| root[i] <= LEFT * share[i] * both);
    (smooth && corners.iter().all(|&a| a >= 0.0)).then_some(corners)
}

/// The action inside contact.
#[inline]
pub(super) fn contact_action(tension: [f64; 2], load: [f64; 2]) -> f64 {
    // Written so that no product of tension and load can leave the range.
    let [first, second] = parts(tension);
    (first * load[1] - second * load[0]).max(0.0)
}

/// The shares of the two tensions in their sum.
#[inline]
fn parts([m1, m2]: [f64; 2]) -> [f64; 2] {
    [m1 / (m1 + m2), m2 / (m1 + m2)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::close;
    use fem_core::quadrature::rule;

    const AREA: f64 = 0.2;

    /// Moments and squared deviations of two loads, from their values at the points of the rule.
    fn loads(value: impl Fn(f64, f64) -> [f64; 2]) -> ([Pair; 3], Pair) {
        let samples = rule().map(|p| (p, value(p.at[1], p.at[2])));
        let sum = |of: &dyn Fn([f64; 3], [f64; 2]) -> f64| -> f64 {
            samples
                .iter()
                .map(|(p, v)| AREA * p.weight * of(p.at, *v))
                .sum()
        };
        let mean = [0, 1].map(|i| sum(&|_, v| v[i]) / AREA);
        (
            [0, 1, 2].map(|k| Pair([0, 1].map(|i| sum(&|at, v| at[k] * v[i])))),
            Pair([0, 1].map(|i| sum(&|_, v| (v[i] - mean[i]).powi(2)))),
        )
    }

    fn action(tension: [f64; 2], value: impl Fn(f64, f64) -> [f64; 2]) -> Option<[f64; 3]> {
        let (hats, deviation) = loads(value);
        affine_action(tension, AREA, &hats, deviation)
    }

    #[test]
    fn affine_loads_give_the_action_inside_contact() {
        let value = |x: f64, y: f64| [-3.0 + x, 1.0 + 2.0 * y];
        let tension = [2.0, 0.5];
        let found = action(tension, value).expect("positive");
        for (found, [x, y]) in found.iter().zip([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]) {
            close(*found, contact_action(tension, value(x, y)), 1e-13);
        }
        // Integrals by the affine function and by samples.
        let affine = Action::Affine(found);
        let points = rule();
        let at = |at: [f64; 3]| contact_action(tension, value(at[1], at[2]));
        for k in 0..3 {
            let wanted: f64 = points
                .iter()
                .map(|p| AREA * p.weight * p.at[k] * at(p.at))
                .sum();
            close(affine.hats(AREA)[k], wanted, 1e-13);
            let sum: f64 = (0..3).map(|l| affine.product(AREA, k, l)).sum();
            close(sum, wanted, 1e-13);
            let wanted: f64 = points
                .iter()
                .map(|p| AREA * p.weight * p.at[k] * p.at[0] * at(p.at))
                .sum();
            close(affine.product(AREA, k, 0), wanted, 1e-13);
        }
    }

    #[test]
    fn no_affine_action_where_it_changes_its_sign_or_a_load_is_rough() {
        let even = [1.0; 2];
        assert!(action(even, |_, _| [-1.0, 0.0]).is_some());
        assert!(action(even, |x, _| [x - 0.5, 0.0]).is_none());
        assert!(action(even, |_, _| [1.0, 0.0]).is_none());
        let bent = |x: f64, _: f64| [-3.0 - 0.05 * x * x, 1.0];
        assert!(action(even, bent).is_some());
        assert!(action(even, |x, _| [-3.0 - x * x, 1.0]).is_none());
        // What contact leaves of the load of a soft membrane is far smaller than that load.
        assert!(action([1e-3, 1.0], bent).is_none());
        let (hats, _) = loads(bent);
        let unknown = hats.map(|_| Pair([f64::NAN; 2]));
        assert!(affine_action(even, AREA, &unknown, Pair::default()).is_none());
    }
}
