//! The clock of the benches.

use std::hint::black_box;
use std::time::Instant;

/// Least seconds of several calls.
pub fn best(repeat: usize, mut work: impl FnMut() -> f64) -> f64 {
    let mut least = f64::INFINITY;
    for _ in 0..repeat {
        let clock = Instant::now();
        black_box(work());
        least = least.min(clock.elapsed().as_secs_f64());
    }
    least
}
