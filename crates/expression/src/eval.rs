//! Runs a compiled formula over blocks of points, one instruction at a time for the whole block.

use crate::compile::{Op, Operand, Program};
use crate::function::{Binary, Unary};
use crate::term::{By, TermValues};
#[cfg(target_arch = "x86_64")]
use crate::wide::Wide;
use crate::wide::{Loops, Plain};
use std::cell::RefCell;

/// Points in a block: few enough that the registers stay in the first cache, and that a byte numbers a point.
const BLOCK: usize = 256;

/// Registers that a thread keeps from one call to the next.
const KEPT_REGISTERS: usize = 512;

/// The values of a block, where no load of four of them crosses a line of the cache.
#[repr(align(64))]
struct Register([f64; BLOCK]);

/// Working memory, kept by each thread.
struct Scratch {
    #[expect(
        clippy::vec_box,
        reason = "registers are swapped, which is not to move their values"
    )]
    registers: Vec<Box<Register>>,
    /// The points of the open branches, as a stack of lists.
    points: Vec<u8>,
    splits: Vec<Split>,
}

/// The points an instruction works on.
#[derive(Clone, Copy)]
enum Active {
    /// The whole block.
    All,
    /// A range of `Scratch::points`.
    List(usize, usize),
}

/// A branch begun and not yet joined.
struct Split {
    before: Active,
    other: Active,
    /// Length of `Scratch::points` before the split.
    mark: usize,
}

thread_local! {
    static SCRATCH: RefCell<Scratch> = const {
        RefCell::new(Scratch {
            registers: Vec::new(),
            points: Vec::new(),
            splits: Vec::new(),
        })
    };
}

/// Evaluates at all points; the lengths are equal, but that of `region` may be zero.
pub(crate) fn evaluate(program: &Program, x: &[f64], y: &[f64], region: &[f64], out: &mut [f64]) {
    if let Operand::Number(value) = program.result {
        out.fill(value);
        return;
    }
    SCRATCH.with_borrow_mut(|scratch| {
        // One more than the program has, see `run`.
        while scratch.registers.len() < program.registers + 1 {
            scratch.registers.push(Box::new(Register([0.0; BLOCK])));
        }
        #[cfg(target_arch = "x86_64")]
        let wide = Wide::detect();
        for (block, out) in out.chunks_mut(BLOCK).enumerate() {
            let range = block * BLOCK..block * BLOCK + out.len();
            let inputs = Inputs {
                x: &x[range.clone()],
                y: &y[range.clone()],
                region: if region.is_empty() {
                    None
                } else {
                    Some(&region[range])
                },
            };
            #[cfg(target_arch = "x86_64")]
            if let Some(wide) = wide {
                run(program, inputs, scratch, out, wide);
                continue;
            }
            run(program, inputs, scratch, out, Plain);
        }
        scratch.registers.truncate(KEPT_REGISTERS);
    });
}

#[derive(Clone, Copy)]
struct Inputs<'a> {
    x: &'a [f64],
    y: &'a [f64],
    region: Option<&'a [f64]>,
}

impl<'a> Inputs<'a> {
    fn fetch(self, operand: Operand, registers: &'a [Box<Register>]) -> Source<'a> {
        match operand {
            Operand::Register(register) => {
                Source::Each(&registers[register as usize].0[..self.x.len()])
            }
            Operand::X => Source::Each(self.x),
            Operand::Y => Source::Each(self.y),
            Operand::Region => self.region.map_or(Source::Same(0.0), Source::Each),
            Operand::Number(value) => Source::Same(value),
        }
    }
}

/// The values of an operand over the block.
#[derive(Clone, Copy)]
pub(crate) enum Source<'a> {
    Each(&'a [f64]),
    Same(f64),
}

impl Source<'_> {
    #[inline(always)]
    pub(crate) fn at(self, point: usize) -> f64 {
        match self {
            Self::Each(values) => values[point],
            Self::Same(value) => value,
        }
    }
}

