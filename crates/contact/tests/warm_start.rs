//! From one mesh to the next: a handful of linear solves whatever the number of vertices.

mod common;

use common::{
    Data, Function, assert_exact, difference, distorted, jumping_action, smooth_action, square,
};
use contact::{Settings, Solution, Solver, Start, solve};
use fem_core::{Children, Mesh, VertexId};

const ZERO: Function = &|_, _| 0.0;
const ONE: Function = &|_, _| 1.0;

/// Solves on a sequence of meshes; the linear solves of every level after the first, and the last solution.
fn levels(
    data: &Data,
    mut mesh: Mesh,
    count: usize,
    reduce: bool,
    mut mark: impl FnMut(&Mesh, &Solution) -> Vec<fem_core::TriangleId>,
) -> (Vec<usize>, Solution) {
    let settings = Settings {
        solver: Solver::ActiveSet,
        reduce,
        ..Settings::default()
    };
    let mut start: Option<Start> = None;
    let mut solves = Vec::new();
    for level in 0..count {
        let problem = data.on(&mesh);
        let s = solve(&problem, &settings, start.as_ref()).unwrap();
        assert_exact(&problem, &s);
        assert!(s.info.kkt_residual <= 1e-12, "{:?}", s.info);
        assert_eq!(s.info.solver, "active-set");
        solves.push(s.info.iterations);
        if level + 1 == count {
            println!("{:?} solves, {} vertices", solves, problem.order());
            return (solves, s);
        }
        let marked = mark(&mesh, &s);
        let refined = mesh.refine(&marked, Children::Four).unwrap();
        start = Some(Start::prolong(&s, &mesh, refined.old_vertices));
    }
    unreachable!("at least one level")
}

fn everything(mesh: &Mesh, _: &Solution) -> Vec<fem_core::TriangleId> {
    mesh.triangle_ids().collect()
}

#[test]
fn manufactured_problems_to_a_hundred_thousand_vertices() {
    type Load = fn(usize, f64, f64) -> f64;
    let cases: [(Load, f64); 2] = [(smooth_action, 2.0), (jumping_action, 1.0)];
    for (load, m2) in cases {
        let data = Data {
            tensions: [ONE, &|_, _| m2],
            loads: [&|x, y| load(0, x, y), &|x, y| load(1, x, y)],
            heights: [ZERO, ZERO],
        };
        let (solves, s) = levels(&data, square(10), 6, true, everything);
        assert!(solves.iter().all(|&n| n <= 5), "{solves:?}");
        // The exact displacements and contact set: the formulas above, to the discretisation error.
        let mut mesh = square(10);
        for _ in 1..6 {
            mesh.refine_uniformly(Children::Four).unwrap();
        }
        for (j, p) in mesh.points().iter().enumerate() {
            let [x, y] = *p;
            let shape = (1.0 - x * x) * (1.0 - y * y);
            let (upper, lower) = if m2 == 2.0 {
                let q = (x * x + y * y - 0.25).max(0.0);
                (
                    shape / 3.0 * (1.0 + 2.0 * q * q),
                    shape / 3.0 * (1.0 - q * q),
                )
            } else {
                let q = ((x - 0.23).powi(2) + (y + 0.17).powi(2) - 0.1681).max(0.0);
                (shape / 2.0 * (1.0 + q * q), shape / 2.0 * (1.0 - q * q))
            };
            assert!((s.displacement[0][j] - upper).abs() < 2e-4, "{x} {y}");
            assert!((s.displacement[1][j] - lower).abs() < 2e-4, "{x} {y}");
        }
    }
}

fn islands(x: f64, y: f64) -> f64 {
    let p = 4.0 * std::f64::consts::PI;
    60.0 * (p * x).sin() * (p * y).sin() - 15.0
}

#[test]
fn contact_islands_on_uniform_meshes() {
    let wave: Function = &|x, y| 1.0 + 0.5 * (3.0 * x + y).sin();
    let cases: [([Function; 2], usize); 3] = [
        ([ONE, ONE], 6),
        ([wave, &|x, y| 2.0 * wave(x, y)], 5),
        ([wave, &|x, y| 2.0 - (x * y - x).cos()], 5),
    ];
    for (tensions, count) in cases {
        let data = Data {
            tensions,
            loads: [&islands, ZERO],
            heights: [&|_, _| 0.3, ZERO],
        };
        let (solves, s) = levels(&data, square(10), count, true, everything);
        assert!(s.contact.iter().filter(|&&c| c).count() > 500);
        assert!(solves.iter().all(|&n| n <= 5), "{solves:?}");
    }
}

