//! Eleven meshes with the values of an independent program (`tests/reference/README.md`).

use std::collections::HashMap;
use std::path::Path;

use adapt::discretise;
use contact::{DiscreteProblem, Solution};
use fem_core::Mesh;
use fem_core::integrate::Loads;
use fem_core::scale::times_power_of_two;
use serde_json::Value;

use crate::cases::{case, solve, tests};

pub const NAMES: [&str; 11] = [
    "P1_disk_8_4",
    "P2_right_16",
    "P3_lshape_16",
    "P4a_delaunay_24",
    "P4b_cross_8",
    "P5_delaunay_16",
    "P6_cross_8",
    "P6c_right_16",
    "P7_delaunay_16",
    "P7c_cross_12",
    "P8_delaunay_24",
];

/// A mesh with its values.
pub struct Reference {
    pub problem: adapt::Problem,
    pub values: Value,
}

impl Reference {
    pub fn read(name: &str) -> Reference {
        let folder = tests().join("reference");
        let text = std::fs::read_to_string(folder.join(format!("{name}.json"))).expect("values");
        let values: Value = serde_json::from_str(&text).expect("JSON");
        let mut problem = case(values["case"].as_str().expect("a case"));
        problem.mesh = mesh(&folder.join(format!("{name}.msh")), problem.scale.length);
        Reference { problem, values }
    }

    fn array(&self, key: &str) -> Vec<f64> {
        numbers(&self.values[key])
    }

    fn total(&self, key: &str) -> Option<f64> {
        self.values["totals"][key].as_f64()
    }

    /// The discrete problem with the loads of the file.
    pub fn discrete(&self) -> DiscreteProblem {
        let (problem, scale) = (&self.problem, self.problem.scale);
        let mut discrete =
            discretise(problem, &std::sync::Arc::new(problem.mesh.clone()), 1).expect("good data");
        for (i, k) in [(0, "1"), (1, "2")] {
            let scaled = |key: String, e: i32| -> Vec<f64> {
                self.array(&key)
                    .iter()
                    .map(|&v| times_power_of_two(v, -e))
                    .collect()
            };
            let deviation: Vec<f64> = (0..problem.mesh.triangle_count())
                .map(|t| discrete.loads[i].deviation_squared(t))
                .collect();
            discrete.loads[i] = Loads::from_parts(
                scaled(format!("load{k}"), scale.force()),
                &scaled(format!("f{k}_mean"), scale.load),
                &deviation,
            );
        }
        discrete
    }

    /// The file's eta_e in the order of a mesh's interior edges.
    fn edges(&self, mesh: &Mesh) -> Vec<f64> {
        let eta = self.array("eta_e");
        let ends = self.values["edges"].as_array().expect("edges");
        let by_ends: HashMap<(u32, u32), f64> = ends
            .iter()
            .zip(eta)
            .map(|(e, eta)| {
                let v = numbers(e);
                let (a, b) = (v[0] as u32, v[1] as u32);
                ((a.min(b), a.max(b)), eta)
            })
            .collect();
        mesh.interior_edges()
            .map(|e| {
                let [a, b] = e.vertices;
                by_ends[&(a.0.min(b.0), a.0.max(b.0))]
            })
            .collect()
    }
}

fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .expect("an array")
        .iter()
        .map(|v| v.as_f64().expect("a number"))
        .collect()
}

fn mesh(path: &Path, exponent: i32) -> Mesh {
    let raw = domain::gmsh::read(path).expect("a mesh");
    let points = raw
        .points
        .iter()
        .map(|p| p.map(|x| times_power_of_two(x, -exponent)))
        .collect();
    Mesh::new(points, &raw.triangles, &raw.regions, None).expect("conforming")
}

/// Largest difference over largest value; the difference itself where all values are zero.
fn difference(found: &[f64], wanted: &[f64]) -> f64 {
    assert_eq!(found.len(), wanted.len());
    let largest = wanted.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let worst = found
        .iter()
        .zip(wanted)
        .fold(0.0f64, |m, (f, w)| m.max((f - w).abs()));
    if largest == 0.0 {
        worst
    } else {
        worst / largest
    }
}

