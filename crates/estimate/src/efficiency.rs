//! How efficient the paper's indicators are: the constants of (7.13) and (7.14) that a solution attains.
//!
//! With e_i = u_i - u_ih, e_sigma = sigma - sigma_h, omega_K the triangle K and its edge neighbours, omega_e the two triangles of e:
//!
//! ```text
//! eta_K <= c ( |e_1|_(1,omega_K) + |e_2|_(1,omega_K) + |e_sigma|_(1,omega_K) + h_K sum_i ||f_i - f_ih||_omega_K )      (7.13)
//! eta_e <= c |e_sigma|_(1,omega_e)                                                                                      (7.14)
//! ```

use contact::DiscreteProblem;
use fem_core::Mesh;

use crate::errors::TrueErrors;
use crate::paper::Paper;

/// The largest local quotients of indicator and error; bounded under refinement, for tensions of order one.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Efficiency {
    /// The smallest c that (7.13) holds with on all triangles.
    pub element: f64,
    /// The smallest c that (7.14) holds with on all interior edges.
    pub edge: f64,
}

/// Indicators below this share of the largest one are rounding: their quotients mean nothing.
const NEGLIGIBLE: f64 = 1e-12;

/// Compares the indicators of a solution with its true errors; `None` where sigma is not known.
///
/// The quotient is infinite where an indicator meets no error at all, and 0 where all indicators vanish.
pub fn efficiency(
    mesh: &Mesh,
    problem: &DiscreteProblem,
    paper: &Paper,
    errors: &TrueErrors,
) -> Option<Efficiency> {
    let sigma = errors.sigma_squared.as_ref()?;
    let [upper, lower] = &errors.displacement_squared;
    let parts: [&dyn Fn(usize) -> f64; 5] = [
        &|t| upper[t],
        &|t| lower[t],
        &|t| sigma[t],
        &|t| problem.loads[0].deviation_squared(t),
        &|t| problem.loads[1].deviation_squared(t),
    ];
    let elements = mesh.triangle_ids().enumerate().map(|(t, id)| {
        let h = mesh.shape(id).diameter();
        let bound: f64 = parts
            .iter()
            .zip([1.0, 1.0, 1.0, h, h])
            .map(|(square, factor)| {
                let around: f64 = mesh.neighbours()[t]
                    .iter()
                    .filter_map(|n| n.get())
                    .map(|(k, _)| square(k.index()))
                    .sum();
                factor * (square(t) + around).sqrt()
            })
            .sum();
        (paper.eta_k[t], bound)
    });
    let edges = mesh.interior_edges().zip(&paper.eta_e).map(|(edge, &eta)| {
        let [k, l] = edge.triangles.map(|t| sigma[t.index()]);
        (eta, (k + l).sqrt())
    });
    Some(Efficiency {
        element: largest_quotient(&paper.eta_k, elements),
        edge: largest_quotient(&paper.eta_e, edges),
    })
}

fn largest_quotient(indicators: &[f64], pairs: impl Iterator<Item = (f64, f64)>) -> f64 {
    let floor = NEGLIGIBLE * indicators.iter().fold(0.0f64, |m, &v| m.max(v));
    pairs
        .filter(|&(indicator, _)| indicator > floor)
        .map(|(indicator, error)| indicator / error)
        .fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{close, deviating, four_triangles, problem};

    #[test]
    fn quotients_by_hand() {
        let mesh = four_triangles();
        let mut problem = problem(&mesh, [vec![1.0; 4], vec![1.0; 4]], [0.0, 0.0]);
        problem.loads[1] = deviating(&problem.loads[1], &[0.0, 0.0, 4.0, 0.0]);
        let errors = TrueErrors {
            displacement_squared: [vec![9.0, 0.0, 0.0, 0.0], vec![0.0, 0.0, 0.0, 25.0]],
            energy_squared: vec![0.0; 4],
            sigma_squared: Some(vec![0.0, 9.0, 16.0, 0.0]),
            energy: 0.0,
            h1: [0.0; 2],
            h1_total: 0.0,
            sigma: None,
        };
        // Triangle 0 has the neighbours 1 and 3 and sees 3 + 5 + 3; triangle 2 too and sees 5 + 5 + 2 * 2.
        let paper = Paper {
            eta_k: vec![22.0, 0.0, 42.0, 1e-20],
            eta_e: vec![0.0; 4],
            eta_e_cell: vec![0.0; 4],
        };
        let result = efficiency(&mesh, &problem, &paper, &errors).unwrap();
        close(result.element, 3.0, 1e-15);
        assert_eq!(result.edge, 0.0);
        let edges: Vec<[usize; 2]> = mesh
            .interior_edges()
            .map(|e| e.triangles.map(|t| t.index()))
            .collect();
        let mut eta_e = vec![0.0; 4];
        eta_e[edges.iter().position(|&e| e == [1, 2]).unwrap()] = 20.0;
        let paper = Paper { eta_e, ..paper };
        let result = efficiency(&mesh, &problem, &paper, &errors).unwrap();
        close(result.edge, 4.0, 1e-15);
        let unknown = TrueErrors {
            sigma_squared: None,
            ..errors
        };
        assert_eq!(efficiency(&mesh, &problem, &paper, &unknown), None);
    }
}
