//! The two discretisations of the action side by side: errors, estimators, cost. `docs/second-discretisation.md` holds the tables that this prints.
//!
//! Method 1: (u_h, sigma_h), the action -laplace sigma_h, the estimators (7.1) and (7.2). Method 2: (u_h, lambda_h), lambda_h constant on dual
//! cells, the residual estimator.

use std::fmt::Write as _;
use std::hint::black_box;
use std::time::Instant;

use adapt::settings::{Estimate, Estimator, Final, Stop, Strategy};
use adapt::{Level, Problem, Settings};
use contact::Solver;
use estimate::{finite_volume, root_sum};
use fem_core::scale::times_power_of_two;
use fem_core::{Children, Samples, TriangleId};

use crate::cases::{Grid, levels, on, tests, uniform};

/// One level of one family of meshes, in the user's units.
struct Row {
    vertices: usize,
    /// |||u - u_h|||.
    energy: f64,
    /// |sigma - sigma_h|_1.
    sigma: f64,
    /// ||lambda - lambda_h||.
    l2: f64,
    /// ||lambda - lambda_h||_-1.
    negative: f64,
    /// eta_K over the total error of method 1.
    first: f64,
    /// (7.11) over the total error of method 1.
    literal: f64,
    /// Residual estimator over the total error of method 2.
    second: f64,
    /// Residual estimator over the energy error.
    residual: f64,
}

impl Row {
    fn numbers(&self) -> [f64; 8] {
        let Row {
            energy,
            sigma,
            l2,
            negative,
            first,
            literal,
            second,
            residual,
            ..
        } = *self;
        [
            energy, sigma, l2, negative, first, literal, second, residual,
        ]
    }
}

/// |sigma|_1^2 where sigma has no closed form: the sum of c_mn^2/k^2 over the sines of the square (-1, 1)^2 with k = pi/2 (m, n).
///
/// With the centre (x, y) and the radius r of the contact set, c_mn = sin(k_1 (x + 1)) sin(k_2 (y + 1)) times 5 (2 pi r/k) J_1(k r) for P8, and times
/// 10 (4 pi r^2/k^2) J_2(k r) for P4a.
fn sigma_seminorm_squared(name: &str) -> Option<f64> {
    match name {
        "P8" => Some(1.27232460287906),
        "P4a" => Some(0.0362034504341248),
        _ => None,
    }
}

/// |sigma - sigma_h|_1 in scaled units: integrated, or from |sigma|_1^2 - 2 (lambda, sigma_h) + |sigma_h|_1^2.
fn sigma_error(name: &str, problem: &Problem, level: &Level) -> f64 {
    let errors = level.estimates.errors.as_ref().expect("exact");
    if let Some(error) = errors.sigma {
        return error;
    }
    let exact = sigma_seminorm_squared(name).expect("|sigma|_1 known");
    let exact = times_power_of_two(exact, -2 * problem.scale.force());
    let mixed = action_times(problem, level);
    (exact - 2.0 * mixed + level.discrete.laplacian().quadratic(&level.solution.sigma)).sqrt()
}

/// (lambda, sigma_h), on a mesh refined along the border of the contact set until no sample can miss a part of the action that matters.
fn action_times(problem: &Problem, level: &Level) -> f64 {
    let exact = problem.exact.as_ref().expect("exact");
    let (contact, action) = (exact.contact.as_deref(), exact.action.as_deref());
    let mut mesh = fem_core::Mesh::clone(&level.mesh);
    for _ in 0..6 {
        let centres: Vec<[f64; 2]> = mesh
            .triangle_ids()
            .map(|t| mesh.corners(t))
            .map(|c| [0, 1].map(|k| (c[0][k] + c[1][k] + c[2][k]) / 3.0))
            .collect();
        let (x, y): (Vec<f64>, Vec<f64>) = centres.iter().map(|p| (p[0], p[1])).unzip();
        let (mut inside, region) = (vec![0.0; x.len()], vec![0.0; x.len()]);
        let at = Samples {
            x: &x,
            y: &y,
            region: &region,
        };
        contact
            .expect("contact")
            .sample(at, &mut inside)
            .expect("finite");
        // Triangles around a vertex that has triangles on both sides.
        let mut seen = vec![[false; 2]; mesh.vertex_count()];
        for (v, inside) in mesh.triangles().iter().zip(&inside) {
            v.iter()
                .for_each(|j| seen[j.index()][usize::from(*inside != 0.0)] = true);
        }
        let near = |t: &TriangleId| {
            mesh.triangles()[t.index()]
                .iter()
                .any(|j| seen[j.index()] == [true; 2])
        };
        let marked: Vec<TriangleId> = mesh.triangle_ids().filter(near).collect();
        mesh.refine(&marked, Children::Four).expect("refines");
    }
    let mut sigma = level.solution.sigma.clone();
    for birth in &mesh.genealogy()[sigma.len()..] {
        let [a, b] = birth.parents.map(|j| sigma[j.index()]);
        sigma.push(0.5 * (a + b));
    }
    let loads = fem_core::integrate::loads(&mesh, action.expect("action")).expect("finite");
    loads.nodal.iter().zip(&sigma).map(|(l, s)| l * s).sum()
}

