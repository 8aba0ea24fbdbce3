//! What a solver returns, and the one number that judges it.

use crate::problem::DiscreteProblem;

/// Which model the solver took: the smallest that the scene allows.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Reduction {
    /// The unconstrained membranes do not touch: two linear problems.
    NoContact,
    /// The membranes touch everywhere: one linear problem with A_1 + A_2 (2.9).
    FullContact,
    /// Constant tensions: one linear problem for mu_1 u1 + mu_2 u2 and one scalar obstacle problem for u1 - u2.
    ConstantTensions,
    /// Variable tensions in a constant ratio: the same with A_1 in place of mu_1 K.
    ConstantRatio,
    /// The two-field problem.
    TwoField,
}

/// How a solver ended.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Status {
    /// The tolerance holds on the iterate that is returned.
    Converged,
    /// No further progress; the tolerance does not hold.
    Stagnated,
    /// The limit on iterations came first.
    Limit,
}

/// Always returned beside a solution.
#[derive(Clone, Debug, PartialEq)]
pub struct SolveInfo {
    /// Name of the solver as in the scene file, for example `active-set`; with `+monotone` where the fallback finished, and
    /// `multigrid+active-set` where multigrid missed its goal and handed over. On a mesh without bisections multigrid is `active-set`.
    pub solver: &'static str,
    /// The model that was solved.
    pub reduction: Reduction,
    /// How it ended.
    pub status: Status,
    /// Linear solves of the inequality (active set; 1 for a problem without inequality), interior-point iterations (clarabel), or
    /// cycles of all fields of the model, sigma not among them (multigrid): see [`Cycles`].
    pub iterations: usize,
    /// Size of the algebraic problem: twice the interior vertices, once for full contact.
    pub unknowns: usize,
    /// Relative KKT residual of the iterate that is returned.
    pub kkt_residual: f64,
    /// Estimate of the energy norm |||.||| of the algebraic error, from the losses of energy of the last cycles; `None` for direct
    /// solvers, which leave rounding. In a reduced model the mean with weight t_1 + t_2 and the gap with t_1 t_2/(t_1 + t_2) (M
    /// norm) add up to it.
    pub algebraic_error: Option<f64>,
    /// Factor of the energy norm of the algebraic error in a cycle: the largest among the last few, of all fields of the model; `None`
    /// for direct solvers and where a single cycle was made.
    pub contraction: Option<f64>,
    /// Factor of the energy norm of the algebraic error in the first cycle from a start, as later ones showed, here or on an
    /// earlier mesh (then a little more is assumed); `None` where it is not known.
    pub first_cycle: Option<f64>,
    /// Cycles field by field, also where multigrid then handed over; `None` for direct solvers.
    pub cycles: Option<Cycles>,
}

/// How many cycles a multigrid solve took.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Cycles {
    /// Steps of conjugate gradients for the field with the inequality: the gap, or both displacements.
    pub inequality: usize,
    /// Monotone cycles for it, from a cold start or where the energy would have risen.
    pub monotone: usize,
    /// Steps for the mean of the displacements, in a reduced model.
    pub mean: usize,
    /// Steps for sigma.
    pub sigma: usize,
    /// Factorisations of the matrix of the initial mesh, those for sigma included where it shares the matrix of the model.
    pub factorisations: usize,
}

/// Nodal solution of a [`DiscreteProblem`], one entry a vertex, boundary included.
#[derive(Clone, Debug)]
pub struct Solution {
    /// Displacements u1, u2.
    pub displacement: [Vec<f64>; 2],
    /// Action forces z_j = <lambda_h, phi_j> >= 0; 0 on the boundary.
    pub force: Vec<f64>,
    /// Riesz representative sigma_h of the action: K sigma = z (4.1), (5.4); 0 on the boundary. Empty where it was left out
    /// ([`Settings::sigma`](crate::Settings::sigma)).
    pub sigma: Vec<f64>,
    /// The contact set: interior vertices of the active set.
    pub contact: Vec<bool>,
    /// How it was found.
    pub info: SolveInfo,
}

impl Solution {
    /// The gap u1 - u2 at a vertex.
    #[inline]
    pub fn gap(&self, vertex: usize) -> f64 {
        self.displacement[0][vertex] - self.displacement[1][vertex]
    }
}

/// U: the largest displacement over all vertices, 1 if all are zero.
fn displacement_unit(displacement: &[Vec<f64>; 2]) -> f64 {
    let largest = displacement
        .iter()
        .flatten()
        .fold(0.0f64, |m, u| m.max(u.abs()));
    if largest == 0.0 { 1.0 } else { largest }
}

/// The relative KKT residual of an iterate: the largest, over interior vertices j, of `|F_ij +- z_j - (A_i u_i)_j| / (d_ij U)` and
/// `|min(w_j, z_j/d_j)| / U`, U the largest displacement (1 if all are zero).
pub fn kkt_residual(problem: &DiscreteProblem, displacement: &[Vec<f64>; 2], force: &[f64]) -> f64 {
    let unit = displacement_unit(displacement);
    let mut worst = 0.0f64;
    for j in (0..problem.order()).filter(|&j| !problem.boundary()[j]) {
        for (i, sign) in [(0, 1.0), (1, -1.0)] {
            let rest = problem.loads[i].nodal[j] + sign * force[j]
                - problem.stiffness(i).row_dot(j, &displacement[i]);
            worst = worst.max(rest.abs() / problem.diagonal(i, j) / unit);
        }
        let gap = displacement[0][j] - displacement[1][j];
        worst = worst.max(gap.min(force[j] / problem.harmonic_diagonal(j)).abs() / unit);
    }
    // A NaN anywhere must not pass for a good residual.
    if displacement
        .iter()
        .flatten()
        .chain(force)
        .all(|v| v.is_finite())
    {
        worst
    } else {
        f64::INFINITY
    }
}

/// The relative KKT residual that rounding alone may leave: the largest, over interior vertices j and membranes i, of
/// `8 eps (|A_i||u_i| + |F_i| + z)_j / (d_ij U)`, U as in [`kkt_residual`].
///
/// Between 1e-15 and 1e-14 on ordinary data, more where a load is far larger than what its membrane carries itself.
pub fn rounding_residual(
    problem: &DiscreteProblem,
    displacement: &[Vec<f64>; 2],
    force: &[f64],
) -> f64 {
    let unit = displacement_unit(displacement);
    let mut worst = 0.0f64;
    for j in (0..problem.order()).filter(|&j| !problem.boundary()[j]) {
        for i in 0..2 {
            let terms = problem.stiffness(i).row_dot_abs(j, &displacement[i])
                + problem.loads[i].nodal[j].abs()
                + force[j];
            worst = worst.max(terms / problem.diagonal(i, j) / unit);
        }
    }
    8.0 * f64::EPSILON * worst
}
