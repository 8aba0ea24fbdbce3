//! The loops over a block of points, compiled twice: for every processor of the target, and for those with registers of four numbers and
//! with fused operations (AVX2 and FMA).
//!
//! Both do the same IEEE operations on every point, and products and sums of the formula are never fused, so that they give the same bits.

#![allow(
    clippy::too_many_arguments,
    reason = "what overlaps nothing is known of arguments by themselves, not of what a structure holds"
)]

use crate::function::{Binary, Unary};
use crate::loops::{self, Source, Values};
use crate::quotient::Divisor;
use crate::term::Sum;

/// Writes down the loops of [`crate::loops`], once for each of the two.
macro_rules! loops {
    ($($name:ident($($argument:ident: $type:ty),*) $(-> $result:ty)?;)*) => {
        /// The loops of the instructions.
        pub(crate) trait Loops: Copy {
            $(fn $name(self, $($argument: $type),*) $(-> $result)?;)*
        }

        /// What every processor of the target can do.
        #[derive(Clone, Copy)]
        pub(crate) struct Plain;

        impl Loops for Plain {
            $(fn $name(self, $($argument: $type),*) $(-> $result)? {
                // Without an instruction for it, a fused operation is slower than a division.
                loops::$name::<false>($($argument),*)
            })*
        }

        #[cfg(target_arch = "x86_64")]
        #[allow(
            unsafe_code,
            reason = "functions for AVX2 and FMA are called: a `Wide` exists only where the processor was found to have it"
        )]
        mod x86 {
            use super::{Binary, Divisor, Loops, Source, Sum, Unary, Values};

            /// The proof that the processor has AVX2 and FMA; made by [`Wide::detect`] alone.
            #[derive(Clone, Copy)]
            pub(crate) struct Wide(());

            impl Wide {
                /// Asks the processor; the answer is kept by the standard library.
                #[inline]
                pub(crate) fn detect() -> Option<Wide> {
                    (is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma"))
                        .then_some(Wide(()))
                }
            }

            impl Loops for Wide {
                $(#[inline(always)]
                fn $name(self, $($argument: $type),*) $(-> $result)? {
                    // SAFETY: the processor has both, or there were no `self`.
                    unsafe { wide::$name($($argument),*) }
                })*
            }

            mod wide {
                use super::{Binary, Divisor, Source, Sum, Unary, Values};
                use crate::loops;

                $(#[target_feature(enable = "avx2,fma")]
                pub(super) fn $name($($argument: $type),*) $(-> $result)? {
                    loops::$name::<true>($($argument),*)
                })*
            }
        }
    };
}

#[cfg(target_arch = "x86_64")]
pub(crate) use x86::Wide;