fn row(name: &str, problem: &Problem, level: &Level) -> Row {
    let scale = problem.scale;
    let by = times_power_of_two;
    let action = problem
        .exact
        .as_ref()
        .and_then(|e| e.action.as_deref())
        .expect("action");
    let method = finite_volume(&level.discrete, &level.solution);
    let defect = method.defect(&level.mesh, &level.discrete, &level.solution.displacement);
    for (what, value) in [
        ("equation", defect.equation),
        ("gap", defect.gap),
        ("action", defect.action),
        ("complementarity", defect.complementarity),
    ] {
        assert!(
            value <= 1e-12,
            "{name} {}: {what} {value:e}",
            level.mesh.vertex_count()
        );
    }
    let record = &level.record;
    let energy = record.true_error.expect("exact");
    let sigma = by(sigma_error(name, problem, level), scale.force());
    let l2 = method.l2_error(&level.mesh, action).expect("finite");
    let negative = method
        .negative_error(&level.mesh, action, 2)
        .expect("finite");
    let negative = by(negative, scale.force());
    let total = [
        record.h1_error.expect("exact").hypot(sigma),
        energy.hypot(negative),
    ];
    let residual = record.residual.expect("asked for");
    Row {
        vertices: record.vertices,
        energy,
        sigma,
        l2: by(l2, scale.load + scale.length),
        negative,
        first: record.eta_k.expect("asked for") / total[0],
        literal: record.bound_711.expect("asked for") / total[0],
        second: residual / total[1],
        residual: residual / energy,
    }
}

/// The solution on the problem's own mesh, to rounding: the equations of the second discretisation are checked that far.
fn solved(problem: &Problem) -> Level {
    let mut settings = uniform(1);
    settings.solve.solver = Solver::ActiveSet;
    levels(problem, &settings).remove(0)
}

/// Levels of an adaptive run from 250 vertices on.
fn adaptive(problem: &Problem, estimator: Estimator) -> Vec<Level> {
    let settings = Settings {
        solve: contact::Settings {
            solver: Solver::ActiveSet,
            ..contact::Settings::default()
        },
        estimate: Estimate {
            estimator,
            also: vec![Estimator::Paper, Estimator::Residual],
            last: Final::Fast,
        },
        stop: Stop {
            vertices: Some(4_000),
            ..Stop::default()
        },
        ..Settings::default()
    };
    assert_eq!(settings.mark.strategy, Strategy::Doerfler);
    let mut levels = levels(problem, &settings);
    levels.retain(|l| l.mesh.vertex_count() >= 250);
    levels
}

/// Slope of the logarithm of an error against that of N^(-1/2), least squares over the rows.
fn order(rows: &[Row], error: impl Fn(&Row) -> f64) -> f64 {
    let points: Vec<[f64; 2]> = rows
        .iter()
        .map(|r| [-0.5 * (r.vertices as f64).ln(), error(r).ln()])
        .collect();
    let mean = [0, 1].map(|k| points.iter().map(|p| p[k]).sum::<f64>() / points.len() as f64);
    let product = |k: usize| {
        let terms = points.iter().map(|p| (p[0] - mean[0]) * (p[k] - mean[k]));
        terms.sum::<f64>()
    };
    product(1) / product(0)
}

/// Three digits.
fn short(value: f64) -> String {
    if (0.1..1000.0).contains(&value) {
        let digits = if value < 1.0 {
            3
        } else if value < 10.0 {
            2
        } else {
            1
        };
        format!("{value:.digits$}")
    } else {
        format!("{value:.2e}")
    }
}

/// Prints a line of a table and holds its numbers to those of the page.
fn hold(page: &str, key: &str, numbers: &[f64], tolerance: f64, broken: &mut String) {
    let cells: Vec<String> = numbers.iter().map(|&v| short(v)).collect();
    let line = format!("| {key} | {} |", cells.join(" | "));
    println!("{line}");
    let Some(written) = page.lines().find(|l| l.starts_with(&format!("| {key} |"))) else {
        let _ = writeln!(broken, "not on the page: {line}");
        return;
    };
    let count = key.split('|').count();
    let written: Vec<f64> = written
        .split('|')
        .skip(1 + count)
        .filter_map(|cell| cell.trim().parse().ok())
        .collect();
    let near = |(a, b): (&f64, &f64)| (a / b - 1.0).abs() <= tolerance;
    if written.len() != numbers.len() || !numbers.iter().zip(&written).all(near) {
        let _ = writeln!(broken, "{line}\n  on the page: {written:?}");
    }
}

