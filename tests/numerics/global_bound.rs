//! The global bound (7.11) as it stands and repaired.

use adapt::Level;
use fem_core::Scale;

use crate::cases::{Grid, on, scene, solve, uniform};

/// The number in the user's units is the formula of the paper, whatever powers of two the computation took out.
#[test]
fn bounds_in_the_units_of_the_user() {
    for (side, tension, load) in [(1.0, 1.0, 1.0), (300.0, 5e-3, 7e4), (1.3e-3, 2e5, 0.02)] {
        let scene = scene(&format!(
            "[domain.rectangle]\nlower = [0, 0]\nupper = [{side:e}, {side:e}]\nsize = {:e}\n\
             [upper]\ntension = {tension:e}\nload = {:e}\nboundary = {:e}\n[lower]\ntension = {:e}\nload = {:e}\n",
            0.1 * side,
            -3.0 * load,
            0.05 * load * side * side / tension,
            2.0 * tension,
            -load
        ));
        assert_ne!(scene.problem.scale, Scale::default());
        let level = crate::cases::levels(&scene.problem, &uniform(1)).remove(0);
        let record = &level.record;
        let (eta_k, eta_e) = (
            record.eta_k.expect("paper"),
            record.eta_e_sum.expect("paper"),
        );
        // Constant loads have no oscillation and the norms |f_i| side.
        let kappa: f64 = 4.0 * load * side;
        let literal = eta_k + kappa.sqrt() * eta_e.sqrt();
        let found = record.bound_711.expect("paper");
        assert!(
            (found / literal - 1.0).abs() < 1e-13,
            "{found:e} {literal:e}"
        );
        let terms = level.estimates.global_bound.expect("paper");
        let scaled = record.bound_711_repaired.expect("paper") - eta_k;
        // Both remaining terms are there, each with its own unit.
        let unit = eta_k / terms.elements;
        let energy = record.energy_norm / level.estimates.energy.energy_norm;
        let expected = terms.jumps * unit + terms.complementarity * energy;
        assert!(
            (scaled / expected - 1.0).abs() < 1e-12,
            "{scaled:e} {expected:e}"
        );
        assert!(terms.jumps > 0.0 && terms.complementarity > 0.0 && eta_e > 0.0);
    }
}

/// A line of the figure.
struct Line {
    vertices: usize,
    h: f64,
    error: f64,
    eta_k: f64,
    edges: f64,
    literal: f64,
    repaired: f64,
    jumps: f64,
    complementarity: f64,
}

fn line(name: &str, level: &Level, h: f64, scale: Scale) -> Line {
    let record = &level.record;
    let errors = level.estimates.errors.as_ref().expect("exact");
    let terms = level.estimates.global_bound.expect("paper");
    let by = fem_core::scale::times_power_of_two;
    let result = Line {
        vertices: record.vertices,
        h,
        // What (7.11) bounds: the sum of the two seminorms.
        error: by(errors.h1[0] + errors.h1[1], scale.displacement()),
        eta_k: record.eta_k.expect("paper"),
        edges: record.eta_e_sum.expect("paper"),
        literal: record.bound_711.expect("paper"),
        repaired: record.bound_711_repaired.expect("paper"),
        jumps: by(terms.jumps, scale.force()),
        complementarity: by(terms.complementarity, scale.energy_norm()),
    };
    let Line {
        vertices,
        h,
        error,
        eta_k,
        edges,
        literal,
        repaired,
        jumps,
        complementarity,
    } = &result;
    println!(
        "csv,{name},{vertices},{h},{error:.4e},{eta_k:.4e},{edges:.4e},{literal:.4e},{repaired:.4e},{jumps:.4e},{complementarity:.4e}"
    );
    result
}

/// The literal bound tends to a constant, the repaired one to zero like h. Its numbers are those of the figure in the documentation.
fn stagnates(name: &str, grids: &[(Grid, usize, f64)], committed: &[[f64; 5]]) {
    println!(
        "csv,case,vertices,h,error,eta_K,eta_e_sum,bound_711,bound_711_repaired,jumps,complementarity"
    );
    let lines: Vec<Line> = grids
        .iter()
        .map(|(grid, refinements, h)| {
            let problem = on(name, grid, *refinements);
            line(name, &solve(&problem), *h, problem.scale)
        })
        .collect();
    assert_eq!(lines.len(), committed.len());
    for (l, c) in lines.iter().zip(committed) {
        let found = [l.error, l.eta_k, l.edges, l.literal, l.repaired];
        for (f, c) in found.iter().zip(c) {
            assert!(
                (f / c - 1.0).abs() < 0.01,
                "{name} {}: {found:?}",
                l.vertices
            );
        }
    }
    let [.., coarse, fine] = &lines[..] else {
        panic!("{name}: lines")
    };
    let order = |f: fn(&Line) -> f64| (f(coarse) / f(fine)).log2();
    // The second term, alone, does not fall at all; the repaired terms do.
    assert!(order(|l| l.edges).abs() < 0.05, "{name}");
    assert!(
        order(|l| l.literal) < 0.35,
        "{name}: {}",
        order(|l| l.literal)
    );
    assert!((0.9..1.1).contains(&order(|l| l.error)), "{name}");
    assert!((0.9..1.1).contains(&order(|l| l.repaired)), "{name}");
    assert!((0.9..1.1).contains(&order(|l| l.jumps)), "{name}");
    assert!(
        order(|l| l.complementarity) > 1.2,
        "{name}: {}",
        order(|l| l.complementarity)
    );
    // Half the force left, summed: O(h^3) to O(h^4) before the root.
    println!(
        "{name}: order of the products of force and gap {:.2}",
        2.0 * order(|l| l.complementarity)
    );
}

#[test]
fn p2_on_squares() {
    let grids = [8, 16, 32, 64, 128, 256].map(|n| (Grid::right(n), 0, 2.0 / n as f64));
    stagnates("P2", &grids, &P2);
}

#[test]
fn p1_on_the_disk() {
    let grids: Vec<_> = (2..=7)
        .map(|l| (Grid::disk(8), l, 0.5f64.powi(l as i32)))
        .collect();
    stagnates("P1", &grids, &P1);
}

/// Error, eta_K, the sum of eta_e, the literal bound, the repaired one.
const P2: [[f64; 5]; 6] = [
    [0.72476, 9.8515, 3.2607, 16.948, 10.749],
    [0.39407, 5.7355, 3.6004, 13.117, 6.1678],
    [0.20141, 3.1136, 3.7181, 10.606, 3.3266],
    [0.10127, 1.623, 3.7633, 9.1596, 1.7285],
    [0.05071, 0.82903, 3.7814, 8.3836, 0.88154],
    [0.025364, 0.41895, 3.7891, 7.9812, 0.44513],
];
const P1: [[f64; 5]; 6] = [
    [0.19904, 1.356, 0.053814, 1.7674, 1.4848],
    [0.12908, 0.91537, 0.045824, 1.2539, 0.95619],
    [0.066831, 0.50126, 0.0712, 0.92012, 0.51129],
    [0.033922, 0.26333, 0.07931, 0.70494, 0.26851],
    [0.017057, 0.13518, 0.082028, 0.58415, 0.13741],
    [0.0085375, 0.068367, 0.084311, 0.52353, 0.069444],
];
