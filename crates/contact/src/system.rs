//! The inequality in one or two fields, and what can be read off an iterate at one vertex.
//!
//! One field: the gap w itself, `M w - y = b`, `w >= 0`, `y >= 0`. Two fields: the displacements, `A_1 u1 - z = F_1`,
//! `A_2 u2 + z = F_2`, `u1 - u2 >= 0`, `z >= 0`. All vectors have one entry a vertex; boundary vertices hold their given values.

use fem_core::SymmetricMatrix;

use crate::interior::Interior;

/// Nodal values of the one or two fields.
pub(crate) type Fields = Vec<Vec<f64>>;

/// Matrices and loads of the one or two fields.
pub(crate) struct System<'a> {
    /// M, or A_1 and A_2.
    pub matrices: Vec<&'a SymmetricMatrix>,
    /// b, or F_1 and F_2.
    pub loads: Vec<Vec<f64>>,
    /// Sum of the magnitudes of the terms that each load was computed from: what its rounding error is relative to.
    pub load_scale: Vec<Vec<f64>>,
    /// The unknowns.
    pub interior: &'a Interior,
}

/// How far an iterate contradicts its contact set.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Violations {
    /// Vertices in contact whose multiplier is negative beyond rounding, and vertices elsewhere with a negative gap.
    pub count: usize,
    /// The largest violation, relative to the largest displacement, a multiplier taken as z_j/d_j.
    pub worst: f64,
}

impl System<'_> {
    /// Whether the two displacements are the fields.
    pub fn is_pair(&self) -> bool {
        self.matrices.len() == 2
    }

    /// The gap at a vertex.
    #[inline]
    pub fn gap(&self, u: &Fields, j: usize) -> f64 {
        if self.is_pair() {
            u[0][j] - u[1][j]
        } else {
            u[0][j]
        }
    }

    /// Share of the upper membrane in the stiffness at a vertex: d_1/(d_1 + d_2).
    #[inline]
    fn share(&self, j: usize) -> f64 {
        1.0 / (1.0 + self.matrices[1].diagonal(j) / self.matrices[0].diagonal(j))
    }

    /// Closes the gap at a vertex: both displacements take the mean weighted by stiffness.
    #[inline]
    pub fn close(&self, u: &mut Fields, j: usize) {
        if self.is_pair() {
            let common = u[1][j] + self.share(j) * (u[0][j] - u[1][j]);
            u[0][j] = common;
            u[1][j] = common;
        } else {
            u[0][j] = 0.0;
        }
    }

    /// Residual of field `i` at a vertex: load minus stiffness times displacement.
    #[inline]
    pub fn residual(&self, u: &Fields, i: usize, j: usize) -> f64 {
        self.loads[i][j] - self.matrices[i].row_dot(j, &u[i])
    }

    /// The stiffness against opening the gap at a vertex: M_jj, or d_1 d_2/(d_1 + d_2).
    #[inline]
    pub fn diagonal(&self, j: usize) -> f64 {
        let d = self.matrices[0].diagonal(j);
        if self.is_pair() {
            d / (1.0 + d / self.matrices[1].diagonal(j))
        } else {
            d
        }
    }

    /// The multiplier that holds a vertex in contact, from the row of the softer membrane: the stiffer one loses digits like
    /// the ratio.
    #[inline]
    pub fn multiplier(&self, u: &Fields, j: usize) -> f64 {
        if self.is_pair() && self.matrices[1].diagonal(j) < self.matrices[0].diagonal(j) {
            self.residual(u, 1, j)
        } else {
            -self.residual(u, 0, j)
        }
    }

    /// How far a multiplier may be below zero by rounding alone: 4 eps min_i (|A_i| |u_i| + |F_i|)_j.
    pub fn rounding(&self, u: &Fields, j: usize) -> f64 {
        let scale = (0..self.matrices.len())
            .map(|i| self.matrices[i].row_dot_abs(j, &u[i]) + self.load_scale[i][j])
            .fold(f64::INFINITY, f64::min);
        4.0 * f64::EPSILON * scale
    }

    /// The largest displacement, or what the loads would displace a single vertex by if that is more.
    pub fn unit(&self, u: &Fields) -> f64 {
        let mut unit = u.iter().flatten().fold(0.0f64, |m, v| m.max(v.abs()));
        for i in 0..self.matrices.len() {
            for j in self.interior.iter() {
                unit = unit.max(self.load_scale[i][j] / self.matrices[i].diagonal(j));
            }
        }
        unit
    }

    /// Where the iterate contradicts the contact set.
    pub fn violations(&self, u: &Fields, contact: &[bool]) -> Violations {
        let unit = self.unit(u);
        let mut found = Violations::default();
        for j in self.interior.iter() {
            if contact[j] {
                let y = self.multiplier(u, j);
                if y < 0.0 && y < -self.rounding(u, j) {
                    found.count += 1;
                    found.worst = found.worst.max(-y / self.diagonal(j) / unit);
                }
            } else {
                let gap = self.gap(u, j);
                if gap < 0.0 {
                    found.count += 1;
                    found.worst = found.worst.max(-gap / unit);
                }
            }
        }
        found
    }

    /// Minimises the energy over the values at one vertex, the gap kept nonnegative.
    #[inline]
    pub fn relax(&self, u: &mut Fields, j: usize) {
        for i in 0..self.matrices.len() {
            let step = self.residual(u, i, j) / self.matrices[i].diagonal(j);
            u[i][j] += step;
        }
        if self.gap(u, j) < 0.0 {
            self.close(u, j);
        }
    }

    /// Closes every gap that is negative.
    pub fn project(&self, u: &mut Fields) {
        for j in self.interior.iter() {
            if self.gap(u, j) < 0.0 {
                self.close(u, j);
            }
        }
    }

    /// Projects the fields, relaxes every vertex `sweeps` times forwards and backwards, and reads off where the gap is closed.
    pub fn relaxed_contact(&self, u: &mut Fields, contact: &mut [bool], sweeps: usize) {
        self.project(u);
        for _ in 0..sweeps {
            for j in self.interior.iter() {
                self.relax(u, j);
            }
            for j in self.interior.iter().rev() {
                self.relax(u, j);
            }
        }
        for j in self.interior.iter() {
            contact[j] = self.gap(u, j) == 0.0;
        }
    }

    /// The energy: the sum over the fields of u'Au/2 - F'u.
    #[cfg(test)]
    pub fn energy(&self, u: &Fields) -> f64 {
        (0..u.len())
            .map(|i| {
                let dot: f64 = self
                    .interior
                    .iter()
                    .map(|j| u[i][j] * self.loads[i][j])
                    .sum();
                0.5 * self.matrices[i].quadratic(&u[i]) - dot
            })
            .sum()
    }
}
