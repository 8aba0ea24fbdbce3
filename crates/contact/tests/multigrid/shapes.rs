//! Bad shapes, jumps of the tension along and across edges, deep meshes, and meshes with nothing to iterate on.

use contact::{Reduction, Settings, Solution, Solver, Start, Tolerance, solve};
use fem_core::{Children, Circle, Mesh, TriangleId, VertexId};

use crate::common::{Data, Function, assert_exact, difference, distorted, square, square_mapped};
use crate::problems::*;

/// What the levels of a run took.
#[derive(Default)]
struct Steps {
    /// The largest number of steps for the inequality where multigrid finished.
    most: usize,
    /// The largest number of factorisations of the initial mesh.
    factorisations: usize,
    /// Levels that multigrid finished.
    finished: usize,
    /// Levels that went over to the active set method.
    handed_over: usize,
}

/// Solves on `mesh` and on `times` refinements of the triangles that `mark` names, and compares with the active set method.
fn levels(
    data: &Data,
    mut mesh: Mesh,
    times: usize,
    mut mark: impl FnMut(&Mesh) -> Vec<TriangleId>,
    children: Children,
) -> (Steps, Solution, Mesh) {
    let settings = multigrid(Tolerance::Relative(1e-10), true);
    let direct = Settings {
        solver: Solver::ActiveSet,
        ..settings
    };
    let mut start: Option<Start> = None;
    let mut steps = Steps::default();
    for level in 0.. {
        let problem = data.on(&mesh);
        let s = solve(&problem, &settings, start.as_ref()).expect("a solution");
        assert_exact(&problem, &s);
        let exact = solve(&problem, &direct, start.as_ref()).expect("a solution");
        let apart = difference(&s, &exact);
        // A residual of 1e-10 bounds the error up to the condition of badly shaped meshes.
        assert!(apart <= 1e-8, "{apart:e} {:?}", s.info);
        println!(
            "{} vertices {} {:?}",
            problem.order(),
            s.info.solver,
            s.info.cycles
        );
        match (s.info.solver, s.info.cycles) {
            ("multigrid", Some(cycles)) => {
                steps.finished += 1;
                steps.most = steps.most.max(cycles.inequality);
                steps.factorisations = steps.factorisations.max(cycles.factorisations);
                assert!(cycles.mean <= 60 && cycles.sigma <= 60, "{cycles:?}");
            }
            ("multigrid+active-set", Some(_)) => steps.handed_over += 1,
            // The initial mesh has no hierarchy.
            other => assert!(level == 0 && other == ("active-set", None), "{other:?}"),
        }
        if level == times {
            return (steps, s, mesh);
        }
        let refined = mesh.refine(&mark(&mesh), children).expect("refines");
        start = Some(Start::prolong(&s, &mesh, refined.old_vertices));
    }
    unreachable!("the loop returns")
}

fn uniformly(data: &Data, mesh: Mesh, times: usize) -> Steps {
    let all = |mesh: &Mesh| mesh.triangle_ids().collect();
    levels(data, mesh, times, all, Children::Four).0
}

const PRESSED: Data<'static> = Data {
    tensions: [ONE, ONE],
    loads: [&islands, ZERO],
    heights: [&|_, _| 0.1, ZERO],
};

#[test]
fn needles_take_at_most_sixty_steps_or_are_handed_over() {
    for aspect in [10.0, 100.0] {
        let mesh = square_mapped(8, |_, _, [x, y]| [x, y / aspect]);
        let data = Data {
            loads: [&|x, y| islands(x, y * aspect) * aspect * aspect, ZERO],
            ..PRESSED
        };
        let steps = uniformly(&data, mesh, 4);
        assert!(steps.most <= 60);
        assert!(steps.finished >= 1);
        if aspect > 50.0 {
            assert!(steps.handed_over >= 1);
        }
    }
}

#[test]
fn distorted_meshes() {
    let steps = uniformly(&PRESSED, distorted(8, 0.35, 5), 4);
    assert!(steps.most <= 45, "{}", steps.most);
    assert_eq!(steps.handed_over, 0);
}

#[test]
fn jumps_of_the_tension_along_and_across_edges() {
    for high in [1e2, 1e6] {
        let board = checkerboard(8, high);
        let along = move |x: f64, _: f64| if x > 0.0 { high } else { 1.0 };
        let across = move |x: f64, y: f64| if x + 0.3 * y > 0.11 { high } else { 1.0 };
        let cases: [(Function, Function, usize); 6] = [
            (&along, ONE, 20),
            (ONE, &along, 20),
            (&across, ONE, 25),
            (&across, &along, 25),
            (&board, ONE, 45),
            (&board, &board, 45),
        ];
        for (upper, lower, most) in cases {
            let data = Data {
                tensions: [upper, lower],
                ..PRESSED
            };
            let steps = uniformly(&data, square(8), 4);
            assert!(steps.most <= most, "{} of {most}", steps.most);
            assert_eq!(steps.handed_over, 0);
        }
    }
}

