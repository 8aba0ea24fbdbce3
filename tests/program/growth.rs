//! The work of a whole run stays in proportion to the vertices of its last mesh: by counts, whatever the machine.

use std::path::Path;

use adapt::output::OutputError;
use adapt::{Level, Reason};

/// What a run to so many vertices takes.
struct Work {
    vertices: usize,
    /// Vertices of a level times its iterations, summed.
    steps: usize,
    /// Vertices of all levels.
    seen: usize,
    /// The most iterations of a level that multigrid solved.
    most: usize,
}

fn work(scene: &str, limit: usize) -> Work {
    let file =
        Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../../benches/growth/{scene}.toml"));
    let limit = format!("stop.vertices={limit}");
    let scene = scene::load(&file, &["stop={}".to_owned(), limit]).expect("a scene");
    let mut work = Work {
        vertices: 0,
        steps: 0,
        seen: 0,
        most: 0,
    };
    let mut watch = |level: &Level, _: Option<Reason>| -> Result<(), OutputError> {
        let record = &level.record;
        work.vertices = record.vertices;
        work.steps += record.vertices * record.iterations;
        work.seen += record.vertices;
        if record.solver == "multigrid" {
            work.most = work.most.max(record.iterations);
        }
        Ok(())
    };
    adapt::run(&scene.problem, &scene.settings, &mut watch).expect("solved");
    work
}

#[test]
fn work_grows_like_the_last_mesh() {
    for scene in ["constant", "square"] {
        let sizes = [20_000, 40_000, 80_000, 160_000].map(|limit| work(scene, limit));
        for w in &sizes {
            let per_vertex = |count: usize| count as f64 / w.vertices as f64;
            println!(
                "{scene}: {} vertices, {:.2} steps and {:.2} vertices of all levels for each, at most {} steps a level",
                w.vertices,
                per_vertex(w.steps),
                per_vertex(w.seen),
                w.most
            );
            assert!((1..=MOST).contains(&w.most), "{scene}: {}", w.most);
            assert!(per_vertex(w.seen) <= SEEN, "{scene}: {}", w.vertices);
            assert!(per_vertex(w.steps) <= STEPS, "{scene}: {}", w.vertices);
        }
    }
}

/// Steps that multigrid may take on a level: 6 were measured on the first that it solves, 3 or 4 later.
const MOST: usize = 6;
/// Vertices of all levels for each of the last; 2.31 were measured.
const SEEN: f64 = 2.5;
/// Vertices times steps for each vertex of the last level; 7.41 were measured.
const STEPS: f64 = 8.0;
