//! The models agree with each other, and each is taken where it applies.

mod common;

use common::{Data, Function, Random, assert_exact, difference, distorted, square, unit};
use contact::{
    DiscreteProblem, Reduction, Settings, Solution, Solver, Start, kkt_residual, rounding_residual,
    solve,
};

const ZERO: Function = &|_, _| 0.0;
const ONE: Function = &|_, _| 1.0;

fn settings(reduce: bool) -> Settings {
    Settings {
        solver: Solver::ActiveSet,
        reduce,
        ..Settings::default()
    }
}

fn solved(problem: &DiscreteProblem, reduce: bool) -> Solution {
    let s = solve(problem, &settings(reduce), None).unwrap();
    assert_exact(problem, &s);
    // The record tells the truth about what is returned.
    assert_eq!(
        s.info.kkt_residual,
        kkt_residual(problem, &s.displacement, &s.force)
    );
    s
}

/// Islands of contact: a load that presses and lifts in turn.
fn islands(x: f64, y: f64) -> f64 {
    let p = 4.0 * std::f64::consts::PI;
    60.0 * (p * x).sin() * (p * y).sin() - 15.0
}

/// The reduced and the two-field form agree to 1e-12 and name what they did.
fn assert_agreement(problem: &DiscreteProblem, expected: Reduction) -> [Solution; 2] {
    let (a, b) = (solved(problem, true), solved(problem, false));
    assert_eq!(a.info.reduction, expected);
    assert_eq!(b.info.reduction, Reduction::TwoField);
    assert_eq!(a.contact, b.contact);
    let d = difference(&a, &b);
    assert!(d <= 1e-12, "{d:e}");
    for s in [&a, &b] {
        let allowed = rounding_residual(problem, &s.displacement, &s.force).max(1e-12);
        assert!(s.info.kkt_residual <= allowed, "{:?} {allowed:e}", s.info);
    }
    let largest = a.force.iter().fold(0.0f64, |m, z| m.max(z.abs()));
    for j in 0..problem.order() {
        let scale = largest.max(problem.harmonic_diagonal(j) * unit(&a));
        assert!((a.force[j] - b.force[j]).abs() <= 1e-11 * scale);
    }
    [a, b]
}

#[test]
fn constant_tensions_agree_with_two_fields_at_every_ratio() {
    for seed in [1, 2] {
        let mesh = distorted(20, 0.4, seed);
        for exponent in [-12, -9, -6, -3, -1, 0, 1, 3, 6, 9, 12] {
            let m = 10f64.powi(exponent);
            let k = m / (1.0 + m);
            // Displacements of order one whatever the ratio.
            let press = |x: f64, y: f64| if x * x + y * y < 0.25 { 4.0 } else { 0.0 };
            let data = Data {
                tensions: [&|_, _| m, ONE],
                loads: [
                    &|x, y| m * (1.0 + x) + k * islands(x, y) - press(x, y),
                    &|x, y| (1.0 + x) - k * islands(x, y) + press(x, y),
                ],
                heights: [&|x, _| 0.1 + 0.05 * x, ZERO],
            };
            let problem = data.on(&mesh);
            let [a, _] = assert_agreement(&problem, Reduction::ConstantTensions);
            let touching = a.contact.iter().filter(|&&c| c).count();
            assert!(touching > 20, "{touching}");
            if exponent >= -4 {
                assert!(a.info.kkt_residual <= 1e-12, "{exponent} {:?}", a.info);
            }
        }
    }
}

#[test]
fn loads_of_order_one_on_tensions_of_any_ratio() {
    // The stiff membrane hardly moves: the soft one is all there is to see.
    let mesh = distorted(16, 0.3, 7);
    for exponent in [-12, -8, -4, 0, 4, 8, 12] {
        let m = 10f64.powi(exponent);
        let data = Data {
            tensions: [&|_, _| m, ONE],
            loads: [&islands, &|x, y| -0.5 * islands(y, x)],
            heights: [&|_, _| 0.01, ZERO],
        };
        assert_agreement(&data.on(&mesh), Reduction::ConstantTensions);
    }
}

