//! Fine initial meshes without a hierarchy below them: aggregates take its place.

use contact::{Settings, Solution, Solver, Start, Tolerance, solve, solve_in};
use fem_core::{Children, Mesh};

use crate::common::{Data, Function, assert_exact, difference, distorted, square, square_mapped};
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

/// Presses the squeezed square as the square is pressed.
fn needles(aspect: f64, times: usize) -> Counts {
    let data = Data {
        tensions: [ONE, ONE],
        loads: [&|x, y| islands(x, y * aspect) * aspect * aspect, ZERO],
        heights: [&|_, _| 0.1, ZERO],
    };
    counts(
        &format!("aspect {aspect}"),
        &data,
        fine(squeezed(8, aspect), times),
        3,
    )
}

/// The square with all points moved, and cells cut by lot: slivers here and there.
fn slivers(times: usize) -> Mesh {
    distorted(8 << times, 0.35, 5)
}

#[test]
fn fine_meshes_without_a_hierarchy() {
    each(|name, data| {
        for (mesh, most) in [
            (fine(square(8), 4), [24, 8, 32, 24]),
            (slivers(4), [38, 8, 40, 38]),
        ] {
            for (level, count) in counts(name, data, mesh, 3).into_iter().enumerate() {
                let count = count.expect("multigrid to the end");
                let within = count.iter().zip(most).all(|(&c, most)| c <= most);
                assert!(within, "{name}, level {level}: {count:?}");
                assert!(level == 0 || count[1] <= 1, "{name}: {count:?}");
            }
        }
    });
}

#[test]
fn aggregates_and_the_active_set_agree() {
    let interface: Function = &|x, _| if x > 0.0 { 1e4 } else { 1.0 };
    for tensions in [[ONE, ONE], [interface, ONE]] {
        let data = Data {
            tensions,
            loads: [&islands, ZERO],
            heights: [&|_, _| 0.1, ZERO],
        };
        let problem = data.on(&slivers(4));
        let settings = multigrid(Tolerance::Relative(1e-12), true);
        let s = solve(&problem, &settings, None).expect("a solution");
        assert_eq!(s.info.solver, "multigrid");
        let direct = Settings {
            solver: Solver::ActiveSet,
            ..settings
        };
        let exact = solve(&problem, &direct, None).expect("a solution");
        let apart = difference(&s, &exact);
        println!("{apart:e} {:?}", s.info);
        assert!(apart <= 1e-9, "{apart:e}");
    }
}

#[test]
fn needles_without_a_hierarchy() {
    for aspect in [10.0, 100.0] {
        for (level, count) in needles(aspect, 4).into_iter().enumerate() {
            match count {
                Some([inequality, _, mean, sigma]) => {
                    assert!(inequality <= 60 && mean <= 60 && sigma <= 60);
                }
                // Bisected needles have obtuse angles: what is drawn together most is not what belongs together.
                None => assert!(aspect > 50.0 && level > 0, "{aspect}: level {level}"),
            }
        }
    }
}

#[test]
#[ignore = "prints counts and seconds"]
fn many() {
    let times: usize = std::env::var("TIMES").map_or(4, |t| t.parse().unwrap());
    let only = std::env::var("PROBLEM").unwrap_or_default();
    each(|name, data| {
        if name.contains(&only) {
            counts(name, data, fine(square(8), times), 3);
            counts(&format!("{name}, slivers"), data, slivers(times), 3);
        }
    });
    for aspect in [10.0, 100.0] {
        if format!("aspect {aspect}").contains(&only) {
            needles(aspect, times);
        }
    }
}
