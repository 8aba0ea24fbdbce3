//! The contact set against the exact one: the expressions of the cases, and how fast the two sets come together.

use adapt::settings::{Estimate, Estimator, Final, Stop};
use adapt::{Level, Settings};
use fem_core::scale::times_power_of_two;
use fem_core::{Field, Samples};

use crate::cases::{Grid, configs, levels, on, scene, solve, tests, uniform};

/// Every case, and whether it lives on the disk or the L-shape.
const CASES: [&str; 14] = [
    "P1", "P2", "P3", "P4a", "P4b", "P4c", "P5", "P6", "P6b", "P6c", "P7", "P7c", "P7l", "P8",
];

/// The section `[exact]` of a scene and the value of a key in it.
fn exact(text: &str) -> (&str, impl Fn(&str) -> String + '_) {
    let section = &text[text.find("[exact]").expect("exact")..];
    let section = section.split("\n\n").next().expect("a section");
    let value = move |key: &str| {
        let line = section.lines().find(|l| l.starts_with(&format!("{key} =")));
        let line = line.unwrap_or_else(|| panic!("no {key}"));
        line.split_once('=').expect("a value").1.trim().to_string()
    };
    (section, value)
}

fn sample(field: &dyn Field, at: Samples<'_>) -> Vec<f64> {
    let mut values = vec![0.0; at.len()];
    field.sample(at, &mut values).expect("finite");
    values
}

/// `contact` is true exactly where u1 = u2, and wherever the action is not zero.
fn agrees(name: &str, text: &str, parameters: &str) {
    let (section, value) = exact(text);
    // The displacements as loads: those can be sampled.
    let scene = scene(&format!(
        "{parameters}\n[domain.rectangle]\nsize = 0.5\n[upper]\nload = {}\n[lower]\nload = {}\n{section}\n",
        value("upper"),
        value("lower")
    ));
    let problem = scene.problem;
    let unit = times_power_of_two(1.0, -problem.scale.length);
    let (mut x, mut y) = (Vec::new(), Vec::new());
    for i in 0..97 {
        for j in 0..89 {
            let p = [
                -1.0 + (2.0 * f64::from(i) + 0.97) / 97.0,
                -1.0 + (2.0 * f64::from(j) + 1.02) / 89.0,
            ];
            let inside = match name {
                "P1" | "disk" => p[0].hypot(p[1]) < 1.0,
                "P3" | "lshape" => p[0] < 0.0 || p[1] > 0.0,
                _ => true,
            };
            if inside {
                x.push(unit * p[0]);
                y.push(unit * p[1]);
            }
        }
    }
    let region = vec![0.0; x.len()];
    let at = Samples {
        x: &x,
        y: &y,
        region: &region,
    };
    let [upper, lower] = [0, 1].map(|i| sample(problem.load[i].as_ref(), at));
    let exact = problem.exact.expect("exact");
    let contact = sample(exact.contact.expect("contact").as_ref(), at);
    let action = sample(exact.action.expect("action").as_ref(), at);
    for k in 0..x.len() {
        let what = format!("{name} at ({}, {})", x[k] / unit, y[k] / unit);
        assert_eq!(contact[k] != 0.0, upper[k] == lower[k], "{what}");
        assert!(upper[k] >= lower[k] && action[k] >= 0.0, "{what}");
        assert!(action[k] == 0.0 || contact[k] != 0.0, "{what}");
    }
}

#[test]
fn the_expressions_are_those_of_the_solutions() {
    for name in CASES {
        let file = tests().join(format!("cases/{name}.toml"));
        agrees(name, &std::fs::read_to_string(file).expect("a case"), "");
    }
    for name in [
        "disk",
        "square",
        "lshape",
        "full-contact",
        "no-contact",
        "tension-jump",
    ] {
        let file = configs().join(format!("{name}.toml"));
        let text = std::fs::read_to_string(file).expect("a scene");
        let parameters = if name == "disk" {
            "[parameters]\ng = 0.05"
        } else {
            ""
        };
        agrees(name, &text, parameters);
    }
}

struct Measured {
    vertices: usize,
    /// Longest edge on the free boundary's elements is that of the mesh on uniform grids.
    h: f64,
    area: f64,
    jaccard: f64,
    hausdorff: f64,
}

fn measure(name: &str, level: &Level) -> Measured {
    let record = &level.record;
    let set = level.estimates.contact_set.expect("contact");
    let diameter = |t| level.mesh.shape(t).diameter();
    let largest = level.mesh.triangle_ids().map(diameter).fold(0.0, f64::max);
    // The scaled lengths of a level are those of the record over the unit.
    let unit = record.contact_hausdorff.expect("not empty") / set.hausdorff.expect("not empty");
    let result = Measured {
        vertices: level.mesh.vertex_count(),
        h: unit * largest,
        area: record.contact_area_error.expect("known"),
        jaccard: record.contact_jaccard.expect("known"),
        hausdorff: record.contact_hausdorff.expect("known"),
    };
    println!(
        "{name} {:>6}: area error {:.3e}, 1 - Jaccard {:.3e}, Hausdorff {:.3e} = {:.2} h",
        result.vertices,
        result.area,
        1.0 - result.jaccard,
        result.hausdorff,
        result.hausdorff / result.h
    );
    result
}