#[test]
fn variable_tensions_in_a_constant_ratio_agree_with_two_fields() {
    let wave: Function = &|x, y| 1.0 + 0.9 * (3.0 * x + 2.0 * y).sin();
    let jump: Function = &|x, y| if x * y > 0.0 { 1000.0 } else { 1.0 };
    let mesh = distorted(24, 0.4, 3);
    for c in [1e-12, 1e-3, 0.3, 1.0, 7.0, 1e6] {
        for tension in [wave, jump] {
            let k = c / (1.0 + c);
            let data = Data {
                tensions: [tension, &|x, y| c * tension(x, y)],
                loads: [
                    &|x, y| tension(x, y) * (1.0 + k * islands(x, y)),
                    &|x, y| tension(x, y) * (c - k * islands(x, y)),
                ],
                heights: [&|_, _| 0.05, ZERO],
            };
            assert_agreement(&data.on(&mesh), Reduction::ConstantRatio);
        }
    }
}

#[test]
fn unrelated_tensions_are_two_fields() {
    let mesh = distorted(20, 0.4, 5);
    let data = Data {
        tensions: [&|x, y| 1.0 + 0.5 * (x + y).sin(), &|x, y| {
            2.0 - (x * y).cos()
        }],
        loads: [&islands, ONE],
        heights: [&|_, _| 0.05, ZERO],
    };
    let problem = data.on(&mesh);
    let s = solved(&problem, true);
    assert_eq!(s.info.reduction, Reduction::TwoField);
    assert_eq!(s.info.unknowns, 2 * 19 * 19);
    assert!(s.info.kkt_residual <= 1e-12);
}

#[test]
fn no_contact_is_one_solve_without_forces() {
    let mesh = distorted(20, 0.4, 5);
    let tensions: [[Function; 2]; 3] = [
        [ONE, &|_, _| 2.0],
        [&|x, _| 1.5 + x, &|x, _| 3.0 + 2.0 * x],
        [&|x, _| 1.5 + x, &|_, y| 1.5 + y],
    ];
    for tensions in tensions {
        let data = Data {
            tensions,
            loads: [ONE, &|_, _| -1.0],
            heights: [ZERO, ZERO],
        };
        let problem = data.on(&mesh);
        let s = solved(&problem, true);
        assert_eq!(s.info.reduction, Reduction::NoContact);
        assert_eq!((s.info.iterations, s.info.unknowns), (1, 2 * 19 * 19));
        assert!(s.force.iter().chain(&s.sigma).all(|&v| v == 0.0));
        assert!(!s.contact.contains(&true));
        assert!(s.info.kkt_residual <= 1e-14);
        let two = solved(&problem, false);
        assert_eq!(two.info.reduction, Reduction::TwoField);
        assert!(difference(&s, &two) <= 1e-12);
    }
}

#[test]
fn full_contact_is_one_solve_with_the_sum_of_the_matrices() {
    let mesh = distorted(20, 0.4, 5);
    let g: Function = &|x, y| 0.3 * x - 0.1 * y * y;
    let tensions: [[Function; 2]; 3] = [
        [ONE, &|_, _| 2.0],
        [&|x, _| 1.5 + x, &|x, _| 3.0 + 2.0 * x],
        [&|x, _| 1.5 + x, &|_, y| 1.5 + y],
    ];
    for tensions in tensions {
        let data = Data {
            tensions,
            loads: [&|x, _| -6.0 - x, &|_, y| 5.0 + y],
            heights: [g, g],
        };
        let problem = data.on(&mesh);
        let s = solved(&problem, true);
        assert_eq!(s.info.reduction, Reduction::FullContact);
        assert_eq!((s.info.iterations, s.info.unknowns), (1, 19 * 19));
        assert!(s.info.kkt_residual <= 1e-14);
        for j in 0..problem.order() {
            assert_eq!(s.contact[j], !problem.boundary()[j]);
            if s.contact[j] {
                assert!(s.force[j] > 0.0);
                let sum: f64 = (0..2)
                    .map(|i| {
                        problem.loads[i].nodal[j]
                            - problem.stiffness(i).row_dot(j, &s.displacement[i])
                    })
                    .sum();
                assert!(sum.abs() < 1e-13, "{sum:e}");
            }
        }
        assert!(s.sigma.iter().any(|&v| v > 0.0));
        assert!(difference(&s, &solved(&problem, false)) <= 1e-12);
    }
}

