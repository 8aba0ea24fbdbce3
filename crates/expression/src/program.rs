//! The instructions of a compiled formula.

use crate::function::{Binary, Unary};
use crate::term::{By, Join, Term};

/// Where an instruction finds a value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Operand {
    Register(u32),
    X,
    Y,
    Region,
    Number(f64),
}

/// The target of an instruction is never one of its operands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Op {
    Unary(Unary, u32, Operand),
    Binary(Binary, u32, Operand, Operand),
    /// A term of a sum, and what it is joined with.
    Term(u32, Term, Option<(Join, Operand)>),
    /// Two targets, and what the term is added to or, where true, subtracted from for either.
    Both([u32; 2], Term, [(bool, Operand); 2]),
    /// Target, condition, then, else.
    Select(u32, Operand, Operand, Operand),
    /// Goes on with the points where the condition holds; without any, jumps to the `Else` at that place.
    Split(Split),
    /// Goes on with the other points; without any, jumps to the `Join` at that place.
    Else(u32),
    /// Goes on with all points that came to the `Split`.
    Join,
    /// After a `Join`: a value of one side where its condition, the second, holds, of the other side elsewhere.
    Pick(u32, Operand, [Side; 2]),
}

/// The beginning of two branches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Split {
    pub(crate) condition: Operand,
    /// The place of the `Else`.
    pub(crate) middle: u32,
    /// Whether both branches are plain operations alone: where points go to both, computing each at all points is cheaper than at single ones.
    pub(crate) plain: bool,
}

/// A value that a branch ends with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Side {
    pub(crate) value: Operand,
    /// Whether its register is of no more use, and may be had instead of a copy.
    pub(crate) spent: bool,
}

/// Compiled formulas, one or more.
#[derive(Debug, Clone)]
pub(crate) struct Program {
    pub(crate) ops: Vec<Op>,
    pub(crate) registers: usize,
    /// One for each formula.
    pub(crate) results: Vec<Outcome>,
    /// Whether all instructions are plain operations.
    pub(crate) plain: bool,
}

/// A result: the product of a value and a number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Outcome {
    pub(crate) value: Operand,
    pub(crate) factor: f64,
}

impl Op {
    pub(crate) fn operands_mut(&mut self) -> impl Iterator<Item = &mut Operand> {
        let list = match self {
            Self::Unary(_, _, a) => [Some(a), None, None, None],
            Self::Split(split) => [Some(&mut split.condition), None, None, None],
            Self::Pick(_, c, [a, b]) => [Some(c), Some(&mut a.value), Some(&mut b.value), None],
            Self::Binary(_, _, a, b) => [Some(a), Some(b), None, None],
            Self::Select(_, c, a, b) => [Some(c), Some(a), Some(b), None],
            Self::Term(_, term, sum) => {
                let by = match &mut term.by {
                    By::Times(b) => Some(b),
                    By::Over(_) => None,
                };
                [Some(&mut term.of), by, sum.as_mut().map(|(_, c)| c), None]
            }
            Self::Both(_, term, [(_, c), (_, d)]) => {
                let by = match &mut term.by {
                    By::Times(b) => Some(b),
                    By::Over(_) => None,
                };
                [Some(&mut term.of), by, Some(c), Some(d)]
            }
            Self::Else(_) | Self::Join => [None, None, None, None],
        };
        list.into_iter().flatten()
    }

    /// Whether a processor does it in a few instructions, without a call.
    pub(crate) fn is_plain(&self) -> bool {
        match self {
            Self::Unary(op, ..) => op.is_cheap(),
            Self::Binary(op, ..) => op.is_cheap(),
            _ => true,
        }
    }

    pub(crate) fn targets_mut(&mut self) -> impl Iterator<Item = &mut u32> {
        let list = match self {
            Self::Unary(_, t, _)
            | Self::Binary(_, t, ..)
            | Self::Term(t, ..)
            | Self::Select(t, ..)
            | Self::Pick(t, ..) => [Some(t), None],
            Self::Both([t, u], ..) => [Some(t), Some(u)],
            Self::Split(..) | Self::Else(_) | Self::Join => [None, None],
        };
        list.into_iter().flatten()
    }
}
