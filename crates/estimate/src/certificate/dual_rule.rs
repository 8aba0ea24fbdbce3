//! Integrals over the shares of dual cells from samples at the seven points of an element.

use fem_core::quadrature::{POINTS, rule};

/// Number of coefficients of a quadratic polynomial.
const QUADRATIC: usize = 6;

/// Weights for the integral over each third K cap D_j, exact for quadratic functions: those of the quadratic function that fits the samples best.
#[derive(Clone, Debug)]
pub(super) struct DualRule {
    /// Weights of the rule for the whole element; they sum to one.
    whole: [f64; POINTS],
    /// Weights for each third; they sum to a third.
    third: [[f64; POINTS]; 3],
    /// What is orthogonal to quadratic functions, scaled so that its product with samples is the largest deviation from the fit.
    rest: [f64; POINTS],
}

fn monomials([_, x, y]: [f64; 3]) -> [f64; QUADRATIC] {
    [1.0, x, y, x * x, x * y, y * y]
}

impl DualRule {
    /// The weights; a few hundred operations.
    pub fn new() -> DualRule {
        let points = rule();
        // Normal equations of the fit, weighted by the rule: gram c = sum of w m(x_k) v_k.
        let mut gram = [[0.0; QUADRATIC]; QUADRATIC];
        for p in &points {
            let m = monomials(p.at);
            for a in 0..QUADRATIC {
                for b in 0..QUADRATIC {
                    gram[a][b] += p.weight * m[a] * m[b];
                }
            }
        }
        let corner = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let centre = [1.0 / 3.0; 3];
        let middle = |p: [f64; 3], q: [f64; 3]| [0, 1, 2].map(|k| 0.5 * (p[k] + q[k]));
        let weights = |moments: [f64; QUADRATIC]| {
            let dual = solve(gram, moments);
            points.map(|p| {
                let value: f64 = monomials(p.at).iter().zip(&dual).map(|(m, d)| m * d).sum();
                p.weight * value
            })
        };
        let third = [0, 1, 2].map(|k| {
            let mut moments = [0.0; QUADRATIC];
            let parts = [
                [corner[k], middle(corner[k], corner[(k + 1) % 3]), centre],
                [corner[k], centre, middle(corner[k], corner[(k + 2) % 3])],
            ];
            for part in parts {
                for p in &points {
                    let at = [0, 1, 2].map(|c| (0..3).map(|v| p.at[v] * part[v][c]).sum::<f64>());
                    for (sum, m) in moments.iter_mut().zip(monomials(at)) {
                        *sum += p.weight / 6.0 * m;
                    }
                }
            }
            weights(moments)
        });
        // The deviations from the fit are multiples of one vector; the fit of a unit sample leaves one.
        let mut unit = [0.0; POINTS];
        unit[0] = 1.0;
        let mut right = [0.0; QUADRATIC];
        for (sum, m) in right.iter_mut().zip(monomials(points[0].at)) {
            *sum += points[0].weight * m;
        }
        let fit = solve(gram, right);
        let mut left = unit;
        for (value, p) in left.iter_mut().zip(&points) {
            *value -= monomials(p.at)
                .iter()
                .zip(&fit)
                .map(|(m, c)| m * c)
                .sum::<f64>();
        }
        let norm: f64 = points
            .iter()
            .zip(&left)
            .map(|(p, l)| p.weight * l * l)
            .sum();
        let largest = left.iter().fold(0.0f64, |m, l| m.max(l.abs()));
        let mut rest = [0.0; POINTS];
        for (k, p) in points.iter().enumerate() {
            rest[k] = p.weight * left[k] * largest / norm;
        }
        DualRule {
            whole: points.map(|p| p.weight),
            third,
            rest,
        }
    }

    /// The mean over the element of (p - c_j)^2, c_j on the share of dual cell j, and the largest deviation of the samples of p from a quadratic function.
    #[inline]
    pub fn square(&self, samples: &[f64; POINTS], constants: [f64; 3]) -> (f64, f64) {
        // One of the constants is taken out first, so that nothing cancels.
        let base = constants[0];
        let c = constants.map(|c| c - base);
        let mut square = (c[0] * c[0] + c[1] * c[1] + c[2] * c[2]) / 3.0;
        let mut rest = 0.0;
        for k in 0..POINTS {
            let p = samples[k] - base;
            let third = c[1] * self.third[1][k] + c[2] * self.third[2][k];
            square += p * (self.whole[k] * p - 2.0 * third);
            rest += self.rest[k] * p;
        }
        (square.max(0.0), rest.abs())
    }
}

/// Gauss elimination; the matrix is positive definite.
fn solve(mut a: [[f64; QUADRATIC]; QUADRATIC], mut b: [f64; QUADRATIC]) -> [f64; QUADRATIC] {
    for k in 0..QUADRATIC {
        for i in k + 1..QUADRATIC {
            let factor = a[i][k] / a[k][k];
            for l in k..QUADRATIC {
                a[i][l] -= factor * a[k][l];
            }
            b[i] -= factor * b[k];
        }
    }
    for k in (0..QUADRATIC).rev() {
        for l in k + 1..QUADRATIC {
            b[k] -= a[k][l] * b[l];
        }
        b[k] /= a[k][k];
    }
    b
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thirds_of_quadratics_are_exact() {
        let dual = DualRule::new();
        let points = rule();
        // int over K cap D_j of phi_j is 11/54, of another hat 7/108, of 1 a third (shares of the area).
        for j in 0..3 {
            for k in 0..3 {
                let sum: f64 = points
                    .iter()
                    .zip(&dual.third[j])
                    .map(|(p, w)| w * p.at[k])
                    .sum();
                let wanted = if j == k { 11.0 / 54.0 } else { 7.0 / 108.0 };
                assert!((sum - wanted).abs() < 1e-15, "{j} {k} {sum}");
            }
        }
        let quadratic = |at: [f64; 3]| 1.0 - 2.0 * at[1] + at[1] * at[2] + 3.0 * at[2] * at[2];
        let samples = points.map(|p| quadratic(p.at));
        let (_, misfit) = dual.square(&samples, [0.0; 3]);
        assert!(misfit < 1e-14);
        // With equal constants the square is that of the rule.
        let (square, _) = dual.square(&samples, [0.3; 3]);
        let wanted: f64 = points
            .iter()
            .zip(&samples)
            .map(|(p, s)| p.weight * (s - 0.3).powi(2))
            .sum();
        assert!((square - wanted).abs() < 1e-14);
    }

    #[test]
    fn the_remainder_of_affine_data_is_the_closed_form() {
        // sum_k P_k (phi_k - chi_k) has the mean square 5/108 sum over pairs of (P_k - P_l)^2.
        let p = [0.7, -1.1, 2.3];
        let samples = rule().map(|r| r.at[0] * p[0] + r.at[1] * p[1] + r.at[2] * p[2]);
        let (square, misfit) = DualRule::new().square(&samples, p);
        let pairs: f64 = [(0, 1), (1, 2), (2, 0)]
            .map(|(k, l)| (p[k] - p[l]) * (p[k] - p[l]))
            .iter()
            .sum();
        assert!((square - 5.0 / 108.0 * pairs).abs() < 1e-14);
        assert!(misfit < 1e-14);
    }

    #[test]
    fn a_jump_is_noticed() {
        let samples = rule().map(|r| f64::from(r.at[0] > 0.4));
        assert!(DualRule::new().square(&samples, [0.0; 3]).1 > 0.05);
    }
}
