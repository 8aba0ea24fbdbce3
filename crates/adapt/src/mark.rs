//! Which triangles are refined.

use fem_core::TriangleId;

use crate::settings::{Mark, Strategy};

/// Marks triangles by the squares of their indicators, in increasing order of their numbers.
///
/// If all indicators are zero every triangle is marked, since something must be.
pub fn mark(squares: &[f64], settings: &Mark) -> Vec<TriangleId> {
    let all = || (0..squares.len() as u32).map(TriangleId).collect();
    let marked: Vec<TriangleId> = match settings.strategy {
        Strategy::Uniform => return all(),
        Strategy::Maximum => {
            let largest = squares.iter().copied().fold(0.0, f64::max);
            let limit = settings.theta * settings.theta * largest;
            (0..squares.len() as u32)
                .map(TriangleId)
                .filter(|t| squares[t.index()] > 0.0 && squares[t.index()] >= limit)
                .collect()
        }
        Strategy::Doerfler => doerfler(squares, settings.theta),
    };
    if marked.is_empty() { all() } else { marked }
}

/// Squares that differ by no more than this part are equal: more than rounding ever leaves between equal indicators of a solution that is exact.
const TIES: f64 = 1e-8;

/// Buckets of the histogram of positive numbers: all exponents, and eight steps in each.
const BUCKETS: usize = 1 << 14;

/// The bucket of a positive number; larger numbers are never in a lower one.
#[inline(always)]
fn bucket(square: f64) -> usize {
    (square.to_bits() >> 49) as usize
}

/// A set of least cardinality whose squared indicators sum to at least `theta` times the total, in linear time.
///
/// A histogram tells the size of the smallest indicator in the set to a step of it, and [`smallest_of_largest`] searches that step. What ties with the
/// smallest one, to [`TIES`], is in the set too: on a symmetric problem rounding would choose among them otherwise, and the meshes of one
/// version, compiler or machine would not be those of another.
fn doerfler(squares: &[f64], theta: f64) -> Vec<TriangleId> {
    let mut histogram = vec![(0.0f64, 0usize); BUCKETS];
    for &square in squares.iter().filter(|s| **s > 0.0) {
        let (sum, count) = &mut histogram[bucket(square)];
        *sum += square;
        *count += 1;
    }
    let mut missing = theta * histogram.iter().map(|b| b.0).sum::<f64>();
    // Everything above `step` is in the set and `missing` still lacks.
    let mut step = BUCKETS;
    while step > 0 {
        step -= 1;
        let (sum, count) = histogram[step];
        if count > 0 && sum >= missing {
            break;
        }
        if step > 0 {
            missing -= sum;
        }
    }
    let numbers = || (0..squares.len() as u32).zip(squares);
    let within = |square: f64| square > 0.0 && bucket(square) == step;
    let candidates = numbers().filter(|(_, s)| within(**s)).map(|(t, _)| t);
    let smallest = smallest_of_largest(squares, candidates.collect(), missing);
    let limit = (1.0 - TIES) * smallest;
    numbers()
        .filter(|(_, s)| **s > 0.0 && **s >= limit)
        .map(|(t, _)| TriangleId(t))
        .collect()
}

