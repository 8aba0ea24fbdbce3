//! The quadrature rule everything is integrated by: seven points strictly inside the triangle, exact to degree five.
//!
//! Radon (1948). No point lies on an edge, so data that jump across edges are never sampled on the wrong side.

/// Number of points of the rule.
pub const POINTS: usize = 7;

/// A point of the rule: barycentric coordinates and weight; the weights sum to one.
#[derive(Clone, Copy, Debug)]
pub struct RulePoint {
    /// Barycentric coordinates.
    pub at: [f64; 3],
    /// Share of the area.
    pub weight: f64,
}

/// The rule of degree five.
pub fn rule() -> [RulePoint; POINTS] {
    let root = 15f64.sqrt();
    let orbit = |a: f64, weight: f64| {
        let b = 1.0 - 2.0 * a;
        [[b, a, a], [a, b, a], [a, a, b]].map(|at| RulePoint { at, weight })
    };
    let near = orbit((6.0 - root) / 21.0, (155.0 - root) / 1200.0);
    let far = orbit((6.0 + root) / 21.0, (155.0 + root) / 1200.0);
    let third = 1.0 / 3.0;
    let centre = RulePoint {
        at: [third; 3],
        weight: 9.0 / 40.0,
    };
    [centre, near[0], near[1], near[2], far[0], far[1], far[2]]
}

/// A point of [`segment_rule`].
#[derive(Clone, Copy, Debug)]
pub struct SegmentPoint {
    /// Position between the ends, in (0, 1).
    pub at: f64,
    /// Share of the length.
    pub weight: f64,
}

/// Gauss's rule with three points on a segment, exact to degree five.
pub fn segment_rule() -> [SegmentPoint; 3] {
    let half = 0.5 * 0.6f64.sqrt();
    [(0.5 - half, 5.0), (0.5, 8.0), (0.5 + half, 5.0)].map(|(at, weight)| SegmentPoint {
        at,
        weight: weight / 18.0,
    })
}

/// The affine function that fits samples at the points of the rule best.
#[derive(Clone, Copy, Debug)]
pub struct AffineFit {
    /// Its values at the three corners.
    pub corners: [f64; 3],
    /// The largest deviation of a sample from it.
    pub misfit: f64,
}

/// Fits samples in the mean (least squares with the weights of the rule).
pub fn affine_fit(rule: &[RulePoint; POINTS], values: &[f64]) -> AffineFit {
    // The first value is taken out so that constant data fit exactly.
    let base = values[0];
    let (mut mean, mut slope) = (0.0, [0.0; 3]);
    for (p, v) in rule.iter().zip(values) {
        let d = v - base;
        mean += p.weight * d;
        for k in 0..3 {
            slope[k] += p.weight * (p.at[k] - 1.0 / 3.0) * d;
        }
    }
    // (lambda_k - 1/3) have mean zero, norm^2 1/18 and products -1/36: the fit is mean + 12 * sum slope_k lambda_k.
    let mut misfit = 0.0f64;
    for (p, v) in rule.iter().zip(values) {
        let fit = mean + 12.0 * (slope[0] * p.at[0] + slope[1] * p.at[1] + slope[2] * p.at[2]);
        misfit = misfit.max((v - base - fit).abs());
    }
    AffineFit {
        corners: slope.map(|s| base + mean + 12.0 * s),
        misfit,
    }
}

/// How far values at the points of the rule are from those of an affine function.
///
/// Returns the largest deviation from the affine function that fits them best: zero to rounding for affine data, O(h^2) for smooth data, of the
/// order of the jump where data jump.
pub fn affine_misfit(rule: &[RulePoint; POINTS], values: &[f64]) -> f64 {
    affine_fit(rule, values).misfit
}

/// [`affine_misfit`] of several functions, bit for bit.
pub fn affine_misfits<const N: usize>(rule: &[RulePoint; POINTS], values: [&[f64]; N]) -> [f64; N] {
    let samples: [[f64; N]; POINTS] = std::array::from_fn(|q| values.map(|values| values[q]));
    let (mut mean, mut slope) = ([0.0; N], [[0.0; N]; 3]);
    for (p, v) in rule.iter().zip(&samples) {
        let factors = p.at.map(|at| p.weight * (at - 1.0 / 3.0));
        for l in 0..N {
            let d = v[l] - samples[0][l];
            mean[l] += p.weight * d;
            for k in 0..3 {
                slope[k][l] += factors[k] * d;
            }
        }
    }
    let mut misfit = [0.0f64; N];
    for (p, v) in rule.iter().zip(&samples) {
        for l in 0..N {
            let [a, b, c] = [0, 1, 2].map(|k| slope[k][l] * p.at[k]);
            let off = (v[l] - samples[0][l] - (mean[l] + 12.0 * (a + b + c))).abs();
            misfit[l] = misfit[l].max(off);
        }
    }
    misfit
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Integral of x^i y^j over the triangle (0,0), (1,0), (0,1), times two.
    fn monomial(i: u32, j: u32) -> f64 {
        let factorial = |n: u32| (1..=n).map(f64::from).product::<f64>();
        2.0 * factorial(i) * factorial(j) / factorial(i + j + 2)
    }

    #[test]
    fn exact_to_degree_five_and_no_further() {
        let error = |i: u32, j: u32| {
            let sum: f64 = rule()
                .iter()
                .map(|p| p.weight * p.at[1].powi(i as i32) * p.at[2].powi(j as i32))
                .sum();
            (sum - monomial(i, j)).abs()
        };
        for i in 0..=5 {
            for j in 0..=5 - i {
                assert!(error(i, j) < 1e-16, "{i} {j} {}", error(i, j));
            }
        }
        assert!(error(6, 0) > 1e-5);
        assert!(rule().iter().all(|p| p.at.iter().all(|&l| l > 0.05)));
    }

    #[test]
    fn several_misfits_are_those_of_each() {
        let r = rule();
        let at = |f: &dyn Fn([f64; 3]) -> f64| r.map(|p| f(p.at));
        let [a, b] = [
            at(&|l| (3.1 * l[0] + l[1]).sin()),
            at(&|l| f64::from(l[0] > 0.4) - 7.3),
        ];
        let single = [&a, &b].map(|values| affine_misfit(&r, values));
        assert_eq!(affine_misfits(&r, [&a, &b]), single);
    }

    #[test]
    fn misfit_vanishes_for_affine_data_only() {
        let r = rule();
        let at = |f: &dyn Fn([f64; 3]) -> f64| r.map(|p| f(p.at));
        assert!(affine_misfit(&r, &at(&|l| 3.0 * l[0] - l[1] + 0.5)) < 1e-15);
        assert_eq!(affine_misfit(&r, &at(&|_| 0.1)), 0.0);
        let curved = affine_misfit(&r, &at(&|l| l[0] * l[0]));
        assert!((0.01..0.3).contains(&curved), "{curved}");
        let jump = affine_misfit(&r, &at(&|l| f64::from(l[0] > 0.4)));
        assert!(jump > 0.2, "{jump}");
    }
}