/// u1, u2, z, sigma, eta_K, eta_e against the file.
fn differences(reference: &Reference, discrete: &DiscreteProblem, solution: &Solution) -> [f64; 6] {
    let (mesh, scale) = (&reference.problem.mesh, reference.problem.scale);
    let paper = estimate::paper(mesh, discrete, solution);
    let physical = |v: &[f64], e: i32| {
        v.iter()
            .map(|&v| times_power_of_two(v, e))
            .collect::<Vec<_>>()
    };
    let (u, f) = (scale.displacement(), scale.force());
    [
        difference(
            &physical(&solution.displacement[0], u),
            &reference.array("u1"),
        ),
        difference(
            &physical(&solution.displacement[1], u),
            &reference.array("u2"),
        ),
        difference(&physical(&solution.force, f), &reference.array("z")),
        difference(&physical(&solution.sigma, f), &reference.array("sigma")),
        difference(&physical(&paper.eta_k, f), &reference.array("eta_K")),
        difference(&physical(&paper.eta_e, f), &reference.edges(mesh)),
    ]
}

#[test]
fn with_the_loads_of_the_file() {
    for name in NAMES {
        let reference = Reference::read(name);
        let discrete = reference.discrete();
        for reduce in [true, false] {
            let settings = contact::Settings {
                reduce,
                ..contact::Settings::default()
            };
            let solution = contact::solve(&discrete, &settings, None).expect("solved");
            let found = differences(&reference, &discrete, &solution);
            println!(
                "{name} {:?}: {found:.1e}",
                solution.info.reduction,
                found = Digits(&found)
            );
            assert!(found.iter().all(|d| *d <= 1e-9), "{name}: {found:?}");
            let active = solution.contact.iter().filter(|c| **c).count() as f64;
            assert_eq!(Some(active), reference.total("active"), "{name}");
        }
    }
}

#[test]
fn with_our_own_loads() {
    for name in NAMES {
        let reference = Reference::read(name);
        let level = solve(&reference.problem);
        let found = differences(&reference, &level.discrete, &level.solution);
        println!("{name}: {found:.1e}", found = Digits(&found));
        let smooth = ["P5", "P6_", "P6c", "P7_"]
            .iter()
            .any(|p| name.starts_with(p));
        let allowed = if smooth {
            [1e-6; 6]
        } else {
            [1e-3, 1e-3, 2e-2, 3e-3, 3e-3, 2e-2]
        };
        for (i, (found, allowed)) in found.iter().zip(allowed).enumerate() {
            // The contact force of P4b is a 1e-4 part of its load.
            if !(name.starts_with("P4b") && [2, 3, 5].contains(&i)) {
                assert!(*found <= allowed, "{name}, number {i}: {found}");
            }
        }
        totals(name, &reference, &level);
    }
}

fn totals(name: &str, reference: &Reference, level: &adapt::Level) {
    let scale = reference.problem.scale;
    let record = &level.record;
    let errors = level.estimates.errors.as_ref().expect("exact");
    let physical = |v, e| Some(times_power_of_two(v, e));
    let u = scale.displacement();
    let allowed = if name.starts_with("P3") { 5e-3 } else { 1e-3 };
    for (key, found) in [
        ("err_u1", physical(errors.h1[0], u)),
        ("err_u2", physical(errors.h1[1], u)),
        ("err_energy", record.true_error),
        ("err_sigma", record.sigma_error),
        ("osc", Some(record.oscillation)),
        ("eta_res", record.residual),
        ("energy", Some(record.energy)),
        ("energy_norm", Some(record.energy_norm)),
        ("eta_K", record.eta_k),
    ] {
        // sigma is known to some cases by its norm only.
        let (Some(found), Some(wanted)) = (found, reference.total(key)) else {
            continue;
        };
        // Loads that jump are good to 1e-3 in the files; |sigma - sigma_h| is small enough on P1 to feel it (1.7e-3 remain
        // when ours are integrated a hundred times more finely), with the file's own loads it agrees to 1e-4.
        let allowed = match key {
            "eta_K" => 3e-3,
            "err_sigma" if name.starts_with("P1") => 3e-3,
            _ => allowed,
        };
        let relative = (found / wanted - 1.0).abs();
        println!("{name} {key}: {relative:.1e}");
        assert!(
            relative <= allowed,
            "{name} {key}: {found} against {wanted}"
        );
    }
}

/// Prints a row of differences with one digit each.
struct Digits<'a>(&'a [f64]);

impl std::fmt::LowerExp for Digits<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.iter().try_for_each(|d| write!(f, "{d:8.1e} "))
    }
}
