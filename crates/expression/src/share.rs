//! Terms that two sums have in common: computed once and joined with both, so that they are neither stored nor loaded.
//!
//! Formulas that belong together, as the loads of two bodies that press on each other, are often such sums.

use crate::function::Binary;
use crate::program::{Op, Operand, Outcome};
use crate::term::{By, Term};

/// How many instructions may move before a shared term, so that what its second sum has before it is there.
const MOVED: usize = 4;

/// Joins terms with both of their sums. Every register is written by one instruction.
pub(crate) fn share(ops: Vec<Op>, virtuals: usize, results: &[Outcome]) -> Vec<Op> {
    let mut sharing = Sharing {
        stretch: Vec::with_capacity(ops.len()),
        written: vec![None; virtuals],
        users: vec![Users::default(); virtuals],
        done: vec![false; ops.len()],
        out: Vec::with_capacity(ops.len()),
        ops,
    };
    sharing.survey(results);
    for place in 0..sharing.ops.len() {
        sharing.put(place);
    }
    sharing.out
}

/// Where a value is used: the first two places, and how many there are.
#[derive(Clone, Copy, Default)]
struct Users {
    places: [usize; 2],
    count: usize,
}

struct Sharing {
    ops: Vec<Op>,
    /// For each instruction, how many jumps and ends of branches come before it.
    stretch: Vec<usize>,
    /// The place of the instruction that writes a register.
    written: Vec<Option<usize>>,
    users: Vec<Users>,
    /// Instructions that are in `out`.
    done: Vec<bool>,
    out: Vec<Op>,
}

/// What a term is joined with: whether it is subtracted, and from or to what.
type Joined = (bool, Operand);

impl Sharing {
    fn survey(&mut self, results: &[Outcome]) {
        let mut stretch = 0;
        for place in 0..self.ops.len() {
            let mut op = self.ops[place];
            stretch += usize::from(matches!(op, Op::Split(_) | Op::Else(_) | Op::Join));
            self.stretch.push(stretch);
            for target in op.targets_mut() {
                self.written[*target as usize] = Some(place);
            }
            for operand in op.operands_mut() {
                if let Operand::Register(register) = operand {
                    let users = &mut self.users[*register as usize];
                    if let Some(to) = users.places.get_mut(users.count) {
                        *to = place;
                    }
                    users.count += 1;
                }
            }
        }
        for result in results {
            if let Operand::Register(register) = result.value {
                // Not a value of two sums alone.
                self.users[register as usize].count += 2;
            }
        }
    }

    /// Goes on with the instruction at `place`; a term that two sums share waits for the first of them.
    fn put(&mut self, place: usize) {
        if self.done[place] || self.shared(place).is_some() {
            return;
        }
        let waiting = self
            .operands(place)
            .find_map(|operand| self.pending(operand));
        if !waiting.is_some_and(|term| self.both(term)) {
            self.emit(place);
        }
    }

    /// Emits both sums of the shared term at `place` together, if what that takes can be had now.
    fn both(&mut self, place: usize) -> bool {
        let Some((term, sums)) = self.shared(place) else {
            return false;
        };
        let joined = sums.map(|sum| self.joined(sum, place));
        let targets = sums.map(|sum| self.target(sum));
        let ([Some(first), Some(second)], [Some(one), Some(two)]) = (joined, targets) else {
            return false;
        };
        let mut needed = Vec::new();
        if ![first.1, second.1]
            .into_iter()
            .all(|operand| self.collect(operand, &mut needed))
        {
            return false;
        }
        needed.into_iter().for_each(|place| self.emit(place));
        for place in [place, sums[0], sums[1]] {
            self.done[place] = true;
        }
        self.out.push(Op::Both([one, two], term, [first, second]));
        true
    }

    /// Lists what is to come before an operand, in order; false if that is much, or if a shared term is among it, as it is where one sum of the term
    /// needs the other.
    fn collect(&self, operand: Operand, needed: &mut Vec<usize>) -> bool {
        let Some(place) = self.pending(operand) else {
            return true;
        };
        if needed.contains(&place) {
            return true;
        }
        if self.shared(place).is_some() || needed.len() >= MOVED {
            return false;
        }
        if !self
            .operands(place)
            .all(|operand| self.collect(operand, needed))
        {
            return false;
        }
        needed.push(place);
        true
    }

    /// Puts down an instruction, and before it the terms that it needs and that have waited in vain.
    fn emit(&mut self, place: usize) {
        let waiting: Vec<usize> = self
            .operands(place)
            .filter_map(|operand| self.pending(operand))
            .collect();
        for place in waiting.into_iter().chain([place]) {
            if !std::mem::replace(&mut self.done[place], true) {
                self.out.push(self.ops[place]);
            }
        }
    }

    /// The term that an instruction computes for two sums of its stretch, and the places of these.
    fn shared(&self, place: usize) -> Option<(Term, [usize; 2])> {
        let term = match self.ops[place] {
            Op::Binary(
                Binary::Mul,
                _,
                of @ (Operand::X | Operand::Y | Operand::Register(_)),
                by,
            ) => Term {
                factor: 1.0,
                of,
                by: By::Times(by),
            },
            Op::Term(_, term, None) => term,
            _ => return None,
        };
        let users = self.users[self.target(place)? as usize];
        let [first, second] = users.places;
        let near = users.count == 2
            && first != second
            && [first, second].iter().all(|sum| {
                self.stretch[*sum] == self.stretch[place] && self.joined(*sum, place).is_some()
            });
        near.then_some((term, users.places))
    }

    /// How the instruction at `sum` joins the term that the one at `term` computes.
    fn joined(&self, sum: usize, term: usize) -> Option<Joined> {
        let own = Operand::Register(self.target(term)?);
        match self.ops[sum] {
            Op::Binary(Binary::Add, _, c, t) | Op::Binary(Binary::Add, _, t, c)
                if t == own && c != own =>
            {
                Some((false, c))
            }
            Op::Binary(Binary::Sub, _, c, t) if t == own && c != own => Some((true, c)),
            _ => None,
        }
    }

    /// The place of the instruction that computes an operand, if it is still to come.
    fn pending(&self, operand: Operand) -> Option<usize> {
        match operand {
            Operand::Register(register) => {
                self.written[register as usize].filter(|place| !self.done[*place])
            }
            _ => None,
        }
    }

    fn operands(&self, place: usize) -> impl Iterator<Item = Operand> + use<> {
        let mut op = self.ops[place];
        let operands: Vec<Operand> = op.operands_mut().map(|operand| *operand).collect();
        operands.into_iter()
    }

    fn target(&self, place: usize) -> Option<u32> {
        let mut op = self.ops[place];
        op.targets_mut().next().copied()
    }
}
