//! The certificate: against the values of an independent program, and above the true error everywhere.

use estimate::{Certificate, Given, Grade, certify};
use fem_core::scale::times_power_of_two;

use crate::cases::solve;
use crate::reference::{NAMES, Reference};

/// The certificate of a level.
fn certificate(
    problem: &adapt::Problem,
    level: &adapt::Level,
    grade: Grade,
    poincare: f64,
) -> Certificate {
    let given = Given {
        mesh: &level.mesh,
        load: [&*problem.load[0], &*problem.load[1]],
        tension: [&*problem.tension[0], &*problem.tension[1]],
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
        let level = solve(&reference.problem);
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
