//! Terms of a sum, `factor*a*b` or `factor*a/c`, and what they are added to: in one loop, so that what lies between is neither stored nor loaded.
//!
//! Every product, quotient and sum is rounded by itself, in the order written.

use crate::compile::Operand;
use crate::eval::Source;
use crate::quotient::Divisor;

/// `(factor*of)*b` or `(factor*of)/c`; a factor that is not there is 1, by which products are exact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Term {
    pub(crate) factor: f64,
    pub(crate) of: Operand,
    pub(crate) by: By<Operand>,
}

/// What comes after the first product.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum By<T> {
    Times(T),
    Over(Divisor),
}

/// How a term t and another number c are joined.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Join {
    /// t + c
    Plus,
    /// t - c
    Minus,
    /// c - t
    From,
}

/// A term with the values of its operands.
#[derive(Clone, Copy)]
pub(crate) struct TermValues<'a> {
    pub(crate) factor: f64,
    pub(crate) of: Source<'a>,
    pub(crate) by: By<Source<'a>>,
    pub(crate) sum: Option<(Join, Source<'a>)>,
}

impl TermValues<'_> {
    /// Computes it at the points of the list, or at all. With `fused`, quotients are found by fused products, see [`Divisor`].
    #[inline(always)]
    pub(crate) fn compute(self, into: &mut [f64], list: Option<&[u8]>, fused: bool) {
        let factor = self.factor;
        if let Some(list) = list {
            for point in list {
                let point = *point as usize;
                into[point] = self.at(point);
            }
            return;
        }
        match (self.of, self.by) {
            (Source::Each(a), By::Times(Source::Each(b))) => {
                self.join(into, a.iter().zip(b).map(|(a, b)| factor * a * b));
            }
            (Source::Each(a), By::Times(Source::Same(b))) => {
                self.join(into, a.iter().map(|a| factor * a * b));
            }
            (Source::Each(a), By::Over(divisor)) if fused => {
                let mut outside = 0;
                let quotients = a.iter().map(|a| divisor.quotient(factor * a, &mut outside));
                self.join(into, quotients);
                if Divisor::is_outside(outside) {
                    self.join(into, a.iter().map(|a| factor * a / divisor.value));
                }
            }
            (Source::Each(a), By::Over(divisor)) => {
                self.join(into, a.iter().map(|a| factor * a / divisor.value));
            }
            (Source::Same(_), _) => {
                for (point, into) in into.iter_mut().enumerate() {
                    *into = self.at(point);
                }
            }
        }
    }

    #[inline(always)]
    fn at(self, point: usize) -> f64 {
        let first = self.factor * self.of.at(point);
        let term = match self.by {
            By::Times(b) => first * b.at(point),
            By::Over(divisor) => first / divisor.value,
        };
        match self.sum {
            None => term,
            Some((Join::Plus, c)) => term + c.at(point),
            Some((Join::Minus, c)) => term - c.at(point),
            Some((Join::From, c)) => c.at(point) - term,
        }
    }

    #[inline(always)]
    fn join(self, into: &mut [f64], terms: impl Iterator<Item = f64>) {
        macro_rules! sums {
            ($c:expr, $f:expr) => {
                match $c {
                    Source::Each(c) => put(into, terms.zip(c).map(|(t, c)| $f(t, *c))),
                    Source::Same(c) => put(into, terms.map(|t| $f(t, c))),
                }
            };
        }
        match self.sum {
            None => put(into, terms),
            Some((Join::Plus, c)) => sums!(c, |t: f64, c: f64| t + c),
            Some((Join::Minus, c)) => sums!(c, |t: f64, c: f64| t - c),
            Some((Join::From, c)) => sums!(c, |t: f64, c: f64| c - t),
        }
    }
}

#[inline(always)]
fn put(into: &mut [f64], values: impl Iterator<Item = f64>) {
    for (into, value) in into.iter_mut().zip(values) {
        *into = value;
    }
}
