//! Instructions of every kernel, counted by callgrind and compared with a committed table.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::{Command, ExitCode};

use crate::{Kernel, Size, ours};

/// How much a count may grow, as a share of what is committed.
const GROWTH: f64 = 0.1;

const HEAD: &str = "\
# Instructions of the kernels of benches/kernels, counted by callgrind, for each of their units.
# Renew with: cargo bench -p membranes --bench kernels -- instructions --write
";

fn table() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../benches/instructions.txt")
}

/// The compiler and the processor that counts belong to.
fn machine() -> String {
    let compiler = Command::new("rustc").arg("--version").output().ok();
    let compiler = compiler.map(|o| String::from_utf8_lossy(&o.stdout).trim().to_owned());
    let compiler = compiler.unwrap_or_else(|| "an unknown compiler".to_owned());
    format!("{compiler}, {}", std::env::consts::ARCH)
}

/// What runs under callgrind: the preparation, and the work `repeat` times.
pub fn run_counted(name: &str, repeat: &str) -> ExitCode {
    let kernel = ours::KERNELS.iter().find(|k| k.name == name);
    let (Some(kernel), Ok(repeat)) = (kernel, repeat.parse()) else {
        eprintln!("no kernel `{name}`, or `{repeat}` is not a number");
        return ExitCode::FAILURE;
    };
    let mut job = (kernel.job)(Size::Counted);
    for _ in 0..repeat {
        std::hint::black_box((job.work)());
    }
    println!("{}", job.units);
    ExitCode::SUCCESS
}

/// Instructions of a run with `repeat` repetitions, and the units of one of them.
fn collected(name: &str, repeat: usize) -> Result<(f64, f64), String> {
    let program = std::env::current_exe().map_err(|e| e.to_string())?;
    let run = Command::new("valgrind")
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
        .arg(program)
        .args(["count", name, &repeat.to_string()])
        .output()
        .map_err(|e| e.to_string())?;
    let text = String::from_utf8_lossy(&run.stderr);
    let line = text.lines().find(|l| l.contains("Collected"));
    let count = line.and_then(|l| l.split_whitespace().last()?.parse().ok());
    let units = String::from_utf8_lossy(&run.stdout).trim().parse().ok();
    match (run.status.success(), count, units) {
        (true, Some(count), Some(units)) => Ok((count, units)),
        _ => Err(format!("callgrind failed on `{name}`:\n{text}")),
    }
}

/// Instructions of a kernel for each of its units. The first repetition warms what later ones find, the second is counted.
fn count(kernel: &Kernel) -> Result<f64, String> {
    let [once, twice] = std::thread::scope(|scope| {
        [1, 2]
            .map(|repeat| scope.spawn(move || collected(kernel.name, repeat)))
            .map(|thread| {
                thread
                    .join()
                    .unwrap_or_else(|_| Err("a thread failed".to_owned()))
            })
    });
    let ((once, units), (twice, _)) = (once?, twice?);
    Ok((twice - once) / units)
}

fn committed() -> BTreeMap<String, f64> {
    let text = std::fs::read_to_string(table()).unwrap_or_default();
    let entry = |line: &str| {
        let (name, count) = line.split_once('=')?;
        Some((name.trim().to_owned(), count.trim().parse().ok()?))
    };
    text.lines()
        .filter(|l| !l.starts_with('#'))
        .filter_map(entry)
        .collect()
}

/// Counts, prints, and compares with the committed table or writes it.
pub fn compare(kernels: &[&Kernel], write: bool) -> ExitCode {
    if Command::new("valgrind").arg("--version").output().is_err() {
        println!("NOT RUN: valgrind was not found, so no instructions were counted");
        return ExitCode::SUCCESS;
    }
    let mut all = committed();
    let machine = machine();
    let text = std::fs::read_to_string(table()).unwrap_or_default();
    if !write && !text.contains(&machine) {
        println!("the committed counts belong to another compiler or processor than {machine}");
    }
    println!(
        "{:<28} {:>10} {:>10} {:>8}",
        "instructions", "committed", "now", "change"
    );
    let mut sound = true;
    for kernel in kernels {
        let name = kernel.name;
        let now = match count(kernel) {
            Ok(now) => now,
            Err(error) => {
                eprintln!("{error}");
                return ExitCode::FAILURE;
            }
        };
        let before = all.insert(name.to_owned(), now);
        let (shown, change, grown) = match before {
            Some(before) => {
                let change = now / before - 1.0;
                (
                    format!("{before:.1}"),
                    format!("{:+.1}%", 100.0 * change),
                    change > GROWTH,
                )
            }
            None => ("none".to_owned(), "new".to_owned(), true),
        };
        let refused = grown && !write;
        sound &= !refused;
        println!(
            "{name:<28} {shown:>10} {now:>10.1} {change:>8}   per {}{}",
            kernel.per,
            if refused { "   TOO MANY" } else { "" }
        );
    }
    if write {
        all.retain(|name, _| ours::KERNELS.iter().any(|k| k.name == name));
        let lines = all
            .iter()
            .map(|(name, count)| format!("{name} = {count:.1}\n"));
        let text = format!(
            "{HEAD}# Counted with {machine}.\n{}",
            lines.collect::<String>()
        );
        if let Err(error) = std::fs::write(table(), text) {
            eprintln!("{}: {error}", table().display());
            return ExitCode::FAILURE;
        }
    }
    if !sound {
        println!("a kernel grew by more than a tenth, or has no committed count");
        return ExitCode::FAILURE;
    }
    ExitCode::SUCCESS
}
