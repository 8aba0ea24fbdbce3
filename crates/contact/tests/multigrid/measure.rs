//! Seconds and steps, on request: `cargo test --release -p membranes -p contact --test multigrid -- --ignored --nocapture`.

use contact::{Solver, Tolerance, solve};

use crate::common::{Data, Function, difference, square};
use crate::problems::*;

/// Seconds that this thread has spent on a processor; wall time where the system does not say.
fn now() -> f64 {
    static BEGUN: std::sync::OnceLock<std::time::Instant> = std::sync::OnceLock::new();
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    match text.split(' ').next().and_then(|t| t.parse::<f64>().ok()) {
        Some(nanoseconds) => 1e-9 * nanoseconds,
        None => BEGUN
            .get_or_init(std::time::Instant::now)
            .elapsed()
            .as_secs_f64(),
    }
}

#[test]
#[ignore = "prints seconds, asserts nothing"]
fn seconds() {
    let sizes = std::env::var("VERTICES").unwrap_or("20000".into());
    let which = std::env::var("PROBLEM").unwrap_or_default();
    let direct = std::env::var("DIRECT").is_ok();
    let jump = checkerboard(8, 100.0);
    let jump4 = checkerboard(8, 1e4);
    let interface: Function = &|x, _| if x > 0.0 { 1e4 } else { 1.0 };
    let smooth: Function = &|x, y| (2.2 * (3.0 * x).sin() * (2.0 * y).cos()).exp();
    let problems: Vec<(&str, Data, bool)> = vec![
        (
            "P2",
            Data {
                tensions: [ONE, &|_, _| 2.0],
                loads: [&|x, y| smooth_action(0, x, y), &|x, y| {
                    smooth_action(1, x, y)
                }],
                heights: [ZERO, ZERO],
            },
            false,
        ),
        (
            "P8",
            Data {
                tensions: [ONE, ONE],
                loads: [&|x, y| jumping_action(0, x, y), &|x, y| {
                    jumping_action(1, x, y)
                }],
                heights: [ZERO, ZERO],
            },
            false,
        ),
        (
            "L",
            Data {
                tensions: [ONE, ONE],
                loads: [&|_, _| -6.0, ZERO],
                heights: [&|_, _| 0.05, ZERO],
            },
            true,
        ),
        (
            "islands",
            Data {
                tensions: [ONE, ONE],
                loads: [&islands, ZERO],
                heights: [&|_, _| 0.1, ZERO],
            },
            false,
        ),
        (
            "spots",
            Data {
                tensions: [ONE, ONE],
                loads: [&spots, ZERO],
                heights: [&|_, _| 0.1, ZERO],
            },
            false,
        ),
        (
            "ratio1e4",
            Data {
                tensions: [&jump4, &jump4],
                loads: [&islands, ZERO],
                heights: [&|_, _| 0.1, ZERO],
            },
            false,
        ),
        (
            "smooth2",
            Data {
                tensions: [smooth, ONE],
                loads: [&islands, ZERO],
                heights: [&|_, _| 0.1, ZERO],
            },
            false,
        ),
        (
            "interface",
            Data {
                tensions: [interface, ONE],
                loads: [&islands, ZERO],
                heights: [&|_, _| 0.1, ZERO],
            },
            false,
        ),
        (
            "checker",
            Data {
                tensions: [&jump, ONE],
                loads: [&islands, ZERO],
                heights: [&|_, _| 0.1, ZERO],
            },
            false,
        ),
        (
            "checkers",
            Data {
                tensions: [&jump, &jump4],
                loads: [&islands, ZERO],
                heights: [&|_, _| 0.1, ZERO],
            },
            false,
        ),
    ];
    for (name, data, corner) in &problems {
        if !which.is_empty() && !which.split(',').any(|w| w == *name) {
            continue;
        }
        for n in sizes.split(',').map(|n| n.parse::<usize>().unwrap()) {
            let mesh = if *corner { lshape(8) } else { square(8) };
            adaptively(data, mesh, n, 0.5, |stage| {
                let depth = stage.mesh.genealogy().iter().map(|b| b.level).max();
                let tight = multigrid(Tolerance::Relative(1e-10), true);
                let clock = now();
                let exact = solve(stage.problem, &tight, stage.start).unwrap();
                let seconds = now() - clock;
                println!(
                    "{name} {} vertices, {} levels: {seconds:.3} s = {:.2} us/vertex, {:?} contraction {:?} kkt {:.1e} {} {:?}",
                    stage.mesh.vertex_count(),
                    depth.unwrap(),
                    1e6 * seconds / stage.mesh.vertex_count() as f64,
                    exact.info.cycles,
                    exact.info.contraction,
                    exact.info.kkt_residual,
                    exact.info.solver,
                    exact.info.reduction
                );
                for factor in [1.0, 0.1] {
                    let mut loose = multigrid(Tolerance::Balanced, true);
                    loose.sigma = false;
                    loose.energy_target = Some(factor * stage.eta);
                    let clock = now();
                    let one = solve(stage.problem, &loose, stage.start).unwrap();
                    let seconds = now() - clock;
                    let error = energy_difference(stage.problem, &one, &exact);
                    println!(
                        "   to {factor} eta: {seconds:.3} s = {:.2} us/vertex, {:?}, error {:.4} eta, estimate {:.4} eta",
                        1e6 * seconds / stage.mesh.vertex_count() as f64,
                        one.info.cycles,
                        error / stage.eta,
                        one.info.algebraic_error.unwrap() / stage.eta
                    );
                }
                let cold = solve(stage.problem, &tight, None).unwrap();
                println!(
                    "   cold {:?} {} {:.1e}",
                    cold.info.cycles,
                    cold.info.solver,
                    difference(&cold, &exact)
                );
                if direct {
                    let mut settings = tight;
                    settings.solver = Solver::ActiveSet;
                    let clock = now();
                    let direct = solve(stage.problem, &settings, stage.start).unwrap();
                    println!(
                        "   active set: {:.3} s, {} solves, difference {:.1e}",
                        (now() - clock),
                        direct.info.iterations,
                        difference(&exact, &direct)
                    );
                }
            });
        }
    }
}
