//! Quotients by a constant without a division, which takes several times as long as the products that give the same bits.

/// A constant c to divide by, and its reciprocal as the sum of two numbers.
///
/// # Why the bits are those of the quotient
///
/// Write |c| as Y 2^k with Y odd, 2 < Y < 2^50, and let u be the spacing of the numbers around x/c.
///
/// - x is X 2^j with 2^52 <= X < 2^53, so that 2^(j-k) is a multiple of u/2 and even of u. A midpoint between two neighbouring numbers is an odd
///   multiple of u/2, and Y times its distance to |x/c| = X/Y 2^(j-k) is a multiple of u/2; it is not zero, as Y times an odd number is odd. So x/c is at
///   least u/(2Y) > 2^-51 u away from where rounding changes. The same holds of the end of a binade, unless x/c is that end.
/// - The first number is 1/c rounded, wrong by 2^-53 of 1/c at most, and the second is what is missing there, rounded: the sum is wrong by 2^-106 of 1/c.
///   Rounding the product of x with the second adds 2^-106 of x/c. Both together are less than 2^-104.9 |x/c| < 2^-51.9 u.
///
/// So `x * high + (x * low)`, rounded once, is x/c rounded. All this needs that nothing overflows or is subnormal: |x| from 2^-512 to 2^512 and |c| from
/// 2^-200 to 2^200 see to it, since |low| is at least 2^-104 of |high|. (The scheme is that of Brisebarre, Muller and Raina, "Accelerating correctly rounded
/// floating-point division when the divisor is known in advance", IEEE Transactions on Computers 53, 2004; a divisor of few digits needs none of their tests.)
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Divisor {
    pub(crate) value: f64,
    high: f64,
    low: f64,
}

/// Bits of the smallest size that is divided by products, 2^-512. From there to 2^512 there are 2^62 numbers, so that the difference of a number's bits
/// and these has a bit 62 if and only if it is not among them; the sign is bit 63.
const SMALLEST: u64 = (1023 - 512) << 52;
const OUTSIDE: u64 = 1 << 62;

impl Divisor {
    /// None of a constant that products do not serve.
    pub(crate) fn new(value: f64) -> Option<Divisor> {
        let exponent = (value.to_bits() >> 52 & 0x7ff) as i32 - 1023;
        let digits = value.to_bits() & ((1 << 52) - 1) | 1 << 52;
        let odd = digits >> digits.trailing_zeros();
        if exponent.abs() >= 200 || odd == 1 || odd >= 1 << 50 {
            return None;
        }
        let high = 1.0 / value;
        // The difference is exact.
        let low = (-value).mul_add(high, 1.0) / value;
        Some(Divisor { value, high, low })
    }

    /// x/c by fused products. `outside` gathers for [`Self::is_outside`] whether some x had to be divided instead.
    #[inline(always)]
    pub(crate) fn quotient(self, x: f64, outside: &mut u64) -> f64 {
        *outside |= x.to_bits().wrapping_sub(SMALLEST);
        x.mul_add(self.high, x * self.low)
    }

    #[inline(always)]
    pub(crate) fn is_outside(outside: u64) -> bool {
        outside & OUTSIDE != 0
    }
}

