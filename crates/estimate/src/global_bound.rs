//! The global bound (7.11) of the paper, as it stands and with a second term that converges.
//!
//! ```text
//! (sum_K sum_i h_K^2 ||f_i - f_ih||_K^2 + eta_K^2)^(1/2)  +  kappa^(1/2) (sum_e eta_e)^(1/2),        kappa = ||f_1|| + ||f_2||       (7.11), (6.2)
//! ```
//!
//! without the constant c in front of the first term. The sum of eta_e tends to a positive constant on every family of
//! meshes, so the second term stagnates. It is repaired by what its proof needs, b(u - u_h, sigma - sigma_h), with all of
//! the jumps in the root of a sum of squares and the products of force and gap that are left where the contact set ends:
//!
//! ```text
//! (sum_e h_e^2 [d_n sigma_h]_e^2)^(1/2)  +  (sum_j z_j (Pi w_h)_j)^(1/2),        (Pi w_h)_j = mean of w_h = u_1h - u_2h over the patch of j.
//! ```
//!
//! The first of these is O(h). The terms of both sums have different units, so they are kept apart here and joined in the
//! user's units only.

use contact::{DiscreteProblem, Solution};
use fem_core::scale::{root_times_power_of_two, times_power_of_two};
use fem_core::{Mesh, Scale};

use crate::gradients::{gradients, scaled_jump, scaled_normal};
use crate::paper::Paper;

/// The terms of (7.11) and of its repaired form, scaled.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct GlobalBound {
    /// (sum_K sum_i h_K^2 ||f_i - f_ih||_K^2 + eta_K^2)^(1/2): a force.
    pub elements: f64,
    /// kappa = ||f_1|| + ||f_2|| (6.2): a load times a length.
    pub kappa: f64,
    /// sum_e eta_e: a force.
    pub edges: f64,
    /// (sum_e h_e^2 [d_n sigma_h]_e^2)^(1/2) over the interior edges: a force.
    pub jumps: f64,
    /// (sum_j z_j (Pi w_h)_j)^(1/2): the root of an energy.
    pub complementarity: f64,
}

impl GlobalBound {
    /// (7.11) as it stands but for its constant, in the user's units.
    pub fn literal(&self, scale: Scale) -> f64 {
        times_power_of_two(self.elements, scale.force()) + self.second_term(scale)
    }

    /// kappa^(1/2) (sum_e eta_e)^(1/2) in the user's units: a load times a length to the power 3/2.
    pub fn second_term(&self, scale: Scale) -> f64 {
        let exponent = scale.load + scale.length + scale.force();
        root_times_power_of_two(self.kappa * self.edges, exponent)
    }

    /// The bound with the repaired second term, in the user's units.
    pub fn repaired(&self, scale: Scale) -> f64 {
        times_power_of_two(self.elements, scale.force())
            + times_power_of_two(self.jumps, scale.force())
            + times_power_of_two(self.complementarity, scale.energy_norm())
    }
}

/// Evaluates the terms; `paper` and the total `oscillation` are those of the same solution.
pub fn global_bound(
    mesh: &Mesh,
    problem: &DiscreteProblem,
    solution: &Solution,
    paper: &Paper,
    oscillation: f64,
) -> GlobalBound {
    let area: Vec<f64> = mesh.triangle_ids().map(|t| mesh.shape(t).area).collect();
    let norm = |i: usize| {
        let load = &problem.loads[i];
        area.iter()
            .enumerate()
            .map(|(t, area)| area * load.mean(t) * load.mean(t) + load.deviation_squared(t))
            .sum::<f64>()
            .sqrt()
    };
    let sigma = gradients(mesh, &solution.sigma);
    let jumps: f64 = mesh
        .interior_edges()
        .map(|edge| {
            let [k, l] = edge.triangles.map(|t| t.index());
            scaled_jump(scaled_normal(mesh, &edge), sigma[k], sigma[l]).powi(2)
        })
        .sum();
    GlobalBound {
        elements: oscillation.hypot(paper.eta_k_total()),
        kappa: norm(0) + norm(1),
        edges: paper.eta_e_sum(),
        jumps: jumps.sqrt(),
        complementarity: force_times_gap(mesh, problem, solution, &area).sqrt(),
    }
}

