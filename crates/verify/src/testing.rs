//! A small level to test on.

use std::sync::Arc;

use adapt::Problem;
use fem_core::{Constant, Field, Mesh, Scale};

use crate::data::{Discrete, Nodal};

/// The square (-1, 1)^2 in n by n small ones, each cut along a diagonal.
pub(crate) fn square(n: u32) -> Mesh {
    let at = |k: u32| 2.0 * f64::from(k) / f64::from(n) - 1.0;
    let points = (0..=n)
        .flat_map(|j| (0..=n).map(move |i| [at(i), at(j)]))
        .collect();
    let number = |i: u32, j: u32| j * (n + 1) + i;
    let triangles: Vec<[u32; 3]> = (0..n)
        .flat_map(|j| (0..n).map(move |i| (i, j)))
        .flat_map(|(i, j)| {
            let [a, b] = [number(i, j), number(i + 1, j)];
            let [c, d] = [number(i + 1, j + 1), number(i, j + 1)];
            [[c, a, b], [a, c, d]]
        })
        .collect();
    Mesh::new(points, &triangles, &[], None).unwrap()
}

/// Loads of minus one and one, tensions of two and three, heights zero.
pub(crate) fn problem(mesh: &Mesh) -> Problem {
    let field = |v: f64| -> Arc<dyn Field> { Arc::new(Constant(v)) };
    Problem {
        mesh: mesh.clone(),
        scale: Scale::default(),
        tension: [field(2.0), field(3.0)],
        load: [field(-1.0), field(1.0)],
        height: [field(0.0), field(0.0)],
        exact: None,
    }
}

/// A level with these nodal values.
pub(crate) fn level<'a>(
    mesh: &'a Mesh,
    displacement: [Vec<f64>; 2],
    force: Vec<f64>,
    sigma: Vec<f64>,
) -> Discrete<'a> {
    let contact = force.iter().map(|&z| z > 0.0).collect();
    let nodal = Nodal {
        displacement,
        force,
        sigma,
        contact,
    };
    Discrete::new(mesh, &problem(mesh), nodal, false).unwrap()
}

/// Numbers between -1 and 1.
pub(crate) fn noise(count: usize) -> Vec<f64> {
    let mut state = 1u64;
    (0..count)
        .map(|_| {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        })
        .collect()
}
