//! Runs compiled formulas over blocks of points, one instruction at a time for the whole block.

use crate::dispatch::{binary, blend, both, compute, copy, unary, values};
use crate::loops::{STEP, Source, Values};
use crate::program::{Op, Operand, Program, Side};
#[cfg(target_arch = "x86_64")]
use crate::wide::Wide;
use crate::wide::{Loops, Plain};
use std::cell::RefCell;

/// Points in a block: few enough that most registers stay in the first cache, and so many that what an instruction costs beside its loop is little.
const BLOCK: usize = 576;

/// Registers that a thread keeps from one call to the next.
const KEPT_REGISTERS: usize = 512;

/// The values of a block, where no load of four of them crosses a line of the cache.
#[repr(align(64))]
struct Register([[f64; STEP]; BLOCK / STEP]);

impl Register {
    fn new() -> Box<Register> {
        Box::new(Register([[0.0; STEP]; BLOCK / STEP]))
    }
}

/// Working memory, kept by each thread.
struct Scratch {
    /// In boxes, since they are swapped, which is not to move their values.
    registers: Vec<Box<Register>>,
    /// Coordinates and regions of a block that does not end with a step.
    inputs: Option<[Box<Register>; 3]>,
    /// The points of the open branches, as a stack of lists.
    points: Vec<u16>,
    splits: Vec<Parting>,
}

/// The points an instruction works on.
#[derive(Clone, Copy)]
enum Active {
    /// The whole block.
    All,
    /// A range of `Scratch::points`.
    List(usize, usize),
}

/// Which branches have points.
#[derive(Clone, Copy, PartialEq)]
enum Sides {
    Both,
    /// The first or the second alone.
    One(usize),
}

/// A branch begun and not yet joined.
struct Parting {
    before: Active,
    other: Active,
    sides: Sides,
    /// Length of `Scratch::points` before the split.
    mark: usize,
}

thread_local! {
    static SCRATCH: RefCell<Scratch> = const {
        RefCell::new(Scratch {
            registers: Vec::new(),
            inputs: None,
            points: Vec::new(),
            splits: Vec::new(),
        })
    };
}

/// Evaluates at all points; the lengths are equal, but that of `region` may be zero. Returns whether all values are finite.
pub(crate) fn evaluate<const N: usize>(
    program: &Program,
    x: &[f64],
    y: &[f64],
    region: &[f64],
    mut out: [&mut [f64]; N],
) -> bool {
    SCRATCH.with_borrow_mut(|scratch| {
        // Two more than the program has, see `run`.
        while scratch.registers.len() < program.registers + 2 {
            scratch.registers.push(Register::new());
        }
        #[cfg(target_arch = "x86_64")]
        let wide = Wide::detect();
        let mut finite = true;
        for begin in (0..x.len()).step_by(BLOCK) {
            let range = begin..x.len().min(begin + BLOCK);
            let given = [
                &x[range.clone()],
                &y[range.clone()],
                region.get(range.clone()).unwrap_or_default(),
            ];
            let mut out = out.each_mut().map(|out| &mut out[range.clone()]);
            #[cfg(target_arch = "x86_64")]
            if let Some(wide) = wide {
                finite &= run(program, given, scratch, &mut out, wide);
                continue;
            }
            finite &= run(program, given, scratch, &mut out, Plain);
        }
        scratch.registers.truncate(KEPT_REGISTERS);
        finite
    })
}

/// The coordinates and regions of a block, in whole steps.
#[derive(Clone, Copy)]
struct Inputs<'a> {
    x: &'a Values,
    y: &'a Values,
    region: &'a Values,
}

/// The regions of a block where none are given.
static NOWHERE: [[f64; STEP]; BLOCK / STEP] = [[0.0; STEP]; BLOCK / STEP];

impl<'a> Inputs<'a> {
    /// Takes them as they are, or copied so that they fill whole steps.
    #[inline(always)]
    fn new(given: [&'a [f64]; 3], room: &'a mut Option<[Box<Register>; 3]>) -> Inputs<'a> {
        let (_, rest) = given[0].as_chunks::<STEP>();
        let [x, y, region] = if rest.is_empty() {
            given.map(|values| values.as_chunks().0)
        } else {
            let room = room.get_or_insert_with(|| std::array::from_fn(|_| Register::new()));
            let mut filled = room.iter_mut().zip(given).map(|(room, values)| {
                let count = values.len().next_multiple_of(STEP);
                let room = room.0.as_flattened_mut();
                room[..values.len()].copy_from_slice(values);
                // The last point again.
                if let Some(last) = values.last() {
                    room[values.len()..count].fill(*last);
                }
                &room.as_chunks().0[..count / STEP]
            });
            std::array::from_fn(|_| filled.next().unwrap_or_default())
        };
        let region = if region.is_empty() {
            &NOWHERE[..x.len()]
        } else {
            region
        };
        Inputs { x, y, region }
    }