#[test]
fn full_contact_needs_equal_heights() {
    let mesh = square(12);
    let data = Data {
        tensions: [ONE, ONE],
        loads: [&|_, _| -60.0, &|_, _| 60.0],
        heights: [&|x, _| if x > 0.99 { 1e-3 } else { 0.0 }, ZERO],
    };
    let s = solved(&data.on(&mesh), true);
    assert_eq!(s.info.reduction, Reduction::ConstantTensions);
    assert!(s.contact.contains(&true));
}

#[test]
fn contact_that_reaches_the_boundary() {
    // Equal heights on the left side only: contact sets out from there.
    let g1: Function = &|x, _| 0.2 * (x + 1.0);
    for tension in [ONE, &|x: f64, y: f64| 1.0 + x * x + y * y] {
        let data = Data {
            tensions: [tension, &|_, _| 2.0],
            loads: [&|_, _| -1.0, &|_, _| 0.5],
            heights: [g1, ZERO],
        };
        let mesh = distorted(24, 0.3, 11);
        let problem = data.on(&mesh);
        let s = solved(&problem, true);
        assert!(s.info.kkt_residual <= 1e-12);
        let neighbour = (0..problem.order()).any(|j| {
            s.contact[j]
                && problem
                    .stiffness(0)
                    .row(j)
                    .any(|(k, _)| problem.boundary()[k])
        });
        assert!(neighbour, "contact stays away from the boundary");
        assert!(difference(&s, &solved(&problem, false)) <= 1e-12);
    }
}

#[test]
fn nothing_acts_and_nothing_moves() {
    let mesh = distorted(10, 0.4, 5);
    let tensions: [[Function; 2]; 2] = [[ONE, ONE], [&|x, _| 1.5 + x, &|_, y| 1.5 + y]];
    for tensions in tensions {
        let data = Data {
            tensions,
            loads: [ZERO, ZERO],
            heights: [ZERO, ZERO],
        };
        let problem = data.on(&mesh);
        for reduce in [true, false] {
            let s = solved(&problem, reduce);
            assert_eq!(s.info.iterations, 1);
            assert_eq!(s.info.kkt_residual, 0.0);
            assert!(s.displacement.iter().flatten().all(|&v| v == 0.0));
            assert!(s.force.iter().chain(&s.sigma).all(|&v| v == 0.0));
        }
    }
}

