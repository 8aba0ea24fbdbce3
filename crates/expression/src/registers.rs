//! Which register holds which value of a compiled formula.

use crate::program::{Op, Operand, Outcome, Program};

/// Gives each value a register from its first computation to its last use in the list. The order of the list is
/// enough: what one branch ends with is used by the `Pick` after the other, and what else it computes has no use there.
pub(crate) fn allocate(mut ops: Vec<Op>, virtuals: usize, mut results: Vec<Outcome>) -> Program {
    link(&mut ops);
    let mut last_use = vec![0usize; virtuals];
    for (place, op) in ops.iter_mut().enumerate() {
        for operand in op.operands_mut() {
            if let Operand::Register(register) = operand {
                last_use[*register as usize] = place;
            }
        }
    }
    for result in &results {
        if let Operand::Register(register) = &result.value {
            last_use[*register as usize] = ops.len();
        }
    }
    let mut given: Vec<Option<u32>> = vec![None; virtuals];
    let mut free: Vec<u32> = Vec::new();
    let mut registers = 0u32;
    for (place, op) in ops.iter_mut().enumerate() {
        for target in op.targets_mut() {
            let register = given[*target as usize].get_or_insert_with(|| {
                free.pop().unwrap_or_else(|| {
                    registers += 1;
                    registers - 1
                })
            });
            *target = *register;
        }
        if let Op::Pick(_, _, sides) = op {
            for side in sides {
                side.spent = match side.value {
                    Operand::Register(register) => last_use[register as usize] == place,
                    _ => false,
                };
            }
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
    for result in &mut results {
        if let Operand::Register(register) = &mut result.value {
            *register = given[*register as usize].expect("the result is computed");
        }
    }
    Program {
        plain: ops.iter().all(Op::is_plain),
        ops,
        registers: registers as usize,
        results,
    }
}

/// Makes the jumps of every `Split` and `Else` lead to where its branch ends.
fn link(ops: &mut [Op]) {
    let mut open = Vec::new();
    for place in 0..ops.len() {
        match ops[place] {
            Op::Split(_) => open.push(place),
            Op::Else(_) | Op::Join => {
                if let Some(begin) = open.pop() {
                    match &mut ops[begin] {
                        Op::Split(split) => split.middle = place as u32,
                        Op::Else(end) => *end = place as u32,
                        _ => {}
                    }
                }
                if matches!(ops[place], Op::Else(_)) {
                    open.push(place);
                }
            }
            _ => {}
        }
    }
}
