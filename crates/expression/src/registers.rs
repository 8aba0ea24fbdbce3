//! Which register holds which value of a compiled formula.

use crate::compile::{Op, Operand, Program};
use crate::term::By;

impl Op {
    pub(crate) fn operands_mut(&mut self) -> impl Iterator<Item = &mut Operand> {
        let list = match self {
            Self::Unary(_, _, a) | Self::Copy(_, a) | Self::Split(a, _) => [Some(a), None, None],
            Self::Binary(_, _, a, b) => [Some(a), Some(b), None],
            Self::Select(_, c, a, b) => [Some(c), Some(a), Some(b)],
            Self::Term(_, term, sum) => {
                let by = match &mut term.by {
                    By::Times(b) => Some(b),
                    By::Over(_) => None,
                };
                [Some(&mut term.of), by, sum.as_mut().map(|(_, c)| c)]
            }
            Self::Else(_) | Self::Join => [None, None, None],
        };
        list.into_iter().flatten()
    }

    pub(crate) fn target_mut(&mut self) -> Option<&mut u32> {
        match self {
            Self::Unary(_, t, _)
            | Self::Binary(_, t, ..)
            | Self::Term(t, ..)
            | Self::Select(t, ..)
            | Self::Copy(t, _) => Some(t),
            Self::Split(..) | Self::Else(_) | Self::Join => None,
        }
    }
}

/// Gives each value a register from its first computation to its last use in the list. The order of the list is
/// enough: a register freed in one branch and used again in the other is written at other points.
pub(crate) fn allocate(mut ops: Vec<Op>, virtuals: usize, mut result: Operand) -> Program {
    let mut last_use = vec![0usize; virtuals];
    for (place, op) in ops.iter_mut().enumerate() {
        for operand in op.operands_mut() {
            if let Operand::Register(register) = operand {
                last_use[*register as usize] = place;
            }
        }
    }
    if let Operand::Register(register) = result {
        last_use[register as usize] = ops.len();
    }
    let mut given: Vec<Option<u32>> = vec![None; virtuals];
    let mut free: Vec<u32> = Vec::new();
    let mut registers = 0u32;
    for (place, op) in ops.iter_mut().enumerate() {
        if let Some(target) = op.target_mut() {
            let register = given[*target as usize].get_or_insert_with(|| {
                free.pop().unwrap_or_else(|| {
                    registers += 1;
                    registers - 1
                })
            });
            *target = *register;
        }
        for operand in op.operands_mut() {
            if let Operand::Register(register) = operand {
                let value = *register as usize;
                let place_given = given[value].expect("a value is computed before it is used");
                if last_use[value] == place {
                    free.push(place_given);
                    // Not freed again by a second mention in the same instruction.
                    last_use[value] = usize::MAX;
                }
                *register = place_given;
            }
        }
    }
    if let Operand::Register(register) = &mut result {
        *register = given[*register as usize].expect("the result is computed");
    }
    Program {
        ops,
        registers: registers as usize,
        result,
    }
}
