//! Tiny meshes, problems and solutions whose indicators can be computed by hand.

use contact::{DiscreteProblem, Reduction, Solution, SolveInfo, Status};
use fem_core::Mesh;
use fem_core::integrate::Loads;

/// The unit square cut along the diagonal from (0,0) to (1,1).
pub(crate) fn two_triangles() -> Mesh {
    let points = vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    Mesh::new(points, &[[0, 1, 2], [0, 2, 3]], &[], None).unwrap()
}

/// The square (-1,1)^2 cut along both diagonals; vertex 4 is the centre, all triangles have area 1.
pub(crate) fn four_triangles() -> Mesh {
    let points = vec![
        [-1.0, -1.0],
        [1.0, -1.0],
        [1.0, 1.0],
        [-1.0, 1.0],
        [0.0, 0.0],
    ];
    let triangles = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]];
    Mesh::new(points, &triangles, &[], None).unwrap()
}

/// A problem with element means of the tensions and constant loads, clamped at height zero.
pub(crate) fn problem(mesh: &Mesh, tension: [Vec<f64>; 2], load: [f64; 2]) -> DiscreteProblem {
    let loads = Loads::constant(mesh, load);
    let heights = [0, 1].map(|_| vec![0.0; mesh.vertex_count()]);
    DiscreteProblem::new(mesh.clone(), tension, loads, heights)
}

/// The same load but for its squared deviations from the element means.
pub(crate) fn deviating(loads: &Loads, deviation_squared: &[f64]) -> Loads {
    let mean: Vec<f64> = (0..deviation_squared.len())
        .map(|t| loads.mean(t))
        .collect();
    Loads::from_parts(loads.nodal.clone(), &mean, deviation_squared)
}

/// A solution with these nodal values.
pub(crate) fn solution(displacement: [Vec<f64>; 2], force: Vec<f64>, sigma: Vec<f64>) -> Solution {
    Solution {
        contact: force.iter().map(|&z| z > 0.0).collect(),
        displacement,
        force,
        sigma,
        info: SolveInfo {
            solver: "given",
            reduction: Reduction::TwoField,
            status: Status::Converged,
            iterations: 0,
            unknowns: 0,
            kkt_residual: 0.0,
            algebraic_error: None,
            contraction: None,
            first_cycle: None,
            cycles: None,
        },
    }
}

/// Asserts that two numbers agree to a relative tolerance.
#[track_caller]
pub(crate) fn close(value: f64, expected: f64, tolerance: f64) {
    assert!(
        (value - expected).abs() <= tolerance * expected.abs(),
        "{value:e} is not {expected:e}"
    );
}
