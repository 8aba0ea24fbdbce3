//! From the graph to a flat list of instructions over registers.
//!
//! Nodes are computed when first needed and found again as long as the points for which they were computed are those
//! that ask: what a branch computed is forgotten at its end, what was computed before it serves inside. A choice
//! between a few plain operations is made by computing both sides and picking, which a processor does several points
//! at a time; any other choice splits the points, and each side runs over its own. Choices by the same condition that
//! are all needed split the points once.

use crate::function::Binary;
use crate::graph::{Graph, Id, Node};
use crate::program::{Op, Operand, Outcome, Program, Side, Split};
use crate::quotient::Divisor;
use crate::registers::allocate;
use crate::share::share;
use crate::term::{By, Join, Term};

/// Most new plain operations in the two sides of a choice that are both computed.
const CHEAP_CHOICE: u32 = 8;

enum Task {
    Need(Id),
    Emit(Id),
    Split(Id),
    Else,
    Join,
}

struct Compiler<'a> {
    graph: &'a Graph,
    ops: Vec<Op>,
    places: Vec<Option<Operand>>,
    /// Nodes placed, in order, to be forgotten at the end of the branch.
    placed: Vec<Id>,
    branches: Vec<Branch>,
    /// For the whole and each open branch: the choices that are needed there and split the points, in order of their conditions, which come first.
    choices: Vec<Vec<(Id, Id)>>,
    /// Which survey came to a node last, and how many there were.
    surveyed: Vec<u32>,
    surveys: u32,
    /// How many operands and results each node is.
    uses: Vec<u32>,
    /// Instructions that are not plain.
    costly: u32,
    virtuals: u32,
}

/// An open branch.
struct Branch {
    /// Length of `placed` at its start.
    mark: usize,
    /// The choices that it is a side of; they have the same condition.
    choices: Vec<Id>,
    /// The values of the first side, once they are known.
    then: Vec<Operand>,
    /// Place of its `Split`.
    split: usize,
    /// `costly` at its start.
    costly: u32,
}

pub(crate) fn compile(graph: &Graph, roots: &[Id]) -> Program {
    let count = graph.nodes().len();
    let mut uses = vec![0; count];
    let operands = graph.nodes().iter().flat_map(|node| node.operands());
    for id in operands.chain(roots.iter().copied()) {
        uses[id.index()] += 1;
    }
    let mut compiler = Compiler {
        graph,
        ops: Vec::new(),
        places: vec![None; count],
        placed: Vec::new(),
        branches: Vec::new(),
        choices: Vec::new(),
        surveyed: vec![0; count],
        surveys: 0,
        uses,
        costly: 0,
        virtuals: 0,
    };
    let (roots, factors): (Vec<Id>, Vec<f64>) =
        roots.iter().map(|root| compiler.scaled(*root)).unzip();
    compiler.survey(roots.clone());
    compiler.run(&roots);
    let values = roots.iter().map(|root| compiler.operand(*root));
    let outcomes = values.zip(factors);
    let results: Vec<Outcome> = outcomes
        .map(|(value, factor)| Outcome { value, factor })
        .collect();
    let virtuals = compiler.virtuals as usize;
    let ops = share(compiler.ops, virtuals, &results);
    allocate(ops, virtuals, results)
}

