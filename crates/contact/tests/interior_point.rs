//! The interior-point method as an independent witness of the active set method.

mod common;

use common::{Data, Function, difference, distorted, unit};
use contact::{
    DiscreteProblem, Reduction, Settings, Solution, SolveError, Solver, Tolerance, solve,
};

const ZERO: Function = &|_, _| 0.0;
const ONE: Function = &|_, _| 1.0;

fn run(problem: &DiscreteProblem, solver: Solver, reduce: bool) -> Solution {
    let settings = Settings {
        solver,
        reduce,
        ..Settings::default()
    };
    solve(problem, &settings, None).unwrap()
}

/// Both methods agree: displacements to 1e-6, and the contact sets wherever contact or its absence is not in doubt.
fn assert_witness(problem: &DiscreteProblem) {
    for reduce in [true, false] {
        let a = run(problem, Solver::ActiveSet, reduce);
        let c = run(problem, Solver::Clarabel, reduce);
        assert_eq!((a.info.solver, c.info.solver), ("active-set", "clarabel"));
        assert_eq!(a.info.reduction, c.info.reduction);
        let d = difference(&a, &c);
        assert!(d <= 1e-6, "{d:e} {:?}", c.info);
        let u = unit(&a);
        let largest = a.sigma.iter().fold(0.0f64, |m, s| m.max(s.abs()));
        for j in 0..problem.order() {
            assert!(c.gap(j) >= 0.0 && c.force[j] >= 0.0);
            assert!(!c.contact[j] || c.gap(j) == 0.0);
            assert!(c.contact[j] || c.force[j] == 0.0);
            assert!((a.sigma[j] - c.sigma[j]).abs() <= 1e-5 * largest.max(u));
            if problem.boundary()[j] {
                continue;
            }
            let clear = (a.gap(j) / u).max(a.force[j] / problem.harmonic_diagonal(j) / u);
            assert!(
                a.contact[j] == c.contact[j] || clear <= 1e-6,
                "contact at {j} differs, {clear:e} from doubt"
            );
        }
    }
}

fn islands(x: f64, y: f64) -> f64 {
    let p = 4.0 * std::f64::consts::PI;
    60.0 * (p * x).sin() * (p * y).sin() - 15.0
}

#[test]
fn witnesses_every_model() {
    let wave: Function = &|x, y| 1.0 + 0.9 * (3.0 * x + 2.0 * y).sin();
    let tensions: [[Function; 2]; 3] = [
        [ONE, &|_, _| 2.0],
        [wave, &|x, y| 3.0 * wave(x, y)],
        [wave, &|x, y| 2.0 - (x * y).cos()],
    ];
    for (seed, tensions) in tensions.into_iter().enumerate() {
        let data = Data {
            tensions,
            loads: [&islands, ONE],
            heights: [&|_, _| 0.05, ZERO],
        };
        assert_witness(&data.on(&distorted(24, 0.4, seed as u64)));
    }
}

#[test]
fn witnesses_full_contact_and_none() {
    for press in [-5.0, 5.0] {
        let data = Data {
            tensions: [ONE, &|_, _| 2.0],
            loads: [&|_, _| press, &|x, _| x - press],
            heights: [ZERO, ZERO],
        };
        let problem = data.on(&distorted(16, 0.3, 3));
        assert_witness(&problem);
        let expected = if press < 0.0 {
            Reduction::FullContact
        } else {
            Reduction::NoContact
        };
        assert_eq!(
            run(&problem, Solver::Clarabel, true).info.reduction,
            expected
        );
    }
}

#[test]
fn witnesses_ratios_and_bad_units() {
    for (ratio, unit) in [(1e-4, 1.0), (1e4, 1.0), (1.0, 1e-30), (2.0, 1e40)] {
        let m = ratio * unit;
        let k = m / (1.0 + ratio);
        let data = Data {
            tensions: [&|_, _| m, &|_, _| unit],
            loads: [&|x, y| m + k * islands(x, y), &|x, y| {
                unit - k * islands(x, y)
            }],
            heights: [&|_, _| 0.05, ZERO],
        };
        assert_witness(&data.on(&distorted(14, 0.3, 9)));
    }
}

#[test]
fn degenerate_contact_is_within_reach() {
    let f: Function = &|x, y| 1.0 + x - y;
    for loads in [[ZERO, ZERO], [f, f]] {
        let data = Data {
            tensions: [ONE, ONE],
            loads,
            heights: [&|x, _| x, &|x, _| x],
        };
        let problem = data.on(&distorted(16, 0.3, 3));
        for reduce in [true, false] {
            let a = run(&problem, Solver::ActiveSet, reduce);
            let c = run(&problem, Solver::Clarabel, reduce);
            assert!(difference(&a, &c) <= 1e-6, "{:?}", c.info);
            assert!(c.info.kkt_residual <= 1e-6);
        }
    }
}

#[test]
fn a_tolerance_out_of_reach_is_refused_with_the_residual() {
    let data = Data {
        tensions: [ONE, &|_, _| 2.0],
        loads: [&islands, ONE],
        heights: [&|_, _| 0.05, ZERO],
    };
    let problem = data.on(&distorted(16, 0.4, 1));
    for solver in [Solver::Auto, Solver::ActiveSet, Solver::Clarabel] {
        let settings = Settings {
            solver,
            tolerance: Tolerance::Relative(1e-30),
            ..Settings::default()
        };
        match solve(&problem, &settings, None) {
            Err(SolveError::NotConverged {
                kkt_residual,
                tolerance,
                ..
            }) => {
                assert_eq!(tolerance, 1e-30);
                assert!(kkt_residual > 0.0 && kkt_residual < 1e-6);
            }
            other => panic!("{other:?}"),
        }
        let settings = Settings {
            tolerance: Tolerance::Relative(1e-6),
            ..settings
        };
        let s = solve(&problem, &settings, None).unwrap();
        assert!(s.info.kkt_residual <= 1e-6);
    }
}
