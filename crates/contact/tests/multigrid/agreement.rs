//! The same answers as the active set method and the interior-point method.

use contact::{DiscreteProblem, Settings, Solution, Solver, Tolerance, kkt_residual, solve};

use crate::common::{Data, Function, assert_exact, difference, square};
use crate::problems::*;

/// Contact sets agree wherever gap or multiplier say clearly which it is.
fn assert_same_contact(problem: &DiscreteProblem, a: &Solution, b: &Solution) {
    let unit = crate::common::unit(a);
    for j in 0..problem.order() {
        let strict = |s: &Solution| {
            let pressed = s.force[j] / problem.harmonic_diagonal(j);
            s.gap(j).max(pressed) > 1e-12 * unit
        };
        if !problem.boundary()[j] && strict(a) && strict(b) {
            assert_eq!(a.contact[j], b.contact[j], "vertex {j}");
        }
    }
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |m: f64, v| m.max(v.abs()))
}

/// |K sigma - z| over |z|, Euclidean norms, and what rounding of K sigma alone makes of it.
fn riesz_residual(problem: &DiscreteProblem, s: &Solution) -> (f64, f64) {
    let (mut rest, mut size, mut rounding) = (0.0, 0.0, 0.0);
    for j in (0..problem.order()).filter(|&j| !problem.boundary()[j]) {
        let r = s.force[j] - problem.laplacian().row_dot(j, &s.sigma);
        rest += r * r;
        size += s.force[j] * s.force[j];
        rounding += problem.laplacian().row_dot_abs(j, &s.sigma).powi(2);
    }
    if size == 0.0 {
        return (rest, 0.0);
    }
    (
        (rest / size).sqrt(),
        f64::EPSILON * (rounding / size).sqrt(),
    )
}

fn compare(data: &Data, corner: bool, reduce: bool) {
    let mesh = if corner { lshape(8) } else { square(8) };
    adaptively(data, mesh, 4_000, 0.5, |stage| {
        let problem = stage.problem;
        let settings = multigrid(Tolerance::Relative(1e-12), reduce);
        let s = solve(problem, &settings, stage.start).expect("a solution");
        assert_eq!(s.info.solver, "multigrid", "{:?}", s.info);
        assert_exact(problem, &s);
        // Measured on the slots of the hierarchy; here on rows, so that rounding differs.
        let by_rows = kkt_residual(problem, &s.displacement, &s.force);
        let apart = (s.info.kkt_residual - by_rows).abs();
        assert!(
            apart <= 1e-15 + 1e-3 * by_rows,
            "{:e} {by_rows:e}",
            s.info.kkt_residual
        );
        let by = |solver: Solver| {
            let settings = Settings {
                solver,
                tolerance: Tolerance::Balanced,
                ..settings
            };
            solve(problem, &settings, stage.start).expect("a solution")
        };
        let exact = by(Solver::ActiveSet);
        let apart = difference(&s, &exact);
        assert!(apart <= 1e-9, "{apart:e}");
        let size = largest(&exact.force);
        for (a, b) in s.force.iter().zip(&exact.force) {
            assert!((a - b).abs() <= 1e-9 * size, "{a:e} {b:e}");
        }
        let size = largest(&exact.sigma);
        for (a, b) in s.sigma.iter().zip(&exact.sigma) {
            assert!((a - b).abs() <= 1e-9 * size, "{a:e} {b:e}");
        }
        let (rest, rounding) = riesz_residual(problem, &s);
        assert!(rest <= 1e-12 + 4.0 * rounding, "{rest:e} {rounding:e}");
        assert_same_contact(problem, &s, &exact);
        assert_eq!(s.info.reduction, exact.info.reduction);
        let second = by(Solver::Clarabel);
        for j in 0..problem.order() {
            assert!(second.gap(j) >= 0.0 && exact.gap(j) >= 0.0);
        }
        assert!(difference(&s, &second) <= 1e-6);
    });
}

#[test]
fn constant_tensions() {
    let heights: [[Function; 2]; 2] = [[ZERO, ZERO], [&|x, _| 0.2 + 0.1 * x, &|_, y| 0.05 * y]];
    for heights in heights {
        for reduce in [true, false] {
            let data = Data {
                tensions: [ONE, &|_, _| 2.0],
                loads: [&|x, y| smooth_action(0, x, y), &|x, y| {
                    smooth_action(1, x, y)
                }],
                heights,
            };
            compare(&data, false, reduce);
            let data = Data {
                tensions: [&|_, _| 3.0, ONE],
                loads: [&|_, _| -6.0, ZERO],
                heights: [&|x, _| 0.06 + 0.01 * x, ZERO],
            };
            compare(&data, true, reduce);
        }
    }
}

#[test]
fn variable_tensions() {
    let smooth: Function = &|x, y| 1.0 + 0.5 * x * y;
    let twice: Function = &|x, y| 2.0 + x * y;
    let other: Function = &|x, y| 2.0 + x + 0.3 * y;
    let jump: Function = &|x, _| if x > 0.0 { 50.0 } else { 1.0 };
    for tensions in [[smooth, twice], [smooth, other], [jump, ONE], [ONE, jump]] {
        let data = Data {
            tensions,
            loads: [&islands, ZERO],
            heights: [&|_, _| 0.1, ZERO],
        };
        compare(&data, false, true);
    }
}

#[test]
fn no_contact_and_full_contact() {
    for (upper, lower, height) in [(5.0, -3.0, 0.0), (-9.0, 4.0, 0.0), (5.0, -3.0, 0.3)] {
        for reduce in [true, false] {
            let data = Data {
                tensions: [ONE, &|x, _| 2.0 + 0.0 * x],
                loads: [&|_, _| upper, &|_, _| lower],
                heights: [&|_, _| height, ZERO],
            };
            compare(&data, false, reduce);
        }
    }
}
