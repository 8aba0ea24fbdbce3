//! The solvers and the forms of the problem agree on every scene of `configs/`.

use adapt::Level;
use adapt::settings::{Fields, Stop};
use contact::{Settings, Solution, Solver};

use crate::cases::{configs, levels};

/// Every scene in `configs/`.
fn scenes() -> Vec<(String, scene::Scene)> {
    let mut names: Vec<_> = std::fs::read_dir(configs())
        .expect("configs")
        .filter_map(|e| {
            e.ok()
                .map(|e| e.path())
                .filter(|p| p.extension().is_some_and(|x| x == "toml"))
        })
        .collect();
    names.sort();
    assert!(names.len() >= 7, "{names:?}");
    names
        .into_iter()
        .map(|path| {
            let scene = scene::load(&path, &[]).unwrap_or_else(|e| panic!("{e}"));
            (
                path.file_stem()
                    .expect("a name")
                    .to_string_lossy()
                    .into_owned(),
                scene,
            )
        })
        .collect()
}

/// The levels of a scene up to a number of vertices, by the active set method.
fn run(scene: &scene::Scene, vertices: usize) -> Vec<Level> {
    let mut settings = scene.settings.clone();
    settings.stop = Stop {
        vertices: Some(vertices),
        ..Stop::default()
    };
    settings.output.fields = Fields::None;
    settings.solve.solver = Solver::ActiveSet;
    levels(&scene.problem, &settings)
}

/// Largest difference of two displacements over the largest displacement.
fn apart(a: &Solution, b: &Solution) -> f64 {
    let largest = a
        .displacement
        .iter()
        .flatten()
        .fold(0.0f64, |m, u| m.max(u.abs()));
    let difference = (0..2)
        .flat_map(|i| a.displacement[i].iter().zip(&b.displacement[i]))
        .fold(0.0f64, |m, (x, y)| m.max((x - y).abs()));
    if largest == 0.0 {
        difference
    } else {
        difference / largest
    }
}

#[test]
fn active_set_is_exact_and_needs_few_solves() {
    for (name, scene) in scenes() {
        for level in run(&scene, 100_000) {
            let info = &level.solution.info;
            assert!(
                info.solver.starts_with("active-set"),
                "{name}: {}",
                info.solver
            );
            assert!(
                info.kkt_residual <= 1e-12,
                "{name} level {}: {:e}",
                level.number,
                info.kkt_residual
            );
            let vertices = level.mesh.vertex_count();
            println!(
                "{name} {}: {vertices} vertices, {} solves, kkt {:.1e}",
                level.number, info.iterations, info.kkt_residual
            );
            assert!(
                level.number < 3 || info.iterations <= 7,
                "{name} level {}: {}",
                level.number,
                info.iterations
            );
        }
    }
}

#[test]
fn reduced_and_two_field_forms_agree() {
    for (name, scene) in scenes() {
        for level in run(&scene, 20_000) {
            let settings = Settings {
                reduce: false,
                solver: Solver::ActiveSet,
                ..Settings::default()
            };
            let full = contact::solve(&level.discrete, &settings, None).expect("solved");
            let difference = apart(&level.solution, &full);
            println!(
                "{name} {}: {:?} {difference:.1e}",
                level.number, level.solution.info.reduction
            );
            assert!(
                difference <= 1e-12,
                "{name} level {}: {difference:e}",
                level.number
            );
            assert!(
                full.info.kkt_residual <= 1e-12,
                "{name} level {}: {:e}",
                level.number,
                full.info.kkt_residual
            );
            assert_same_contact(&name, &level, &full, 1e-12);
        }
    }
}

#[test]
fn clarabel_and_active_set_agree() {
    for (name, scene) in scenes() {
        for level in run(&scene, 20_000)
            .iter()
            .filter(|l| l.mesh.vertex_count() <= 20_000)
        {
            let settings = Settings {
                solver: Solver::Clarabel,
                ..Settings::default()
            };
            let interior = contact::solve(&level.discrete, &settings, None).expect("solved");
            let difference = apart(&level.solution, &interior);
            println!(
                "{name} {}: {difference:.1e}, kkt {:.1e}",
                level.number, interior.info.kkt_residual
            );
            assert!(
                difference <= 1e-6,
                "{name} level {}: {difference:e}",
                level.number
            );
            assert_same_contact(&name, level, &interior, 1e-6);
        }
    }
}

/// Contact sets are the same wherever the complementarity is strict beyond `strict`.
fn assert_same_contact(name: &str, level: &Level, other: &Solution, strict: f64) {
    let solution = &level.solution;
    let unit = solution
        .displacement
        .iter()
        .flatten()
        .fold(0.0f64, |m, u| m.max(u.abs()));
    let unit = if unit == 0.0 { 1.0 } else { unit };
    for j in (0..level.discrete.order()).filter(|&j| !level.discrete.boundary()[j]) {
        let clear = (solution.gap(j) / unit)
            .max(solution.force[j] / (level.discrete.harmonic_diagonal(j) * unit));
        assert!(
            clear <= strict || solution.contact[j] == other.contact[j],
            "{name} level {}, vertex {j}: contact {} against {} at {clear:e}",
            level.number,
            solution.contact[j],
            other.contact[j],
        );
    }
}
