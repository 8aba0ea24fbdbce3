//! The certificate: against the values of an independent program, and above the true error everywhere.

use adapt::settings::{Estimator, Final, Strategy};
use estimate::certificate::POINCARE;
use estimate::{Certificate, Given, Grade, Moments, certify};
use fem_core::scale::times_power_of_two;

use crate::cases::{Grid, levels, on, solve, uniform};
use crate::reference::{NAMES, Reference};

/// The certificate of a level.
fn certificate(
    problem: &adapt::Problem,
    level: &adapt::Level,
    grade: Grade,
    poincare: f64,
) -> Certificate {
    let load = [&*problem.load[0], &*problem.load[1]];
    let tension = [&*problem.tension[0], &*problem.tension[1]];
    let mean = &level.discrete.tension_mean;
    let moments = match &level.moments {
        Some(moments) => moments.clone(),
        None => Moments::of(&level.mesh, load, tension, mean).expect("good data"),
    };
    let given = Given {
        mesh: &level.mesh,
        load,
        tension,
        moments: &moments,
        tension_mean: &level.discrete.tension_mean,
        displacement: &level.solution.displacement,
        force: &level.solution.force,
    };
    certify(&given, grade, poincare).expect("good data")
}

#[test]
fn against_the_reference() {
    for name in NAMES {
        let reference = Reference::read(name);
        let mut level = solve(&reference.problem);
        if std::env::var("FILE").is_ok() {
            level.solution =
                contact::solve(&reference.discrete(), &contact::Settings::default(), None)
                    .expect("solved");
        }
        let scale = reference.problem.scale;
        for (grade, key) in [(Grade::Rt0, "rt0_corrected"), (Grade::Rt1, "rt1_corrected")] {
            let found = certificate(&reference.problem, &level, grade, std::f64::consts::PI);
            let wanted = |k: &str| {
                reference.values["totals"][key][k]
                    .as_f64()
                    .expect("a number")
            };
            let e = scale.energy_norm();
            let relative = |found: f64, e: i32, wanted: f64| {
                let found = times_power_of_two(found, e);
                if wanted == 0.0 {
                    found
                } else {
                    found / wanted - 1.0
                }
            };
            println!(
                "{name} {key}: eta {:9.1e} C {:9.1e} bound {:9.1e}; eta_alg/eta {:.1e}",
                relative(found.eta, e, wanted("eta")),
                relative(found.contact, 2 * e, wanted("C")),
                relative(found.bound, e, wanted("bound")),
                found.algebraic / found.eta,
            );
        }
    }
}

/// Grids of every case: the domain's own, and a second family on the square.
pub fn grids(name: &str) -> Vec<(&'static str, Grid)> {
    match name {
        "P1" => vec![("disk", Grid::disk(8))],
        "P3" => vec![("lshape", Grid::lshape(4))],
        _ => vec![("right", Grid::right(4)), ("cross", Grid::cross(4))],
    }
}

const CASES: [&str; 14] = [
    "P1", "P2", "P3", "P4a", "P4b", "P4c", "P5", "P6", "P6b", "P6c", "P7", "P7c", "P7l", "P8",
];

#[test]
fn effectivity_explore() {
    for name in CASES {
        for (family, grid) in grids(name) {
            for adaptive in [false, true] {
                let problem = on(name, &grid, usize::from(name == "P1"));
                let mut settings = uniform(6);
                settings.estimate.estimator = Estimator::Certified;
                settings.estimate.last = Final::Fast;
                if adaptive {
                    settings.mark.strategy = Strategy::Doerfler;
                    settings.stop.levels = None;
                    settings.stop.vertices = Some(6000);
                }
                for level in levels(&problem, &settings) {
                    let error = level.estimates.errors.as_ref().expect("exact").energy;
                    let a = level.estimates.certificate.as_ref().expect("certified");
                    let b = certificate(&problem, &level, Grade::Rt1, POINCARE);
                    println!(
                        "{name:4} {family:6} {} {:6} error {error:9.3e} a {:6.3} b {:6.3} C/eta2 {:8.1e} alg/eta {:8.1e}",
                        if adaptive { "adaptive" } else { "uniform " },
                        level.mesh.vertex_count(),
                        a.bound / error,
                        b.bound / error,
                        b.contact / b.eta.powi(2),
                        b.algebraic / b.eta,
                    );
                }
            }
        }
    }
}
