//! What must not change the digits, and what data are refused.

mod common;

use common::{Data, Function, assert_exact, difference, distorted, square, square_mapped};
use contact::{DiscreteProblem, Settings, Solution, SolveError, Solver, Start, solve};

const ZERO: Function = &|_, _| 0.0;
const ONE: Function = &|_, _| 1.0;

fn islands(x: f64, y: f64) -> f64 {
    let p = 4.0 * std::f64::consts::PI;
    60.0 * (p * x).sin() * (p * y).sin() - 15.0
}

fn settings(reduce: bool) -> Settings {
    Settings {
        solver: Solver::ActiveSet,
        reduce,
        ..Settings::default()
    }
}

const WAVE: Function = &|x, y| 1.0 + 0.5 * (3.0 * x + y).sin();
const OTHER: Function = &|x, y| 2.0 - (x * y - x).cos();

/// The three models, tensions times 4^k and loads times 2^l.
fn scaled(model: usize, k: i32, l: i32) -> DiscreteProblem {
    let (t, f) = (4f64.powi(k), 2f64.powi(l));
    let tensions: [Function; 2] = match model {
        0 => [ONE, &|_, _| 3.0],
        1 => [WAVE, &|x, y| 4.0 * WAVE(x, y)],
        _ => [WAVE, OTHER],
    };
    let data = Data {
        tensions: [&|x, y| t * tensions[0](x, y), &|x, y| t * tensions[1](x, y)],
        loads: [&|x, y| f * islands(x, y), &|x, _| f * x],
        heights: [&|_, _| 0.3 * (f / t), ZERO],
    };
    data.on(&distorted(24, 0.4, 6))
}

#[test]
fn powers_of_two_change_exponents_only() {
    for model in 0..3 {
        for reduce in [true, false] {
            let a = solve(&scaled(model, 0, 0), &settings(reduce), None).unwrap();
            assert!(a.contact.contains(&true));
            for (k, l) in [(1, 0), (0, 1), (-3, 5), (40, -77), (-60, 33)] {
                let b = solve(&scaled(model, k, l), &settings(reduce), None).unwrap();
                let (u, z) = (2f64.powi(l - 2 * k), 2f64.powi(l));
                assert_eq!(a.contact, b.contact);
                assert_eq!(a.info.iterations, b.info.iterations);
                assert_eq!(a.info.kkt_residual, b.info.kkt_residual);
                for j in 0..a.force.len() {
                    for i in 0..2 {
                        assert_eq!(a.displacement[i][j] * u, b.displacement[i][j]);
                    }
                    assert_eq!(a.force[j] * z, b.force[j]);
                    assert_eq!(a.sigma[j] * z, b.sigma[j]);
                }
            }
        }
    }
}

#[test]
fn the_same_problem_gives_the_same_bits() {
    let same = |a: &Solution, b: &Solution| {
        a.displacement == b.displacement
            && a.force == b.force
            && a.sigma == b.sigma
            && a.contact == b.contact
            && a.info == b.info
    };
    for model in 0..3 {
        let problem = scaled(model, 0, 0);
        let a = solve(&problem, &settings(true), None).unwrap();
        let b = std::thread::spawn(move || solve(&problem, &settings(true), None).unwrap())
            .join()
            .unwrap();
        assert!(same(&a, &b));
    }
}

#[test]
fn needles_and_steep_gradings() {
    // Flat cells, cells that shrink geometrically towards a side, and both with diagonals by lot.
    let flat = square_mapped(20, |_, _, [x, y]| [x, 1e-4 * y]);
    let graded = square_mapped(20, |r, _, [x, y]| {
        [
            x,
            if r == 0 {
                y
            } else {
                -1.0 + 2.0 * 0.25f64.powi(20 - r as i32)
            },
        ]
    });
    let sheared = square_mapped(20, |_, _, [x, y]| [x + 30.0 * y, y]);
    for mesh in [flat, graded, sheared, distorted(20, 5.0, 12)] {
        // Lifts by a wave, presses by more than it can lift.
        let data = Data {
            tensions: [WAVE, OTHER],
            loads: [&islands, ZERO],
            heights: [&|x, _| 1e-10 * (2.0 + x.sin()), ZERO],
        };
        let constant = Data {
            tensions: [ONE, &|_, _| 2.0],
            ..data
        };
        for data in [data, constant] {
            let problem = data.on(&mesh);
            let a = solve(&problem, &settings(true), None).unwrap();
            let b = solve(&problem, &settings(false), None).unwrap();
            for s in [&a, &b] {
                assert_exact(&problem, s);
                assert!(s.info.kkt_residual <= 1e-12, "{:?}", s.info);
            }
            assert!(a.contact.contains(&true));
            let d = difference(&a, &b);
            assert!(d <= 1e-11, "{d:e}");
        }
    }
}

#[test]
fn jumps_of_the_tensions() {
    let board: Function = &|x, y| {
        if ((4.0 * x).floor() + (4.0 * y).floor()) as i64 % 2 == 0 {
            1.0
        } else {
            1e4
        }
    };
    let lines: Function = &|x, _| if x > 0.1 { 1e-3 } else { 1.0 };
    let data = Data {
        tensions: [board, lines],
        loads: [&islands, ZERO],
        heights: [&|_, _| 1e-4, ZERO],
    };
    let problem = data.on(&square(40));
    let s = solve(&problem, &settings(true), None).unwrap();
    assert_exact(&problem, &s);
    assert!(s.contact.contains(&true));
    assert!(s.info.kkt_residual <= 1e-12, "{:?}", s.info);
}

#[test]
fn senseless_data_are_refused_by_name() {
    let data = Data {
        tensions: [ONE, &|_, _| 2.0],
        loads: [&islands, ZERO],
        heights: [&|_, _| 0.3, ZERO],
    };
    let fine = data.on(&square(6));
    let n = fine.order();
    let inside = fine.boundary().iter().position(|b| !b).unwrap();
    let fails = |problem: &DiscreteProblem, start: Option<&Start>| {
        solve(problem, &Settings::default(), start).unwrap_err()
    };

    let mut bad = fine.clone();
    bad.loads[1].nodal[inside] = f64::NAN;
    assert_eq!(
        fails(&bad, None),
        SolveError::NotFinite {
            what: "lower load",
            vertex: inside
        }
    );

    let mut bad = fine.clone();
    bad.heights[0][0] = -1.0;
    assert_eq!(
        fails(&bad, None),
        SolveError::HeightsCross {
            vertex: 0,
            upper: -1.0,
            lower: 0.0
        }
    );

    let start = Start {
        displacement: [vec![0.0; n], vec![0.0; n]],
        force: None,
        sigma: None,
        first_cycle: None,
        contact: vec![false; n - 1],
    };
    assert_eq!(
        fails(&fine, Some(&start)),
        SolveError::Length {
            what: "start of the contact set",
            expected: n,
            found: n - 1
        }
    );

    // A negative tension: not a minimisation problem.
    let bad = Data {
        tensions: [&|_, _| -1.0, &|x, _| 1.0 + x * x],
        ..data
    };
    assert!(matches!(
        fails(&bad.on(&square(6)), None),
        SolveError::NotPositiveDefinite { vertex } if !fine.boundary()[vertex]
    ));
    let text = fails(&bad.on(&square(6)), None).to_string();
    assert!(text.contains("not positive definite"), "{text}");
}
