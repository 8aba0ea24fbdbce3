//! The smallest model of a problem, and the way back to the two displacements.
//!
//! With tensions t_1 M, t_2 M of one matrix M and theta_i = t_i/(t_1 + t_2), the mean s = theta_1 u1 + theta_2 u2 solves one
//! linear problem, `M s = (F_1 + F_2)/(t_1 + t_2)`, and the gap w one scalar obstacle problem, `M w - y = F_1/t_1 - F_2/t_2`,
//! `w >= 0`, `y >= 0`. Then `u1 = s + theta_2 w`, `u2 = s - theta_1 w`, `z = y t_1 t_2/(t_1 + t_2)`. M is K for constant
//! tensions and A_1 for variable tensions in a constant ratio. No quotient in here overflows before its value does.

use fem_core::SymmetricMatrix;

use crate::interior::{Interior, Role};
use crate::problem::{DiscreteProblem, Tensions};
use crate::solution::Reduction;
use crate::start::Start;
use crate::system::{Fields, System};

/// Loads that cancel to this many units of rounding cancel exactly: what is left of them is noise without a sign.
const CANCELLED: f64 = 8.0 * f64::EPSILON;

/// Tensions in a constant ratio: the two displacements decouple into mean and gap.
pub(crate) struct Proportional<'a> {
    problem: &'a DiscreteProblem,
    /// What M stands for.
    pub role: Role,
    /// Name of the model.
    pub reduction: Reduction,
    tension: [f64; 2],
    /// theta_1, theta_2: the share of either membrane in the tension.
    shares: [f64; 2],
    /// The larger tension, and the sum of both in units of it.
    sum: [f64; 2],
}

impl<'a> Proportional<'a> {
    /// The reduced model, where the tensions allow one.
    pub fn of(problem: &'a DiscreteProblem) -> Option<Self> {
        let (role, reduction, tension) = match problem.tensions {
            Tensions::Constant(m1, m2) => (Role::Laplacian, Reduction::ConstantTensions, [m1, m2]),
            Tensions::Ratio(c) => (Role::Stiffness, Reduction::ConstantRatio, [1.0, c]),
            Tensions::General => return None,
        };
        let [t1, t2] = tension;
        let (large, small) = (t1.max(t2), t1.min(t2));
        Some(Proportional {
            problem,
            role,
            reduction,
            tension,
            shares: [1.0 / (1.0 + t2 / t1), 1.0 / (1.0 + t1 / t2)],
            sum: [large, 1.0 + small / large],
        })
    }

