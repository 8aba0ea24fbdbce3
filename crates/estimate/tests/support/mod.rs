//! Reads the committed reference meshes and values (`tests/reference/` of the workspace).
#![allow(dead_code)]

pub mod cases;
pub mod quadrature;

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

use contact::{DiscreteProblem, Reduction, Solution, SolveInfo, Status};
use fem_core::integrate::Loads;
use fem_core::{Field, Mesh};
use serde_json::Value;

/// A mesh with the discrete solution that the file holds, and the file's own numbers.
pub struct Reference {
    pub mesh: Mesh,
    pub problem: DiscreteProblem,
    pub solution: Solution,
    pub values: Value,
}

impl Reference {
    /// Reads `name`.json and `name`.msh; element means of the tensions by a rule of high order. Oscillations are not in the files: they are set to zero.
    pub fn read(name: &str, tension: &[Arc<dyn Field>; 2]) -> Reference {
        let text = read(&format!("{name}.json"));
        let values: Value = serde_json::from_str(&text).unwrap();
        let (points, triangles) = read_msh(&read(&format!("{name}.msh")));
        let mesh = Mesh::new(points, &triangles, &[], None).unwrap();
        let loads = [("load1", "f1_mean"), ("load2", "f2_mean")].map(|(nodal, mean)| {
            let mean = numbers(&values[mean]);
            Loads::from_parts(numbers(&values[nodal]), &mean, &vec![0.0; mean.len()])
        });
        let displacement = [numbers(&values["u1"]), numbers(&values["u2"])];
        let heights = [0, 1].map(|i: usize| {
            let u = &displacement[i];
            u.iter()
                .zip(mesh.boundary())
                .map(|(u, &b)| if b { *u } else { 0.0 })
                .collect()
        });
        let mean = [0, 1].map(|i: usize| quadrature::means(&mesh, tension[i].as_ref()));
        let problem = DiscreteProblem::new(mesh.clone(), mean, loads, heights);
        let force = numbers(&values["z"]);
        let solution = Solution {
            contact: force.iter().map(|&z| z > 0.0).collect(),
            displacement,
            force,
            sigma: numbers(&values["sigma"]),
            info: SolveInfo {
                solver: "given",
                reduction: Reduction::TwoField,
                status: Status::Converged,
                iterations: 0,
                unknowns: 0,
                kkt_residual: 0.0,
                algebraic_error: None,
                contraction: None,
                first_cycle: None,
                cycles: None,
            },
        };
        Reference {
            mesh,
            problem,
            solution,
            values,
        }
    }

    /// A number of the file's totals.
    pub fn total(&self, key: &str) -> f64 {
        self.values["totals"][key].as_f64().unwrap()
    }

    /// An array of the file.
    pub fn array(&self, key: &str) -> Vec<f64> {
        numbers(&self.values[key])
    }

    /// The file's `eta_e` in the order of the mesh's interior edges.
    pub fn eta_e(&self) -> Vec<f64> {
        let key = |a: u64, b: u64| (a.min(b), a.max(b));
        let by_ends: HashMap<(u64, u64), f64> = self.values["edges"]
            .as_array()
            .unwrap()
            .iter()
            .map(|e| key(e[0].as_u64().unwrap(), e[1].as_u64().unwrap()))
            .zip(self.array("eta_e"))
            .collect();
        self.mesh
            .interior_edges()
            .map(|e| by_ends[&key(e.vertices[0].0.into(), e.vertices[1].0.into())])
            .collect()
    }
}

/// The largest difference over the largest expected value.
pub fn difference(values: &[f64], expected: &[f64]) -> f64 {
    assert_eq!(values.len(), expected.len());
    let largest = expected.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let worst = values
        .iter()
        .zip(expected)
        .fold(0.0f64, |m, (v, e)| m.max((v - e).abs()));
    if worst == 0.0 { 0.0 } else { worst / largest }
}

fn read(file: &str) -> String {
    let path: PathBuf = [env!("CARGO_MANIFEST_DIR"), "../../tests/reference", file]
        .iter()
        .collect();
    std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

fn numbers(array: &Value) -> Vec<f64> {
    let array = array.as_array().unwrap();
    array.iter().map(|v| v.as_f64().unwrap()).collect()
}

/// Nodes and triangles of a Gmsh 4.1 ASCII file with one block of nodes, one of triangles, and tags counted from 1.
fn read_msh(text: &str) -> (Vec<[f64; 2]>, Vec<[u32; 3]>) {
    let section = |name: &str| -> Vec<Vec<f64>> {
        text.lines()
            .skip_while(|l| *l != format!("${name}"))
            .skip(1)
            .take_while(|l| *l != format!("$End{name}"))
            .map(|l| l.split_whitespace().map(|w| w.parse().unwrap()).collect())
            .collect()
    };
    let nodes = section("Nodes");
    // Two header lines, all tags, then all coordinates.
    let count = nodes[1][3] as usize;
    let points = nodes[2 + count..2 + 2 * count]
        .iter()
        .map(|p| [p[0], p[1]])
        .collect();
    let triangles = section("Elements")[2..]
        .iter()
        .map(|e| [e[1], e[2], e[3]].map(|v| v as u32 - 1))
        .collect();
    (points, triangles)
}
