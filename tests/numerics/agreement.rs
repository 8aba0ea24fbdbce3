//! The solvers and the forms of the problem agree on every scene of `configs/` and on the cases of `tests/cases/`.

use adapt::settings::{Estimator, Fields, Stop};
use adapt::{Level, Problem};
use contact::{Settings, Solution, Solver, Tolerance};

use crate::cases::{Grid, configs, levels, on, tests};

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

/// Every case in `tests/cases/`, on a coarse mesh of its domain.
fn cases() -> Vec<(String, Problem)> {
    let files = std::fs::read_dir(tests().join("cases")).expect("cases");
    let mut names: Vec<String> = files
        .filter_map(|e| Some(e.ok()?.path().file_stem()?.to_str()?.to_owned()))
        .collect();
    names.sort();
    assert!(names.len() >= 14, "{names:?}");
    let problem = |name: String| {
        let grid = match name.as_str() {
            "P1" => Grid::disk(8),
            "P3" => Grid::lshape(4),
            _ => Grid::right(4),
        };
        let mut problem = on(&name, &grid, 0);
        problem.exact = None;
        (name, problem)
    };
    names.into_iter().map(problem).collect()
}

/// The levels of a scene up to a number of vertices, by the active set method.
fn run(scene: &scene::Scene, vertices: usize) -> Vec<Level> {
    run_with(&scene.problem, scene.settings.clone(), vertices)
}

/// Residual estimator and nothing else.
fn plain() -> adapt::Settings {
    let mut settings = adapt::Settings::default();
    settings.estimate.estimator = Estimator::Residual;
    settings.estimate.also.clear();
    settings
}

/// The levels of a problem up to a number of vertices, by the active set method.
fn run_with(problem: &Problem, mut settings: adapt::Settings, vertices: usize) -> Vec<Level> {
    settings.stop = Stop {
        vertices: Some(vertices),
        ..Stop::default()
    };
    settings.output.fields = Fields::None;
    settings.solve.solver = Solver::ActiveSet;
    levels(problem, &settings)
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

/// Largest difference of two sets of forces: over the largest force, and over the diagonal of its row and the largest displacement, as in the KKT residual.
fn forces_apart(level: &Level, other: &Solution) -> [f64; 2] {
    let one = &level.solution;
    let most = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0f64, |m, z| m.max(z.abs()));
    let difference = |j: usize| one.force[j] - other.force[j];
    let inner = || (0..one.force.len()).filter(|&j| !level.discrete.boundary()[j]);
    let absolute = most(&mut inner().map(difference));
    if absolute == 0.0 {
        return [0.0; 2];
    }
    let diagonal = |j: usize| level.discrete.harmonic_diagonal(j);
    let in_gaps = most(&mut inner().map(|j| difference(j) / diagonal(j)));
    let unit = most(&mut one.displacement.iter().flatten().copied());
    [
        absolute / most(&mut one.force.iter().copied()),
        in_gaps / unit,
    ]
}

#[test]
fn multigrid_and_active_set_agree() {
    let scenes = scenes().into_iter().map(|(name, s)| (name, s.problem));
    for (name, problem) in scenes.chain(cases()) {
        let levels = run_with(&problem, plain(), 5_000);
        for level in levels.iter().filter(|l| l.number > 0) {
            let settings = Settings {
                solver: Solver::Multigrid,
                tolerance: Tolerance::Relative(1e-12),
                ..Settings::default()
            };
            let iterated = contact::solve(&level.discrete, &settings, None).expect("solved");
            let info = &iterated.info;
            let difference = apart(&level.solution, &iterated);
            let [forces, in_gaps] = forces_apart(level, &iterated);
            println!(
                "{name} {}: {} vertices, u {difference:.1e}, z {forces:.1e} {in_gaps:.1e}, {:?}, {:?}",
                level.number,
                level.mesh.vertex_count(),
                info.reduction,
                info.cycles
            );
            assert_eq!(info.solver, "multigrid", "{name} level {}", level.number);
            assert!(info.kkt_residual <= 1e-12, "{name}: {info:?}");
            assert!(difference <= 1e-9, "{name}: u {difference:e}");
            assert!(in_gaps <= 1e-9, "{name}: z {in_gaps:e}");
            // Rows are solved relative to their diagonals. That is a larger part of the forces where the tensions jump, and where the action vanishes
            // in the limit.
            let limit = match name.as_str() {
                "tension-jump" => 1e-7,
                "P4b" | "P7l" => 1e-8,
                _ => 1e-9,
            };
            assert!(forces <= limit, "{name}: z {forces:e}");
            assert_same_contact(&name, level, &iterated, 1e-12);
        }
    }
}

#[test]
fn clarabel_agrees_on_the_cases() {
    for (name, problem) in cases() {
        let levels = run_with(&problem, plain(), 3_000);
        let level = levels.last().expect("a level");
        let settings = Settings {
            solver: Solver::Clarabel,
            ..Settings::default()
        };
        let interior = contact::solve(&level.discrete, &settings, None).expect("solved");
        let difference = apart(&level.solution, &interior);
        println!("{name} {}: {difference:.1e}", level.number);
        assert!(difference <= 1e-6, "{name}: {difference:e}");
        assert_same_contact(&name, level, &interior, 1e-6);
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