fn page() -> String {
    let file = tests().join("../docs/second-discretisation.md");
    std::fs::read_to_string(file).expect("the page")
}

/// What a family must show: orders of the four errors, ranges of eta_K over the error of method 1 and of eta_res over that of method 2.
struct Expected {
    orders: [std::ops::RangeInclusive<f64>; 4],
    first: std::ops::RangeInclusive<f64>,
    second: std::ops::RangeInclusive<f64>,
}

fn family(
    (name, mesh): (&str, &str),
    problem: &Problem,
    levels: &[Level],
    expected: &Expected,
    broken: &mut String,
) {
    let page = page();
    let rows: Vec<Row> = levels.iter().map(|l| row(name, problem, l)).collect();
    for r in &rows {
        let key = format!("{name} | {mesh} | {}", r.vertices);
        hold(&page, &key, &r.numbers(), 0.02, broken);
        assert!(expected.first.contains(&r.first), "{key}: {}", r.first);
        assert!(expected.second.contains(&r.second), "{key}: {}", r.second);
    }
    let orders = [
        order(&rows, |r| r.energy),
        order(&rows, |r| r.sigma),
        order(&rows, |r| r.l2),
        order(&rows, |r| r.negative),
    ];
    let key = format!("{name} | {mesh} | order");
    hold(&page, &key, &orders, 0.02, broken);
    for (order, range) in orders.iter().zip(&expected.orders) {
        assert!(range.contains(order), "{name} {mesh}: {orders:?}");
    }
}

fn compare(name: &str, uniform: &[(Grid, usize)], expected: [Expected; 2]) {
    let problems: Vec<Problem> = uniform.iter().map(|(g, l)| on(name, g, *l)).collect();
    let solved: Vec<Level> = problems.iter().map(solved).collect();
    let [first, second] = expected;
    let mut broken = String::new();
    family(
        (name, "uniform"),
        &problems[0],
        &solved,
        &first,
        &mut broken,
    );
    let start = match name {
        "P1" => on(name, &Grid::disk(8), 2),
        _ => on(name, &Grid::right(8), 0),
    };
    for (mesh, estimator) in [
        ("eta_K", Estimator::Paper),
        ("eta_res", Estimator::Residual),
    ] {
        let levels = adaptive(&start, estimator);
        family((name, mesh), &start, &levels, &second, &mut broken);
    }
    assert!(broken.is_empty(), "{broken}");
}

fn squares() -> Vec<(Grid, usize)> {
    [16, 32, 64, 128].map(|n| (Grid::right(n), 0)).into()
}

/// First order for displacements and sigma_h; `action` holds the orders in L2 and in H^-1.
fn expected(
    sigma: std::ops::RangeInclusive<f64>,
    action: [std::ops::RangeInclusive<f64>; 2],
    first: std::ops::RangeInclusive<f64>,
    second: std::ops::RangeInclusive<f64>,
) -> Expected {
    let [l2, negative] = action;
    Expected {
        orders: [0.95..=1.15, sigma, l2, negative],
        first,
        second,
    }
}

/// The action jumps; on these few grids the border of the contact set happens to be met better and better, so the orders exceed 1/2 and 3/2.
#[test]
fn p1_on_the_disk() {
    let grids: Vec<_> = (3..=6).map(|l| (Grid::disk(8), l)).collect();
    let range = || expected(0.95..=1.4, [0.45..=1.0, 1.4..=2.1], 8.4..=11.5, 3.8..=4.9);
    compare("P1", &grids, [range(), range()]);
}

/// Order one in L2, two in H^-1.
#[test]
fn p2_with_a_continuous_action() {
    let uniform = expected(
        0.97..=1.05,
        [0.97..=1.03, 1.9..=2.05],
        18.0..=21.0,
        5.4..=5.9,
    );
    let adaptive = expected(
        0.75..=1.05,
        [0.65..=1.05, 1.3..=2.05],
        18.0..=23.5,
        5.5..=6.2,
    );
    compare("P2", &squares(), [uniform, adaptive]);
}

/// Order one half in L2, three halves in H^-1.
#[test]
fn p8_with_a_jump_of_the_action() {
    let uniform = expected(
        0.97..=1.05,
        [0.45..=0.58, 1.45..=1.6],
        14.5..=17.0,
        5.5..=6.0,
    );
    let adaptive = expected(0.85..=1.05, [0.4..=0.6, 1.3..=1.7], 15.0..=18.5, 5.7..=6.1);
    compare("P8", &squares(), [uniform, adaptive]);
}