impl Compiler<'_> {
    /// The root as a product of a node and a number.
    fn scaled(&self, root: Id) -> (Id, f64) {
        let Node::Binary(Binary::Mul, a, b) = self.graph.node(root) else {
            return (root, 1.0);
        };
        match (self.graph.as_number(a), self.graph.as_number(b)) {
            (_, Some(factor)) => (a, factor),
            (Some(factor), _) => (b, factor),
            _ => (root, 1.0),
        }
    }

    fn run(&mut self, roots: &[Id]) {
        let mut tasks: Vec<Task> = roots.iter().rev().map(|root| Task::Need(*root)).collect();
        while let Some(task) = tasks.pop() {
            match task {
                Task::Need(id) => self.need(id, &mut tasks),
                Task::Emit(id) => self.emit(id),
                Task::Split(id) => self.split(id, &mut tasks),
                Task::Else => self.other(),
                Task::Join => self.join(),
            }
        }
    }

    /// Finds the choices that split the points among what it takes to have these nodes, whatever branches are taken.
    fn survey(&mut self, roots: Vec<Id>) {
        self.surveys += 1;
        let mut found = Vec::new();
        let mut open = roots;
        while let Some(id) = open.pop() {
            if self.surveyed[id.index()] == self.surveys || self.place(id).is_some() {
                continue;
            }
            self.surveyed[id.index()] = self.surveys;
            match self.graph.node(id) {
                node @ Node::If(condition, ..) if !self.is_cheap_choice(node) => {
                    found.push((condition, id));
                    open.push(condition);
                }
                node => open.extend(node.operands()),
            }
        }
        found.sort_unstable();
        self.choices.push(found);
    }

    /// Queues what it takes to have the node, unless it is there.
    fn need(&mut self, id: Id, tasks: &mut Vec<Task>) {
        if self.place(id).is_some() {
            return;
        }
        let node = self.graph.node(id);
        if let Node::If(condition, ..) = node
            && !self.is_cheap_choice(node)
        {
            tasks.push(Task::Split(id));
            tasks.push(Task::Need(condition));
            return;
        }
        tasks.push(Task::Emit(id));
        let first = tasks.len();
        tasks.extend(node.operands().map(Task::Need));
        // What the operation takes in is to come right before it.
        if !self.takes_in_left(node) {
            tasks[first..].reverse();
        }
    }

    /// Whether a left operand, but not the right one, may become part of an instruction with the operation.
    fn takes_in_left(&self, node: Node) -> bool {
        let is_number = |id: Id| self.graph.as_number(id).is_some();
        let is_scaled = |id: Id| match self.graph.node(id) {
            Node::Binary(Binary::Mul, a, b) => is_number(a) || is_number(b),
            _ => false,
        };
        let is_term = |id: Id| match self.graph.node(id) {
            Node::Binary(Binary::Mul, ..) => true,
            Node::Binary(Binary::Div, _, b) => is_number(b),
            _ => false,
        };
        let (a, b, is_part): (Id, Id, &dyn Fn(Id) -> bool) = match node {
            Node::Binary(Binary::Mul, a, b) => (a, b, &is_scaled),
            Node::Binary(Binary::Add | Binary::Sub, a, b) => (a, b, &is_term),
            _ => return false,
        };
        let takes = |id: Id| is_part(id) && self.uses[id.index()] == 1 && self.place(id).is_none();
        takes(a) && !takes(b)
    }

    fn emit(&mut self, id: Id) {
        // The node may have come by another way since it was queued.
        if self.place(id).is_some() {
            return;
        }
        let target = self.new_register();
        let op = match self.graph.node(id) {
            Node::Unary(op, a) => Op::Unary(op, target, self.operand(a)),
            Node::Binary(op, a, b) => self.binary(op, target, a, b),
            Node::If(c, a, b) => {
                Op::Select(target, self.operand(c), self.operand(a), self.operand(b))
            }
            Node::Number(_) | Node::X | Node::Y | Node::Region => return,
        };
        self.costly += u32::from(!op.is_plain());
        self.ops.push(op);
        self.set_place(id, target);
    }

    /// The instruction for an operation. One that comes right before it, for an operand that nothing else needs, is taken into it if both make a term of
    /// a sum.
    fn binary(&mut self, op: Binary, target: u32, a: Id, b: Id) -> Op {
        let divisor = match op {
            Binary::Div => self.graph.as_number(b).and_then(Divisor::new),
            _ => None,
        };
        let joins = match op {
            Binary::Add => Some((Join::Plus, Join::Plus)),
            Binary::Sub => Some((Join::Minus, Join::From)),
            _ => None,
        };
        if let Some(divisor) = divisor {
            let (factor, of) = match self.take_scaled(a) {
                Some(scaled) => scaled,
                None => (1.0, self.operand(a)),
            };
            let by = By::Over(divisor);
            return Op::Term(target, Term { factor, of, by }, None);
        }
        if op == Binary::Mul {
            for (scaled, other) in [(b, a), (a, b)] {
                if let Some((factor, of)) = self.take_scaled(scaled) {
                    let by = By::Times(self.operand(other));
                    return Op::Term(target, Term { factor, of, by }, None);
                }
            }
        }
        if let Some((left, right)) = joins {
            for (join, term, other) in [(right, b, a), (left, a, b)] {
                if let Some(term) = self.take_term(term) {
                    return Op::Term(target, term, Some((join, self.operand(other))));
                }
            }
        }
        Op::Binary(op, target, self.operand(a), self.operand(b))
    }

    /// Takes back the last instruction, if it computes a product with a number that only one operation needs.
    fn take_scaled(&mut self, id: Id) -> Option<(f64, Operand)> {
        let scaled = match self.last_for(id)? {
            Op::Binary(Binary::Mul, _, Operand::Number(factor), of)
            | Op::Binary(Binary::Mul, _, of, Operand::Number(factor)) => (factor, of),
            _ => return None,
        };
        self.take_back();
        Some(scaled)
    }

    /// Takes back the last instruction, if it computes a term that only one operation needs.
    fn take_term(&mut self, id: Id) -> Option<Term> {
        let term = match self.last_for(id)? {
            // A number is not what varies.
            Op::Binary(Binary::Mul, _, b @ Operand::Number(_), of)
            | Op::Binary(Binary::Mul, _, of, b) => Term {
                factor: 1.0,
                of,
                by: By::Times(b),
            },
            Op::Term(_, term, None) => term,
            _ => return None,
        };
        self.take_back();
        Some(term)
    }

    /// The last instruction, if it computes this node and only one operation needs it.
    fn last_for(&self, id: Id) -> Option<Op> {
        let last = *self.ops.last()?;
        let mut copy = last;
        let target = Operand::Register(*copy.targets_mut().next()?);
        let own = self.placed.last() == Some(&id) && self.places[id.index()] == Some(target);
        (own && self.uses[id.index()] == 1).then_some(last)
    }

    fn take_back(&mut self) {
        self.ops.pop();
        if let Some(id) = self.placed.pop() {
            self.places[id.index()] = None;
        }
    }

    /// Opens the branches of a choice, and of the others by the same condition that are needed too.
    fn split(&mut self, id: Id, tasks: &mut Vec<Task>) {
        let Node::If(condition, ..) = self.graph.node(id) else {
            return;
        };
        if self.place(id).is_some() {
            return;
        }
        let needed: &[(Id, Id)] = self.choices.last().map_or(&[], |needed| needed);
        let first = needed.partition_point(|(other, _)| *other < condition);
        let same = needed[first..]
            .iter()
            .take_while(|(other, _)| *other == condition);
        let mut choices: Vec<Id> = same
            .map(|(_, id)| *id)
            .filter(|id| self.place(*id).is_none())
            .collect();
        if !choices.contains(&id) {
            choices.push(id);
        }
        let [then, other] = [true, false].map(|holds| self.sides(&choices, holds));
        let split = self.ops.len();
        self.ops.push(Op::Split(Split {
            condition: self.operand(condition),
            middle: 0,
            plain: false,
        }));
        self.branches.push(Branch {
            mark: self.placed.len(),
            choices,
            then: Vec::new(),
            split,
            costly: self.costly,
        });
        tasks.push(Task::Join);
        tasks.extend(other.into_iter().rev().map(Task::Need));
        tasks.push(Task::Else);
        tasks.extend(then.iter().rev().map(|id| Task::Need(*id)));
        self.survey(then);
    }

    /// The values of choices where their condition holds, or where it does not.
    fn sides(&self, choices: &[Id], holds: bool) -> Vec<Id> {
        let side = |id: &Id| match self.graph.node(*id) {
            Node::If(_, then, other) => Some(if holds { then } else { other }),
            _ => None,
        };
        choices.iter().filter_map(side).collect()
    }

    /// Ends the first branch and begins the second.
    fn other(&mut self) {
        let Some(mut branch) = self.branches.pop() else {
            return;
        };
        branch.then = self.end_branch(&branch, true);
        self.ops.push(Op::Else(0));
        self.survey(self.sides(&branch.choices, false));
        self.branches.push(branch);
    }

    fn join(&mut self) {
        let Some(branch) = self.branches.pop() else {
            return;
        };
        let others = self.end_branch(&branch, false);
        self.ops.push(Op::Join);
        let Op::Split(split) = &mut self.ops[branch.split] else {
            return;
        };
        split.plain = self.costly == branch.costly;
        let condition = split.condition;
        let sides = branch.then.into_iter().zip(others);
        for (id, (then, other)) in branch.choices.into_iter().zip(sides) {
            let target = self.new_register();
            let sides = [then, other].map(|value| Side {
                value,
                spent: false,
            });
            self.ops.push(Op::Pick(target, condition, sides));
            self.set_place(id, target);
        }
    }

    /// Where the branch's values are; forgets what it computed.
    fn end_branch(&mut self, branch: &Branch, holds: bool) -> Vec<Operand> {
        let values = self.sides(&branch.choices, holds);
        let values = values.iter().map(|value| self.operand(*value)).collect();
        for id in self.placed.drain(branch.mark..) {
            self.places[id.index()] = None;
        }
        self.choices.pop();
        values
    }

    /// Whether both sides of a choice are few plain operations.
    fn is_cheap_choice(&self, choice: Node) -> bool {
        let mut left = CHEAP_CHOICE;
        let mut open: Vec<Id> = choice.operands().skip(1).collect();
        while let Some(id) = open.pop() {
            if self.place(id).is_some() {
                continue;
            }
            let node = self.graph.node(id);
            let plain = match node {
                Node::Unary(op, _) => op.is_cheap(),
                Node::Binary(op, ..) => op.is_cheap(),
                _ => true,
            };
            if !plain || left == 0 {
                return false;
            }
            left -= 1;
            open.extend(node.operands());
        }
        true
    }

    fn place(&self, id: Id) -> Option<Operand> {
        match self.graph.node(id) {
            Node::Number(value) => Some(Operand::Number(value)),
            Node::X => Some(Operand::X),
            Node::Y => Some(Operand::Y),
            Node::Region => Some(Operand::Region),
            _ => self.places[id.index()],
        }
    }

    fn operand(&self, id: Id) -> Operand {
        self.place(id)
            .expect("operands are emitted before the operation that needs them")
    }

    fn set_place(&mut self, id: Id, register: u32) {
        self.places[id.index()] = Some(Operand::Register(register));
        self.placed.push(id);
    }

    fn new_register(&mut self) -> u32 {
        self.virtuals += 1;
        self.virtuals - 1
    }
}

#[cfg(test)]
mod tests;
