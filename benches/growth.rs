//! What a whole adaptive run costs a vertex, while the number of vertices grows.
//!
//! `cargo bench -p membranes --bench growth` runs the scenes in `benches/growth/` to 10^4 vertices, then to twice as many, and so on up to 10^6:
//! residual estimator, no known solution, no files, one thread, from the scene file to the solution in memory. `-- --to 1e7` goes further, `--only constant/square` takes some of the scenes,
//! `--theta 0.8` marks by another bulk parameter than the default, `--repeat 3` takes the least times of three, `--threads 2` compares two threads with one on the largest size, `--plot` draws
//! `docs/pictures/growth.svg` with Python. Tables are printed as the documentation quotes them.
//!
//! Every measurement is a process of its own (this program started anew), so that its peak of memory and its page faults are its own.
//! Times are also told in sparse matrix-vector products of as many rows, whose time a row is measured before and after in the same run; the
//! lesser counts.

use std::collections::HashMap;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};
use std::time::Instant;

use adapt::output::checksum::checksum;
use adapt::output::{OutputError, peak_memory_mb};
use adapt::settings::Stop;
use adapt::{Level, LevelRecord, Reason};

#[path = "kernels/clock.rs"]
mod clock;
#[path = "kernels/limits.rs"]
mod limits;

#[global_allocator]
static ALLOCATOR: memory::HugePages = memory::HugePages;

/// Name of the scene's file and what a table calls it.
const SCENES: [(&str, &str); 3] = [
    ("constant", "L-shape, constant loads"),
    ("square", "square, loads are formulas"),
    ("two_fields", "square, two fields, tensions are formulas"),
];

/// The first limit on vertices.
const FROM: usize = 10_000;

/// From so many vertices on the slope of log time in log vertices is fitted.
const SLOPE_FROM: f64 = 1e5;

/// Up to this limit on vertices a run is done twice in its process.
const TWICE: usize = 2_000_000;

fn scene_file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../../benches/growth/{name}.toml"))
}

/// A number of `/proc/self/status` in bytes; 0 where the system does not tell.
fn status(name: &str) -> f64 {
    let text = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = text.lines().find_map(|l| l.strip_prefix(name));
    let number = line.and_then(|l| l.trim_start_matches(':').split_whitespace().next());
    1024.0 * number.and_then(|n| n.parse().ok()).unwrap_or(0.0)
}

/// Processor seconds of the first thread so far; 0 where the system does not tell.
fn processor_seconds() -> f64 {
    let text = std::fs::read_to_string("/proc/self/schedstat").unwrap_or_default();
    let nanoseconds = text.split_whitespace().next().and_then(|n| n.parse().ok());
    1e-9 * nanoseconds.unwrap_or(0.0)
}

/// Everything that must come out the same, bit by bit: the record but for times and memory, and the displacements.
fn digest(level: &Level) -> String {
    let record = LevelRecord {
        seconds_refine: 0.0,
        seconds_assemble: 0.0,
        seconds_solve: 0.0,
        seconds_estimate: 0.0,
        seconds_total: 0.0,
        peak_memory_mb: None,
        ..level.record.clone()
    };
    // The shortest text of a number that reads back as the same bits.
    let mut bytes = format!("{record:?}").into_bytes();
    for u in &level.solution.displacement {
        bytes.extend(u.iter().flat_map(|v| v.to_bits().to_le_bytes()));
    }
    checksum(&bytes)
}

/// One run; what was measured, as lines `name=value`, and the text that tells whether results are the same. `scene@0.8` is the scene with that theta.
fn measure(scene: &str, limit: usize, threads: usize) -> (HashMap<&'static str, f64>, String) {
    let before = status("VmRSS");
    let (clock, processor) = (Instant::now(), processor_seconds());
    let (scene, theta) = scene
        .split_once('@')
        .map_or((scene, None), |(s, t)| (s, Some(t)));
    let mut scene = scene::load(&scene_file(scene), &[]).expect("the scene is valid");
    scene.settings.solve.threads = threads;
    if let Some(theta) = theta {
        scene.settings.mark.theta = theta.parse().expect("a number");
    }
    scene.settings.stop = Stop {
        relative_error: None,
        error: None,
        vertices: Some(limit),
        levels: None,
        seconds: None,
    };
    let (mut stages, mut steps, mut steady) = ([0.0; 4], 0, 0.0);
    let mut watch = |level: &Level, last: Option<Reason>| -> Result<(), OutputError> {
        let r = &level.record;
        let seconds = [
            r.seconds_refine,
            r.seconds_assemble,
            r.seconds_solve,
            r.seconds_estimate,
        ];
        for (sum, s) in stages.iter_mut().zip(seconds) {
            *sum += s;
        }
        steps += r.iterations * r.vertices;
        if last.is_some() {
            steady = status("VmRSS") - before;
        }
        Ok(())
    };
    let outcome = adapt::run(&scene.problem, &scene.settings, &mut watch).expect("solved");
    let wall = clock.elapsed().as_secs_f64();
    let numbers = HashMap::from([
        ("wall", wall),
        ("cpu", processor_seconds() - processor),
        (
            "peak",
            peak_memory_mb().map_or(0.0, |mb| mb * 1_048_576.0 - before),
        ),
        ("steady", steady),
        ("vertices", outcome.level.record.vertices as f64),
        ("levels", (outcome.level.number + 1) as f64),
        ("steps", steps as f64),
        ("refine", stages[0]),
        ("assemble", stages[1]),
        ("solve", stages[2]),
        ("estimate", stages[3]),
    ]);
    (numbers, digest(&outcome.level))
}

