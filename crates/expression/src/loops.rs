//! The loops of the instructions over whole steps of points.
//!
//! What they read and write comes as separate arguments, from which a compiler knows that nothing overlaps.

#![allow(
    clippy::too_many_arguments,
    reason = "what overlaps nothing is known of arguments by themselves, not of what a structure holds"
)]

use crate::function::{Binary, Unary};
use crate::quotient::Divisor;
use crate::term::{Join, Sum};

/// Points that a loop takes in one step: whole steps leave nothing to be done point by point.
pub(crate) const STEP: usize = 16;

/// The values of an operand, in whole steps.
pub(crate) type Values = [[f64; STEP]];

/// Values of an operand that are the same everywhere or not.
#[derive(Clone, Copy)]
pub(crate) enum Source<'a> {
    Each(&'a Values),
    Same(f64),
}

impl Source<'_> {
    /// The values of the first steps alone.
    pub(crate) fn first(self, steps: usize) -> Self {
        match self {
            Self::Each(values) => Self::Each(&values[..steps]),
            same => same,
        }
    }

    #[inline(always)]
    pub(crate) fn at(self, point: usize) -> f64 {
        match self {
            Self::Each(values) => values[point / STEP][point % STEP],
            Self::Same(value) => value,
        }
    }
}

/// The values of this many steps. A compiler that sees that they are whole steps leaves out what would be for a rest.
#[inline(always)]
fn flat(values: &Values, steps: usize) -> &[f64] {
    values[..steps].as_flattened()
}

#[inline(always)]
fn map(into: &mut Values, a: &Values, f: impl FnMut(f64) -> f64) {
    let n = into.len();
    let values = flat(a, n).iter().copied().map(f);
    for (into, value) in into.as_flattened_mut().iter_mut().zip(values) {
        *into = value;
    }
}

#[inline(always)]
fn zip(into: &mut Values, a: &Values, b: &Values, f: impl Fn(f64, f64) -> f64) {
    let n = into.len();
    let pairs = flat(a, n).iter().zip(flat(b, n));
    for (into, (a, b)) in into.as_flattened_mut().iter_mut().zip(pairs) {
        *into = f(*a, *b);
    }
}

/// Joins terms with what they are added to.
#[inline(always)]
fn join(into: &mut Values, terms: impl Iterator<Item = f64>, sum: Sum, c: &Values) {
    let c = flat(
        c,
        if matches!(sum, Sum::Each(_)) {
            into.len()
        } else {
            0
        },
    );
    let into = into.as_flattened_mut();
    macro_rules! put {
        ($values:expr) => {
            for (into, value) in into.iter_mut().zip($values) {
                *into = value;
            }
        };
    }
    match sum {
        Sum::Nothing => put!(terms),
        Sum::Each(Join::Plus) => put!(terms.zip(c).map(|(t, c)| t + c)),
        Sum::Each(Join::Minus) => put!(terms.zip(c).map(|(t, c)| t - c)),
        Sum::Each(Join::From) => put!(terms.zip(c).map(|(t, c)| c - t)),
        Sum::Same(Join::Plus, c) => put!(terms.map(|t| t + c)),
        Sum::Same(Join::Minus, c) => put!(terms.map(|t| t - c)),
        Sum::Same(Join::From, c) => put!(terms.map(|t| c - t)),
    }
}

/// Terms `(factor*a)*b`.
#[inline(always)]
pub(crate) fn products<const FUSED: bool>(
    into: &mut Values,
    factor: f64,
    a: &Values,
    b: &Values,
    sum: Sum,
    c: &Values,
) {
    let n = into.len();
    let pairs = flat(a, n).iter().zip(flat(b, n));
    join(into, pairs.map(|(a, b)| factor * a * b), sum, c);
}

/// Terms `(factor*a)*b` with a number b.
#[inline(always)]
pub(crate) fn multiples<const FUSED: bool>(
    into: &mut Values,
    factor: [f64; 2],
    a: &Values,
    sum: Sum,
    c: &Values,
) {
    let n = into.len();
    let [first, second] = factor;
    join(into, flat(a, n).iter().map(|a| first * a * second), sum, c);
}

