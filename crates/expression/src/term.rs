//! Terms of a sum, `factor*a*b` or `factor*a/c`, and what they are added to: in one loop, so that what lies between is neither stored nor loaded.
//!
//! Every product, quotient and sum is rounded by itself, in the order written.

use crate::loops::Source;
use crate::program::Operand;
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

/// What terms are joined with: nothing, a value for each, or a number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Sum {
    Nothing,
    Each(Join),
    Same(Join, f64),
}

/// A term with the values of its operands.
#[derive(Clone, Copy)]
pub(crate) struct TermValues<'a> {
    pub(crate) factor: f64,
    pub(crate) of: Source<'a>,
    pub(crate) by: By<Source<'a>>,
}

impl TermValues<'_> {
    /// The value at one point.
    #[inline(always)]
    pub(crate) fn at(self, point: usize) -> f64 {
        let first = self.factor * self.of.at(point);
        match self.by {
            By::Times(b) => first * b.at(point),
            By::Over(divisor) => first / divisor.value,
        }
    }
}