/// `measure SCENE LIMIT THREADS TIMES`: what the processes do that this program starts.
fn child(arguments: &[String]) {
    let number = |i: usize| arguments[i].parse::<usize>().expect("a number");
    let (mut numbers, digest) = measure(&arguments[0], number(1), number(2));
    if number(3) > 1 {
        let (second, again) = measure(&arguments[0], number(1), number(2));
        assert_eq!(digest, again, "a second run gives other numbers");
        numbers.insert("second", second["wall"]);
        numbers.insert("second cpu", second["cpu"]);
    }
    for (name, value) in numbers {
        println!("{name}={value:e}");
    }
    println!("digest={digest}");
}

/// What several processes measured: the least of every number.
struct Measured {
    numbers: HashMap<String, f64>,
    digest: String,
}

impl Measured {
    fn of(scene: &str, limit: usize, threads: usize, times: usize) -> Measured {
        let program = std::env::current_exe().expect("this program");
        let counts = [limit, threads, times].map(|n| n.to_string());
        let run = Command::new(program)
            .args(["measure", scene])
            .args(counts)
            .stderr(Stdio::inherit())
            .output()
            .expect("started");
        assert!(run.status.success(), "{scene} to {limit} vertices failed");
        let text = String::from_utf8(run.stdout).expect("text");
        let pairs = || text.lines().filter_map(|l| l.split_once('='));
        Measured {
            numbers: pairs()
                .filter_map(|(n, v)| Some((n.to_owned(), v.parse().ok()?)))
                .filter(|(n, _)| n != "digest")
                .collect(),
            digest: pairs()
                .find(|(n, _)| *n == "digest")
                .expect("a digest")
                .1
                .to_owned(),
        }
    }

    /// Takes in another measurement of the same run.
    fn and(&mut self, other: &Measured) {
        assert_eq!(self.digest, other.digest, "the same run, other numbers");
        for (name, value) in &mut self.numbers {
            *value = value.min(other.get(name));
        }
    }

    fn get(&self, name: &str) -> f64 {
        self.numbers.get(name).copied().unwrap_or(f64::NAN)
    }

    fn per_vertex(&self, name: &str) -> f64 {
        self.get(name) / self.get("vertices")
    }
}

/// The limits on vertices: doubled from the first one to the largest, which is the last.
fn limits_to(largest: usize) -> Vec<usize> {
    let doubled = |n: &usize| Some(2 * n);
    let mut limits: Vec<usize> = std::iter::successors(Some(FROM), doubled)
        .take_while(|&n| n < largest)
        .collect();
    limits.push(largest);
    limits
}

/// Slope of the logarithm of a number in that of the vertices, by least squares over the large sizes.
fn slope(sizes: &[Measured], name: &str) -> f64 {
    let points: Vec<(f64, f64)> = sizes
        .iter()
        .filter(|m| m.get("vertices") >= SLOPE_FROM)
        .map(|m| (m.get("vertices").ln(), m.get(name).ln()))
        .collect();
    let count = points.len() as f64;
    let mean = |f: fn(&(f64, f64)) -> f64| points.iter().map(f).sum::<f64>() / count;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let (over, under) = points.iter().fold((0.0, 0.0), |(o, u), p| {
        (o + (p.0 - x) * (p.1 - y), u + (p.0 - x) * (p.0 - x))
    });
    over / under
}

/// The tables of a scene.
fn tables(title: &str, sizes: &[Measured], product: f64) -> String {
    let mut out = format!(
        "\nThe {title}:\n\n\
         | vertices | levels | wall s | processor s | us a vertex | products a vertex | steps a vertex | peak bytes a vertex | steady | fresh over second |\n\
         |---|---|---|---|---|---|---|---|---|---|\n"
    );
    for m in sizes {
        let second = match m.get("wall") / m.get("second") {
            r if r.is_nan() => "-".to_owned(),
            r => format!("{r:.2}"),
        };
        let _ = writeln!(
            out,
            "| {} | {} | {:.3} | {:.3} | {:.2} | {:.0} | {:.1} | {:.0} | {:.0} | {second} |",
            m.get("vertices"),
            m.get("levels"),
            m.get("wall"),
            m.get("cpu"),
            1e6 * m.per_vertex("wall"),
            1e9 * m.per_vertex("wall") / product,
            m.per_vertex("steps"),
            m.per_vertex("peak"),
            m.per_vertex("steady"),
        );
    }
    let _ = writeln!(
        out,
        "\nSlope of log time in log vertices from {SLOPE_FROM:e} on: {:.3} (wall), {:.3} (processor).\n",
        slope(sizes, "wall"),
        slope(sizes, "cpu"),
    );
    out += "| vertices | refine s | assemble | solve | estimate | the rest |\n|---|---|---|---|---|---|\n";
    for m in sizes {
        let stages = ["refine", "assemble", "solve", "estimate"].map(|s| m.get(s));
        let rest = m.get("wall") - stages.iter().sum::<f64>();
        let cells: String = stages.iter().map(|s| format!(" {s:.3} |")).collect();
        let _ = writeln!(out, "| {} |{cells} {rest:.3} |", m.get("vertices"));
    }
    out
}