    /// The values of an operand, with what a register has beyond the steps of the block.
    #[inline(always)]
    fn fetch(self, operand: Operand, registers: &'a [Box<Register>]) -> Source<'a> {
        match operand {
            Operand::Register(register) => Source::Each(&registers[register as usize].0),
            Operand::X => Source::Each(self.x),
            Operand::Y => Source::Each(self.y),
            Operand::Region => Source::Each(self.region),
            Operand::Number(value) => Source::Same(value),
        }
    }
}

/// Evaluates at the points of one block; returns whether all values are finite.
fn run(
    program: &Program,
    given: [&[f64]; 3],
    scratch: &mut Scratch,
    out: &mut [&mut [f64]],
    loops: impl Loops,
) -> bool {
    let length = given[0].len();
    let Scratch {
        registers,
        inputs,
        points,
        splits,
    } = scratch;
    let inputs = Inputs::new(given, inputs);
    let Some((registers, [taken, second])) = registers.split_last_chunk_mut() else {
        return true;
    };
    points.clear();
    splits.clear();
    let mut active = Active::All;
    if length < STEP && !program.plain {
        // Calls for a whole step would be more work than those for the points.
        points.extend(0..length as u16);
        active = Active::List(0, length);
    }
    let mut sides = Sides::Both;
    let mut next = 0;
    while let Some(op) = program.ops.get(next) {
        next += 1;
        let target = match *op {
            Op::Split(split) => {
                let condition = inputs.fetch(split.condition, registers);
                let condition = condition.first(inputs.x.len());
                let mark = points.len();
                let (then, other) = divide(condition, active, points, split.plain, loops);
                sides = match [is_empty(then), is_empty(other)] {
                    [true, _] => Sides::One(1),
                    [_, true] => Sides::One(0),
                    _ => Sides::Both,
                };
                splits.push(Parting {
                    before: active,
                    other,
                    sides,
                    mark,
                });
                active = then;
                if is_empty(active) {
                    next = split.middle as usize;
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
                    sides = split.sides;
                    points.truncate(split.mark);
                }
                continue;
            }
            Op::Pick(target, _, of) if let Sides::One(side) = sides => {
                let Side { value, spent } = of[side];
                if let (true, Operand::Register(register)) = (spent, value) {
                    registers.swap(register as usize, target as usize);
                    continue;
                }
                target as usize
            }
            Op::Both([target, other], ..) => {
                std::mem::swap(second, &mut registers[other as usize]);
                target as usize
            }
            Op::Unary(_, target, _)
            | Op::Binary(_, target, ..)
            | Op::Term(target, ..)
            | Op::Select(target, ..)
            | Op::Pick(target, ..) => target as usize,
        };
        // The target is none of the operands: swapped for one that nobody reads, it can be written while they are read.
        std::mem::swap(taken, &mut registers[target]);
        let into = &mut taken.0[..inputs.x.len()];
        let list = match active {
            Active::All => None,
            Active::List(start, end) => Some(&points[start..end]),
        };
        let fetch = |operand| inputs.fetch(operand, registers);
        match *op {
            Op::Unary(op, _, a) => unary(op, into, fetch(a), list, loops),
            Op::Binary(op, _, a, b) => binary(op, into, [fetch(a), fetch(b)], list, loops),
            Op::Term(_, term, sum) => {
                let sum = sum.map(|(join, c)| (join, fetch(c)));
                compute(values(term, fetch), sum, into, list, loops);
            }
            Op::Both([_, target], term, sums) => {
                let term = values(term, fetch);
                let [c, d] = sums.map(|(minus, c)| (minus, fetch(c)));
                let two = &mut second.0[..inputs.x.len()];
                both([into, two], term, [c, d], list, loops);
                std::mem::swap(second, &mut registers[target as usize]);
            }
            Op::Select(_, c, a, b) => blend(into, [fetch(c), fetch(a), fetch(b)], list, loops),
            Op::Pick(_, c, [a, b]) => match sides {
                Sides::Both => {
                    blend(
                        into,
                        [fetch(c), fetch(a.value), fetch(b.value)],
                        list,
                        loops,
                    );
                }
                Sides::One(side) => copy(into, fetch([a, b][side].value), list),
            },
            Op::Split(..) | Op::Else(_) | Op::Join => {}
        }
        std::mem::swap(taken, &mut registers[target]);
    }
    let mut finite = true;
    for (out, result) in out.iter_mut().zip(&program.results) {
        finite &= match inputs.fetch(result.value, registers) {
            Source::Each(values) => loops.put(out, values, result.factor),
            Source::Same(value) => {
                let value = value * result.factor;
                out.fill(value);
                value.is_finite()
            }
        };
    }
    finite
}

fn is_empty(active: Active) -> bool {
    matches!(active, Active::List(start, end) if start == end)
}

/// Parts the active points by the condition. A side that gets all of them stays what they were, so that a whole block
/// is still worked on as one; with `plain`, a whole block with points on both sides is so on both.
fn divide(
    condition: Source<'_>,
    active: Active,
    points: &mut Vec<u16>,
    plain: bool,
    loops: impl Loops,
) -> (Active, Active) {
    let mark = points.len();
    let nobody = Active::List(mark, mark);
    // Most blocks are on one side.
    if let (Source::Each(condition), Active::All) = (condition, active) {
        match loops.count(condition) {
            0 => return (nobody, active),
            all if all == STEP * condition.len() => return (active, nobody),
            _ if plain => return (active, active),
            _ => {}
        }
    }
    let count = match (active, condition) {
        (Active::List(start, end), _) => end - start,
        (Active::All, Source::Each(condition)) => STEP * condition.len(),
        (Active::All, Source::Same(value)) if value != 0.0 => return (active, nobody),
        (Active::All, Source::Same(_)) => return (nobody, active),
    };
    // Points where it holds from the front, the others from the back.
    points.resize(mark + count, 0);
    let (mut front, mut back) = (mark, mark + count);
    for k in 0..count {
        let point = match active {
            Active::All => k as u16,
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
