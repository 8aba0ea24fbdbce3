//! Fine initial meshes without a hierarchy below them: aggregates take its place.

use contact::{Solution, Start, Tolerance, solve_in};
use fem_core::{Children, Mesh};

use crate::common::{Data, Function, assert_exact, distorted, square, square_mapped};
use crate::problems::*;

/// A mesh that has forgotten how it was made.
fn imported(mesh: &Mesh) -> Mesh {
    let triangles: Vec<[u32; 3]> = mesh.triangles().iter().map(|t| t.map(|v| v.0)).collect();
    Mesh::new(mesh.points().to_vec(), &triangles, &[], None).expect("a mesh")
}

/// The mesh refined `times` times, every triangle into four, and imported.
fn fine(mut mesh: Mesh, times: usize) -> Mesh {
    for _ in 0..times {
        mesh.refine_uniformly(Children::Four).expect("refines");
    }
    imported(&mesh)
}

/// Steps of the inequality, monotone cycles among them, of the mean and of sigma on every level; `None` where the active set finished.
type Counts = Vec<Option<[usize; 4]>>;

/// Solves on the mesh and after `times` adaptive refinements to a relative KKT residual of 1e-10.
fn counts(name: &str, data: &Data, mut mesh: Mesh, times: usize) -> Counts {
    let settings = multigrid(Tolerance::Relative(1e-10), true);
    let mut workspace = contact::Workspace::default();
    let mut start: Option<Start> = None;
    let mut counts = Counts::new();
    loop {
        let problem = data.on(&mesh);
        let clock = std::time::Instant::now();
        let s: Solution =
            solve_in(&problem, &settings, start.as_ref(), &mut workspace).expect("a solution");
        assert_exact(&problem, &s);
        assert!(s.info.kkt_residual <= 1e-10, "{:?}", s.info);
        println!(
            "{name}: {} vertices {} {:?} {:.2} us a vertex",
            problem.order(),
            s.info.solver,
            s.info.cycles,
            1e6 * clock.elapsed().as_secs_f64() / problem.order() as f64
        );
        counts.push(match (s.info.solver, s.info.cycles) {
            ("multigrid", Some(c)) => Some([c.inequality, c.monotone, c.mean, c.sigma]),
            _ => None,
        });
        if counts.len() > times {
            return counts;
        }
        let squares = indicators(&mesh, &problem, &s);
        let refined = mesh.refine(&bulk(&squares, 0.5), Children::Two);
        start = Some(Start::prolong(
            &s,
            &mesh,
            refined.expect("refines").old_vertices,
        ));
    }
}

/// Problems by name: one field, two fields, jumps along edges and in checkerboards.
fn each(mut run: impl FnMut(&str, &Data)) {
    let along: Function = &|x, _| if x > 0.0 { 1e6 } else { 1.0 };
    let board = checkerboard(8, 1e6);
    let smooth: Function = &|x, y| (2.2 * (3.0 * x).sin() * (2.0 * y).cos()).exp();
    let tensions: [(&str, [Function; 2]); 6] = [
        ("constant", [ONE, ONE]),
        ("smooth, two fields", [smooth, ONE]),
        ("interface, one field", [along, along]),
        ("interface, two fields", [ONE, along]),
        ("checkerboard, one field", [&board, &board]),
        ("checkerboard, two fields", [&board, ONE]),
    ];
    for (name, tensions) in tensions {
        let data = Data {
            tensions,
            loads: [&islands, ZERO],
            heights: [&|_, _| 0.1, ZERO],
        };
        run(name, &data);
    }
}

/// The square squeezed: triangles of this aspect ratio, and the load that goes with it.
fn squeezed(n: usize, aspect: f64) -> Mesh {
    square_mapped(n, |_, _, [x, y]| [x, y / aspect])
}

#[test]
#[ignore = "prints counts and seconds"]
fn many() {
    let times: usize = std::env::var("TIMES").map_or(4, |t| t.parse().unwrap());
    let only = std::env::var("PROBLEM").unwrap_or_default();
    each(|name, data| {
        if name.contains(&only) {
            counts(name, data, fine(square(8), times), 3);
            counts(
                &format!("{name}, distorted"),
                data,
                fine(distorted(8, 0.35, 5), times),
                3,
            );
        }
    });
    for aspect in [10.0, 100.0] {
        let data = Data {
            tensions: [ONE, ONE],
            loads: [&|x, y| islands(x, y * aspect) * aspect * aspect, ZERO],
            heights: [&|_, _| 0.1, ZERO],
        };
        let name = format!("aspect {aspect}");
        if name.contains(&only) {
            counts(&name, &data, fine(squeezed(8, aspect), times), 3);
        }
    }
}