fn run(
    program: &Program,
    inputs: Inputs,
    scratch: &mut Scratch,
    out: &mut [f64],
    loops: impl Loops,
) {
    let length = out.len();
    let Scratch {
        registers,
        points,
        splits,
    } = scratch;
    let Some((taken, registers)) = registers.split_last_mut() else {
        return;
    };
    points.clear();
    splits.clear();
    let mut active = Active::All;
    let mut next = 0;
    while let Some(op) = program.ops.get(next) {
        next += 1;
        let target = match *op {
            Op::Split(condition, middle) => {
                let condition = inputs.fetch(condition, registers);
                let mark = points.len();
                let (then, other) = divide(condition, length, active, points, loops);
                splits.push(Split {
                    before: active,
                    other,
                    mark,
                });
                active = then;
                if is_empty(active) {
                    next = middle as usize;
                }
                continue;
            }
            Op::Else(end) => {
                if let Some(split) = splits.last() {
                    active = split.other;
                }
                if is_empty(active) {
                    next = end as usize;
                }
                continue;
            }
            Op::Join => {
                if let Some(split) = splits.pop() {
                    active = split.before;
                    points.truncate(split.mark);
                }
                continue;
            }
            Op::Unary(_, target, _)
            | Op::Binary(_, target, ..)
            | Op::Term(target, ..)
            | Op::Select(target, ..)
            | Op::Copy(target, _) => target as usize,
        };
        // The target is none of the operands: swapped for one that nobody reads, it can be written while they are read.
        std::mem::swap(taken, &mut registers[target]);
        let into = &mut taken.0[..length];
        let list = match active {
            Active::All => None,
            Active::List(start, end) => Some(&points[start..end]),
        };
        match *op {
            Op::Unary(op, _, a) => loops.unary(op, into, inputs.fetch(a, registers), list),
            Op::Binary(op, _, a, b) => {
                loops.binary(
                    op,
                    into,
                    inputs.fetch(a, registers),
                    inputs.fetch(b, registers),
                    list,
                );
            }
            Op::Term(_, term, sum) => {
                let values = TermValues {
                    factor: term.factor,
                    of: inputs.fetch(term.of, registers),
                    by: match term.by {
                        By::Times(b) => By::Times(inputs.fetch(b, registers)),
                        By::Over(divisor) => By::Over(divisor),
                    },
                    sum: sum.map(|(join, c)| (join, inputs.fetch(c, registers))),
                };
                loops.term(into, values, list);
            }
            Op::Select(_, c, a, b) => {
                let of = [c, a, b].map(|operand| inputs.fetch(operand, registers));
                loops.select(into, of, list);
            }
            Op::Copy(_, a) => map(into, inputs.fetch(a, registers), list, |a| a),
            Op::Split(..) | Op::Else(_) | Op::Join => {}
        }
        std::mem::swap(taken, &mut registers[target]);
    }
    match inputs.fetch(program.result, registers) {
        Source::Each(values) => out.copy_from_slice(values),
        Source::Same(value) => out.fill(value),
    }
}

fn is_empty(active: Active) -> bool {
    matches!(active, Active::List(start, end) if start == end)
}

/// Parts the active points by the condition. A side that gets all of them stays what they were, so that a whole block
/// is still worked on as one.
fn divide(
    condition: Source,
    length: usize,
    active: Active,
    points: &mut Vec<u8>,
    loops: impl Loops,
) -> (Active, Active) {
    let mark = points.len();
    let nobody = Active::List(mark, mark);
    // Most blocks are on one side.
    if let (Source::Each(condition), Active::All) = (condition, active) {
        match loops.count(condition) {
            0 => return (nobody, active),
            all if all == length => return (active, nobody),
            _ => {}
        }
    }
    let count = match active {
        Active::All => length,
        Active::List(start, end) => end - start,
    };
    // Points where it holds from the front, the others from the back.
    points.resize(mark + count, 0);
    let (mut front, mut back) = (mark, mark + count);
    for k in 0..count {
        let point = match active {
            Active::All => k as u8,
            Active::List(start, _) => points[start + k],
        };
        // Written at both ends, kept at one: there is no telling which, for a processor that would guess.
        points[front] = point;
        points[back - 1] = point;
        let holds = condition.at(point as usize) != 0.0;
        front += usize::from(holds);
        back -= usize::from(!holds);
    }
    if back == mark {
        (nobody, active)
    } else if front == mark + count {
        (active, nobody)
    } else {
        (Active::List(mark, front), Active::List(back, mark + count))
    }
}