/// Area error, 1 - Jaccard and distance stay below multiples of h, and each falls by half a level or faster from the first grid to the last.
fn first_order(name: &str, family: &[Measured], bounds: [f64; 3]) {
    let numbers = |m: &Measured| [m.area, 1.0 - m.jaccard, m.hausdorff];
    for m in family {
        for (value, bound) in numbers(m).iter().zip(bounds) {
            assert!(
                *value <= bound * m.h,
                "{name} {}: {value} {}",
                m.vertices,
                m.h
            );
        }
    }
    let [first, .., last] = family else {
        panic!("{name}: a family")
    };
    for (k, (a, b)) in numbers(first).into_iter().zip(numbers(last)).enumerate() {
        let order = (a / b).ln() / (first.h / last.h).ln();
        println!(
            "{name}: order {order:.2} of {}",
            ["area", "Jaccard", "distance"][k]
        );
        assert!(order >= 0.9, "{name}: order {order} of number {k}");
    }
}

fn family(name: &str, grids: &[(Grid, usize)]) -> Vec<Measured> {
    let at =
        |(grid, refinements): &(Grid, usize)| measure(name, &solve(&on(name, grid, *refinements)));
    grids.iter().map(at).collect()
}

fn squares(grid: fn(usize) -> Grid) -> Vec<(Grid, usize)> {
    [16, 32, 64, 128, 256]
        .map(|n| (grid(n), 0))
        .into_iter()
        .collect()
}

#[test]
fn p1_on_the_disk() {
    let grids: Vec<_> = (3..=6).map(|l| (Grid::disk(8), l)).collect();
    first_order("P1", &family("P1", &grids), [3.0, 2.0, 1.0]);
}

#[test]
fn p2_where_the_action_is_continuous() {
    first_order("P2", &family("P2", &squares(Grid::right)), [3.0, 2.0, 1.0]);
}

#[test]
fn p3_on_the_lshape() {
    first_order("P3", &family("P3", &squares(Grid::lshape)), [3.0, 4.0, 1.0]);
}

#[test]
fn p8_with_a_jump_of_the_action() {
    first_order("P8", &family("P8", &squares(Grid::right)), [3.0, 3.0, 1.5]);
}

/// Adaptive meshes: the sets come together with the number of vertices.
#[test]
fn adaptive_meshes() {
    let square = scene::load(&configs().join("square.toml"), &[]).unwrap_or_else(|e| panic!("{e}"));
    let settings = Settings {
        estimate: Estimate {
            estimator: Estimator::Residual,
            also: Vec::new(),
            last: Final::Fast,
        },
        stop: Stop {
            vertices: Some(30_000),
            ..Stop::default()
        },
        // The sets of the discrete problems themselves: a balanced solve leaves a few vertices along the free boundary undecided.
        solve: contact::Settings {
            tolerance: contact::Tolerance::Relative(1e-10),
            ..contact::Settings::default()
        },
        ..Settings::default()
    };
    let levels = levels(&square.problem, &settings);
    let measured: Vec<_> = levels.iter().map(|l| measure("square", l)).collect();
    let [first, .., last] = &measured[..] else {
        panic!("levels")
    };
    let order =
        |a: f64, b: f64| 2.0 * (a / b).ln() / (last.vertices as f64 / first.vertices as f64).ln();
    let found = [
        order(first.area, last.area),
        order(1.0 - first.jaccard, 1.0 - last.jaccard),
        order(first.hausdorff, last.hausdorff),
    ];
    println!("square, adaptive: orders {found:.2?} in vertices^(-1/2)");
    assert!(found.iter().all(|&o| o >= 0.9), "{found:?}");
}

/// Full contact up to the boundary: what is missing are the dual cells of boundary vertices, by the definition of the discrete set.
#[test]
fn full_contact_misses_the_cells_of_the_boundary() {
    for n in [16, 64] {
        let found = measure("P6", &solve(&on("P6", &Grid::right(n), 0)));
        let h = 2.0 / n as f64;
        // Strips of half a square, but the cells of the corners lie in two of them.
        let inner = (2.0 - h) * (2.0 - h);
        assert!(
            (found.area - (4.0 - inner)).abs() <= 1e-10,
            "{}",
            found.area
        );
        assert!((found.jaccard - inner / 4.0).abs() <= 1e-10);
        // The triangle in a corner off the diagonals has no interior vertex.
        let distance = 8f64.sqrt() / 3.0 * h;
        assert!(
            (found.hausdorff / distance - 1.0).abs() <= 1e-3,
            "{}",
            found.hausdorff
        );
    }
}

/// Contact without area: the exact set counts as empty, so every contact vertex is in error and there is no distance.
#[test]
fn contact_in_a_point_and_on_a_segment() {
    for name in ["P7", "P7l", "P5"] {
        let level = solve(&on(name, &Grid::right(32), 0));
        let record = &level.record;
        let touching = record.contact_vertices > 0;
        println!("{name}: {} contact vertices", record.contact_vertices);
        assert_eq!(
            record.contact_area_error,
            Some(record.contact_area),
            "{name}"
        );
        assert_eq!(
            record.contact_jaccard,
            Some(if touching { 0.0 } else { 1.0 }),
            "{name}"
        );
        assert_eq!(
            record.contact_hausdorff,
            (!touching).then_some(0.0),
            "{name}"
        );
    }
    // Nothing is compared where the set is not given.
    let mut problem = on("P5", &Grid::right(4), 0);
    problem.exact.as_mut().expect("exact").contact = None;
    let record = levels(&problem, &uniform(1)).remove(0).record;
    assert_eq!(record.contact_area_error, None);
    assert_eq!(
        (record.contact_jaccard, record.contact_hausdorff),
        (None, None)
    );
}
