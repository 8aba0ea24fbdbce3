//! What the certificate costs a triangle, beside a sparse matrix-vector product in the same run.
//!
//! `cargo bench -p membranes -p estimate --bench certificate` prints seconds, and after `-- instructions` the instructions a triangle as
//! valgrind's callgrind counts them, which travel between machines of one kind.

#[path = "kernels/clock.rs"]
mod clock;

use contact::{DiscreteProblem, Settings, Solution};
use estimate::certificate::POINCARE;
use estimate::{Given, Grade, Moments, certify};
use fem_core::{Children, Constant, Field, Mesh};

use clock::best;

/// The L-shape with constant loads, refined uniformly.
fn lshape(refinements: usize) -> Mesh {
    let points = vec![
        [-1.0, -1.0],
        [0.0, -1.0],
        [-1.0, 0.0],
        [0.0, 0.0],
        [1.0, 0.0],
        [-1.0, 1.0],
        [0.0, 1.0],
        [1.0, 1.0],
    ];
    let triangles = [
        [0, 1, 3],
        [0, 3, 2],
        [2, 3, 6],
        [2, 6, 5],
        [3, 4, 7],
        [3, 7, 6],
    ];
    let mut mesh = Mesh::new(points, &triangles, &[], None).expect("a mesh");
    for _ in 0..refinements {
        mesh.refine_uniformly(Children::Four).expect("refines");
    }
    mesh
}

struct Case {
    mesh: Mesh,
    discrete: DiscreteProblem,
    solution: Solution,
}

const LOAD: [Constant; 2] = [Constant(-6.0), Constant(0.0)];
const TENSION: [Constant; 2] = [Constant(1.0), Constant(2.0)];

fn fields(constants: &[Constant; 2]) -> [&dyn Field; 2] {
    [&constants[0], &constants[1]]
}

impl Case {
    fn new(refinements: usize) -> Case {
        let mesh = lshape(refinements);
        let means = TENSION.map(|t| vec![t.0; mesh.triangle_count()]);
        let loads = fem_core::integrate::load_pair(&mesh, fields(&LOAD)).expect("finite");
        let height = |g: f64| -> Vec<f64> {
            mesh.boundary()
                .iter()
                .map(|&b| if b { g } else { 0.0 })
                .collect()
        };
        let heights = [height(0.05), height(0.0)];
        let discrete = DiscreteProblem::new(mesh.clone(), means, loads, heights);
        let solution = contact::solve(&discrete, &Settings::default(), None).expect("solved");
        Case {
            mesh,
            discrete,
            solution,
        }
    }

    fn certify(&self, grade: Grade) -> f64 {
        let mean = &self.discrete.tension_mean;
        let moments = Moments::of(&self.mesh, fields(&LOAD), fields(&TENSION)).expect("finite");
        let given = Given {
            mesh: &self.mesh,
            load: fields(&LOAD),
            tension: fields(&TENSION),
            moments: &moments,
            loads: &self.discrete.loads,
            tension_mean: mean,
            displacement: &self.solution.displacement,
            force: &self.solution.force,
            threads: 1,
        };
        certify(&given, grade, POINCARE).expect("finite").bound
    }
}

/// Counts this program under callgrind with one certificate and without any.
fn instructions() {
    let count = |grade: &str| -> Option<f64> {
        let program = std::env::current_exe().ok()?;
        let run = std::process::Command::new("valgrind")
            .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
            .arg(program)
            .args(["count", grade])
            .output()
            .ok()?;
        let text = String::from_utf8_lossy(&run.stderr).into_owned();
        let line = text.lines().find(|l| l.contains("Collected"))?;
        line.split_whitespace().last()?.parse().ok()
    };
    let Some(none) = count("none") else {
        println!("valgrind was not found: instructions are not counted");
        return;
    };
    for grade in ["rt0", "rt1"] {
        if let Some(with) = count(grade) {
            println!(
                "{grade}: {:.0} instructions a triangle",
                (with - none) / COUNTED as f64
            );
        }
    }
}

/// Triangles of the mesh that instructions are counted on.
const COUNTED: usize = 6144;

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    if arguments.iter().any(|a| a == "instructions") {
        return instructions();
    }
    if let Some(at) = arguments.iter().position(|a| a == "count") {
        let case = Case::new(5);
        let bound = match arguments.get(at + 1).map(String::as_str) {
            Some("rt0") => case.certify(Grade::Rt0),
            Some("rt1") => case.certify(Grade::Rt1),
            _ => 0.0,
        };
        assert_eq!(case.mesh.triangle_count(), COUNTED);
        println!("{bound:.6e}");
        return;
    }
    println!("constant loads and tensions, one thread, best of several");
    println!(
        "{:>9} {:>9} {:>12} {:>12} {:>14}",
        "vertices", "triangles", "rt0 us/tri", "rt1 us/tri", "product ns/row"
    );
    for refinements in [6, 8] {
        let case = Case::new(refinements);
        let (n, count) = (case.mesh.vertex_count(), case.mesh.triangle_count());
        let x = &case.solution.displacement[0];
        let matrix = case.discrete.stiffness(0);
        let mut y = vec![0.0; n];
        let product = best(20, || {
            for (j, y) in y.iter_mut().enumerate() {
                *y = matrix.row_dot(j, x);
            }
            y[n / 2]
        });
        let fast = best(7, || case.certify(Grade::Rt0));
        let sharp = best(3, || case.certify(Grade::Rt1));
        println!(
            "{n:>9} {count:>9} {:>12.3} {:>12.3} {:>14.1}   rt0 = {:.1} and rt1 = {:.1} products",
            1e6 * fast / count as f64,
            1e6 * sharp / count as f64,
            1e9 * product / n as f64,
            fast / product,
            sharp / product,
        );
    }
}