#[inline(always)]
fn map(into: &mut [f64], a: Source, list: Option<&[u8]>, f: impl Fn(f64) -> f64) {
    match (list, a) {
        (None, Source::Each(a)) => {
            for (into, a) in into.iter_mut().zip(a) {
                *into = f(*a);
            }
        }
        (None, Source::Same(a)) => into.fill(f(a)),
        (Some(list), a) => {
            for point in list {
                let point = *point as usize;
                into[point] = f(a.at(point));
            }
        }
    }
}

#[inline(always)]
fn zip(into: &mut [f64], a: Source, b: Source, list: Option<&[u8]>, f: impl Fn(f64, f64) -> f64) {
    match (list, a, b) {
        (None, Source::Each(a), Source::Each(b)) => {
            for (into, (a, b)) in into.iter_mut().zip(a.iter().zip(b)) {
                *into = f(*a, *b);
            }
        }
        (None, Source::Each(a), Source::Same(b)) => {
            for (into, a) in into.iter_mut().zip(a) {
                *into = f(*a, b);
            }
        }
        (None, Source::Same(a), Source::Each(b)) => {
            for (into, b) in into.iter_mut().zip(b) {
                *into = f(a, *b);
            }
        }
        (None, Source::Same(a), Source::Same(b)) => into.fill(f(a, b)),
        (Some(list), a, b) => {
            for point in list {
                let point = *point as usize;
                into[point] = f(a.at(point), b.at(point));
            }
        }
    }
}

/// Picks from the values where the condition, the first of the three, is true and false.
#[inline(always)]
pub(crate) fn choose(into: &mut [f64], [c, a, b]: [Source; 3], list: Option<&[u8]>) {
    let Source::Each(condition) = c else {
        let chosen = if c.at(0) != 0.0 { a } else { b };
        return map(into, chosen, list, |value| value);
    };
    if let Some(list) = list {
        for point in list {
            let point = *point as usize;
            into[point] = if condition[point] != 0.0 {
                a.at(point)
            } else {
                b.at(point)
            };
        }
        return;
    }
    let pairs = into.iter_mut().zip(condition);
    match (a, b) {
        (Source::Each(a), Source::Each(b)) => {
            for ((into, c), (a, b)) in pairs.zip(a.iter().zip(b)) {
                *into = if *c != 0.0 { *a } else { *b };
            }
        }
        (Source::Each(a), Source::Same(b)) => {
            for ((into, c), a) in pairs.zip(a) {
                *into = if *c != 0.0 { *a } else { b };
            }
        }
        (Source::Same(a), Source::Each(b)) => {
            for ((into, c), b) in pairs.zip(b) {
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
pub(crate) fn count(values: &[f64]) -> usize {
    let mut count = 0u64;
    for value in values {
        count += u64::from(*value != 0.0);
    }
    count as usize
}

#[inline(always)]
pub(crate) fn apply_unary(op: Unary, into: &mut [f64], a: Source, list: Option<&[u8]>) {
    // One loop for each operation, with the operation known in it.
    macro_rules! loops {
        ($($name:ident)*) => {
            match op {
                $(Unary::$name => map(into, a, list, |a| Unary::$name.apply(a)),)*
            }
        };
    }
    loops!(Neg Not Sin Cos Tan Asin Acos Atan Sinh Cosh Tanh Exp Ln Log10 Sqrt Cbrt Abs Sign Floor Ceil Step)
}

#[inline(always)]
pub(crate) fn apply_binary(
    op: Binary,
    into: &mut [f64],
    a: Source,
    b: Source,
    list: Option<&[u8]>,
) {
    macro_rules! loops {
        ($($name:ident)*) => {
            match op {
                $(Binary::$name => zip(into, a, b, list, |a, b| Binary::$name.apply(a, b)),)*
            }
        };
    }
    loops!(Add Sub Mul Div Pow Lt Le Gt Ge Eq Ne And Or Min Max Hypot Atan2)
}
