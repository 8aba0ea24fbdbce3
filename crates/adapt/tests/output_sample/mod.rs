//! Made-up levels for the tests of the output.

#![allow(dead_code)]

use adapt::Assurance;
use adapt::output::{EdgeFields, LevelFields};
use adapt::record::LevelRecord;
use contact::Reduction;
use fem_core::{Mesh, VertexId};

/// n x n squares, each cut in two.
pub fn squares(n: usize) -> Mesh {
    let at = |i: usize, j: usize| (i * (n + 1) + j) as u32;
    let mut points = Vec::new();
    let mut triangles = Vec::new();
    for i in 0..=n {
        for j in 0..=n {
            points.push([i as f64 / n as f64, 0.1 + j as f64 / n as f64]);
        }
    }
    for i in 0..n {
        for j in 0..n {
            triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    Mesh::new(points, &triangles, &[], None).expect("a grid")
}

/// One triangle.
pub fn triangle() -> Mesh {
    Mesh::new(
        vec![[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]],
        &[[0, 1, 2]],
        &[7],
        None,
    )
    .expect("a triangle")
}

/// Numbers of every size and sign that no decimal form holds exactly; also a negative zero and a subnormal number.
pub fn awkward(count: usize, salt: u64) -> Vec<f64> {
    (0..count as u64)
        .map(|i| match i {
            2 => -0.0,
            3 => 5e-324,
            4 => -1.7e308,
            _ => {
                let mixed = (i + 1)
                    .wrapping_mul(0x9e37_79b9_7f4a_7c15)
                    .wrapping_add(salt.wrapping_mul(0xd1b5_4a32_d192_ed03));
                let mixed = (mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
                // The exponent field stays below that of infinity.
                f64::from_bits(mixed & !(1 << 62))
            }
        })
        .collect()
}

/// Every array there is, filled with awkward numbers.
pub fn level_fields(mesh: &Mesh, level: usize) -> LevelFields<'_> {
    let (n, m) = (mesh.vertex_count(), mesh.triangle_count());
    LevelFields {
        level,
        error_bound: 0.1 + 0.2,
        points: mesh.points().into(),
        triangles: mesh.triangles().into(),
        u1: awkward(n, 1).into(),
        u2: awkward(n, 2).into(),
        gap: awkward(n, 3).into(),
        sigma: awkward(n, 4).into(),
        action_force: awkward(n, 5).into(),
        action: awkward(n, 6).into(),
        contact: (0..n).map(|i| i % 3 == 0).collect::<Vec<_>>().into(),
        eta_k: Some(awkward(m, 7).into()),
        eta_e: Some(awkward(m, 8).into()),
        residual: Some(awkward(m, 9).into()),
        certified: Some(awkward(m, 10).into()),
        oscillation: Some(awkward(m, 11).into()),
        f1_h: awkward(m, 12).into(),
        f2_h: awkward(m, 13).into(),
        generation: mesh.generation().into(),
        region: mesh.region().into(),
    }
}

/// The interior edges with awkward numbers.
pub fn edge_fields(mesh: &Mesh, level: usize) -> EdgeFields<'_> {
    let edges: Vec<[VertexId; 2]> = mesh.interior_edges().map(|e| e.vertices).collect();
    EdgeFields {
        level,
        error_bound: 0.1 + 0.2,
        points: mesh.points().into(),
        eta_e: awkward(edges.len(), 14).into(),
        edges: edges.into(),
    }
}

/// A level with every column that this version computes.
pub fn record(level: usize) -> LevelRecord {
    LevelRecord {
        level,
        vertices: 100 * (level + 1),
        triangles: 180 * (level + 1),
        unknowns: 160,
        contact_vertices: 12,
        contact_area: 0.1 + 0.2,
        energy: -1.0 / 3.0,
        energy_norm: 1e-9,
        eta_k: Some(0.25),
        eta_e_sum: Some(0.5),
        bound_711: Some(10.0),
        bound_711_repaired: Some(11.0),
        residual: Some(1e22),
        certified: Some(1.25),
        eta_alg: Some(0.03125),
        algebraic_error: Some(0.015625),
        assurance: Some(Assurance {
            guaranteed: true,
            caveats: vec!["one".into()],
        }),
        oscillation: 0.0,
        error_bound: 0.125,
        bound_kind: "residual",
        relative_bound: Some(0.01),
        true_error: Some(2.0),
        effectivity: Some(1.5),
        sigma_error: Some(3.0),
        h1_error: Some(4.0),
        solver: "active-set",
        reduction: Reduction::TwoField,
        iterations: 5,
        kkt_residual: 1.5e-16,
        contact_force: 6.0,
        max_action: 7.0,
        contact_area_error: Some(0.75),
        contact_jaccard: Some(0.875),
        contact_hausdorff: Some(0.0625),
        smallest_gap: 0.0,
        seconds_refine: 0.5,
        seconds_assemble: 0.25,
        seconds_solve: 0.125,
        seconds_estimate: 1.0,
        seconds_total: 2.0,
        peak_memory_mb: Some(8.5),
    }
}
