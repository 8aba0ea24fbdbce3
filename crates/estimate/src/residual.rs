//! A residual estimator of the energy error, robust in the tensions; reliable up to a constant.
//!
//! With the nodal action l_j of [`crate::action`], element means mu_iK and f_ih, the upper sign for i = 1:
//!
//! ```text
//! eta_res^2 = sum_K { sum_i [ (h_K^2/mu_iK) (|K|/3) sum_{j in K} (f_ih +- l_j)^2
//!                             + 1/2 sum over interior edges e of K of  h_e^2 [mu_iK d_n u_ih]_e^2 / max(mu_iK, mu_iK') ] + c_K }
//! c_K = sum_{j in K} l_j int_{K cap D_j} w_h,       w_h = u_1h - u_2h
//! ```
//!
//! On the dual cell's share K cap D_j the hat function of j has the integral 11|K|/54 and each other one 7|K|/108. c_K is what
//! action times gap leaves where the contact set ends inside an element; it is of higher order.
//!
//! This is the estimator as it is written; [`mod@crate::sweep`] finds the same numbers together with others in a single pass.

use contact::{DiscreteProblem, Solution};
use fem_core::Mesh;

use crate::action::nodal_action;
use crate::gradients::{gradients, scaled_jump, scaled_normal};

/// The local values of eta_res: roots, one entry a triangle, in the unit of the energy norm.
pub fn residual(mesh: &Mesh, problem: &DiscreteProblem, solution: &Solution) -> Vec<f64> {
    let action = nodal_action(mesh, problem, solution);
    let mut squares: Vec<f64> = mesh
        .triangle_ids()
        .zip(mesh.triangles())
        .enumerate()
        .map(|(t, (id, v))| {
            let shape = mesh.shape(id);
            let v = v.map(|j| j.index());
            let weight = shape.diameter() * shape.diameter() * shape.area / 3.0;
            let mut square =
                contact_term(shape.area, v.map(|j| action[j]), v.map(|j| solution.gap(j)));
            for (i, sign) in [(0, 1.0), (1, -1.0)] {
                let mean = problem.loads[i].mean(t);
                let sum: f64 = v.iter().map(|&j| (mean + sign * action[j]).powi(2)).sum();
                square += weight / problem.tension_mean[i][t] * sum;
            }
            square
        })
        .collect();
    for i in 0..2 {
        let mu = &problem.tension_mean[i];
        let mut flux = gradients(mesh, &solution.displacement[i]);
        for (t, q) in flux.iter_mut().enumerate() {
            *q = [mu[t] * q[0], mu[t] * q[1]];
        }
        for edge in mesh.interior_edges() {
            let [k, l] = edge.triangles.map(|t| t.index());
            let jump = scaled_jump(scaled_normal(mesh, &edge), flux[k], flux[l]);
            let half = 0.5 * jump * jump / mu[k].max(mu[l]);
            squares[k] += half;
            squares[l] += half;
        }
    }
    squares.iter().map(|s| s.sqrt()).collect()
}

/// c_K from the actions and gaps at the corners; not negative, whatever rounding left in the gaps.
#[inline]
pub(crate) fn contact_term(area: f64, action: [f64; 3], gap: [f64; 3]) -> f64 {
    let all: f64 = gap.iter().sum();
    let sum: f64 = (0..3)
        .map(|j| action[j] * (22.0 * gap[j] + 7.0 * (all - gap[j])))
        .sum();
    (area / 108.0 * sum).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{close, four_triangles, problem, solution, two_triangles};

    #[test]
    fn two_triangles_by_hand() {
        // As for the paper's indicators: h_e [d_n u]_e is 2 when u is 1 at (1,0) and 0 elsewhere.
        let mesh = two_triangles();
        let problem = problem(&mesh, [vec![3.0, 5.0], vec![7.0, 2.0]], [1.0, -2.0]);
        let displacement = [vec![0.0, 1.0, 0.0, 0.0], vec![0.0, -1.0, 0.0, 0.0]];
        let solution = solution(displacement, vec![0.0; 4], vec![0.0; 4]);
        let local = residual(&mesh, &problem, &solution);
        // h_K^2 |K| = 1; triangle 0 holds the vertex (1,0), so the jumps are 2 * 3 and 2 * 7.
        let jumps: f64 = 0.5 * (36.0 / 5.0 + 196.0 / 7.0);
        close(local[0], (1.0 / 3.0 + 4.0 / 7.0 + jumps).sqrt(), 1e-15);
        close(local[1], (1.0 / 5.0 + 4.0 / 2.0 + jumps).sqrt(), 1e-15);
    }

    #[test]
    fn action_enters_the_load_and_meets_the_gap() {
        // Action 3 on the centre's dual cell (z = 4) and at the corners in contact; corner 1 has a gap of 1/2.
        let mesh = four_triangles();
        let problem = problem(&mesh, [vec![1.0; 4], vec![1.0; 4]], [-3.0, 3.0]);
        let displacement = [vec![0.0, 0.5, 0.0, 0.0, 0.0], vec![0.0; 5]];
        let force = vec![0.0, 0.0, 0.0, 0.0, 4.0];
        let solution = solution(displacement, force, vec![0.0; 5]);
        let local = residual(&mesh, &problem, &solution);
        // u_1 is (x - y)/4 on triangles 0 and 1: h_e [d_n u_1]_e = 1/2 on the diagonal towards 2 and 3.
        let jump = 0.5 * 0.25;
        // Loads and action cancel but at corner 1, where the action is 0: h_K^2 |K|/3 9 for either membrane.
        let load = 4.0 / 3.0 * 9.0 * 2.0;
        // The gap meets the action of corners 0 and 4 (or 2 and 4).
        let contact = 2.0 * 3.0 * 7.0 / 108.0 * 0.5;
        for t in [0, 1] {
            close(local[t], f64::sqrt(jump + load + contact), 1e-15);
        }
        for t in [2, 3] {
            close(local[t], jump.sqrt(), 1e-15);
        }
    }
}