/// Several threads against one on the largest size, and whether all give the same bits.
fn compare_threads(scene: &str, limit: usize, threads: usize, repeat: usize) {
    let counts: Vec<usize> = (1..=threads.max(3)).collect();
    let mut seen: Vec<Measured> = Vec::new();
    // In turn, so that all meet the same minutes.
    for round in 0..repeat {
        for (i, &count) in counts.iter().enumerate() {
            let m = Measured::of(scene, limit, count, 1);
            match round {
                0 => seen.push(m),
                _ => seen[i].and(&m),
            }
        }
    }
    for (m, count) in seen.iter().zip(&counts) {
        assert_eq!(m.digest, seen[0].digest, "{count} threads, other bits");
        println!(
            "| {scene} | {} | {count} | {:.3} | {:.2} |",
            m.get("vertices"),
            m.get("wall"),
            seen[0].get("wall") / m.get("wall")
        );
    }
}

/// Hands the curves to the script that draws them.
fn plot(curves: &str) -> std::io::Result<()> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/pictures/growth.py");
    let mut python = Command::new("python3")
        .arg(script)
        .stdin(Stdio::piped())
        .spawn()?;
    if let Some(mut input) = python.stdin.take() {
        input.write_all(curves.as_bytes())?;
    }
    python.wait().map(|_| ())
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if arguments.first().is_some_and(|a| a == "measure") {
        child(&arguments[1..]);
        return ExitCode::SUCCESS;
    }
    let value = |name: &str| -> Option<usize> {
        let at = arguments.iter().position(|a| a == name)?;
        Some(arguments.get(at + 1)?.parse::<f64>().ok()? as usize)
    };
    let largest = value("--to").unwrap_or(1_000_000);
    let repeat = value("--repeat").unwrap_or(1).max(1);
    println!("one thread; other programs on the machine disturb\n");
    let before = limits::print();
    let mut measured = Vec::new();
    let only = arguments.iter().position(|a| a == "--only");
    let only = only.and_then(|at| arguments.get(at + 1));
    let scenes: Vec<_> = SCENES
        .into_iter()
        .filter(|(scene, _)| only.is_none_or(|names| names.split('/').any(|name| name == *scene)))
        .collect();
    let theta = arguments.iter().position(|a| a == "--theta");
    let theta = theta.and_then(|at| arguments.get(at + 1));
    let run = |scene: &str| theta.map_or_else(|| scene.into(), |theta| format!("{scene}@{theta}"));
    for &(scene, title) in &scenes {
        let mut sizes = Vec::new();
        for limit in limits_to(largest) {
            let times = if limit <= TWICE { 2 } else { 1 };
            let mut m = Measured::of(&run(scene), limit, 1, times);
            for _ in 1..repeat {
                m.and(&Measured::of(&run(scene), limit, 1, times));
            }
            eprintln!("{scene} {limit}: {:.3} s", m.get("wall"));
            sizes.push(m);
        }
        measured.push((scene, title, sizes));
    }
    println!("\nand afterwards\n");
    let after = limits::print();
    let product = before.product.min(after.product);
    let triad = before.triad.max(after.triad);
    println!("\nA product takes {product:.2} ns a row, the triad runs at {triad:.1} GB/s.");
    let mut curves = String::from("csv,scene,vertices,microseconds,products\n");
    for (scene, title, sizes) in &measured {
        print!("{}", tables(title, sizes, product));
        for m in sizes {
            let us = 1e6 * m.per_vertex("wall");
            let products = 1e3 * us / product;
            let _ = writeln!(curves, "csv,{scene},{},{us},{products}", m.get("vertices"));
        }
    }
    if let Some(threads) = value("--threads") {
        println!("\n| scene | vertices | threads | wall s | times faster |\n|---|---|---|---|---|");
        for &(scene, _) in &scenes {
            compare_threads(&run(scene), largest, threads, repeat);
        }
        println!("\nThe last record and the displacements have the same bits for all of them.");
    }
    if arguments.iter().any(|a| a == "--plot")
        && let Err(error) = plot(&curves)
    {
        eprintln!("not drawn: {error}");
        return ExitCode::FAILURE;
    }
    ExitCode::SUCCESS
}
