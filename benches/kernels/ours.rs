//! Kernels of the program.

use std::path::PathBuf;
use std::sync::Arc;

use adapt::Problem;
use adapt::settings::{Mark, Strategy};
use fem_core::integrate::load_pair;
use fem_core::{Children, Constant, Field, Mesh, Samples, TriangleId};

use crate::limits::Dice;
use crate::{Job, Kernel, Size};

/// All of them, in the order in which they are printed.
pub const KERNELS: &[Kernel] = &[
    Kernel {
        name: "bisection, uniform",
        per: "added triangle",
        job: |size| bisection(size, |mesh| mesh.triangle_ids().collect()),
    },
    Kernel {
        name: "bisection, graded",
        per: "added triangle",
        job: |size| bisection(size, towards_circle),
    },
    Kernel {
        name: "bisection, untouched",
        per: "triangle",
        job: untouched,
    },
    Kernel {
        name: "marking, doerfler",
        per: "triangle",
        job: marking,
    },
    Kernel {
        name: "loads, constant",
        per: "triangle",
        job: |size| loads(size, [Arc::new(Constant(-6.0)), Arc::new(Constant(1.0))]),
    },
    Kernel {
        name: "loads, square.toml",
        per: "triangle",
        job: |size| loads(size, square().load),
    },
    Kernel {
        name: "expression, square.toml",
        per: "point",
        job: expression,
    },
];

/// The problem of `configs/square.toml`.
fn square() -> Problem {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../configs/square.toml");
    scene::load(&path, &[])
        .expect("a scene that is tested")
        .problem
}

/// The square (-1, 1)^2 with 4^k times two triangles.
fn mesh(size: Size) -> Mesh {
    let points = vec![[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let mut mesh = Mesh::new(points, &[[0, 1, 2], [0, 2, 3]], &[], None).expect("a square");
    let goal = match size {
        Size::Counted => 1 << 13,
        Size::Timed => 1 << 19,
    };
    while mesh.triangle_count() < goal {
        mesh.refine_uniformly(Children::Four).expect("refines");
    }
    mesh
}

fn towards_circle(mesh: &Mesh) -> Vec<TriangleId> {
    let cut = |t: &TriangleId| {
        let inside = mesh.corners(*t).map(|p| p[0] * p[0] + p[1] * p[1] < 0.4);
        inside.iter().any(|x| *x) && !inside.iter().all(|x| *x) || t.0.is_multiple_of(3)
    };
    mesh.triangle_ids().filter(cut).collect()
}

fn bisection(size: Size, marks: fn(&Mesh) -> Vec<TriangleId>) -> Job {
    let mesh = mesh(size);
    let marked = marks(&mesh);
    let before = mesh.triangle_count();
    let count = move || {
        let refined = mesh.refined(&marked, Children::Four);
        refined.expect("refines").0.triangle_count()
    };
    Job::new(count() - before, move || count() as f64)
}

/// A pass that refines one triangle: what all the others cost.
fn untouched(size: Size) -> Job {
    let mesh = mesh(size);
    Job::new(mesh.triangle_count(), move || {
        let refined = mesh.refined(&[TriangleId(0)], Children::Two);
        refined.expect("refines").0.triangle_count() as f64
    })
}

fn marking(size: Size) -> Job {
    let count = match size {
        Size::Counted => 1 << 13,
        Size::Timed => 1 << 20,
    };
    let mut dice = Dice(3);
    // Indicators of a graded mesh: of one size but for a factor.
    let squares: Vec<f64> = (0..count)
        .map(|_| 1.0 + dice.below(1 << 20) as f64 / 1e5)
        .collect();
    let settings = Mark {
        strategy: Strategy::Doerfler,
        theta: 0.5,
        children: Children::Four,
    };
    Job::new(count, move || adapt::mark(&squares, &settings).len() as f64)
}

fn loads(size: Size, fields: [Arc<dyn Field>; 2]) -> Job {
    let mesh = mesh(size);
    Job::new(mesh.triangle_count(), move || {
        let pair = load_pair(&mesh, [&*fields[0], &*fields[1]]).expect("finite");
        pair[0].nodal[0] + pair[1].nodal[0]
    })
}

/// The upper load, at points all over the square, in batches.
fn expression(size: Size) -> Job {
    const BATCH: usize = 256;
    let count = match size {
        Size::Counted => 1 << 12,
        Size::Timed => 1 << 18,
    };
    let field = square().load[0].clone();
    let mut dice = Dice(5);
    let mut coordinates = || -> Vec<f64> {
        let coordinate = |_| dice.below(1 << 20) as f64 / (1 << 19) as f64 - 1.0;
        (0..count).map(coordinate).collect()
    };
    let (x, y, region) = (coordinates(), coordinates(), vec![0.0; BATCH]);
    let mut out = vec![0.0; BATCH];
    Job::new(count, move || {
        let mut sum = 0.0;
        for (x, y) in x.chunks_exact(BATCH).zip(y.chunks_exact(BATCH)) {
            let at = Samples {
                x,
                y,
                region: &region,
            };
            field.sample(at, &mut out).expect("finite");
            sum += out[0];
        }
        sum
    })
}
