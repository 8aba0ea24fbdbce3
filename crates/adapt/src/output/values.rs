//! Arrays that are asked for piece by piece.

use std::fmt;
use std::ops::Range;
use std::sync::Arc;

use fem_core::scale::times_power_of_two;

/// One value a vertex or triangle: lent, owned, or computed when it is asked for.
///
/// A file takes a few thousand values at a time, so that what is computed for it, if only by a change of units, is never held whole.
#[derive(Clone)]
pub struct Values<'a, T> {
    len: usize,
    append: Arc<Append<'a, T>>,
}

/// Puts the values with the numbers of a range behind those that are there.
type Append<'a, T> = dyn Fn(Range<usize>, &mut Vec<T>) + Send + Sync + 'a;

impl<'a, T: Copy + Send + Sync + 'a> Values<'a, T> {
    /// `len` values, number i computed by `value(i)` whenever it is asked for.
    pub fn by(len: usize, value: impl Fn(usize) -> T + Send + Sync + 'a) -> Self {
        Values {
            len,
            append: Arc::new(move |range, out| out.extend(range.map(&value))),
        }
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Puts the values with the numbers of a range, all below [`Values::len`], behind those in `out`.
    pub fn append(&self, range: Range<usize>, out: &mut Vec<T>) {
        (self.append)(range, out);
    }

    /// All of them.
    pub fn to_vec(&self) -> Vec<T> {
        let mut all = Vec::with_capacity(self.len);
        self.append(0..self.len, &mut all);
        all
    }
}

impl<'a> Values<'a, f64> {
    /// `values * 2^exponent`.
    pub fn scaled(values: &'a [f64], exponent: i32) -> Self {
        if exponent == 0 {
            return values.into();
        }
        Values::by(values.len(), move |i| {
            times_power_of_two(values[i], exponent)
        })
    }
}

impl<'a> Values<'a, [f64; 2]> {
    /// Points with both coordinates times 2^exponent.
    pub fn scaled_points(points: &'a [[f64; 2]], exponent: i32) -> Self {
        if exponent == 0 {
            return points.into();
        }
        Values::by(points.len(), move |i| {
            points[i].map(|x| times_power_of_two(x, exponent))
        })
    }
}

impl<'a, T: Copy + Send + Sync> From<&'a [T]> for Values<'a, T> {
    fn from(values: &'a [T]) -> Self {
        Values {
            len: values.len(),
            append: Arc::new(|range, out| out.extend_from_slice(&values[range])),
        }
    }
}

impl<'a, T: Copy + Send + Sync + 'a> From<Vec<T>> for Values<'a, T> {
    fn from(values: Vec<T>) -> Self {
        Values {
            len: values.len(),
            append: Arc::new(move |range, out| out.extend_from_slice(&values[range])),
        }
    }
}

impl<T> fmt::Debug for Values<'_, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} values", self.len)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_range_is_that_of_the_whole() {
        let numbers: Vec<f64> = (0..10).map(|i| f64::from(i) - 4.5).collect();
        let points: Vec<[f64; 2]> = numbers.iter().map(|&v| [v, -v]).collect();
        let doubled: Vec<f64> = numbers.iter().map(|v| 2.0 * v).collect();
        for (values, expected) in [
            (Values::from(numbers.as_slice()), &numbers),
            (Values::from(numbers.clone()), &numbers),
            (Values::scaled(&numbers, 0), &numbers),
            (Values::scaled(&numbers, 1), &doubled),
            (Values::by(10, |i| 2.0 * numbers[i]), &doubled),
        ] {
            assert_eq!(values.to_vec(), *expected);
            for from in 0..10 {
                for to in from..=10 {
                    let mut out = vec![7.0];
                    values.append(from..to, &mut out);
                    assert_eq!(out[0], 7.0);
                    assert_eq!(out[1..], expected[from..to]);
                }
            }
        }
        assert_eq!(Values::scaled_points(&points, 0).to_vec(), points);
        let halved: Vec<[f64; 2]> = points.iter().map(|p| p.map(|x| 0.5 * x)).collect();
        assert_eq!(Values::scaled_points(&points, -1).to_vec(), halved);
    }
}
