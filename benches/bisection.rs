//! Cost of bisection: seconds and closure work for each new triangle, beside a copy of the same arrays.
//!
//! `cargo bench -p fem-core --bench bisection`
//!
//! Two families: uniform refinement, and refinement towards a circle with every third triangle. The last column relates the time to that
//! of copying the refined mesh once, measured in the same run: it travels between machines, seconds do not.

use std::hint::black_box;
use std::time::Instant;

use fem_core::{Children, Mesh, TriangleId};

#[global_allocator]
static ALLOCATOR: memory::HugePages = memory::HugePages;

const GOAL: usize = 4_000_000;

fn square() -> Mesh {
    let points = vec![[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    Mesh::new(points, &[[0, 1, 2], [0, 2, 3]], &[], None).expect("a square")
}

fn all(mesh: &Mesh) -> Vec<TriangleId> {
    mesh.triangle_ids().collect()
}

fn towards_circle(mesh: &Mesh) -> Vec<TriangleId> {
    let cut = |t: &TriangleId| {
        let inside = mesh.corners(*t).map(|p| p[0] * p[0] + p[1] * p[1] < 0.4);
        inside.iter().any(|x| *x) && !inside.iter().all(|x| *x) || t.0.is_multiple_of(3)
    };
    mesh.triangle_ids().filter(cut).collect()
}

fn family(name: &str, marks: fn(&Mesh) -> Vec<TriangleId>) {
    println!("{name}");
    println!(
        "{:>10} {:>16} {:>18} {:>12}",
        "triangles", "ns/new triangle", "closure steps/new", "over copy"
    );
    let mut mesh = square();
    while mesh.triangle_count() < GOAL {
        let before = mesh.triangle_count();
        let marked = marks(&mesh);
        // The best of five refinements of the same mesh.
        let (mut best, mut refined) = (f64::INFINITY, None);
        for _ in 0..5 {
            // The one before is dropped first, so that its memory is used again: the first touch would cost more than the work.
            drop(refined.take());
            let clock = Instant::now();
            let result = mesh.refined(&marked, Children::Four).expect("refines");
            best = best.min(clock.elapsed().as_secs_f64());
            refined = Some(result);
        }
        let (next, info) = refined.expect("five rounds");
        let mut copy = f64::INFINITY;
        for _ in 0..5 {
            let clock = Instant::now();
            let second = black_box(next.clone());
            copy = copy.min(clock.elapsed().as_secs_f64());
            drop(second);
        }
        mesh = next;
        let new = (mesh.triangle_count() - before) as f64;
        if mesh.triangle_count() > 50_000 {
            println!(
                "{:>10} {:>16.1} {:>18.3} {:>12.2}",
                mesh.triangle_count(),
                1e9 * best / new,
                info.closure_steps as f64 / new,
                best / copy
            );
        }
    }
}

fn main() {
    family("uniform", all);
    family("towards a circle", towards_circle);
}
