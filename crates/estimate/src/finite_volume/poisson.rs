//! The first-order solution of the Poisson problem on a quartered mesh, by conjugate gradients.
//!
//! Preconditioner: the diagonal in the hierarchical basis (Yserentant 1986), which takes hat functions of the mesh on which
//! each vertex was born. The diagonal is that of the finest mesh: similar triangles have the same stiffness. With two
//! quarterings this takes about a quarter of the steps.

use std::sync::Arc;

use fem_core::Pattern;
use fem_core::assemble::stiffness;

use super::quarter::Quartered;

/// The preconditioned residual falls to this share of the first. The squared seminorm misses at most the square of it, times
/// the condition of the preconditioned matrix: 1e-7 on a million vertices.
const REDUCTION: f64 = 1e-6;

/// |r_h|_1 with `K r = load` at the interior vertices and r = 0 on the boundary; entries of `load` on the boundary do not count.
pub(super) fn seminorm_of_solution(fine: &Quartered, load: &[f64]) -> f64 {
    let mesh = &fine.mesh;
    let pattern = Arc::new(Pattern::of(mesh));
    let matrix = stiffness(mesh, &pattern, |_| 1.0);
    let n = load.len();
    let inside: Vec<usize> = (0..n).filter(|&i| !mesh.boundary()[i]).collect();
    let mut residual = vec![0.0; n];
    inside.iter().for_each(|&i| residual[i] = load[i]);
    let (mut direction, mut product) = (vec![0.0; n], vec![0.0; n]);
    let mut step = vec![0.0; n];
    let old = n - fine.parents.len();
    let (mut square, mut before, mut first) = (0.0, f64::INFINITY, f64::INFINITY);
    // In exact arithmetic n steps solve the system.
    for count in 0..=n {
        step.copy_from_slice(&residual);
        for (v, [a, b]) in (old..n).zip(&fine.parents).rev() {
            let half = 0.5 * step[v];
            step[*a as usize] += half;
            step[*b as usize] += half;
        }
        for i in 0..n {
            step[i] = if mesh.boundary()[i] {
                0.0
            } else {
                step[i] / matrix.diagonal(i)
            };
        }
        for (v, [a, b]) in (old..n).zip(&fine.parents) {
            step[v] += 0.5 * (step[*a as usize] + step[*b as usize]);
        }
        let now: f64 = inside.iter().map(|&i| residual[i] * step[i]).sum();
        if count == 0 {
            first = now;
        }
        if now <= REDUCTION * REDUCTION * first {
            break;
        }
        let turn = now / before;
        let mut curvature = 0.0;
        inside
            .iter()
            .for_each(|&i| direction[i] = step[i] + turn * direction[i]);
        for &i in &inside {
            product[i] = matrix.row_dot(i, &direction);
            curvature += direction[i] * product[i];
        }
        let length = now / curvature;
        // What the step takes off the squared energy of the error; the squared seminorm of the solution is the sum of these.
        square += length * now;
        inside
            .iter()
            .for_each(|&i| residual[i] -= length * product[i]);
        before = now;
    }
    square.sqrt()
}
