//! The loops over a block of points, compiled twice: for every processor of the target, and for those with registers of four numbers and
//! with fused operations (AVX2 and FMA).
//!
//! Both do the same IEEE operations on every point, and products and sums of the formula are never fused, so that they give the same bits.

use crate::eval::{Source, apply_binary, apply_unary, choose, count};
use crate::function::{Binary, Unary};
use crate::term::TermValues;

/// The loops of the instructions; `list` holds the points to work on, all of them if there is none.
pub(crate) trait Loops: Copy {
    fn unary(self, op: Unary, into: &mut [f64], a: Source<'_>, list: Option<&[u8]>);

    fn binary(
        self,
        op: Binary,
        into: &mut [f64],
        a: Source<'_>,
        b: Source<'_>,
        list: Option<&[u8]>,
    );

    /// How many of the values are true.
    fn count(self, values: &[f64]) -> usize;

    fn term(self, into: &mut [f64], term: TermValues<'_>, list: Option<&[u8]>);

    /// `of` holds the condition and the values where it is true and false.
    fn select(self, into: &mut [f64], of: [Source<'_>; 3], list: Option<&[u8]>);
}

/// What every processor of the target can do.
#[derive(Clone, Copy)]
pub(crate) struct Plain;

impl Loops for Plain {
    fn unary(self, op: Unary, into: &mut [f64], a: Source<'_>, list: Option<&[u8]>) {
        apply_unary(op, into, a, list);
    }

    fn binary(
        self,
        op: Binary,
        into: &mut [f64],
        a: Source<'_>,
        b: Source<'_>,
        list: Option<&[u8]>,
    ) {
        apply_binary(op, into, a, b, list);
    }

    fn count(self, values: &[f64]) -> usize {
        count(values)
    }

    // Without an instruction for it, a fused operation is slower than a division.
    fn term(self, into: &mut [f64], term: TermValues<'_>, list: Option<&[u8]>) {
        term.compute(into, list, false);
    }

    fn select(self, into: &mut [f64], of: [Source<'_>; 3], list: Option<&[u8]>) {
        choose(into, of, list);
    }
}

#[cfg(target_arch = "x86_64")]
pub(crate) use x86::Wide;

#[cfg(target_arch = "x86_64")]
#[allow(
    unsafe_code,
    reason = "functions for AVX2 and FMA are called: a `Wide` exists only where the processor was found to have it"
)]
mod x86 {
    use super::{
        Binary, Loops, Source, TermValues, Unary, apply_binary, apply_unary, choose,
        count as count_true,
    };

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
        fn unary(self, op: Unary, into: &mut [f64], a: Source<'_>, list: Option<&[u8]>) {
            // SAFETY: the processor has both, or there were no `self`.
            unsafe { unary(op, into, a, list) }
        }

        fn binary(
            self,
            op: Binary,
            into: &mut [f64],
            a: Source<'_>,
            b: Source<'_>,
            list: Option<&[u8]>,
        ) {
            // SAFETY: the processor has both, or there were no `self`.
            unsafe { binary(op, into, a, b, list) }
        }

        fn count(self, values: &[f64]) -> usize {
            // SAFETY: the processor has both, or there were no `self`.
            unsafe { count(values) }
        }

        fn term(self, into: &mut [f64], term: TermValues<'_>, list: Option<&[u8]>) {
            // SAFETY: the processor has both, or there were no `self`.
            unsafe { compute(into, term, list) }
        }

        fn select(self, into: &mut [f64], of: [Source<'_>; 3], list: Option<&[u8]>) {
            // SAFETY: the processor has both, or there were no `self`.
            unsafe { select(into, of, list) }
        }
    }

    #[target_feature(enable = "avx2,fma")]
    fn unary(op: Unary, into: &mut [f64], a: Source<'_>, list: Option<&[u8]>) {
        apply_unary(op, into, a, list);
    }

    #[target_feature(enable = "avx2,fma")]
    fn binary(op: Binary, into: &mut [f64], a: Source<'_>, b: Source<'_>, list: Option<&[u8]>) {
        apply_binary(op, into, a, b, list);
    }

    #[target_feature(enable = "avx2,fma")]
    fn count(values: &[f64]) -> usize {
        count_true(values)
    }

    #[target_feature(enable = "avx2,fma")]
    fn compute(into: &mut [f64], term: TermValues<'_>, list: Option<&[u8]>) {
        term.compute(into, list, true);
    }

    #[target_feature(enable = "avx2,fma")]
    fn select(into: &mut [f64], of: [Source<'_>; 3], list: Option<&[u8]>) {
        choose(into, of, list);
    }
}

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use super::*;
    use crate::quotient::Divisor;
    use crate::term::{By, Join};

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
    fn numbers(seed: u64) -> Vec<f64> {
        let special = [0.0, -0.0, 1.0, -1.5, f64::NAN, f64::INFINITY, 1e-310, 3e200];
        let mut state = seed;
        (0..253)
            .map(|_| {
                state = state
                    .wrapping_mul(6364136223846793005)
                    .wrapping_add(1442695040888963407);
                match state >> 60 {
                    0..4 => special[(state >> 50) as usize % special.len()],
                    _ => (state >> 40) as f64 / 4e6 - 2.0,
                }
            })
            .collect()
    }

    /// A term by the operations that it is made of.
    fn one_by_one(term: TermValues<'_>, into: &mut [f64], list: Option<&[u8]>) {
        let [mut scaled, mut product] = [vec![0.0; into.len()], vec![0.0; into.len()]];
        let factor = Source::Same(term.factor);
        Plain.binary(Binary::Mul, &mut scaled, factor, term.of, None);
        let (op, by) = match term.by {
            By::Times(b) => (Binary::Mul, b),
            By::Over(divisor) => (Binary::Div, Source::Same(divisor.value)),
        };
        Plain.binary(op, &mut product, Source::Each(&scaled), by, None);
        let t = Source::Each(&product);
        match term.sum {
            None => Plain.binary(Binary::Mul, into, t, Source::Same(1.0), list),
            Some((Join::Plus, c)) => Plain.binary(Binary::Add, into, t, c, list),
            Some((Join::Minus, c)) => Plain.binary(Binary::Sub, into, t, c, list),
            Some((Join::From, c)) => Plain.binary(Binary::Sub, into, c, t, list),
        }
    }

    #[test]
    fn wide_loops_give_the_bits_of_plain_ones() {
        let Some(wide) = Wide::detect() else {
            return;
        };
        let [a, b, c] = [1, 2, 3].map(numbers);
        let sources = |v| [Source::Each(v), Source::Same(0.3)];
        let list: Vec<u8> = (0..253).filter(|k| k % 3 != 1).collect();
        // Which NaN it is means nothing.
        let bits = |v: &[f64]| -> Vec<Option<u64>> {
            v.iter()
                .map(|x| (!x.is_nan()).then_some(x.to_bits()))
                .collect()
        };
        for list in [None, Some(&list[..])] {
            let same = |plain: &dyn Fn(&mut [f64]), wide: &dyn Fn(&mut [f64]), what: String| {
                let mut out = [vec![0.0; 253], vec![0.0; 253]];
                plain(&mut out[0]);
                wide(&mut out[1]);
                assert_eq!(bits(&out[0]), bits(&out[1]), "{what}");
            };
            for op in UNARY {
                same(
                    &|out| Plain.unary(op, out, Source::Each(&a), list),
                    &|out| wide.unary(op, out, Source::Each(&a), list),
                    format!("{op:?}"),
                );
            }
            for (p, q) in sources(&a)
                .into_iter()
                .flat_map(|p| sources(&b).map(|q| (p, q)))
            {
                for op in BINARY {
                    same(
                        &|out| Plain.binary(op, out, p, q, list),
                        &|out| wide.binary(op, out, p, q, list),
                        format!("{op:?}"),
                    );
                }
                let by = [3.0, -0.75, 12.0].map(|value| By::Over(Divisor::new(value).unwrap()));
                let joins = [Join::Plus, Join::Minus, Join::From].into_iter();
                let sums = joins.flat_map(|join| sources(&c).map(|c| Some((join, c))));
                for (by, sum) in by
                    .into_iter()
                    .chain([By::Times(q)])
                    .flat_map(|by| sums.clone().chain([None]).map(move |sum| (by, sum)))
                {
                    let term = TermValues {
                        factor: if sum.is_none() { 1.0 } else { 0.7 },
                        of: p,
                        by,
                        sum,
                    };
                    same(
                        &|out| one_by_one(term, out, list),
                        &|out| wide.term(out, term, list),
                        "term".into(),
                    );
                    same(
                        &|out| one_by_one(term, out, list),
                        &|out| Plain.term(out, term, list),
                        "term".into(),
                    );
                }
                same(
                    &|out| Plain.select(out, [Source::Each(&c), p, q], list),
                    &|out| wide.select(out, [Source::Each(&c), p, q], list),
                    "select".into(),
                );
            }
        }
    }
}