/// sum_j z_j (Pi w_h)_j; not negative, whatever rounding left in the gaps.
fn force_times_gap(
    mesh: &Mesh,
    problem: &DiscreteProblem,
    solution: &Solution,
    area: &[f64],
) -> f64 {
    // |omega_j| (Pi w_h)_j; the patch has three times the area of the dual cell.
    let mut integral = vec![0.0; mesh.vertex_count()];
    for (v, area) in mesh.triangles().iter().zip(area) {
        let v = v.map(|j| j.index());
        let mean: f64 = v.iter().map(|&j| solution.gap(j)).sum::<f64>() / 3.0;
        for j in v {
            integral[j] += area * mean;
        }
    }
    let terms = solution.force.iter().zip(&integral);
    let sum: f64 = terms
        .zip(&problem.dual_area)
        .map(|((z, w), area)| z * w / (3.0 * area))
        .sum();
    sum.max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{close, deviating, four_triangles, problem, solution};
    use crate::{oscillation, paper};

    fn terms() -> GlobalBound {
        // sigma is 1 at the centre and 0 around it: h_e [d_n sigma]_e over each of the four inner edges is (grad' - grad) .
        // (1, -1) = -2. The gap is 1/2 at corner 1, so its mean over the patch of the centre is (2/3 of 1/2)/4.
        let mesh = four_triangles();
        let mut problem = problem(&mesh, [vec![1.0; 4], vec![1.0; 4]], [3.0, -4.0]);
        problem.loads[1] = deviating(&problem.loads[1], &[9.0, 0.0, 0.0, 0.0]);
        let solution = solution(
            [vec![0.0, 0.5, 0.0, 0.0, 0.0], vec![0.0; 5]],
            vec![0.0, 0.0, 0.0, 0.0, 12.0],
            vec![0.0, 0.0, 0.0, 0.0, 1.0],
        );
        let paper = paper(&mesh, &problem, &solution);
        let oscillation = crate::root_sum(&oscillation(&mesh, &problem));
        let bound = global_bound(&mesh, &problem, &solution, &paper, oscillation);
        close(
            bound.elements,
            (36.0 + paper.eta_k.iter().map(|e| e * e).sum::<f64>()).sqrt(),
            1e-15,
        );
        bound
    }

    #[test]
    fn terms_by_hand() {
        let bound = terms();
        close(bound.kappa, 6.0 + (64.0 + 9.0f64).sqrt(), 1e-15);
        close(bound.jumps, 4.0, 1e-15);
        close(bound.complementarity, 1.0, 1e-15);
        assert_eq!(bound.edges, 0.0);
    }

    #[test]
    fn the_mean_of_the_gap_is_weighted_by_area() {
        // The inner vertex at (1/2, 0): triangles of area 1, 1/2, 1, 3/2, the gap 1/2 at a corner of the first two.
        let mut points = four_triangles().points().to_vec();
        points[4] = [0.5, 0.0];
        let mesh = Mesh::new(
            points,
            &[[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]],
            &[],
            None,
        )
        .unwrap();
        let problem = problem(&mesh, [vec![1.0; 4], vec![1.0; 4]], [0.0, 0.0]);
        let solution = solution(
            [vec![0.0, 0.5, 0.0, 0.0, 0.0], vec![0.0; 5]],
            vec![0.0, 0.0, 0.0, 0.0, 16.0],
            vec![0.0; 5],
        );
        let area: Vec<f64> = mesh.triangle_ids().map(|t| mesh.shape(t).area).collect();
        close(
            force_times_gap(&mesh, &problem, &solution, &area),
            1.0,
            1e-14,
        );
    }

    #[test]
    fn terms_are_joined_in_the_units_of_the_user() {
        let bound = GlobalBound {
            edges: 0.7,
            ..terms()
        };
        // Odd exponents of the length: the second term has a half of a power of two.
        let scale = Scale {
            length: 3,
            tension: -4,
            load: 2,
        };
        let (l, f): (f64, f64) = (8.0, 4.0);
        let (force, mu) = (f * l * l, 1.0f64 / 16.0);
        let second = (bound.kappa * f * l).sqrt() * (bound.edges * force).sqrt();
        close(bound.second_term(scale), second, 1e-15);
        close(bound.literal(scale), bound.elements * force + second, 1e-15);
        let energy = force * (force / mu);
        close(
            bound.repaired(scale),
            (bound.elements + bound.jumps) * force + bound.complementarity * energy.sqrt(),
            1e-15,
        );
        // Far out of the range of a product in the user's units.
        let far = Scale {
            length: 400,
            tension: 0,
            load: -300,
        };
        close(
            bound.second_term(far),
            times_power_of_two((bound.kappa * bound.edges).sqrt(), 300),
            1e-15,
        );
    }
}