#[test]
fn equal_loads_touch_without_force_and_do_not_flicker() {
    // u1 = u2 in exact arithmetic, so gap and force are nothing but rounding.
    for seed in 0..6 {
        let mesh = distorted(24, 0.5, seed);
        let mut random = Random(seed);
        let (a, b) = (random.between(-3.0, 3.0), random.between(-3.0, 3.0));
        let f: Function = &|x, y| 1.0 + a * x + b * (7.0 * y).sin();
        let tensions: [[Function; 2]; 2] = [[ONE, ONE], [&|x, _| 1.5 + x, &|x, _| 1.5 + x]];
        for tensions in tensions {
            let data = Data {
                tensions,
                loads: [f, f],
                heights: [&|x, y| x + y * y, &|x, y| x + y * y],
            };
            let problem = data.on(&mesh);
            for reduce in [true, false] {
                let s = solved(&problem, reduce);
                assert!(s.info.iterations <= 2, "{:?}", s.info);
                assert!(s.info.kkt_residual <= 1e-14, "{:?}", s.info);
                let u = unit(&s);
                for j in 0..problem.order() {
                    assert!(s.gap(j) <= 1e-13 * u);
                    assert!(s.force[j] <= 1e-13 * u * problem.harmonic_diagonal(j).max(1e-3));
                }
                // A second solve from there changes nothing.
                let start = Start {
                    displacement: s.displacement.clone(),
                    force: None,
                    sigma: None,
                    first_cycle: None,
                    contact: s.contact.clone(),
                };
                let again = solve(&problem, &settings(reduce), Some(&start)).unwrap();
                assert!(again.info.iterations <= 2, "{:?}", again.info);
            }
        }
    }
}

#[test]
fn loads_in_proportion_to_the_tensions_cancel_in_the_gap() {
    // F_1/t_1 = F_2/t_2 up to rounding: the gap is that of the boundary, everywhere above zero.
    let mesh = distorted(16, 0.4, 2);
    let f: Function = &|x, y| (5.0 * x).sin() + y;
    let data = Data {
        tensions: [&|_, _| 0.3, &|_, _| 0.7],
        loads: [&|x, y| 0.3 * f(x, y), &|x, y| 0.7 * f(x, y)],
        heights: [ZERO, ZERO],
    };
    let s = solved(&data.on(&mesh), true);
    assert_eq!(s.info.iterations, 1);
    assert!(s.force.iter().all(|&z| z == 0.0));
    assert_eq!(s.displacement[0], s.displacement[1]);
}

#[test]
fn meshes_without_interior_vertices() {
    let data = Data {
        tensions: [ONE, &|x, _| 2.0 + x],
        loads: [ONE, ONE],
        heights: [&|x, _| 3.0 + x, &|_, y| y],
    };
    let corners = vec![[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
    let mesh = fem_core::Mesh::new(corners, &[[0, 1, 2]], &[], None).unwrap();
    let problem = data.on(&mesh);
    for solver in [Solver::Auto, Solver::ActiveSet, Solver::Clarabel] {
        for reduce in [true, false] {
            let s = solve(
                &problem,
                &Settings {
                    solver,
                    reduce,
                    ..Settings::default()
                },
                None,
            )
            .unwrap();
            assert_eq!(s.displacement, problem.heights);
            assert_eq!(s.info.unknowns, 0);
            assert_eq!(s.info.kkt_residual, 0.0);
        }
    }
}

#[test]
fn one_interior_vertex_is_solved_by_hand() {
    let mesh = square(2);
    let data = Data {
        tensions: [ONE, &|_, _| 3.0],
        loads: [&|_, _| -8.0, &|_, _| 8.0],
        heights: [&|_, _| 0.25, ZERO],
    };
    let problem = data.on(&mesh);
    let centre = problem.boundary().iter().position(|b| !b).unwrap();
    let (d1, d2) = (problem.diagonal(0, centre), problem.diagonal(1, centre));
    let (f1, f2) = (
        problem.loads[0].nodal[centre] + d1 * 0.25,
        problem.loads[1].nodal[centre],
    );
    // Free: u1 = f1/d1, u2 = f2/d2 cross, so both are (f1 + f2)/(d1 + d2).
    assert!(f1 / d1 < f2 / d2);
    let u = (f1 + f2) / (d1 + d2);
    for reduce in [true, false] {
        let s = solved(&problem, reduce);
        assert!((s.displacement[0][centre] - u).abs() < 1e-14);
        assert!((s.force[centre] - (d1 * u - f1)).abs() < 1e-13);
        assert!((s.sigma[centre] - s.force[centre] / d1).abs() < 1e-13);
    }
}