/// The reciprocal of a power of two, if it is a power of two itself: a product with it is the quotient, both being the same real number rounded.
pub(crate) fn exact_reciprocal(value: f64) -> Option<f64> {
    let digits = value.to_bits() & ((1 << 52) - 1);
    (digits == 0 && value.is_normal() && (1.0 / value).is_normal()).then(|| 1.0 / value)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers of 64 random bits.
    fn random(seed: u64) -> impl Iterator<Item = u64> {
        let mut state = seed;
        std::iter::repeat_with(move || {
            state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = state;
            z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
            z ^ z >> 31
        })
    }

    /// With the exponent put between those two.
    fn between(bits: u64, least: i32, most: i32) -> f64 {
        let exponent = least + ((bits >> 52 & 0x7ff) as i32) % (most - least + 1);
        f64::from_bits(bits & !(0x7ff << 52) | ((1023 + exponent) as u64) << 52)
    }

    fn divisors() -> Vec<Divisor> {
        let small = (3..200).map(f64::from);
        let decimal = [1e3, 1e6, 1e9, 0.375, -1.5, -12.0, 3e15];
        let largest = ((1u64 << 50) - 1) as f64;
        // All sizes of Y, the last ones the hardest.
        let odd = random(1).zip(0..300).map(|(bits, k)| {
            let y = ((bits >> 14 | 1 << 49) >> (k % 48) | 1) as f64;
            y * between(bits & 1 << 63, 0, 0) * 2f64.powi((bits % 300) as i32 - 190)
        });
        let all = small.chain(decimal).chain([largest, -largest]).chain(odd);
        all.filter_map(Divisor::new).collect()
    }

    /// Divides and compares with `/`.
    fn check(divisor: Divisor, numbers: &[f64]) {
        let mut outside = 0;
        let quotients: Vec<f64> = numbers
            .iter()
            .map(|x| divisor.quotient(*x, &mut outside))
            .collect();
        assert!(!Divisor::is_outside(outside), "by {:e}", divisor.value);
        for (x, q) in numbers.iter().zip(quotients) {
            let expected = x / divisor.value;
            assert!(
                q.to_bits() == expected.to_bits(),
                "{x:e} / {:e} is {expected:e}, not {q:e}",
                divisor.value
            );
        }
    }

    #[test]
    fn products_give_the_bits_of_quotients() {
        let divisors = divisors();
        assert!(divisors.len() > 400, "{}", divisors.len());
        for (seed, divisor) in divisors.into_iter().enumerate() {
            let any = random(seed as u64).take(4000);
            check(
                divisor,
                &any.map(|b| between(b, -512, 511)).collect::<Vec<_>>(),
            );
            // Quotients next to the middle of two numbers, and next to numbers.
            let near = random(!seed as u64).take(4000).map(|bits| {
                let quotient = between(bits, -250, 250);
                let away = quotient * f64::EPSILON * 0.25 * (bits % 3) as f64;
                (away * divisor.value) + quotient * divisor.value
            });
            check(divisor, &near.collect::<Vec<_>>());
            // As 53 digits X with X 2^s = (Y M +- 1)/2: as near to the middle as a quotient comes.
            let y = {
                let digits = divisor.value.to_bits() & ((1 << 52) - 1) | 1 << 52;
                u128::from(digits >> digits.trailing_zeros())
            };
            let hard = random(7 * seed as u64).take(4000).map(|bits| {
                let odd = u128::from(bits >> 11 | 1 << 53 | 1);
                let shift = 128 - (odd * y).leading_zeros() - 53;
                (((odd * y) >> shift) + u128::from(bits & 1)) as f64
            });
            check(divisor, &hard.collect::<Vec<_>>());
        }
    }

    #[test]
    fn what_is_outside_the_range_is_told() {
        let special = [
            0.0,
            -0.0,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::NAN,
            f64::MAX,
            f64::MIN_POSITIVE,
            5e-324,
            -1e-310,
            2f64.powi(-513) * 1.9,
            -2f64.powi(512),
        ];
        let [three, ..] = &divisors()[..] else {
            panic!("there are divisors");
        };
        for x in special {
            let mut outside = 0;
            for x in [1.0, x, -0.7] {
                three.quotient(x, &mut outside);
            }
            assert!(Divisor::is_outside(outside), "{x:e}");
        }
    }

    #[test]
    fn constants_that_products_do_not_serve() {
        let none = [
            0.0,
            1.0,
            -4.0,
            0.1,
            1.0 / 3.0,
            f64::NAN,
            f64::INFINITY,
            5e-324,
            3e200,
            3e-200,
        ];
        for value in none {
            assert_eq!(Divisor::new(value), None, "{value:e}");
        }
    }

    #[test]
    fn reciprocals_of_powers_of_two() {
        for (value, reciprocal) in [
            (4.0, 0.25),
            (-0.5, -2.0),
            (2f64.powi(1022), 2f64.powi(-1022)),
        ] {
            assert_eq!(exact_reciprocal(value), Some(reciprocal));
        }
        let none = [
            3.0,
            0.0,
            f64::INFINITY,
            f64::NAN,
            2f64.powi(1023),
            5e-324,
            1e-310,
        ];
        for value in none {
            assert_eq!(exact_reciprocal(value), None, "{value:e}");
        }
        for bits in random(5).take(100_000) {
            let x = f64::from_bits(bits);
            assert!(x.is_nan() || (x / 8.0).to_bits() == (x * 0.125).to_bits());
        }
    }
}
