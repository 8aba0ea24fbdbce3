//! Numbers that are compared: a value, how far another may be from it, and its unit.

use fem_core::scale::times_power_of_two;

/// Largest difference from a recomputed number, relative to it (to the largest value of an array).
pub const TOLERANCE: f64 = 1e-9;

/// Allowance for rounding, relative to the terms that a number is summed from before anything cancels.
pub(crate) const ROUNDING: f64 = 1e-12;

/// A recomputed number in units of 2^exponent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Number {
    /// The value.
    pub value: f64,
    /// How far a number that is the same may be from it.
    pub slack: f64,
    /// Exponent of the unit.
    pub exponent: i32,
}

impl Number {
    /// A number summed from terms whose absolute values add to `terms`.
    pub fn new(value: f64, terms: f64, exponent: i32) -> Number {
        Number {
            value,
            slack: TOLERANCE * value.abs() + ROUNDING * terms.abs(),
            exponent,
        }
    }

    /// A number in which nothing cancels.
    pub fn plain(value: f64, exponent: i32) -> Number {
        Number::new(value, 0.0, exponent)
    }

    /// The quotient; none where the divisor is zero.
    pub fn over(self, divisor: Number) -> Option<Number> {
        if divisor.value == 0.0 {
            return None;
        }
        let value = self.value / divisor.value;
        // What rounding adds to the common tolerance.
        let beyond = |n: Number| (n.slack / n.value.abs() - TOLERANCE).max(0.0);
        let slack = value.abs() * (TOLERANCE + beyond(self) + beyond(divisor));
        Some(Number {
            value,
            // 0/x: whatever the numerator may be over the divisor.
            slack: if self.value == 0.0 {
                self.slack / divisor.value.abs()
            } else {
                slack
            },
            exponent: self.exponent - divisor.exponent,
        })
    }

    /// The value in the user's units.
    pub fn physical(self) -> f64 {
        times_power_of_two(self.value, self.exponent)
    }

    /// Whether a number of a file, in the user's units, is this one.
    pub fn agrees(self, claimed: f64) -> bool {
        let expected = self.physical();
        let slack = times_power_of_two(self.slack, self.exponent);
        claimed == expected || (claimed - expected).abs() <= slack + SPACING
    }
}

/// The spacing of the smallest doubles, which is what scaling back may round to.
pub(crate) const SPACING: f64 = f64::from_bits(1);

/// The largest absolute value; 0 of nothing.
pub(crate) fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |m, v| m.max(v.abs()))
}

/// Sum with the rounding of every addition carried along (Neumaier 1974).
pub(crate) fn sum(values: impl IntoIterator<Item = f64>) -> f64 {
    let (mut sum, mut rest) = (0.0f64, 0.0f64);
    for v in values {
        let next = sum + v;
        rest += if sum.abs() >= v.abs() {
            (sum - next) + v
        } else {
            (v - next) + sum
        };
        sum = next;
    }
    sum + rest
}

/// Root of the sum of squares.
pub(crate) fn root_sum(values: &[f64]) -> f64 {
    sum(values.iter().map(|v| v * v)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_in_a_billion_is_the_limit() {
        let n = Number::plain(3.0, 2);
        assert!(n.agrees(12.0 * (1.0 + 0.9e-9)) && !n.agrees(12.0 * (1.0 + 1.1e-9)));
        assert!(!n.agrees(f64::NAN) && !n.agrees(f64::INFINITY));
        assert!(Number::plain(1.0, 5000).agrees(f64::INFINITY));
        assert!(Number::plain(1.5, -1074).agrees(f64::from_bits(2)));
    }

    #[test]
    fn terms_that_cancel_leave_their_rounding() {
        let n = Number::new(1e-15, 1.0, 0);
        assert!(n.agrees(-3e-13) && !n.agrees(2e-12));
        let q = n.over(Number::plain(2.0, 3)).unwrap();
        assert_eq!(q.exponent, -3);
        assert!(times_power_of_two(q.slack, 0) > 4e-13);
        assert_eq!(n.over(Number::plain(0.0, 0)), None);
        let q = Number::plain(6.0, 0).over(Number::plain(2.0, 0)).unwrap();
        assert!(q.agrees(3.0 * (1.0 + 0.9e-9)) && !q.agrees(3.0 * (1.0 + 1.1e-9)));
    }

    #[test]
    fn compensated_sums() {
        assert_eq!(sum([1.0, 1e100, 1.0, -1e100]), 2.0);
        assert_eq!(root_sum(&[3.0, 4.0]), 5.0);
        assert_eq!(largest(&[1.0, -2.0]), 2.0);
    }
}