/// As P2, with tensions that vary.
#[test]
fn p4a_with_variable_tensions() {
    let uniform = expected(
        0.97..=1.05,
        [0.97..=1.03, 1.9..=2.05],
        18.5..=22.0,
        5.4..=5.9,
    );
    let adaptive = expected(0.9..=1.1, [0.85..=1.1, 1.7..=2.05], 16.5..=19.5, 5.6..=6.3);
    compare("P4a", &squares(), [uniform, adaptive]);
}

/// How much of the H^-1 norm the mesh refined twice sees: once more changes it little.
#[test]
fn negative_norm_on_a_mesh_refined_thrice() {
    let mut worst = 1.0f64;
    for name in ["P2", "P8"] {
        let problem = on(name, &Grid::right(32), 0);
        let level = solved(&problem);
        let method = finite_volume(&level.discrete, &level.solution);
        let action = problem
            .exact
            .as_ref()
            .and_then(|e| e.action.as_deref())
            .expect("action");
        let norm = |times| {
            method
                .negative_error(&level.mesh, action, times)
                .expect("finite")
        };
        let found = [1, 2, 3].map(norm);
        println!(
            "{name}: {:.4} {:.4} of the norm on the mesh refined thrice",
            found[0] / found[2],
            found[1] / found[2]
        );
        assert!(found[0] < found[1] && found[1] < found[2]);
        worst = worst.min(found[1] / found[2]);
    }
    assert!(worst > 0.97, "{worst}");
}

/// Seconds of the fastest of several calls.
fn fastest<T>(mut call: impl FnMut() -> T) -> f64 {
    let mut best = f64::INFINITY;
    for _ in 0..15 {
        let clock = Instant::now();
        black_box(call());
        best = best.min(clock.elapsed().as_secs_f64());
    }
    best
}

/// Steps of conjugate gradients, preconditioned by the diagonal, until the residual of `K sigma = z` is 1e-8 of the first.
fn steps(level: &Level) -> usize {
    let (matrix, n) = (level.discrete.laplacian(), level.solution.force.len());
    let inside: Vec<usize> = (0..n).filter(|&j| !level.discrete.boundary()[j]).collect();
    let mut rest = level.solution.force.clone();
    let (mut direction, mut product) = (vec![0.0; n], vec![0.0; n]);
    let (mut before, mut first) = (f64::INFINITY, f64::INFINITY);
    for step in 0.. {
        let now: f64 = inside
            .iter()
            .map(|&i| rest[i] * rest[i] / matrix.diagonal(i))
            .sum();
        if step == 0 {
            first = now;
        }
        if now <= 1e-16 * first {
            return step;
        }
        for &i in &inside {
            direction[i] = rest[i] / matrix.diagonal(i) + now / before * direction[i];
        }
        inside
            .iter()
            .for_each(|&i| product[i] = matrix.row_dot(i, &direction));
        let curvature: f64 = inside.iter().map(|&i| direction[i] * product[i]).sum();
        inside
            .iter()
            .for_each(|&i| rest[i] -= now / curvature * product[i]);
        before = now;
    }
    0
}

/// Seconds beside those of a product with K in the same run. Ratios travel between machines, seconds do not; only gross changes fail.
#[test]
fn cost_beside_a_matrix_vector_product() {
    println!(
        "| triangles | product, ns a triangle | (7.1) and (7.2) | eta_res | l_j | steps of CG for sigma_h |"
    );
    for n in [64, 256] {
        let level = solved(&on("P2", &Grid::right(n), 0));
        let (mesh, discrete, solution) = (&level.mesh, &level.discrete, &level.solution);
        let product = fastest(|| discrete.laplacian().multiply(&solution.sigma));
        let paper = fastest(|| estimate::paper(mesh, discrete, solution)) / product;
        let residual =
            fastest(|| root_sum(&estimate::residual(mesh, discrete, solution))) / product;
        let action = fastest(|| finite_volume(discrete, solution)) / product;
        let steps = steps(&level);
        let triangles = mesh.triangle_count();
        println!(
            "| {triangles} | {:.2} | {paper:.1} | {residual:.1} | {action:.2} | {steps} |",
            1e9 * product / triangles as f64
        );
        assert!(
            (1.0..200.0).contains(&paper) && (1.0..200.0).contains(&residual),
            "{paper} {residual}"
        );
        assert!(action < 5.0, "{action}");
        // As many steps as there are squares a side, but for a factor: a solve that the second method does without.
        assert!((n / 2..4 * n).contains(&steps), "{n}: {steps}");
    }
}
