//! Rates of convergence: first order in h on uniform meshes, N^(-1/2) with adaptivity where a corner spoils it.

use adapt::Settings;
use adapt::settings::{Estimate, Estimator, Final, Stop, Strategy};

use crate::cases::{Grid, configs, levels, on, uniform};

/// Orders in h over the last two levels: u1, u2, sigma in the H1 seminorm.
fn orders(name: &str, problem: &adapt::Problem, count: usize) -> [Option<f64>; 3] {
    let mut settings = uniform(count);
    settings.estimate.also.clear();
    let levels = levels(problem, &settings);
    let errors: Vec<_> = levels
        .iter()
        .filter_map(|l| l.estimates.errors.as_ref())
        .collect();
    let [.., coarse, fine] = errors[..] else {
        panic!("{name}: no exact solution")
    };
    let vertices = levels[levels.len() - 1].mesh.vertex_count();
    assert!(vertices >= 100_000, "{name}: only {vertices} vertices");
    let order = |a: f64, b: f64| (a / b).log2();
    let orders = [
        Some(order(coarse.h1[0], fine.h1[0])),
        Some(order(coarse.h1[1], fine.h1[1])),
        coarse.sigma.zip(fine.sigma).map(|(a, b)| order(a, b)),
    ];
    println!("{name}: {vertices} vertices, orders {orders:.4?}");
    orders
}

fn assert_first_order(name: &str, grid: &Grid, count: usize, with_sigma: bool) {
    assert_first_order_of(name, &on(name, grid, 0), count, with_sigma);
}

fn assert_first_order_of(name: &str, problem: &adapt::Problem, count: usize, with_sigma: bool) {
    let orders = orders(name, problem, count);
    assert!(
        !with_sigma || orders[2].is_some(),
        "{name}: sigma is not known"
    );
    for order in orders.iter().take(if with_sigma { 3 } else { 2 }).flatten() {
        assert!((0.97..=1.03).contains(order), "{name}: {orders:?}");
    }
}

#[test]
fn p1_on_the_disk() {
    let disk = scene::load(&configs().join("disk.toml"), &[]).unwrap_or_else(|e| panic!("{e}"));
    assert_first_order_of("P1", &disk.problem, 7, true);
}

#[test]
fn p2_with_continuous_action() {
    assert_first_order("P2", &Grid::right(10), 6, true);
}

#[test]
fn p4_with_variable_tensions() {
    assert_first_order("P4a", &Grid::right(10), 6, false);
    assert_first_order("P4b", &Grid::right(10), 6, false);
}

#[test]
fn p5_and_p7_without_action() {
    for name in ["P5", "P7", "P7l"] {
        assert_first_order(name, &Grid::right(10), 6, false);
    }
}

#[test]
fn p6_in_full_contact() {
    assert_first_order("P6", &Grid::right(10), 6, false);
    assert_first_order("P6c", &Grid::right(10), 6, true);
}

#[test]
fn p7c_and_p8_with_discontinuous_action() {
    for name in ["P7c", "P8"] {
        assert_first_order(name, &Grid::right(10), 6, false);
    }
}

/// Slope of log error against log vertices, least squares over the levels with at least `from` vertices.
fn slope(points: &[(usize, f64)], from: usize) -> f64 {
    let logs: Vec<_> = points
        .iter()
        .filter(|p| p.0 >= from)
        .map(|&(n, e)| ((n as f64).ln(), e.ln()))
        .collect();
    let n = logs.len() as f64;
    let (mx, my) = (
        logs.iter().map(|p| p.0).sum::<f64>() / n,
        logs.iter().map(|p| p.1).sum::<f64>() / n,
    );
    logs.iter().map(|p| (p.0 - mx) * (p.1 - my)).sum::<f64>()
        / logs.iter().map(|p| (p.0 - mx).powi(2)).sum::<f64>()
}

#[test]
fn adaptivity_restores_the_rate_at_a_corner() {
    let problem = on("P3", &Grid::lshape(8), 0);
    let run = |strategy, estimator| {
        let mut settings = Settings::default();
        settings.mark.strategy = strategy;
        settings.estimate = Estimate {
            estimator,
            also: vec![],
            last: Final::Fast,
        };
        settings.stop = Stop {
            vertices: Some(40_000),
            ..Stop::default()
        };
        let points: Vec<_> = levels(&problem, &settings)
            .iter()
            .map(|l| {
                (
                    l.mesh.vertex_count(),
                    l.estimates.errors.as_ref().expect("exact").energy,
                )
            })
            .collect();
        points
    };
    let adaptive = slope(&run(Strategy::Doerfler, Estimator::Residual), 500);
    let paper = slope(&run(Strategy::Doerfler, Estimator::Paper), 500);
    // The smooth part of the error falls faster than the corner's: the last two levels show the rate.
    let uniform = slope(&run(Strategy::Uniform, Estimator::Residual), 10_000);
    println!("slopes: residual {adaptive:.4}, paper {paper:.4}, uniform {uniform:.4}");
    assert!(adaptive <= -0.48, "{adaptive}");
    assert!(paper <= -0.48, "{paper}");
    assert!((-0.46..=-0.42).contains(&uniform), "{uniform}");
}
