//! Energy of a discrete solution.
//!
//! ```text
//! J(u_h) = sum_i 1/2 u_i' A_i u_i - F_i' u_i,        |||u_h||| = (sum_i u_i' A_i u_i)^(1/2)
//! ```
//!
//! The load term runs over all vertices: F_ij = (f_i, phi_j) on the boundary too.

use contact::{DiscreteProblem, Solution};
use fem_core::Mesh;
use fem_core::norms::weighted_seminorm_squared;

/// Energy and energy norm of a solution.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Energy {
    /// J(u_h), in the unit of an energy.
    pub energy: f64,
    /// |||u_h|||, the root of an energy.
    pub energy_norm: f64,
}

/// Evaluates J(u_h) and |||u_h|||, with the element means of the tensions.
pub fn energy(mesh: &Mesh, problem: &DiscreteProblem, solution: &Solution) -> Energy {
    let (mut square, mut work) = (0.0, 0.0);
    for i in 0..2 {
        let u = &solution.displacement[i];
        // By element gradients: a common height of all vertices must not cost digits.
        square += weighted_seminorm_squared(mesh, u, |t| problem.tension_mean[i][t]);
        work += u
            .iter()
            .zip(&problem.loads[i].nodal)
            .map(|(u, f)| u * f)
            .sum::<f64>();
    }
    Energy {
        energy: 0.5 * square - work,
        energy_norm: square.sqrt(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{close, four_triangles, problem, solution};

    #[test]
    fn one_free_vertex_by_hand() {
        // Hat function of the centre: gradient 1 on an area of 4; its load is a third of that area.
        let mesh = four_triangles();
        let problem = problem(&mesh, [vec![2.0; 4], vec![3.0; 4]], [1.0, -6.0]);
        let solution = solution(
            [
                vec![0.0, 0.0, 0.0, 0.0, 0.5],
                vec![0.0, 0.0, 0.0, 0.0, -1.0],
            ],
            vec![0.0; 5],
            vec![0.0; 5],
        );
        let result = energy(&mesh, &problem, &solution);
        let square: f64 = 4.0 * (2.0 * 0.25 + 3.0);
        close(result.energy_norm, square.sqrt(), 1e-15);
        close(result.energy, 0.5 * square - 4.0 / 3.0 * (0.5 + 6.0), 1e-15);
    }
}
