//! What the machine can do at most.

use std::hint::black_box;
use std::time::Instant;

use crate::clock::best;

/// What a program's own times are compared with.
pub struct Limits {
    /// Bandwidth of the triad from memory, in bytes a nanosecond.
    pub triad: f64,
    /// A sparse product with 10^6 rows of seven entries, in nanoseconds a row.
    #[allow(
        dead_code,
        reason = "only one of the benches that share this file divides by it"
    )]
    pub product: f64,
}

/// Numbers from a fixed sequence that looks random.
pub struct Dice(pub u64);

impl Dice {
    /// The next one, below `n`.
    pub fn below(&mut self, n: usize) -> usize {
        self.0 = self
            .0
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        ((self.0 >> 33) as usize) % n
    }
}

/// Prints the limits, and returns those that others are compared with.
pub fn print() -> Limits {
    // Before anything else, while no memory has been used and kept.
    let huge = first_touch(&mut [vec![0u8; TOUCHED]]);
    let mut small: Vec<_> = (0..TOUCHED >> 20).map(|_| vec![0u8; 1 << 20]).collect();
    let small = first_touch(&mut small);
    println!(
        "{:<44} {small:>8.2} us",
        "first touch of 4 KiB, small pages"
    );
    println!("{:<44} {huge:>8.2} us", "first touch of 4 KiB, huge pages");
    triad(1 << 17, 200);
    let triad = triad(1 << 25, 5);
    product(100_000, triad);
    let product = product(1_000_000, triad);
    for n in [1 << 20, 1 << 24] {
        gather(n);
    }
    Limits { triad, product }
}

/// Bytes that are touched for the first time.
const TOUCHED: usize = 256 << 20;

/// Microseconds for every 4 KiB of blocks that were never touched.
fn first_touch(blocks: &mut [Vec<u8>]) -> f64 {
    let clock = Instant::now();
    for block in blocks.iter_mut() {
        for place in block.iter_mut().step_by(4096) {
            *place = 1;
        }
    }
    let seconds = clock.elapsed().as_secs_f64();
    black_box(&blocks);
    1e6 * seconds / (TOUCHED / 4096) as f64
}

/// a = b + 3 c, 24 bytes counted for each element.
fn triad(n: usize, repeat: usize) -> f64 {
    let (mut a, b, c) = (vec![0.5; n], vec![1.0; n], vec![2.0; n]);
    let seconds = best(repeat, || {
        for ((a, b), c) in a.iter_mut().zip(black_box(&b)).zip(black_box(&c)) {
            *a = b + 3.0 * c;
        }
        a[n / 2]
    });
    let bandwidth = 24e-9 * n as f64 / seconds;
    let megabytes = 8e-6 * n as f64;
    let name = format!("triad, arrays of {megabytes:.0} MB");
    println!("{name:<44} {bandwidth:>8.1} GB/s");
    bandwidth
}

/// A sparse matrix with the seven entries a row of a regular triangulation, rows in order; nanoseconds a row.
fn product(n: usize, triad: f64) -> f64 {
    let width = (n as f64).sqrt() as usize;
    let mut columns = Vec::with_capacity(7 * n);
    for i in 0..n {
        let around = [n - width - 1, n - width, n - 1, 0, 1, width, width + 1];
        let mut row = around.map(|step| ((i + step) % n) as u32);
        row.sort_unstable();
        columns.extend(row);
    }
    let starts: Vec<u32> = (0..=n as u32).map(|i| 7 * i).collect();
    let values = vec![0.25; 7 * n];
    let x = vec![1.5; n];
    let mut y = vec![0.0; n];
    let seconds = best(20, || {
        for (y, ends) in y.iter_mut().zip(starts.windows(2)) {
            let row = ends[0] as usize..ends[1] as usize;
            *y = columns[row.clone()]
                .iter()
                .zip(&values[row])
                .map(|(&j, a)| a * x[j as usize])
                .sum();
        }
        y[n / 2]
    });
    let nanoseconds = 1e9 * seconds / n as f64;
    // Seven values and columns, a start, an entry of each vector.
    let share = 100.0 * (7.0 * 12.0 + 4.0 + 16.0) / nanoseconds / triad;
    let name = format!("sparse product, {n} rows of 7");
    println!("{name:<44} {nanoseconds:>8.2} ns a row, {share:.0} % of the triad from memory");
    nanoseconds
}

/// Sums numbers from all over an array.
fn gather(n: usize) {
    let x: Vec<f64> = (0..n).map(|i| i as f64).collect();
    let mut dice = Dice(7);
    let order: Vec<u32> = (0..1 << 20).map(|_| dice.below(n) as u32).collect();
    let seconds = best(7, || order.iter().map(|&i| x[i as usize]).sum());
    let nanoseconds = 1e9 * seconds / order.len() as f64;
    let name = format!("gather from {:.0} MB at random", 8e-6 * n as f64);
    println!("{name:<44} {nanoseconds:>8.2} ns");
}
