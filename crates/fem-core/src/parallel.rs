//! Work on several threads whose results do not depend on how many there are.
//!
//! A loop over triangles is cut into blocks of [`BLOCK`], always the same ones. A block writes only what belongs to it, and sums are taken over
//! every block first and then over the blocks in their order: which thread does which block, and how many threads there are, shows nowhere.

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

/// Triangles in a block. Sums are rounded by blocks, so that this number is part of the results of meshes with more triangles.
pub const BLOCK: usize = 1 << 14;

/// Below so many triangles one thread does everything: to start another costs as much as it would save.
const ENOUGH: usize = 20_000;

/// The threads that are worth their while for a loop over `count` triangles, where `threads` are allowed; at least 1.
pub fn worthwhile(threads: usize, count: usize) -> usize {
    if count < ENOUGH { 1 } else { threads.max(1) }
}

/// The blocks of `0..count`, in order; the last one may be shorter.
pub fn blocks(count: usize) -> impl Iterator<Item = Range<usize>> {
    (0..count)
        .step_by(BLOCK)
        .map(move |first| first..count.min(first + BLOCK))
}

/// Does every job once, on at most `threads` threads, the caller's among them; the results are in the order of the jobs.
///
/// A thread that is done with a job takes the next one.
///
/// # Panics
/// Where a job does.
pub fn map<J: Send, R: Send>(threads: usize, jobs: Vec<J>, run: impl Fn(J) -> R + Sync) -> Vec<R> {
    let threads = threads.min(jobs.len());
    if threads <= 1 {
        return jobs.into_iter().map(run).collect();
    }
    let mut results: Vec<Option<R>> = jobs.iter().map(|_| None).collect();
    let queue = Mutex::new(jobs.into_iter().zip(results.iter_mut()));
    let work = || {
        loop {
            let next = queue.lock().unwrap_or_else(PoisonError::into_inner).next();
            let Some((job, result)) = next else {
                return;
            };
            *result = Some(run(job));
        }
    };
    std::thread::scope(|scope| {
        for _ in 1..threads {
            scope.spawn(work);
        }
        work();
    });
    drop(queue);
    results.into_iter().flatten().collect()
}

/// Does two things, side by side where there are two threads.
///
/// # Panics
/// Where one of them does.
pub fn both<A: Send, B>(
    threads: usize,
    first: impl FnOnce() -> A + Send,
    second: impl FnOnce() -> B,
) -> (A, B) {
    if threads <= 1 {
        return (first(), second());
    }
    std::thread::scope(|scope| {
        let first = scope.spawn(first);
        let second = second();
        let first = first.join();
        (
            first.unwrap_or_else(|e| std::panic::resume_unwind(e)),
            second,
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_cover_a_range_once_and_in_order() {
        for count in [0, 1, BLOCK - 1, BLOCK, BLOCK + 1, 3 * BLOCK + 5] {
            let all: Vec<usize> = blocks(count).flatten().collect();
            assert!(all.iter().copied().eq(0..count), "{count}");
            assert!(blocks(count).all(|b| b.start % BLOCK == 0 && b.len() <= BLOCK));
        }
    }

    #[test]
    fn results_are_in_the_order_of_the_jobs_for_any_number_of_threads() {
        let count = 5 * BLOCK + 17;
        let sums = |threads| -> (Vec<u64>, Vec<f64>) {
            let mut values = vec![0.0; count];
            let jobs: Vec<_> = blocks(count).zip(values.chunks_mut(BLOCK)).collect();
            let sums = map(threads, jobs, |(block, values)| {
                let mut sum = 0.0;
                for (t, value) in block.zip(values) {
                    *value = 1.0 / (1.0 + t as f64);
                    sum += *value;
                }
                f64::to_bits(sum)
            });
            (sums, values)
        };
        let one = sums(1);
        assert_eq!(one.0.len(), 6);
        assert!(one.1.iter().all(|v| *v > 0.0));
        for threads in [0, 2, 3, 16] {
            assert_eq!(sums(threads), one, "{threads} threads");
        }
    }

    #[test]
    fn small_meshes_get_one_thread() {
        assert_eq!(worthwhile(4, ENOUGH - 1), 1);
        assert_eq!(worthwhile(4, ENOUGH), 4);
        assert_eq!(worthwhile(0, ENOUGH), 1);
    }
}