#[test]
fn contact_islands_on_graded_meshes() {
    let data = Data {
        tensions: [ONE, &|_, _| 2.0],
        loads: [&islands, ZERO],
        heights: [&|_, _| 0.1, ZERO],
    };
    // Along the free boundary, where the set has to be found anew.
    let mark = |mesh: &Mesh, s: &Solution| {
        let inside = |v: VertexId| s.contact[v.index()];
        mesh.triangle_ids()
            .filter(|t| {
                let count = mesh.triangles()[t.index()]
                    .iter()
                    .filter(|&&v| inside(v))
                    .count();
                (1..3).contains(&count) || t.index() % 16 == 0
            })
            .collect()
    };
    let (solves, _) = levels(&data, distorted(10, 0.3, 4), 7, true, mark);
    assert!(solves.iter().all(|&n| n <= 6), "{solves:?}");
}

#[test]
fn a_cold_start_on_a_fine_mesh_needs_few_solves() {
    let data = Data {
        tensions: [ONE, &|_, _| 2.0],
        loads: [&islands, ZERO],
        heights: [&|_, _| 0.3, ZERO],
    };
    for n in [40, 80, 160] {
        let problem = data.on(&square(n));
        let settings = Settings {
            solver: Solver::ActiveSet,
            ..Settings::default()
        };
        let s = solve(&problem, &settings, None).unwrap();
        // The plain update needs 8 with 64 cells a side and 19 with 256.
        assert!(s.info.iterations <= 8, "{:?}", s.info);
    }
}

#[test]
fn the_answer_does_not_depend_on_the_start() {
    let data = Data {
        tensions: [ONE, &|x, y| 1.5 + x * y],
        loads: [&islands, ZERO],
        heights: [&|_, _| 0.1, ZERO],
    };
    let problem = data.on(&distorted(20, 0.4, 8));
    let settings = Settings::default();
    let cold = solve(&problem, &settings, None).unwrap();
    let n = problem.order();
    for (value, touching) in [(0.0, false), (0.0, true), (-7.0, true), (1e6, false)] {
        let start = Start {
            displacement: [vec![value; n], vec![-0.5 * value; n]],
            force: None,
            sigma: None,
            first_cycle: None,
            contact: vec![touching; n],
        };
        let warm = solve(&problem, &settings, Some(&start)).unwrap();
        assert_exact(&problem, &warm);
        assert_eq!(warm.contact, cold.contact);
        assert!(difference(&cold, &warm) <= 1e-13);
    }
}

#[test]
fn prolongation_takes_means_and_keeps_contact_between_contacts() {
    let data = Data {
        tensions: [ONE, ONE],
        loads: [&|x, _| -1.0 - x, ZERO],
        heights: [&|x, _| if x < 0.0 { 0.0 } else { x }, ZERO],
    };
    let mut mesh = square(8);
    let problem = data.on(&mesh);
    let s = solve(&problem, &Settings::default(), None).unwrap();
    assert!(s.contact.contains(&true));
    let old = mesh.refine_uniformly(Children::Four).unwrap().old_vertices;
    let start = Start::prolong(&s, &mesh, old);
    assert_eq!(start.contact.len(), mesh.vertex_count());
    let mut through_boundary = 0;
    for (j, birth) in mesh.genealogy().iter().enumerate() {
        if j < old {
            assert_eq!(start.displacement[0][j], s.displacement[0][j]);
            assert_eq!(start.contact[j], s.contact[j]);
            continue;
        }
        let [a, b] = birth.parents.map(|p| p.index());
        for u in &start.displacement {
            assert_eq!(u[j], 0.5 * (u[a] + u[b]));
        }
        let touches = |p: usize| {
            start.contact[p]
                || mesh.boundary()[p] && start.displacement[0][p] == start.displacement[1][p]
        };
        let expected = touches(a) && touches(b) && !mesh.boundary()[j];
        assert_eq!(start.contact[j], expected);
        through_boundary += usize::from(expected && (mesh.boundary()[a] || mesh.boundary()[b]));
    }
    assert!(through_boundary > 0);
}