    /// M in rows.
    pub fn matrix(&self) -> &'a SymmetricMatrix {
        match self.role {
            Role::Laplacian => self.problem.laplacian(),
            Role::Stiffness => self.problem.stiffness(0),
        }
    }

    /// t_1, t_2.
    pub fn tension(&self) -> [f64; 2] {
        self.tension
    }

    /// The mean s of two displacements.
    pub fn mean_of(&self, u: [f64; 2]) -> f64 {
        let [s1, s2] = self.shares;
        s1 * u[0] + s2 * u[1]
    }

    /// What the squared norms of mean and gap in the matrix M count in the energy norm of the pair: t_1 + t_2 and t_1 t_2/(t_1 + t_2).
    pub fn energy_weights(&self) -> [f64; 2] {
        let [t1, t2] = self.tension;
        [t1 + t2, t1 / (1.0 + t1 / t2)]
    }

    /// The obstacle problem of the gap.
    pub fn system<'s>(&self, interior: &'s Interior) -> System<'s>
    where
        'a: 's,
    {
        let mut load = vec![0.0; self.problem.order()];
        let mut scale = load.clone();
        for j in interior.iter() {
            (load[j], scale[j]) = self.gap_load(j);
        }
        System {
            matrices: vec![self.matrix()],
            loads: vec![load],
            load_scale: vec![scale],
            interior,
        }
    }

    /// The load of the gap, F_1/t_1 - F_2/t_2, and the sum of the magnitudes that it was computed from.
    #[inline]
    pub fn gap_load(&self, j: usize) -> (f64, f64) {
        let [t1, t2] = self.tension;
        let [a, b] = [
            self.problem.loads[0].nodal[j] / t1,
            self.problem.loads[1].nodal[j] / t2,
        ];
        let scale = a.abs() + b.abs();
        let difference = a - b;
        if difference.abs() > CANCELLED * scale {
            (difference, scale)
        } else {
            (0.0, scale)
        }
    }

    /// The gap to start from: boundary values of the problem, else the start's or zero.
    pub fn initial_gap(&self, interior: &Interior, start: Option<&Start>) -> Fields {
        let [g1, g2] = &self.problem.heights;
        let mut gap: Vec<f64> = g1.iter().zip(g2).map(|(a, b)| a - b).collect();
        for j in interior.iter() {
            gap[j] = start.map_or(0.0, |s| {
                (s.displacement[0][j] - s.displacement[1][j]).max(0.0)
            });
        }
        vec![gap]
    }

    /// The mean to start from: boundary values of the problem, else the start's or zero.
    pub fn initial_mean(&self, interior: &Interior, start: Option<&Start>) -> Vec<f64> {
        let mean = |u: &[Vec<f64>; 2], j: usize| self.mean_of([u[0][j], u[1][j]]);
        let mut values: Vec<f64> = (0..self.problem.order())
            .map(|j| mean(&self.problem.heights, j))
            .collect();
        for j in interior.iter() {
            values[j] = start.map_or(0.0, |s| mean(&s.displacement, j));
        }
        values
    }

    /// The load of the mean, (F_1 + F_2)/(t_1 + t_2).
    pub fn mean_load(&self, j: usize) -> f64 {
        let [large, both] = self.sum;
        let sum = self.problem.loads[0].nodal[j] + self.problem.loads[1].nodal[j];
        sum / large / both
    }

    /// Turns multipliers y of the gap into action forces z.
    pub fn forces(&self, multiplier: &mut [f64]) {
        for y in multiplier {
            *y = self.force(*y);
        }
    }

    /// The action force of a multiplier of the gap.
    #[inline]
    pub fn force(&self, multiplier: f64) -> f64 {
        let [t1, t2] = self.tension;
        multiplier * (t1 / (1.0 + t1 / t2))
    }

    /// The displacements from mean and gap; the heights on the boundary.
    pub fn fields(&self, interior: &Interior, mean: &[f64], gap: &[f64]) -> [Vec<f64>; 2] {
        let mut u = self.problem.heights.clone();
        for j in interior.iter() {
            [u[0][j], u[1][j]] = self.displacements(mean[j], gap[j]);
        }
        u
    }

    /// The displacements of a vertex from its mean and gap.
    ///
    /// Rounding is monotone, so a gap that is not negative stays so, and a closed one closed.
    #[inline]
    pub fn displacements(&self, mean: f64, gap: f64) -> [f64; 2] {
        let [s1, s2] = self.shares;
        [mean + s2 * gap, mean - s1 * gap]
    }
}

/// The two-field problem.
pub(crate) fn pair_system<'a>(problem: &'a DiscreteProblem, interior: &'a Interior) -> System<'a> {
    let loads: Vec<Vec<f64>> = problem.loads.iter().map(|l| l.nodal.clone()).collect();
    System {
        matrices: vec![problem.stiffness(0), problem.stiffness(1)],
        load_scale: loads
            .iter()
            .map(|l| l.iter().map(|f| f.abs()).collect())
            .collect(),
        loads,
        interior,
    }
}

/// The displacements to start from: boundary values of the problem, else the start's or zero.
pub(crate) fn initial_pair(
    problem: &DiscreteProblem,
    interior: &Interior,
    start: Option<&Start>,
) -> Fields {
    let mut fields = problem.heights.to_vec();
    for (i, field) in fields.iter_mut().enumerate() {
        for j in interior.iter() {
            field[j] = start.map_or(0.0, |s| s.displacement[i][j]);
        }
    }
    fields
}
