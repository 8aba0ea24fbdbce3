//! Which huge pages are kept for later blocks: plain bookkeeping, no memory is touched here.

/// Runs that the pool can remember; a run more is refused.
const RUNS: usize = 1024;

/// Pages in use for each one that may be kept.
const IN_USE_PER_KEPT: usize = 4;

/// Consecutive huge pages: address of the first in units of a huge page, and their number.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Run {
    pub first: usize,
    pub count: usize,
}

/// Pages that no block uses, and how many are in use.
///
/// At most one page is kept for four in use, so that a program that has shrunk does not hold on to what it needed once. Blocks
/// are made of kept pages before fresh ones are asked for, so that all pages together are never more than were in use at one time.
pub struct Pool {
    runs: [Run; RUNS],
    len: usize,
    kept: usize,
    used: usize,
}

impl Pool {
    pub const fn new() -> Self {
        Self {
            runs: [Run { first: 0, count: 0 }; RUNS],
            len: 0,
            kept: 0,
            used: 0,
        }
    }

    /// Notes that pages came into use.
    pub fn used(&mut self, count: usize) {
        self.used += count;
    }

    /// Takes back the pages of a block and returns those that are not kept, to be given to the system.
    pub fn put(&mut self, run: Run) -> Run {
        self.used -= run.count;
        let room = (self.used / IN_USE_PER_KEPT)
            .saturating_sub(self.kept)
            .min(run.count);
        let mut kept = Run {
            first: run.first,
            count: room,
        };
        let refused = Run {
            first: run.first + room,
            count: run.count - room,
        };
        if room == 0 {
            return refused;
        }
        let mut i = 0;
        while i < self.len {
            let other = self.runs[i];
            if other.first + other.count == kept.first || kept.first + kept.count == other.first {
                kept = Run {
                    first: kept.first.min(other.first),
                    count: kept.count + other.count,
                };
                self.remove(i);
            } else {
                i += 1;
            }
        }
        if self.len == RUNS {
            return run;
        }
        self.runs[self.len] = kept;
        self.len += 1;
        self.kept += room;
        refused
    }

    fn remove(&mut self, i: usize) {
        self.len -= 1;
        self.runs[i] = self.runs[self.len];
    }

    /// The address of `count` consecutive kept pages, from the shortest run that has them; they count as used.
    pub fn take(&mut self, count: usize) -> Option<usize> {
        let (i, run) = self.runs[..self.len]
            .iter()
            .copied()
            .enumerate()
            .filter(|(_, run)| run.count >= count)
            .min_by_key(|(_, run)| run.count)?;
        self.cut(i, run, count);
        self.used += count;
        Some(run.first)
    }

    /// At most `most` consecutive kept pages, from the longest run; they count neither as kept nor as used.
    pub fn take_some(&mut self, most: usize) -> Option<Run> {
        let (i, run) = self.runs[..self.len]
            .iter()
            .copied()
            .enumerate()
            .max_by_key(|(_, run)| run.count)?;
        let count = run.count.min(most);
        self.cut(i, run, count);
        Some(Run {
            first: run.first,
            count,
        })
    }

    fn cut(&mut self, i: usize, run: Run, count: usize) {
        self.kept -= count;
        if run.count == count {
            self.remove(i);
        } else {
            self.runs[i] = Run {
                first: run.first + count,
                count: run.count - count,
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(first: usize, count: usize) -> Run {
        Run { first, count }
    }

    #[test]
    fn neighbours_are_joined_and_the_shortest_run_serves() {
        let mut pool = Pool::new();
        pool.used(100);
        for piece in [run(10, 4), run(30, 9), run(18, 2), run(14, 4)] {
            assert_eq!(pool.put(piece).count, 0);
        }
        assert_eq!(pool.take(10), Some(10));
        assert_eq!(pool.take(10), None);
        assert_eq!(pool.take(8), Some(30));
        assert_eq!(pool.take_some(8), Some(run(38, 1)));
        assert_eq!(pool.take_some(8), None);
        assert_eq!((pool.kept, pool.used), (0, 99));
    }

    #[test]
    fn no_more_is_kept_than_a_share_of_what_is_used() {
        let mut pool = Pool::new();
        pool.used(10 * IN_USE_PER_KEPT + 10);
        assert_eq!(pool.put(run(0, 4)), run(4, 0));
        assert_eq!(
            pool.put(run(4, 6 + IN_USE_PER_KEPT)),
            run(9, 1 + IN_USE_PER_KEPT)
        );
        assert_eq!(
            pool.put(run(50, 9 * IN_USE_PER_KEPT)),
            run(50, 9 * IN_USE_PER_KEPT)
        );
        assert_eq!((pool.kept, pool.used), (9, 0));
        assert_eq!(pool.take_some(90), Some(run(0, 9)));
    }

    #[test]
    fn a_full_table_refuses() {
        let mut pool = Pool::new();
        pool.used(10 * RUNS);
        for i in 0..RUNS {
            assert_eq!(pool.put(run(2 * i, 1)).count, 0);
        }
        assert_eq!(pool.put(run(4 * RUNS, 1)), run(4 * RUNS, 1));
        assert_eq!(pool.kept, RUNS);
    }
}