loops! {
    unary(op: Unary, into: &mut Values, a: &Values);
    binary(op: Binary, into: &mut Values, a: &Values, b: &Values);
    binary_with(op: Binary, into: &mut Values, a: &Values, number: f64, place: usize);
    products(into: &mut Values, factor: f64, a: &Values, b: &Values, sum: Sum, c: &Values);
    multiples(into: &mut Values, factor: [f64; 2], a: &Values, sum: Sum, c: &Values);
    quotients(into: &mut Values, factor: f64, a: &Values, divisor: Divisor, sum: Sum, c: &Values);
    both_products(one: &mut Values, two: &mut Values, factor: f64, a: &Values, b: &Values, minus: [bool; 2], c: &Values, d: &Values);
    both_multiples(one: &mut Values, two: &mut Values, factor: [f64; 2], a: &Values, minus: [bool; 2], c: &Values, d: &Values);
    both_quotients(one: &mut Values, two: &mut Values, factor: f64, a: &Values, divisor: Divisor, minus: [bool; 2], c: &Values, d: &Values);
    blend(into: &mut Values, c: &Values, a: Source<'_>, b: Source<'_>);
    count(values: &Values) -> usize;
    put(out: &mut [f64], values: &Values, factor: f64) -> bool;
}

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use super::*;
    use crate::loops::STEP;
    use crate::term::Join;

    const UNARY: [Unary; 21] = {
        use Unary::*;
        [
            Neg, Not, Sin, Cos, Tan, Asin, Acos, Atan, Sinh, Cosh, Tanh, Exp, Ln, Log10, Sqrt,
            Cbrt, Abs, Sign, Floor, Ceil, Step,
        ]
    };

    const BINARY: [Binary; 17] = {
        use Binary::*;
        [
            Add, Sub, Mul, Div, Pow, Lt, Le, Gt, Ge, Eq, Ne, And, Or, Min, Max, Hypot, Atan2,
        ]
    };

    /// Numbers of all kinds, the same number often.
    fn numbers(seed: u64) -> [[f64; STEP]; 9] {
        let special = [0.0, -0.0, 1.0, -1.5, f64::NAN, f64::INFINITY, 1e-310, 3e200];
        let mut state = seed;
        let mut next = || {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            match state >> 60 {
                0..4 => special[(state >> 50) as usize % special.len()],
                _ => (state >> 40) as f64 / 4e6 - 2.0,
            }
        };
        // All numbers of the last step may be divided by products.
        let mut numbers: [[f64; STEP]; 9] =
            std::array::from_fn(|_| std::array::from_fn(|_| next()));
        numbers[8] = std::array::from_fn(|k| 0.3 + k as f64);
        numbers
    }

    /// Whether two loops give the same bits; which NaN it is means nothing.
    fn compare(steps: usize, what: &str, plain: impl Fn(&mut Values), wide: impl Fn(&mut Values)) {
        let mut out = [[[0.0; STEP]; 9]; 2];
        plain(&mut out[0][..steps]);
        wide(&mut out[1][..steps]);
        let bits = |values: &Values| -> Vec<Option<u64>> {
            let values = values.as_flattened().iter();
            values
                .map(|x| (!x.is_nan()).then_some(x.to_bits()))
                .collect()
        };
        assert_eq!(bits(&out[0]), bits(&out[1]), "{what} of {steps} steps");
    }

    /// A term by the operations that it is made of.
    fn one_by_one(into: &mut Values, term: impl Fn(&mut Values), sum: Sum, c: &Values) {
        let mut t = [[0.0; STEP]; 9];
        let t = &mut t[..into.len()];
        term(t);
        match sum {
            Sum::Nothing => into.copy_from_slice(t),
            Sum::Each(Join::Plus) => Plain.binary(Binary::Add, into, t, c),
            Sum::Each(Join::Minus) => Plain.binary(Binary::Sub, into, t, c),
            Sum::Each(Join::From) => Plain.binary(Binary::Sub, into, c, t),
            Sum::Same(Join::Plus, c) => Plain.binary_with(Binary::Add, into, t, c, 1),
            Sum::Same(Join::Minus, c) => Plain.binary_with(Binary::Sub, into, t, c, 1),
            Sum::Same(Join::From, c) => Plain.binary_with(Binary::Sub, into, t, c, 0),
        }
    }

    #[test]
    fn wide_loops_give_the_bits_of_plain_ones() {
        let Some(wide) = Wide::detect() else {
            return;
        };
        let [a, b, c] = [1, 2, 3].map(numbers);
        for steps in [1, 2, 9] {
            for op in UNARY {
                compare(
                    steps,
                    &format!("{op:?}"),
                    |out| Plain.unary(op, out, &a),
                    |out| wide.unary(op, out, &a),
                );
            }
            for op in BINARY {
                compare(
                    steps,
                    &format!("{op:?}"),
                    |out| Plain.binary(op, out, &a, &b),
                    |out| wide.binary(op, out, &a, &b),
                );
                for place in [0, 1] {
                    compare(
                        steps,
                        &format!("{op:?} with a number as {place}"),
                        |out| Plain.binary_with(op, out, &a, 0.3, place),
                        |out| wide.binary_with(op, out, &a, 0.3, place),
                    );
                }
            }
            for [a, b] in [[&a[..], &b[..]], [&a, &a]] {
                let sources = |v| [Source::Each(v), Source::Same(0.3)];
                let pairs = sources(a)
                    .into_iter()
                    .flat_map(|p| sources(b).map(|q| [p, q]));
                for [p, q] in pairs {
                    compare(
                        steps,
                        "blend",
                        |out| Plain.blend(out, &c, p, q),
                        |out| wide.blend(out, &c, p, q),
                    );
                }
            }
            assert_eq!(Plain.count(&a[..steps]), wide.count(&a[..steps]));
        }
    }

    #[test]
    fn terms_are_their_operations_one_by_one() {
        let wide = Wide::detect();
        let [a, b, c] = [1, 2, 3].map(numbers);
        let last = numbers(4)[8];
        let joins = [Join::Plus, Join::Minus, Join::From];
        let sums = joins
            .into_iter()
            .flat_map(|join| [Sum::Each(join), Sum::Same(join, 0.3)])
            .chain([Sum::Nothing]);
        let scaled = |factor: f64, a: &Values| {
            let mut out = [[0.0; STEP]; 9];
            Plain.binary_with(Binary::Mul, &mut out[..a.len()], a, factor, 0);
            out
        };
        for sum in sums {
            for (a, factor) in [(&a[..], 0.7), (&a, 1.0), (&[last], 3.0)] {
                let n = a.len();
                let first = scaled(factor, a);
                let product = |t: &mut Values| Plain.binary(Binary::Mul, t, &first, &b);
                let multiple = |t: &mut Values| Plain.binary_with(Binary::Mul, t, &first, 0.9, 1);
                let what = format!("{sum:?}");
                compare(
                    n,
                    &what,
                    |out| one_by_one(out, product, sum, &c),
                    |out| {
                        Plain.products(out, factor, a, &b, sum, &c);
                    },
                );
                compare(
                    n,
                    &what,
                    |out| one_by_one(out, multiple, sum, &c),
                    |out| {
                        Plain.multiples(out, [factor, 0.9], a, sum, &c);
                    },
                );
                if let Some(wide) = wide {
                    compare(
                        n,
                        &what,
                        |out| one_by_one(out, product, sum, &c),
                        |out| {
                            wide.products(out, factor, a, &b, sum, &c);
                        },
                    );
                    compare(
                        n,
                        &what,
                        |out| one_by_one(out, multiple, sum, &c),
                        |out| {
                            wide.multiples(out, [factor, 0.9], a, sum, &c);
                        },
                    );
                }
                for divisor in [3.0, -0.75, 12.0].map(|value| Divisor::new(value).unwrap()) {
                    let quotient = |t: &mut Values| {
                        Plain.binary_with(Binary::Div, t, &first, divisor.value, 1);
                    };
                    compare(
                        n,
                        &what,
                        |out| one_by_one(out, quotient, sum, &c),
                        |out| {
                            Plain.quotients(out, factor, a, divisor, sum, &c);
                        },
                    );
                    if let Some(wide) = wide {
                        compare(
                            n,
                            &what,
                            |out| one_by_one(out, quotient, sum, &c),
                            |out| {
                                wide.quotients(out, factor, a, divisor, sum, &c);
                            },
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn results_are_products_and_judged() {
        let Some(wide) = Wide::detect() else {
            return;
        };
        let finite = [[0.75; STEP]; 3];
        for length in [33, 40, 48] {
            for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX] {
                for at in [None, Some(0), Some(31), Some(length - 1)] {
                    let mut values = finite;
                    if let Some(at) = at {
                        values[at / STEP][at % STEP] = wrong;
                    }
                    let mut out = [[0.0; 48]; 2];
                    let [plain, other] = &mut out;
                    let judged = [
                        Plain.put(&mut plain[..length], &values, 2.0),
                        wide.put(&mut other[..length], &values, 2.0),
                    ];
                    assert_eq!(judged, [at.is_none(); 2], "{wrong} at {at:?}");
                    for out in out {
                        for (k, value) in out[..length].iter().enumerate() {
                            assert!(*value == 1.5 || Some(k) == at);
                        }
                    }
                }
            }
        }
    }
}
