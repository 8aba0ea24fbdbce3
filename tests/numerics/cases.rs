//! Problems with known solutions on given grids.

use std::path::{Path, PathBuf};

use adapt::settings::{Estimate, Estimator, Final, Stop, Strategy};
use adapt::{Level, Problem, Reason, Settings};
use fem_core::scale::times_power_of_two;
use fem_core::{Children, Circle, Mesh};

/// The folder of the tests.
pub fn tests() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests")
}

/// The folder of the scenes that users start from.
pub fn configs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs")
}

/// Builds a scene from its text.
pub fn scene(text: &str) -> scene::Scene {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("scene.toml");
    std::fs::write(&file, text).expect("written");
    scene::load(&file, &[]).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// The data of a case, on a coarse mesh of (-1, 1)^2 that is to be replaced.
pub fn case(name: &str) -> Problem {
    let data = std::fs::read_to_string(tests().join(format!("cases/{name}.toml"))).expect("a case");
    let domain = "[domain.rectangle]\nlower = [-1, -1]\nupper = [1, 1]\nsize = 0.25\n";
    scene(&format!("{domain}{data}")).problem
}

/// Points and triangles of a grid.
pub struct Grid {
    pub points: Vec<[f64; 2]>,
    pub triangles: Vec<[u32; 3]>,
    pub circle: bool,
}

impl Grid {
    /// n x n squares of (-1, 1)^2 with diagonals along (1, 1).
    pub fn right(n: usize) -> Grid {
        Grid::squares(n, |_, _| true, false)
    }

    /// n x n squares with both diagonals.
    pub fn cross(n: usize) -> Grid {
        Grid::squares(n, |_, _| true, true)
    }

    /// The right grid without x > 0, y < 0.
    pub fn lshape(n: usize) -> Grid {
        Grid::squares(n, |x, y| x < 0.0 || y > 0.0, false)
    }

    /// A fan of `k` triangles over the unit disk, to be divided by bisection.
    pub fn disk(k: usize) -> Grid {
        let mut points = vec![[0.0, 0.0]];
        points.extend((0..k).map(|i| {
            let phi = std::f64::consts::TAU * i as f64 / k as f64;
            [phi.cos(), phi.sin()]
        }));
        let triangles = (0..k)
            .map(|i| [1 + i as u32, 1 + ((i + 1) % k) as u32, 0])
            .collect();
        Grid {
            points,
            triangles,
            circle: true,
        }
    }

    fn squares(n: usize, keep: impl Fn(f64, f64) -> bool, cross: bool) -> Grid {
        let at = |k: usize| -1.0 + 2.0 * k as f64 / n as f64;
        let mut number = std::collections::HashMap::new();
        let mut points: Vec<[f64; 2]> = Vec::new();
        let mut vertex = |key: (usize, usize), p: [f64; 2]| {
            *number.entry(key).or_insert_with(|| {
                points.push(p);
                points.len() as u32 - 1
            })
        };
        let mut triangles = Vec::new();
        for i in 0..n {
            for j in 0..n {
                let centre = [0.5 * (at(i) + at(i + 1)), 0.5 * (at(j) + at(j + 1))];
                if !keep(centre[0], centre[1]) {
                    continue;
                }
                let corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)];
                let c = corners.map(|(i, j)| vertex((2 * i, 2 * j), [at(i), at(j)]));
                if cross {
                    let m = vertex((2 * i + 1, 2 * j + 1), centre);
                    triangles.extend((0..4).map(|k| [c[k], c[(k + 1) % 4], m]));
                } else {
                    triangles.extend([[c[0], c[1], c[2]], [c[0], c[2], c[3]]]);
                }
            }
        }
        Grid {
            points,
            triangles,
            circle: false,
        }
    }

    /// The grid as a mesh in the scaled lengths of a problem.
    pub fn mesh(&self, problem: &Problem) -> Mesh {
        let exponent = -problem.scale.length;
        let points = self
            .points
            .iter()
            .map(|p| p.map(|x| times_power_of_two(x, exponent)))
            .collect();
        let circle = Circle {
            center: [0.0, 0.0],
            radius: times_power_of_two(1.0, exponent),
        };
        // The fan's refinement edges are those on the circle, as in the reference meshes.
        if self.circle {
            return Mesh::with_refinement_edges(points, &self.triangles, &[], Some(circle))
                .expect("a fan");
        }
        Mesh::new(points, &self.triangles, &[], None).expect("a grid")
    }
}

/// A case on a grid, divided uniformly `refinements` times.
pub fn on(name: &str, grid: &Grid, refinements: usize) -> Problem {
    let mut problem = case(name);
    problem.mesh = grid.mesh(&problem);
    for _ in 0..refinements {
        problem
            .mesh
            .refine_uniformly(Children::Four)
            .expect("refines");
    }
    problem
}

/// Both estimators, no files, `levels` levels of uniform refinement.
pub fn uniform(levels: usize) -> Settings {
    let mut settings = Settings {
        estimate: Estimate {
            estimator: Estimator::Residual,
            also: vec![Estimator::Paper],
            last: Final::Fast,
        },
        ..Settings::default()
    };
    settings.mark.strategy = Strategy::Uniform;
    settings.stop = Stop {
        levels: Some(levels),
        ..Stop::default()
    };
    settings
}

/// Runs and keeps every level.
pub fn levels(problem: &Problem, settings: &Settings) -> Vec<Level> {
    let mut kept = Vec::new();
    let mut keep = |level: &Level, _: Option<Reason>| {
        kept.push(level.clone());
        Ok(())
    };
    adapt::run(problem, settings, &mut keep).unwrap_or_else(|e| panic!("{e}"));
    kept
}

/// Solves and estimates on the problem's own mesh.
pub fn solve(problem: &Problem) -> Level {
    levels(problem, &uniform(1)).remove(0)
}
