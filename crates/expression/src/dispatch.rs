//! Which loop an instruction runs: by where its operands are, and whether it works on whole steps or on the points of a list.

use crate::function::{Binary, Unary};
use crate::loops::{STEP, Source, Values};
use crate::program::Operand;
use crate::term::{By, Join, Sum, Term, TermValues};
use crate::wide::Loops;

/// The values at the points of a list.
#[inline(always)]
fn at(into: &mut Values, list: &[u16], f: impl Fn(usize) -> f64) {
    for point in list {
        let point = *point as usize;
        into[point / STEP][point % STEP] = f(point);
    }
}

pub(crate) fn copy(into: &mut Values, a: Source<'_>, list: Option<&[u16]>) {
    match (list, a) {
        (Some(list), a) => at(into, list, |point| a.at(point)),
        (None, Source::Each(values)) => into.copy_from_slice(&values[..into.len()]),
        (None, Source::Same(value)) => into.as_flattened_mut().fill(value),
    }
}

#[inline]
pub(crate) fn unary(
    op: Unary,
    into: &mut Values,
    a: Source<'_>,
    list: Option<&[u16]>,
    loops: impl Loops,
) {
    match (list, a) {
        (Some(list), a) => at(into, list, |point| op.apply(a.at(point))),
        (None, Source::Each(a)) => loops.unary(op, into, a),
        (None, Source::Same(a)) => into.as_flattened_mut().fill(op.apply(a)),
    }
}

#[inline]
pub(crate) fn binary(
    op: Binary,
    into: &mut Values,
    of: [Source<'_>; 2],
    list: Option<&[u16]>,
    loops: impl Loops,
) {
    match (list, of) {
        (Some(list), [a, b]) => at(into, list, |point| op.apply(a.at(point), b.at(point))),
        (None, [Source::Each(a), Source::Each(b)]) => loops.binary(op, into, a, b),
        (None, [Source::Each(a), Source::Same(b)]) => loops.binary_with(op, into, a, b, 1),
        (None, [Source::Same(a), Source::Each(b)]) => loops.binary_with(op, into, b, a, 0),
        (None, [Source::Same(a), Source::Same(b)]) => into.as_flattened_mut().fill(op.apply(a, b)),
    }
}

#[inline(always)]
pub(crate) fn values<'a>(term: Term, fetch: impl Fn(Operand) -> Source<'a>) -> TermValues<'a> {
    TermValues {
        factor: term.factor,
        of: fetch(term.of),
        by: match term.by {
            By::Times(b) => By::Times(fetch(b)),
            By::Over(divisor) => By::Over(divisor),
        },
    }
}

#[inline]
pub(crate) fn compute(
    term: TermValues<'_>,
    sum: Option<(Join, Source<'_>)>,
    into: &mut Values,
    list: Option<&[u16]>,
    loops: impl Loops,
) {
    let factor = term.factor;
    let (how, c): (Sum, &Values) = match sum {
        None => (Sum::Nothing, &[]),
        Some((join, Source::Each(c))) => (Sum::Each(join), c),
        Some((join, Source::Same(c))) => (Sum::Same(join, c), &[]),
    };
    let joined = |point: usize| match sum {
        None => term.at(point),
        Some((Join::Plus, c)) => term.at(point) + c.at(point),
        Some((Join::Minus, c)) => term.at(point) - c.at(point),
        Some((Join::From, c)) => c.at(point) - term.at(point),
    };
    match (list, term.of, term.by) {
        (None, Source::Each(a), By::Times(Source::Each(b))) => {
            loops.products(into, factor, a, b, how, c);
        }
        (None, Source::Each(a), By::Times(Source::Same(b))) => {
            loops.multiples(into, [factor, b], a, how, c);
        }
        (None, Source::Each(a), By::Over(divisor)) => {
            loops.quotients(into, factor, a, divisor, how, c);
        }
        (None, Source::Same(_), _) => each(into, joined),
        (Some(list), ..) => at(into, list, joined),
    }
}

/// Adds a term to both values, or subtracts it where that is said.
#[inline]
pub(crate) fn both(
    [one, two]: [&mut Values; 2],
    term: TermValues<'_>,
    [(first, c), (second, d)]: [(bool, Source<'_>); 2],
    list: Option<&[u16]>,
    loops: impl Loops,
) {
    let (factor, minus) = (term.factor, [first, second]);
    if let (None, Source::Each(a), Source::Each(c), Source::Each(d)) = (list, term.of, c, d) {
        return match term.by {
            By::Times(Source::Each(b)) => {
                loops.both_products(one, two, factor, a, b, minus, c, d);
            }
            By::Times(Source::Same(b)) => {
                loops.both_multiples(one, two, [factor, b], a, minus, c, d);
            }
            By::Over(divisor) => loops.both_quotients(one, two, factor, a, divisor, minus, c, d),
        };
    }
    for (into, minus, c) in [(one, first, c), (two, second, d)] {
        let joined = |point: usize| match minus {
            false => c.at(point) + term.at(point),
            true => c.at(point) - term.at(point),
        };
        match list {
            None => each(into, joined),
            Some(list) => at(into, list, joined),
        }
    }
}

/// The values at all points, one by one.
#[inline]
fn each(into: &mut Values, f: impl Fn(usize) -> f64) {
    for (point, value) in into.as_flattened_mut().iter_mut().enumerate() {
        *value = f(point);
    }
}

/// Picks from the values where the condition, the first of the three, is true and false.
#[inline]
pub(crate) fn blend(
    into: &mut Values,
    [c, a, b]: [Source<'_>; 3],
    list: Option<&[u16]>,
    loops: impl Loops,
) {
    match (list, c) {
        (Some(list), c) => at(into, list, |point| {
            let of = if c.at(point) != 0.0 { a } else { b };
            of.at(point)
        }),
        (None, Source::Each(c)) => loops.blend(into, c, a, b),
        (None, Source::Same(c)) => copy(into, if c != 0.0 { a } else { b }, None),
    }
}
