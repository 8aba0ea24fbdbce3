//! The kernels of the program beside the limits of the machine, measured in the same run.
//!
//! `cargo bench -p membranes --bench kernels` prints times (one thread, the best of several). With `-- instructions` it counts instructions
//! under valgrind's callgrind on small sizes instead, compares them with `benches/instructions.txt`, and fails when one has grown by more than a
//! tenth; `-- instructions --write` writes that file anew. Counts travel between machines of one kind, but belong to one version of the
//! compiler and of the C library: renew them with either. Names after the options pick kernels (`-- bisection`).
//!
//! A kernel is one entry of [`ours::KERNELS`].

mod clock;
mod instructions;
mod limits;
mod ours;

use std::process::ExitCode;

#[global_allocator]
static ALLOCATOR: memory::HugePages = memory::HugePages;

/// A piece of the program that is measured.
pub struct Kernel {
    /// What it is called in tables; no `=` in it.
    pub name: &'static str,
    /// What its cost is divided by.
    pub per: &'static str,
    /// Prepares it.
    pub job: fn(Size) -> Job,
}

/// How large a kernel's problem is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Size {
    /// Of the order of 10^4 triangles: for counting instructions under an emulator.
    Counted,
    /// Of the order of 10^6 triangles, beyond the caches: for times.
    Timed,
}

/// A prepared kernel.
pub struct Job {
    /// How many units of [`Kernel::per`] one call of `work` does.
    pub units: usize,
    /// One repetition; the result is only looked at so that it is not optimised away.
    pub work: Box<dyn FnMut() -> f64>,
}

impl Job {
    /// A job from what it does.
    pub fn new(units: usize, work: impl FnMut() -> f64 + 'static) -> Job {
        let work = Box::new(work);
        Job { units, work }
    }
}

fn times(kernels: &[&Kernel]) {
    println!("one thread, the best of several; other programs on the machine disturb\n");
    let triad = limits::print().triad;
    println!(
        "\n{:<28} {:>10} {:>14}  unit",
        "kernel", "ns/unit", "bytes at triad"
    );
    for kernel in kernels {
        let Job { units, mut work } = (kernel.job)(Size::Timed);
        let nanoseconds = 1e9 * clock::best(5, &mut *work) / units as f64;
        // How many bytes the machine could have streamed in that time.
        let bytes = nanoseconds * triad;
        println!(
            "{:<28} {nanoseconds:>10.1} {bytes:>14.0}  {}",
            kernel.name, kernel.per
        );
    }
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let has = |name: &str| arguments.iter().any(|a| a == name);
    if let [mode, name, repeat] = &arguments[..]
        && mode == "count"
    {
        return instructions::run_counted(name, repeat);
    }
    let words = ["instructions", "--write", "--bench"];
    let names: Vec<&String> = arguments
        .iter()
        .filter(|a| !words.contains(&a.as_str()))
        .collect();
    let wanted =
        |k: &&Kernel| names.is_empty() || names.iter().any(|n| k.name.contains(n.as_str()));
    let kernels: Vec<&Kernel> = ours::KERNELS.iter().filter(wanted).collect();
    if has("instructions") {
        return instructions::compare(&kernels, has("--write"));
    }
    times(&kernels);
    ExitCode::SUCCESS
}
