//! The indicators of the paper, (7.1) and (7.2).
//!
//! With the jump [w . n]_e = (w|_K' - w|_K) . n through an interior edge e, n pointing from K to K', h_K the diameter, h_e the
//! length and f_ih the mean of f_i over K:
//!
//! ```text
//! eta_K = h_K |K|^(1/2) (|f_1h| + |f_2h|)
//!       + sum over interior edges e of K of  h_e ( |[d_n(mu_1 u_1h - sigma_h)]_e| + |[d_n(mu_2 u_2h + sigma_h)]_e| )      (7.1)
//! eta_e = h_e max([d_n sigma_h]_e, 0)                                                                                     (7.2)
//! ```
//!
//! Variable tensions enter by their element means. Both have the unit of a force.

use contact::{DiscreteProblem, Solution};
use fem_core::Mesh;

use crate::gradients::{gradients, scaled_jump, scaled_normal};
use crate::root_sum;

/// The local indicators of a solution.
#[derive(Clone, PartialEq, Debug)]
pub struct Paper {
    /// eta_K (7.1), one entry a triangle.
    pub eta_k: Vec<f64>,
    /// eta_e (7.2), one entry an interior edge in the order of [`fem_core::Topology::interior_edges`].
    pub eta_e: Vec<f64>,
    /// eta_e carried to triangles: the sum over the triangle's interior edges, each counted half in either neighbour.
    pub eta_e_cell: Vec<f64>,
}

impl Paper {
    /// (sum_K eta_K^2)^(1/2).
    pub fn eta_k_total(&self) -> f64 {
        root_sum(&self.eta_k)
    }

    /// sum_e eta_e, the plain sum of (7.11).
    pub fn eta_e_sum(&self) -> f64 {
        self.eta_e.iter().sum()
    }
}

/// Evaluates (7.1) and (7.2).
pub fn paper(mesh: &Mesh, problem: &DiscreteProblem, solution: &Solution) -> Paper {
    let sigma = gradients(mesh, &solution.sigma);
    // The fluxes mu_1 grad u_1h - grad sigma_h and mu_2 grad u_2h + grad sigma_h.
    let flux = [(0, -1.0), (1, 1.0)].map(|(i, sign): (usize, f64)| {
        let mut flux = gradients(mesh, &solution.displacement[i]);
        for (t, (q, s)) in flux.iter_mut().zip(&sigma).enumerate() {
            let mu = problem.tension_mean[i][t];
            *q = [mu * q[0] + sign * s[0], mu * q[1] + sign * s[1]];
        }
        flux
    });
    let mut eta_k: Vec<f64> = mesh
        .triangle_ids()
        .enumerate()
        .map(|(t, id)| {
            let shape = mesh.shape(id);
            let load: f64 = problem.loads.iter().map(|f| f.mean(t).abs()).sum();
            shape.diameter() * shape.area.sqrt() * load
        })
        .collect();
    let mut eta_e = Vec::with_capacity(3 * eta_k.len() / 2);
    let mut eta_e_cell = vec![0.0; eta_k.len()];
    for edge in mesh.interior_edges() {
        let normal = scaled_normal(mesh, &edge);
        let [k, l] = edge.triangles.map(|t| t.index());
        let jump = |field: &[[f64; 2]]| scaled_jump(normal, field[k], field[l]);
        let full = jump(&flux[0]).abs() + jump(&flux[1]).abs();
        let positive = jump(&sigma).max(0.0);
        eta_e.push(positive);
        for t in [k, l] {
            eta_k[t] += full;
            eta_e_cell[t] += 0.5 * positive;
        }
    }
    Paper {
        eta_k,
        eta_e,
        eta_e_cell,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{close, problem, solution, two_triangles};

    #[test]
    fn two_triangles_by_hand() {
        // The unit square cut along (0,0)-(1,1); only the value at (1,0) is not zero. There grad = (v, -v) below the diagonal and 0
        // above it; h_e n = (-1, 1) from below to above, so h_e [w . n] = 2 v.
        let mesh = two_triangles();
        let problem = problem(&mesh, [vec![3.0, 5.0], vec![7.0, 2.0]], [1.0, -2.0]);
        let solution = solution(
            [vec![0.0, 1.0, 0.0, 0.0], vec![0.0, -1.0, 0.0, 0.0]],
            vec![0.0; 4],
            vec![0.0, 0.25, 0.0, 0.0],
        );
        let result = paper(&mesh, &problem, &solution);
        // mu_1 u - sigma: 3 - 0.25 = 2.75, mu_2 u + sigma: -7 + 0.25 = -6.75; loads sqrt(2) sqrt(1/2) 3.
        let edge = 2.0 * 2.75 + 2.0 * 6.75;
        for eta in &result.eta_k {
            close(*eta, 3.0 + edge, 1e-15);
        }
        close(
            result.eta_k_total(),
            std::f64::consts::SQRT_2 * (3.0 + edge),
            1e-15,
        );
        assert_eq!(result.eta_e, [0.5]);
        assert_eq!(result.eta_e_cell, [0.25, 0.25]);
        assert_eq!(result.eta_e_sum(), 0.5);
    }

    #[test]
    fn a_concave_sigma_has_no_positive_jump() {
        // sigma = 1 at the ends of the diagonal and 0 elsewhere, a ridge: h_e [d_n sigma]_e = -4, a positive action.
        let mesh = two_triangles();
        let problem = problem(&mesh, [vec![1.0; 2], vec![1.0; 2]], [0.0, 0.0]);
        let solution = solution(
            [vec![0.0; 4], vec![0.0; 4]],
            vec![0.0; 4],
            vec![1.0, 0.0, 1.0, 0.0],
        );
        let result = paper(&mesh, &problem, &solution);
        assert_eq!(result.eta_e_sum(), 0.0);
        assert_eq!(result.eta_k, [8.0, 8.0]);
    }
}
