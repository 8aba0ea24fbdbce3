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

/// A set of least cardinality whose squared indicators sum to at least `theta` times the total, in linear time.
///
/// The largest indicators are found by repeated partition about the median, of which only one half is followed (Pfeiler,
/// Praetorius, "Doerfler marking with minimal cardinality is a linear complexity problem", 2020). Ties go to
/// the lower number, so the set is unique.
fn doerfler(squares: &[f64], theta: f64) -> Vec<TriangleId> {
    let mut order: Vec<u32> = (0..squares.len() as u32)
        .filter(|&t| squares[t as usize] > 0.0)
        .collect();
    let mut missing = theta * order.iter().map(|&t| squares[t as usize]).sum::<f64>();
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
    order.truncate(high);
    order.sort_unstable();
    order.into_iter().map(TriangleId).collect()
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

    /// The definition: sort, take the largest until the sum is reached.
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
            if sum >= target {
                break;
            }
            sum += squares[t as usize];
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
