//! Cost of the file of a level with a million vertices, beside a plain `write` of the same bytes to the same disk.
//!
//! `cargo bench -p membranes --bench output`
//!
//! A uniform mesh by bisection and made-up fields, every array that a level can have, in units that must be scaled. Three things are
//! timed in turn, several rounds, each to the disk (`fsync` included) in the folder of the build: the file as a run writes it, whose
//! checksum is taken on the way; its bytes written at once from memory; and, without a disk, their checksum alone. The first against
//! the second travels between machines, seconds do not.

use std::fs::{self, File};
use std::hint::black_box;
use std::io::Write;
use std::path::Path;
use std::time::Instant;

use adapt::output::checksum::checksum;
use adapt::output::{LevelFields, RunFolder, Values, peak_memory_mb};
use fem_core::{Children, Mesh};

const VERTICES: usize = 1_000_000;
const ROUNDS: usize = 7;

fn square() -> Mesh {
    let points = vec![[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let mut mesh = Mesh::new(points, &[[0, 1, 2], [0, 2, 3]], &[], None).expect("a square");
    while mesh.vertex_count() < VERTICES {
        mesh.refine_uniformly(Children::Four).expect("refines");
    }
    mesh
}

/// Numbers without a pattern.
fn made_up(count: usize, salt: usize) -> Vec<f64> {
    let number = |i: usize| ((i * 7919 + salt) as f64 * 0.618_033_988_749_894_9).fract();
    (0..count).map(number).collect()
}

/// Seconds of a call.
fn seconds(call: impl FnOnce()) -> f64 {
    let clock = Instant::now();
    call();
    clock.elapsed().as_secs_f64()
}

/// Resident memory, in MiB; Linux only.
fn resident() -> Option<f64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmRSS:"))?;
    let kibibytes: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kibibytes / 1024.0)
}

/// Largest resident memory during a call above that before it, in MiB; `None` where the system does not tell.
fn memory(call: impl FnOnce()) -> Option<f64> {
    // Linux sets the peak back to the present.
    fs::write("/proc/self/clear_refs", "5").ok()?;
    let before = resident()?;
    call();
    Some(peak_memory_mb()? - before)
}

/// Bytes of a level's arrays at their types in the file, three coordinates a point.
fn raw_bytes(vertices: usize, triangles: usize) -> usize {
    let point = 3 * 8 + 6 * 8 + 1;
    let cell = 7 * 8 + 2 * 4;
    // Vertices and offset of a triangle as 32-bit integers, its type as a byte.
    let topology = 3 * 4 + 4 + 1;
    vertices * point + triangles * (cell + topology) + 16
}

fn main() {
    let mesh = square();
    let (n, m) = (mesh.vertex_count(), mesh.triangle_count());
    let nodal: Vec<Vec<f64>> = (0..6).map(|k| made_up(n, k)).collect();
    let local: Vec<Vec<f64>> = (0..7).map(|k| made_up(m, k)).collect();
    let contact: Vec<bool> = nodal[0].iter().map(|v| *v < 0.3).collect();
    let fields = || LevelFields {
        level: 7,
        error_bound: 0.125,
        points: Values::scaled_points(mesh.points(), 1),
        triangles: mesh.triangles().into(),
        u1: Values::scaled(&nodal[0], -3),
        u2: Values::scaled(&nodal[1], -3),
        gap: Values::scaled(&nodal[2], -3),
        sigma: Values::scaled(&nodal[3], -3),
        action_force: Values::scaled(&nodal[4], -3),
        action: Values::scaled(&nodal[5], -3),
        contact: contact.as_slice().into(),
        eta_k: Some(Values::scaled(&local[0], -3)),
        eta_e: Some(Values::scaled(&local[1], -3)),
        residual: Some(Values::scaled(&local[2], -3)),
        certified: Some(Values::scaled(&local[3], -3)),
        oscillation: Some(Values::scaled(&local[4], -3)),
        f1_h: Values::scaled(&local[5], -3),
        f2_h: Values::scaled(&local[6], -3),
        generation: mesh.generation().into(),
        region: mesh.region().into(),
    };
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("bench-output");
    let mut run = RunFolder::prepare(&folder, true).expect("a folder");
    let mut write = || run.write_level(fields()).expect("written");
    let extra = memory(&mut write);
    let file = folder.join("level_0007.vtu");
    let bytes = fs::read(&file).expect("the file");

    let (mut ours, mut plain, mut sum) = (f64::INFINITY, f64::INFINITY, f64::INFINITY);
    for _ in 0..ROUNDS {
        ours = ours.min(seconds(&mut write));
        plain = plain.min(seconds(|| {
            let mut file = File::create(folder.join("plain.tmp")).expect("a file");
            file.write_all(&bytes).expect("written");
            file.sync_all().expect("on the disk");
        }));
        sum = sum.min(seconds(|| {
            black_box(checksum(&bytes));
        }));
    }
    fs::remove_dir_all(&folder).expect("removed");

    let size = bytes.len() as f64;
    let per_million = 1e6 / n as f64;
    println!("{n} vertices, {m} triangles");
    println!(
        "{:>24} {:>8} {:>16} {:>8}",
        "", "s", "s/1e6 vertices", "GB/s"
    );
    for (name, seconds) in [
        ("level_NNNN.vtu", ours),
        ("plain write", plain),
        ("SHA-256 alone", sum),
    ] {
        println!(
            "{name:>24} {seconds:>8.3} {:>16.3} {:>8.2}",
            seconds * per_million,
            1e-9 * size / seconds
        );
    }
    println!("{:>24} {:>8.2}", "over plain write", ours / plain);
    println!(
        "{:>24} {:>8.3} of {:.1} MB",
        "file over its arrays",
        size / raw_bytes(n, m) as f64,
        1e-6 * raw_bytes(n, m) as f64
    );
    match extra {
        Some(extra) => println!(
            "{:>24} {extra:>8.1} MiB above what was held before",
            "peak memory"
        ),
        None => println!("{:>24} unknown on this system", "peak memory"),
    }
}