/// The smallest square among the fewest of the triangles in `order` whose squares sum to `missing`, or among all if they do not; 0 of none.
///
/// They are found by repeated partition about the median, of which only one half is followed (Pfeiler, Praetorius, "Doerfler marking with minimal
/// cardinality is a linear complexity problem", 2020).
fn smallest_of_largest(squares: &[f64], mut order: Vec<u32>, mut missing: f64) -> f64 {
    let (mut low, mut high) = (0, order.len());
    // Everything before `low` is in the set and `missing` still lacks; nothing from `high` on is needed.
    while high - low > 1 {
        let middle = low + (high - low) / 2;
        order[low..high].select_nth_unstable_by(middle - low, |&s, &t| {
            squares[t as usize]
                .total_cmp(&squares[s as usize])
                .then(s.cmp(&t))
        });
        let upper: f64 = order[low..middle]
            .iter()
            .map(|&t| squares[t as usize])
            .sum();
        if upper >= missing {
            high = middle;
        } else {
            missing -= upper;
            low = middle;
        }
    }
    order[..high]
        .iter()
        .map(|&t| squares[t as usize])
        .reduce(f64::min)
        .unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use fem_core::Children;

    fn settings(strategy: Strategy, theta: f64) -> Mark {
        Mark {
            strategy,
            theta,
            children: Children::Four,
        }
    }

    fn numbers(marked: Vec<TriangleId>) -> Vec<u32> {
        marked.into_iter().map(|t| t.0).collect()
    }

    /// The definition: sort, take the largest until the sum is reached, and what ties with the last.
    fn by_sorting(squares: &[f64], theta: f64) -> Vec<u32> {
        let mut order: Vec<u32> = (0..squares.len() as u32).collect();
        order.sort_by(|&s, &t| {
            squares[t as usize]
                .total_cmp(&squares[s as usize])
                .then(s.cmp(&t))
        });
        let target = theta * squares.iter().sum::<f64>();
        let (mut sum, mut set) = (0.0, Vec::new());
        for t in order {
            let square = squares[t as usize];
            let tie = set
                .last()
                .is_some_and(|&last: &u32| square == squares[last as usize]);
            if square == 0.0 || (sum >= target && !tie) {
                break;
            }
            sum += square;
            set.push(t);
        }
        set.sort_unstable();
        set
    }

    #[test]
    fn doerfler_takes_the_least_set() {
        let mut state = 1u64;
        for n in [1usize, 2, 3, 7, 64, 1000] {
            // Multiples of 1/8, so that sums are exact and ties abound.
            let squares: Vec<f64> = (0..n)
                .map(|_| {
                    state = state
                        .wrapping_mul(6364136223846793005)
                        .wrapping_add(1442695040888963407);
                    ((state >> 59) + 1) as f64 / 8.0
                })
                .collect();
            for theta in [0.1, 0.5, 0.75, 1.0] {
                let marked = numbers(mark(&squares, &settings(Strategy::Doerfler, theta)));
                assert_eq!(marked, by_sorting(&squares, theta), "{n} {theta}");
            }
        }
    }

    #[test]
    fn doerfler_takes_the_least_set_of_numbers_of_all_sizes() {
        let mut state = 5u64;
        let mut random = move || {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            state >> 40
        };
        // Powers of two over sixteen octaves with three binary digits, zeros between them: sums are exact.
        let squares: Vec<f64> = (0..3000)
            .map(|_| match random() % 5 {
                0 => 0.0,
                _ => (8 + random() % 8) as f64 * 2f64.powi((random() % 16) as i32 - 30),
            })
            .collect();
        for theta in [0.01, 0.25, 0.5, 0.9, 0.999] {
            let marked = numbers(mark(&squares, &settings(Strategy::Doerfler, theta)));
            assert_eq!(marked, by_sorting(&squares, theta), "{theta}");
        }
        let all = numbers(mark(&squares, &settings(Strategy::Doerfler, 1.0)));
        assert_eq!(all.len(), squares.iter().filter(|s| **s > 0.0).count());
    }

    #[test]
    fn rounding_does_not_choose_among_ties() {
        // Of four equal indicators two would do.
        let squares = [1.0, 0.25, 1.0 + 1e-15, 1.0 - 1e-15, 0.1, 1.0, 1.0 - 1e-6];
        let marked = numbers(mark(&squares, &settings(Strategy::Doerfler, 0.3)));
        assert_eq!(marked, [0, 2, 3, 5]);
        assert_eq!(
            numbers(mark(&[0.0, 2.0], &settings(Strategy::Doerfler, 1.0))),
            [1]
        );
    }

    #[test]
    fn maximum_and_uniform() {
        let squares = [1.0, 0.25, 0.24, 0.0];
        assert_eq!(
            numbers(mark(&squares, &settings(Strategy::Maximum, 0.5))),
            [0, 1]
        );
        assert_eq!(
            numbers(mark(&squares, &settings(Strategy::Uniform, 0.5))),
            [0, 1, 2, 3]
        );
    }

    #[test]
    fn zero_indicators_mark_everything() {
        for strategy in [Strategy::Doerfler, Strategy::Maximum, Strategy::Uniform] {
            assert_eq!(
                numbers(mark(&[0.0; 3], &settings(strategy, 0.5))),
                [0, 1, 2]
            );
        }
    }
}