/// Terms `(factor*a)/divisor`. With `FUSED`, quotients are found by fused products, see [`Divisor`].
#[inline(always)]
pub(crate) fn quotients<const FUSED: bool>(
    into: &mut Values,
    factor: f64,
    a: &Values,
    divisor: Divisor,
    sum: Sum,
    c: &Values,
) {
    let n = into.len();
    if FUSED {
        let mut outside = 0;
        let quotient = |a| divisor.quotient(factor * a, &mut outside);
        join(into, flat(a, n).iter().map(quotient), sum, c);
        if !Divisor::is_outside(outside) {
            return;
        }
    }
    join(
        into,
        flat(a, n).iter().map(|a| factor * a / divisor.value),
        sum,
        c,
    );
}

/// Adds terms to c and to d, or subtracts them where `minus` is true.
#[inline(always)]
fn both(
    [one, two]: [&mut Values; 2],
    terms: impl Iterator<Item = f64>,
    minus: [bool; 2],
    [c, d]: [&Values; 2],
) {
    let n = one.len();
    let sums = flat(c, n).iter().zip(flat(d, n));
    let into = one
        .as_flattened_mut()
        .iter_mut()
        .zip(two[..n].as_flattened_mut());
    let all = into.zip(sums.zip(terms));
    macro_rules! put {
        ($first:tt $second:tt) => {
            for ((one, two), ((c, d), t)) in all {
                *one = *c $first t;
                *two = *d $second t;
            }
        };
    }
    match minus {
        [false, false] => put!(+ +),
        [false, true] => put!(+ -),
        [true, false] => put!(- +),
        [true, true] => put!(- -),
    }
}

/// Terms of [`products`], each for two sums.
#[inline(always)]
pub(crate) fn both_products<const FUSED: bool>(
    one: &mut Values,
    two: &mut Values,
    factor: f64,
    a: &Values,
    b: &Values,
    minus: [bool; 2],
    c: &Values,
    d: &Values,
) {
    let n = one.len();
    let terms = flat(a, n)
        .iter()
        .zip(flat(b, n))
        .map(|(a, b)| factor * a * b);
    both([one, two], terms, minus, [c, d]);
}

/// Terms of [`multiples`], each for two sums.
#[inline(always)]
pub(crate) fn both_multiples<const FUSED: bool>(
    one: &mut Values,
    two: &mut Values,
    factor: [f64; 2],
    a: &Values,
    minus: [bool; 2],
    c: &Values,
    d: &Values,
) {
    let terms = flat(a, one.len()).iter().map(|a| factor[0] * a * factor[1]);
    both([one, two], terms, minus, [c, d]);
}

/// Terms of [`quotients`], each for two sums.
#[inline(always)]
pub(crate) fn both_quotients<const FUSED: bool>(
    one: &mut Values,
    two: &mut Values,
    factor: f64,
    a: &Values,
    divisor: Divisor,
    minus: [bool; 2],
    c: &Values,
    d: &Values,
) {
    let a = flat(a, one.len()).iter();
    if FUSED {
        let mut outside = 0;
        let terms = a
            .clone()
            .map(|a| divisor.quotient(factor * a, &mut outside));
        both([&mut *one, &mut *two], terms, minus, [c, d]);
        if !Divisor::is_outside(outside) {
            return;
        }
    }
    both(
        [one, two],
        a.map(|a| factor * a / divisor.value),
        minus,
        [c, d],
    );
}

/// Picks from the values where the condition is true and false.
#[inline(always)]
pub(crate) fn blend<const FUSED: bool>(
    into: &mut Values,
    c: &Values,
    a: Source<'_>,
    b: Source<'_>,
) {
    let n = into.len();
    let pairs = into.as_flattened_mut().iter_mut().zip(flat(c, n));
    match (a, b) {
        (Source::Each(a), Source::Each(b)) => {
            for ((into, c), (a, b)) in pairs.zip(flat(a, n).iter().zip(flat(b, n))) {
                *into = if *c != 0.0 { *a } else { *b };
            }
        }
        (Source::Each(a), Source::Same(b)) => {
            for ((into, c), a) in pairs.zip(flat(a, n)) {
                *into = if *c != 0.0 { *a } else { b };
            }
        }
        (Source::Same(a), Source::Each(b)) => {
            for ((into, c), b) in pairs.zip(flat(b, n)) {
                *into = if *c != 0.0 { a } else { *b };
            }
        }
        (Source::Same(a), Source::Same(b)) => {
            for (into, c) in pairs {
                *into = if *c != 0.0 { a } else { b };
            }
        }
    }
}

