//! Bisection: invariants, depth, cost.

use fem_core::invariants::check;
use fem_core::{Children, Circle, Mesh, TriangleId};
use proptest::prelude::*;

/// n x n squares of (-1,1)^2, each with its diagonal along (1,1).
fn squares(n: usize) -> Mesh {
    let at = |i: usize, j: usize| (i * (n + 1) + j) as u32;
    let mut points = Vec::new();
    let mut triangles = Vec::new();
    for i in 0..=n {
        for j in 0..=n {
            points.push([
                -1.0 + 2.0 * i as f64 / n as f64,
                -1.0 + 2.0 * j as f64 / n as f64,
            ]);
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

fn fan(k: usize) -> Mesh {
    let mut points = vec![[0.0, 0.0]];
    for i in 0..k {
        let phi = std::f64::consts::TAU * i as f64 / k as f64;
        points.push([phi.cos(), phi.sin()]);
    }
    let triangles: Vec<_> = (0..k as u32)
        .map(|i| [0, 1 + i, 1 + (i + 1) % k as u32])
        .collect();
    let circle = Circle {
        center: [0.0, 0.0],
        radius: 1.0,
    };
    Mesh::new(points, &triangles, &[], Some(circle)).expect("a fan")
}

fn area(mesh: &Mesh) -> f64 {
    fem_core::norms::area(mesh)
}

#[test]
fn uniform_refinement_quarters_every_triangle() {
    let mut mesh = squares(3);
    let before = mesh.triangle_count();
    let r = mesh.refine_uniformly(Children::Four).expect("refines");
    check(&mesh).expect("sound");
    assert_eq!(mesh.triangle_count(), 4 * before);
    assert_eq!(r.parent.len(), mesh.triangle_count());
    assert_eq!(mesh.vertex_count(), 49);
    assert!((area(&mesh) - 4.0).abs() < 1e-14);
    assert!(mesh.generation().iter().all(|&g| g == 2));
    let two = squares(3)
        .refine_uniformly(Children::Two)
        .map(|_| ())
        .map_err(|e| e.to_string());
    assert_eq!(two, Ok(()));
}

#[test]
fn new_boundary_vertices_lie_on_the_circle() {
    let mut mesh = fan(8);
    for _ in 0..5 {
        mesh.refine_uniformly(Children::Four).expect("refines");
        check(&mesh).expect("sound");
    }
    for (p, _) in mesh
        .points()
        .iter()
        .zip(mesh.boundary())
        .filter(|(_, b)| **b)
    {
        assert!(((p[0] * p[0] + p[1] * p[1]).sqrt() - 1.0).abs() < 4e-16);
    }
    assert!((area(&mesh) - std::f64::consts::PI).abs() < 4e-4);
}

#[test]
fn ninety_levels_at_one_corner() {
    let mut mesh = squares(1);
    for level in 0..90 {
        let corner: Vec<_> = mesh
            .triangle_ids()
            .filter(|t| mesh.corners(*t).contains(&[-1.0, -1.0]))
            .collect();
        // The corner sits at the origin of a shifted copy only; here 2^-52 ends the way.
        match mesh.refine(&corner, Children::Two) {
            Ok(_) => check(&mesh).expect("sound"),
            Err(e) => panic!("level {level}: {e}"),
        }
    }
    assert!(mesh.triangle_count() < 90 * 8, "{}", mesh.triangle_count());
    assert_eq!(*mesh.generation().iter().max().expect("some"), 90);
}

#[test]
fn ninety_halvings_at_the_origin_and_a_clear_refusal_elsewhere() {
    let mut mesh = fan(6);
    for _ in 0..90 {
        let corner: Vec<_> = mesh
            .triangle_ids()
            .filter(|t| mesh.corners(*t).contains(&[0.0, 0.0]))
            .collect();
        mesh.refine(&corner, Children::Four)
            .expect("room at the origin");
        check(&mesh).expect("sound");
    }
    let mut mesh = squares(1);
    let mut refused = None;
    for _ in 0..80 {
        let corner: Vec<_> = mesh
            .triangle_ids()
            .filter(|t| mesh.corners(*t).contains(&[-1.0, -1.0]))
            .collect();
        let before = (mesh.vertex_count(), mesh.triangle_count());
        if let Err(e) = mesh.refine(&corner, Children::Four) {
            assert_eq!(before, (mesh.vertex_count(), mesh.triangle_count()));
            check(&mesh).expect("the mesh is left as it was");
            refused = Some(e.to_string());
            break;
        }
    }
    assert!(
        refused
            .expect("coordinates run out")
            .contains("cannot be bisected")
    );
}

#[test]
fn refinement_edges_that_wait_for_each_other_are_refused() {
    let points = vec![[0.0, 0.0], [2.0, 0.0], [1.0, 2.0], [1.0, 0.7]];
    let circle = [[0, 3, 1], [1, 3, 2], [2, 3, 0]];
    let error = Mesh::with_refinement_edges(points.clone(), &circle, &[], None).map(|_| ());
    assert_eq!(
        error,
        Err(fem_core::MeshError::CyclicRefinementEdges { triangle: 0 })
    );
    let rim = [[0, 1, 3], [1, 2, 3], [2, 0, 3]];
    let mut mesh = Mesh::with_refinement_edges(points, &rim, &[], None).expect("no circle");
    assert_eq!(mesh.triangles()[1].map(|v| v.0), [1, 2, 3]);
    mesh.refine_uniformly(Children::Four).expect("refines");
    check(&mesh).expect("sound");
}

/// Work of the closure for each new triangle, refining towards a circle.
#[test]
fn closure_work_for_each_new_triangle_is_constant() {
    let mut mesh = squares(4);
    let mut rates = Vec::new();
    let (mut steps, mut begun) = (0, mesh.triangle_count());
    while mesh.triangle_count() < 4_000_000 {
        let cut: Vec<TriangleId> = mesh
            .triangle_ids()
            .filter(|t| {
                let r = mesh.corners(*t).map(|p| p[0] * p[0] + p[1] * p[1] < 0.4);
                r.iter().any(|x| *x) && !r.iter().all(|x| *x) || t.0 % 3 == 0
            })
            .collect();
        let r = mesh.refine(&cut, Children::Four).expect("refines");
        steps += r.closure_steps;
        let grown = mesh.triangle_count();
        if grown > 2 * begun {
            rates.push(steps as f64 / (grown - begun) as f64);
            (steps, begun) = (0, grown);
        }
    }
    check(&mesh).expect("sound");
    let late: Vec<f64> = rates.split_off(rates.len() - 5);
    let (low, high) = late
        .iter()
        .fold((f64::MAX, 0.0f64), |(l, h), &r| (l.min(r), h.max(r)));
    assert!(high <= 1.1 * low, "{late:?}");
    assert!(high < 3.5, "{late:?}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 20, ..ProptestConfig::default() })]

    /// Random marks on random distorted triangulations with arbitrary shapes: 50 refinements each, 1000 in all.
    #[test]
    fn random_refinements_keep_every_invariant(
        n in 1usize..4,
        seed in proptest::collection::vec(0u32..1000, 50),
        shift in proptest::collection::vec(-0.3f64..0.3, 32),
        four in any::<bool>(),
    ) {
        let base = squares(n);
        let points: Vec<_> = base.points().iter().enumerate().map(|(i, p)| {
            let h = 0.5 / n as f64;
            [p[0] + h * shift[2 * i % 32], p[1] + h * shift[(2 * i + 1) % 32]]
        }).collect();
        let triangles: Vec<_> = base.triangles().iter().map(|t| t.map(|v| v.0)).collect();
        let mut mesh = Mesh::new(points, &triangles, &[], None).expect("distorted little");
        let whole = area(&mesh);
        for pick in seed {
            let marked = [TriangleId(pick % mesh.triangle_count() as u32), TriangleId(pick * 7 % mesh.triangle_count() as u32)];
            let before = mesh.triangle_count();
            mesh.refine(&marked, if four { Children::Four } else { Children::Two }).expect("refines");
            prop_assert!(mesh.triangle_count() > before);
            prop_assert_eq!(check(&mesh), Ok(()));
        }
        prop_assert!((area(&mesh) - whole).abs() < 1e-12);
    }
}
