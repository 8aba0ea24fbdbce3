//! A quadratic function of one constant and of one value a spoke, coupled from each spoke to the next around a vertex.

/// The symmetric positive definite system of such a function; buffers are reused.
///
/// Unknowns: the spokes 1 to n-1 in a row, bordered by spoke 0 and the constant. On an open fan spoke 0 is coupled to spoke 1 only.
#[derive(Default, Debug)]
pub(super) struct Ring {
    diagonal: Vec<f64>,
    /// Coupling of a spoke of the row to the next one.
    off: Vec<f64>,
    /// Couplings to spoke 0 and to the constant.
    border: Vec<[f64; 2]>,
    right: Vec<f64>,
    corner: [[f64; 2]; 2],
    corner_right: [f64; 2],
    row: Vec<f64>,
    found: [f64; 2],
}

impl Ring {
    /// Forgets everything; `spokes` is at least two.
    pub fn begin(&mut self, spokes: usize) {
        let n = spokes - 1;
        for values in [&mut self.diagonal, &mut self.off, &mut self.right] {
            values.clear();
            values.resize(n, 0.0);
        }
        self.border.clear();
        self.border.resize(n, [0.0; 2]);
        self.corner = [[0.0; 2]; 2];
        self.corner_right = [0.0; 2];
    }

    /// Adds to the constant's second derivative and to its first one.
    pub fn add_constant(&mut self, second: f64, gradient: f64) {
        self.corner[1][1] += second;
        self.corner_right[1] -= gradient;
    }

    /// Adds to a spoke's second derivative, to its coupling with the constant and to its first derivative.
    pub fn add_spoke(&mut self, spoke: usize, second: f64, with_constant: f64, gradient: f64) {
        match spoke.checked_sub(1) {
            None => {
                self.corner[0][0] += second;
                self.corner[0][1] += with_constant;
                self.corner_right[0] -= gradient;
            }
            Some(k) => {
                self.diagonal[k] += second;
                self.border[k][1] += with_constant;
                self.right[k] -= gradient;
            }
        }
    }

    /// Adds to the coupling of a spoke with the next one.
    pub fn couple(&mut self, spoke: usize, next: usize, value: f64) {
        match (spoke.checked_sub(1), next.checked_sub(1)) {
            (None, Some(k)) | (Some(k), None) => self.border[k][0] += value,
            (Some(k), Some(_)) => self.off[k] += value,
            (None, None) => self.corner[0][0] += 2.0 * value,
        }
    }

    /// Finds the minimum by elimination without pivots; the matrix is positive definite.
    pub fn solve(&mut self) {
        let n = self.diagonal.len();
        for k in 0..n.saturating_sub(1) {
            let factor = self.off[k] / self.diagonal[k];
            self.diagonal[k + 1] -= factor * self.off[k];
            self.right[k + 1] -= factor * self.right[k];
            for b in 0..2 {
                self.border[k + 1][b] -= factor * self.border[k][b];
            }
        }
        let [[mut a, mut b], [_, mut c]] = self.corner;
        let [mut r, mut s] = self.corner_right;
        for k in 0..n {
            let [p, q] = self.border[k];
            let d = self.diagonal[k];
            a -= p * p / d;
            b -= p * q / d;
            c -= q * q / d;
            r -= p * self.right[k] / d;
            s -= q * self.right[k] / d;
        }
        // Two rows are left.
        let factor = b / a;
        let constant = (s - factor * r) / (c - factor * b);
        let zeroth = (r - b * constant) / a;
        self.found = [zeroth, constant];
        self.row.clear();
        self.row.resize(n, 0.0);
        let mut next = 0.0;
        for k in (0..n).rev() {
            let [p, q] = self.border[k];
            let off = if k + 1 < n { self.off[k] } else { 0.0 };
            next = (self.right[k] - p * zeroth - q * constant - off * next) / self.diagonal[k];
            self.row[k] = next;
        }
    }

    /// The constant found.
    pub fn constant(&self) -> f64 {
        self.found[1]
    }

    /// The value found for a spoke.
    pub fn spoke(&self, spoke: usize) -> f64 {
        match spoke.checked_sub(1) {
            None => self.found[0],
            Some(k) => self.row[k],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Dense elimination for comparison.
    fn dense(mut a: Vec<Vec<f64>>, mut b: Vec<f64>) -> Vec<f64> {
        let n = b.len();
        for k in 0..n {
            for i in k + 1..n {
                let f = a[i][k] / a[k][k];
                for l in k..n {
                    a[i][l] -= f * a[k][l];
                }
                b[i] -= f * b[k];
            }
        }
        for k in (0..n).rev() {
            for l in k + 1..n {
                b[k] -= a[k][l] * b[l];
            }
            b[k] /= a[k][k];
        }
        b
    }

    #[test]
    fn agrees_with_dense_elimination() {
        for (spokes, closed) in [
            (2, false),
            (3, false),
            (7, false),
            (3, true),
            (4, true),
            (9, true),
        ] {
            // Unknowns: the spokes, then the constant.
            let n = spokes + 1;
            let mut matrix = vec![vec![0.0; n]; n];
            let mut right = vec![0.0; n];
            let mut ring = Ring::default();
            ring.begin(spokes);
            let links = if closed { spokes } else { spokes - 1 };
            for k in 0..links {
                let next = (k + 1) % spokes;
                let x = k as f64;
                // A positive definite block a triangle.
                let h = [
                    [4.0 + x.sin(), 1.0, -0.7],
                    [1.0, 3.0 + x.cos(), 0.4 + 0.1 * x],
                    [-0.7, 0.4 + 0.1 * x, 5.0],
                ];
                let g = [0.3 * x - 1.0, 1.0 / (1.0 + x), x.sin()];
                ring.add_constant(h[0][0], g[0]);
                ring.add_spoke(k, h[1][1], h[0][1], g[1]);
                ring.add_spoke(next, h[2][2], h[0][2], g[2]);
                ring.couple(k, next, h[1][2]);
                let at = [n - 1, k, next];
                for p in 0..3 {
                    for q in 0..3 {
                        matrix[at[p]][at[q]] += h[p][q];
                    }
                    right[at[p]] -= g[p];
                }
            }
            ring.solve();
            let wanted = dense(matrix, right);
            for k in 0..spokes {
                assert!((ring.spoke(k) - wanted[k]).abs() < 1e-13, "{spokes} {k}");
            }
            assert!((ring.constant() - wanted[n - 1]).abs() < 1e-13);
        }
    }
}