/// How many of the values are true.
#[inline(always)]
pub(crate) fn count<const FUSED: bool>(values: &Values) -> usize {
    let mut count = 0u64;
    for value in values.as_flattened() {
        count += u64::from(*value != 0.0);
    }
    count as usize
}

/// Writes a result, the product of the values and a number, and tells whether all are finite.
#[inline(always)]
pub(crate) fn put<const FUSED: bool>(out: &mut [f64], values: &Values, factor: f64) -> bool {
    // The difference of a finite number and itself is 0, that of any other is NaN.
    let mut wrong = 0;
    let mut put = |out: &mut f64, value: &f64| {
        let value = value * factor;
        let same = value;
        wrong |= (value - same).to_bits();
        *out = value;
    };
    let (steps, rest) = out.as_chunks_mut::<STEP>();
    let whole = flat(values, steps.len());
    for (out, value) in steps.as_flattened_mut().iter_mut().zip(whole) {
        put(out, value);
    }
    let values = values.as_flattened().iter().skip(STEP * steps.len());
    for (out, value) in rest.iter_mut().zip(values) {
        put(out, value);
    }
    wrong == 0
}

/// One loop for each operation that is named, with the operation known in it; `$other` does the rest.
macro_rules! each_operation {
    ($kind:ident, $op:expr, $other:expr, |$f:ident| $run:expr; $($name:ident)*) => {
        match $op {
            $($kind::$name => {
                let $f = $kind::$name;
                $run
            })*
            _ => $other,
        }
    };
}

#[inline(always)]
pub(crate) fn unary<const FUSED: bool>(op: Unary, into: &mut Values, a: &Values) {
    each_operation!(Unary, op, unary_by_calls(op, into, a), |f| map(into, a, |a| f.apply(a));
        Neg Not Sqrt Abs Sign Floor Ceil Step)
}

#[inline(always)]
pub(crate) fn binary<const FUSED: bool>(op: Binary, into: &mut Values, a: &Values, b: &Values) {
    each_operation!(Binary, op, binary_by_calls(op, into, Source::Each(a), Source::Each(b)), |f| zip(into, a, b, |a, b| f.apply(a, b));
        Add Sub Mul Div Lt Le Gt Ge Eq Ne And Or Min Max)
}

/// The operation with a number, which is the operand of that place, 0 or 1.
#[inline(always)]
pub(crate) fn binary_with<const FUSED: bool>(
    op: Binary,
    into: &mut Values,
    a: &Values,
    number: f64,
    place: usize,
) {
    if place == 0 {
        each_operation!(Binary, op, binary_by_calls(op, into, Source::Same(number), Source::Each(a)), |f| map(into, a, |a| f.apply(number, a));
            Add Sub Mul Div Lt Le Gt Ge Eq Ne And Or Min Max)
    } else {
        each_operation!(Binary, op, binary_by_calls(op, into, Source::Each(a), Source::Same(number)), |f| map(into, a, |a| f.apply(a, number));
            Add Sub Mul Div Lt Le Gt Ge Eq Ne And Or Min Max)
    }
}

/// Operations that take a call for each value, beside which finding out which it is costs little.
#[inline(never)]
fn unary_by_calls(op: Unary, into: &mut Values, a: &Values) {
    map(into, a, |a| op.apply(a));
}

/// The same for two operands.
#[inline(never)]
fn binary_by_calls(op: Binary, into: &mut Values, a: Source<'_>, b: Source<'_>) {
    for (point, into) in into.as_flattened_mut().iter_mut().enumerate() {
        *into = op.apply(a.at(point), b.at(point));
    }
}