/// Triangles with a vertex at the origin.
fn at_the_origin(mesh: &Mesh) -> Vec<TriangleId> {
    let here = |v: &VertexId| mesh.points()[v.index()] == [0.0, 0.0];
    mesh.triangle_ids()
        .filter(|t| mesh.triangles()[t.index()].iter().any(here))
        .collect()
}

#[test]
fn depth_does_not_matter() {
    for lower in [ONE, &|x: f64, _: f64| if x > 0.0 { 10.0 } else { 1.0 }] {
        let data = Data {
            tensions: [ONE, lower],
            ..PRESSED
        };
        let (steps, _, mesh) = levels(&data, square(16), 90, at_the_origin, Children::Two);
        let depth = mesh.genealogy().iter().map(|b| b.level).max();
        assert!(depth >= Some(85), "{depth:?}");
        assert!(steps.most <= 12, "{}", steps.most);
        assert_eq!((steps.finished, steps.handed_over), (90, 0));
        // And from nothing, where every level counts.
        let problem = data.on(&mesh);
        let settings = multigrid(Tolerance::Relative(1e-10), true);
        let s = solve(&problem, &settings, None).expect("a solution");
        println!("cold {:?}", s.info);
        let cycles = s.info.cycles.expect("cycles");
        assert_eq!(s.info.solver, "multigrid");
        assert!(cycles.inequality + cycles.monotone <= 20, "{cycles:?}");
        assert!(cycles.mean <= 13 && cycles.sigma <= 14, "{cycles:?}");
    }
}

#[test]
fn a_fine_initial_mesh_is_the_coarse_level() {
    let few = |mesh: &Mesh| -> Vec<TriangleId> {
        let middle = |t: TriangleId| {
            let c = mesh.corners(t);
            [0, 1].map(|k| c.iter().map(|p| p[k]).sum::<f64>() / 3.0)
        };
        let near = |t: &TriangleId| {
            let [x, y] = middle(*t);
            (x * x + y * y - 0.3).abs() < 0.03
        };
        mesh.triangle_ids().filter(near).collect()
    };
    let (steps, ..) = levels(&PRESSED, square(64), 3, few, Children::Two);
    assert!(steps.most <= 12, "{}", steps.most);
    // Fewer than one a step: the factor is kept while the truncation changes little.
    assert!(steps.factorisations <= 6, "{}", steps.factorisations);
    assert_eq!((steps.finished, steps.handed_over), (3, 0));
}

#[test]
fn a_disk() {
    let mut points = vec![[0.0, 0.0]];
    points.extend((0..8).map(|i| {
        let phi = std::f64::consts::TAU * i as f64 / 8.0;
        [phi.cos(), phi.sin()]
    }));
    let triangles: Vec<[u32; 3]> = (0..8).map(|i| [1 + i, 1 + (i + 1) % 8, 0]).collect();
    let circle = Circle {
        center: [0.0, 0.0],
        radius: 1.0,
    };
    for named in [true, false] {
        let curve = Some(circle);
        let mesh = if named {
            Mesh::with_refinement_edges(points.clone(), &triangles, &[], curve)
        } else {
            Mesh::new(points.clone(), &triangles, &[], curve)
        };
        let steps = uniformly(&PRESSED, mesh.expect("a fan"), 6);
        assert!(steps.most <= 16, "{}", steps.most);
        assert_eq!(steps.handed_over, 0);
    }
}

#[test]
fn nothing_to_iterate_on() {
    // One triangle bisected twice: a hierarchy, and no interior vertex.
    let corners = vec![[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
    let mut mesh = Mesh::new(corners, &[[0, 1, 2]], &[], None).expect("a triangle");
    let settings = multigrid(Tolerance::Balanced, true);
    let mut interior = 0;
    for _ in 0..5 {
        let problem = PRESSED.on(&mesh);
        let s = solve(&problem, &settings, None).expect("a solution");
        assert_exact(&problem, &s);
        if problem.boundary().contains(&false) {
            assert_eq!(s.info.solver, "multigrid");
            interior += 1;
        } else {
            assert_eq!(s.info.reduction, Reduction::NoContact);
            assert!(s.sigma.iter().all(|&v| v == 0.0));
        }
        mesh.refine_uniformly(Children::Two).expect("refines");
    }
    assert_eq!(interior, 2);
    // And without data: everything is zero, whatever is asked for.
    let nothing = Data {
        tensions: [ONE, &|_, _| 2.0],
        loads: [ZERO, ZERO],
        heights: [ZERO, ZERO],
    };
    let mut mesh = square(4);
    mesh.refine_uniformly(Children::Four).expect("refines");
    let problem = nothing.on(&mesh);
    for target in [None, Some(0.0)] {
        let settings = Settings {
            energy_target: target,
            ..settings
        };
        let s = solve(&problem, &settings, None).expect("a solution");
        assert_eq!(s.info.solver, "multigrid");
        assert!(s.displacement.iter().flatten().all(|&u| u == 0.0));
        assert_eq!(s.info.algebraic_error, Some(0.0));
    }
}
