//! Powers of two taken out of a problem so that everything inside is of order one.
//!
//! With lengths `x = 2^a X`, tensions `mu = 2^k M` (k even) and loads `f = 2^l F` the membrane equation
//! keeps its form in (X, M, F) with displacements `u = 2^(l + 2a - k) U`. Multiplying by a power of two
//! is exact, so the whole computation gives the same digits whatever the units are. The exponents are kept
//! apart from the numbers until output.

/// Exponents of the units in which a problem is held; see the module for their meaning.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Scale {
    /// Exponent a of the unit of length.
    pub length: i32,
    /// Exponent k of the unit of tension; always even, so that a factorisation keeps its digits.
    pub tension: i32,
    /// Exponent l of the unit of load (force per area).
    pub load: i32,
}

impl Scale {
    /// Exponent of a displacement.
    pub fn displacement(self) -> i32 {
        self.load + 2 * self.length - self.tension
    }

    /// Exponent of a force: load times area; also of `sigma` and of the paper's indicators.
    pub fn force(self) -> i32 {
        self.load + 2 * self.length
    }

    /// Exponent of an energy.
    pub fn energy(self) -> i32 {
        2 * self.load + 4 * self.length - self.tension
    }

    /// Exponent of an energy norm, the root of an energy.
    pub fn energy_norm(self) -> i32 {
        self.energy() / 2
    }

    /// Exponent of an area.
    pub fn area(self) -> i32 {
        2 * self.length
    }
}

/// `value * 2^exponent`, exact unless the result leaves the range of double precision.
///
/// Exponents beyond the range of a double are applied in steps.
pub fn times_power_of_two(value: f64, exponent: i32) -> f64 {
    let mut value = value;
    let mut left = exponent;
    while left > 1000 {
        value *= power_of_two(1000);
        left -= 1000;
        if value.is_infinite() || value == 0.0 {
            return value;
        }
    }
    while left < -1000 {
        // Stop one step short, so that only the last product can round to a subnormal number.
        value *= power_of_two(-1000);
        left += 1000;
        if value == 0.0 {
            return value;
        }
    }
    value * power_of_two(left)
}

/// `(value * 2^exponent)^(1/2)` for a value that is not negative, rounded as if the product had no limits.
///
/// For numbers whose unit is a root that powers of two do not divide evenly; an odd exponent leaves a factor of two under the root.
pub fn root_times_power_of_two(value: f64, exponent: i32) -> f64 {
    let odd = exponent.rem_euclid(2);
    times_power_of_two(times_power_of_two(value, odd).sqrt(), (exponent - odd) / 2)
}

/// 2^exponent for -1022 <= exponent <= 1023.
fn power_of_two(exponent: i32) -> f64 {
    f64::from_bits(((exponent + 1023) as u64) << 52)
}

/// The exponent e with 2^e <= |value| < 2^(e+1); 0 for zero and for values that are not finite.
pub fn exponent_of(value: f64) -> i32 {
    if value == 0.0 || !value.is_finite() {
        return 0;
    }
    let bits = value.abs().to_bits();
    let field = (bits >> 52) as i32;
    if field > 0 {
        field - 1023
    } else {
        // Subnormal: the position of the leading bit counts.
        -1011 - bits.leading_zeros() as i32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_of_two_are_exact_over_the_whole_range() {
        assert_eq!(times_power_of_two(1.5, 3), 12.0);
        assert_eq!(times_power_of_two(1.5, -1022), 1.5 * f64::MIN_POSITIVE);
        assert_eq!(
            times_power_of_two(times_power_of_two(1.7, 900), -1800),
            1.7 * power_of_two(-900)
        );
        assert_eq!(
            times_power_of_two(times_power_of_two(1.7, -900), 1900),
            1.7 * power_of_two(1000)
        );
        assert_eq!(times_power_of_two(1.0, 1024), f64::INFINITY);
        assert_eq!(times_power_of_two(1.0, -1074), f64::from_bits(1));
        assert_eq!(times_power_of_two(-3.0, 0), -3.0);
    }

    #[test]
    fn roots_of_odd_and_even_powers() {
        for value in [0.0, 0.3, 1.0, 7.5] {
            for exponent in -9..9 {
                let direct = times_power_of_two(value, exponent).sqrt();
                assert_eq!(root_times_power_of_two(value, exponent), direct);
            }
        }
        assert_eq!(root_times_power_of_two(2.0, 2001), power_of_two(1001));
        assert_eq!(root_times_power_of_two(2.0, -1901), power_of_two(-950));
    }

    #[test]
    fn exponents_bracket_the_value() {
        for value in [
            1.0,
            1.999,
            2.0,
            0.75,
            1e-300,
            1e300,
            f64::MIN_POSITIVE,
            f64::from_bits(1),
            f64::from_bits(12345),
        ] {
            let e = exponent_of(-value);
            assert!(times_power_of_two(1.0, e) <= value, "{value:e} {e}");
            assert!(
                e == 1023 || times_power_of_two(1.0, e + 1) > value,
                "{value:e} {e}"
            );
        }
        assert_eq!(exponent_of(0.0), 0);
    }

    #[test]
    fn derived_units_agree_with_each_other() {
        let s = Scale {
            length: 3,
            tension: -4,
            load: 7,
        };
        assert_eq!(s.energy(), s.force() + s.displacement());
        assert_eq!(2 * s.energy_norm(), s.energy());
        assert_eq!(s.energy(), s.tension + 2 * s.displacement());
    }
}
