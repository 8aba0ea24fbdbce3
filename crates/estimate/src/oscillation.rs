//! Oscillation of the loads: what their element means do not see.
//!
//! ```text
//! osc_K = (sum_i h_K^2 ||f_i - f_ih||_K^2)^(1/2)
//! ```

use contact::DiscreteProblem;
use fem_core::Mesh;

/// The local values osc_K: roots, one entry a triangle, in the unit of a force.
pub fn oscillation(mesh: &Mesh, problem: &DiscreteProblem) -> Vec<f64> {
    mesh.triangle_ids()
        .enumerate()
        .map(|(t, id)| {
            let deviation: f64 = problem.loads.iter().map(|f| f.deviation_squared(t)).sum();
            mesh.shape(id).diameter() * deviation.sqrt()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{close, deviating, problem, two_triangles};

    #[test]
    fn diameter_times_deviation() {
        let mesh = two_triangles();
        let mut problem = problem(&mesh, [vec![1.0; 2], vec![1.0; 2]], [0.0, 0.0]);
        problem.loads[0] = deviating(&problem.loads[0], &[3.0, 0.0]);
        problem.loads[1] = deviating(&problem.loads[1], &[1.0, 0.0]);
        let local = oscillation(&mesh, &problem);
        close(local[0], 8f64.sqrt(), 1e-15);
        assert_eq!(local[1], 0.0);
    }
}
