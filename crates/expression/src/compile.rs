//! From the graph to a flat list of instructions over registers.
//!
//! Nodes are computed when first needed and found again as long as the points for which they were computed are those
//! that ask: what a branch computed is forgotten at its end, what was computed before it serves inside. A choice
//! between a few plain operations is made by computing both sides and picking, which a processor does several points
//! at a time; any other choice splits the points, and each side runs over its own.

use crate::function::{Binary, Unary};
use crate::graph::{Graph, Id, Node};
use crate::quotient::Divisor;

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
    /// A quotient by a constant.
    Quotient(u32, Operand, Divisor),
    /// Target, condition, then, else.
    Select(u32, Operand, Operand, Operand),
    Copy(u32, Operand),
    /// Goes on with the points where the condition holds; without any, jumps to the `Else` at that place.
    Split(Operand, u32),
    /// Goes on with the other points; without any, jumps to the `Join` at that place.
    Else(u32),
    /// Goes on with all points that came to the `Split`.
    Join,
}

/// A compiled formula.
#[derive(Debug, Clone)]
pub(crate) struct Program {
    pub(crate) ops: Vec<Op>,
    pub(crate) registers: usize,
    pub(crate) result: Operand,
}

/// Most new plain operations in the two sides of a choice that are both computed.
const CHEAP_CHOICE: u32 = 8;

enum Task {
    Need(Id),
    Emit(Id),
    Split(Id),
    Else(Id, usize),
    Join(Id, usize),
}

struct Compiler<'a> {
    graph: &'a Graph,
    ops: Vec<Op>,
    places: Vec<Option<Operand>>,
    /// Nodes placed, in order, to be forgotten at the end of the branch.
    placed: Vec<Id>,
    /// For each open branch: the length of `placed` at its start and the target of its choice.
    branches: Vec<(usize, u32)>,
    virtuals: u32,
}

pub(crate) fn compile(graph: &Graph, root: Id) -> Program {
    let mut compiler = Compiler {
        graph,
        ops: Vec::new(),
        places: vec![None; graph.nodes().len()],
        placed: Vec::new(),
        branches: Vec::new(),
        virtuals: 0,
    };
    compiler.run(root);
    let result = compiler.operand(root);
    allocate(compiler.ops, compiler.virtuals as usize, result)
}

impl Compiler<'_> {
    fn run(&mut self, root: Id) {
        let mut tasks = vec![Task::Need(root)];
        while let Some(task) = tasks.pop() {
            match task {
                Task::Need(id) => self.need(id, &mut tasks),
                Task::Emit(id) => self.emit(id),
                Task::Split(id) => self.split(id, &mut tasks),
                Task::Else(id, split) => {
                    if let Node::If(_, then, _) = self.graph.node(id) {
                        self.end_branch(then, split);
                    }
                    self.jump_from(split);
                    self.ops.push(Op::Else(0));
                }
                Task::Join(id, split) => self.join(id, split),
            }
        }
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
        tasks[first..].reverse();
    }

    fn emit(&mut self, id: Id) {
        // The node may have come by another way since it was queued.
        if self.place(id).is_some() {
            return;
        }
        let target = self.new_register();
        let op = match self.graph.node(id) {
            Node::Binary(Binary::Div, a, b)
                if let Some(divisor) = self.graph.as_number(b).and_then(Divisor::new) =>
            {
                Op::Quotient(target, self.operand(a), divisor)
            }
            Node::Unary(op, a) => Op::Unary(op, target, self.operand(a)),
            Node::Binary(op, a, b) => Op::Binary(op, target, self.operand(a), self.operand(b)),
            Node::If(c, a, b) => {
                Op::Select(target, self.operand(c), self.operand(a), self.operand(b))
            }
            Node::Number(_) | Node::X | Node::Y | Node::Region => return,
        };
        self.ops.push(op);
        self.set_place(id, target);
    }

    fn split(&mut self, id: Id, tasks: &mut Vec<Task>) {
        let Node::If(condition, then, other) = self.graph.node(id) else {
            return;
        };
        if self.place(id).is_some() {
            return;
        }
        let split = self.ops.len();
        self.ops.push(Op::Split(self.operand(condition), 0));
        let target = self.new_register();
        self.branches.push((self.placed.len(), target));
        tasks.push(Task::Join(id, split));
        tasks.push(Task::Need(other));
        tasks.push(Task::Else(id, split));
        tasks.push(Task::Need(then));
    }

    fn join(&mut self, id: Id, split: usize) {
        let Op::Split(_, middle) = self.ops[split] else {
            return;
        };
        if let Node::If(_, _, other) = self.graph.node(id) {
            self.end_branch(other, middle as usize);
        }
        self.jump_from(middle as usize);
        self.ops.push(Op::Join);
        if let Some((_, target)) = self.branches.pop() {
            self.set_place(id, target);
        }
    }

    /// Puts the branch's value into the target of the choice and forgets what the branch computed. `start` is the
    /// instruction that opened the branch.
    fn end_branch(&mut self, value: Id, start: usize) {
        let Some((mark, target)) = self.branches.last().copied() else {
            return;
        };
        let source = self.operand(value);
        let open = self.ops.len() > start + 1;
        match self.ops.last_mut() {
            // Computed by the last instruction of this branch, so nobody else has it: compute it into the target.
            Some(
                Op::Unary(_, last, _)
                | Op::Binary(_, last, ..)
                | Op::Quotient(last, ..)
                | Op::Select(last, ..),
            ) if open && Operand::Register(*last) == source => {
                *last = target;
            }
            _ => self.ops.push(Op::Copy(target, source)),
        }
        for id in self.placed.drain(mark..) {
            self.places[id.index()] = None;
        }
    }

    /// Makes the jump at `from` lead to the next instruction.
    fn jump_from(&mut self, from: usize) {
        let next = self.ops.len() as u32;
        if let Op::Split(_, to) | Op::Else(to) = &mut self.ops[from] {
            *to = next;
        }
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

impl Op {
    fn operands_mut(&mut self) -> impl Iterator<Item = &mut Operand> {
        let list = match self {
            Self::Unary(_, _, a)
            | Self::Quotient(_, a, _)
            | Self::Copy(_, a)
            | Self::Split(a, _) => [Some(a), None, None],
            Self::Binary(_, _, a, b) => [Some(a), Some(b), None],
            Self::Select(_, c, a, b) => [Some(c), Some(a), Some(b)],
            Self::Else(_) | Self::Join => [None, None, None],
        };
        list.into_iter().flatten()
    }

    fn target_mut(&mut self) -> Option<&mut u32> {
        match self {
            Self::Unary(_, t, _)
            | Self::Binary(_, t, ..)
            | Self::Quotient(t, ..)
            | Self::Select(t, ..)
            | Self::Copy(t, _) => Some(t),
            Self::Split(..) | Self::Else(_) | Self::Join => None,
        }
    }
}

/// Gives each value a register from its first computation to its last use in the list. The order of the list is
/// enough: a register freed in one branch and used again in the other is written at other points.
fn allocate(mut ops: Vec<Op>, virtuals: usize, mut result: Operand) -> Program {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lower::lower;
    use crate::scope::Scope;

    fn program(source: &str) -> Program {
        let (graph, root) = crate::parser::parse(source, &Scope::new(), true).unwrap();
        let nodes = crate::graph::prune(graph.nodes(), root);
        let (graph, root) = lower(&nodes);
        compile(&graph, root)
    }

    /// The instructions as one letter each: `s`, `c` sine and cosine, `p` a product, `.` others, `(|)` a choice that
    /// splits, `?` one that does not, `=` a copy.
    fn shape(source: &str) -> String {
        let letter = |op: &Op| match op {
            Op::Unary(Unary::Sin, ..) => 's',
            Op::Unary(Unary::Cos, ..) => 'c',
            Op::Binary(Binary::Mul, ..) => 'p',
            Op::Unary(..) | Op::Binary(..) | Op::Quotient(..) => '.',
            Op::Select(..) => '?',
            Op::Copy(..) => '=',
            Op::Split(..) => '(',
            Op::Else(_) => '|',
            Op::Join => ')',
        };
        program(source).ops.iter().map(letter).collect()
    }

    #[test]
    fn common_subexpressions_are_computed_once() {
        assert_eq!(shape("sin(x*y) + sin(y*x)"), "ps.");
        assert_eq!(shape("x^2 + x^4 + x^6"), "pp.p.");
        assert_eq!(shape("x^2 + 1/x^2"), "p..");
    }

    #[test]
    fn work_of_a_branch_stays_in_it() {
        assert_eq!(shape("if(x > 0, sin(x), cos(x))"), ".(s|c)");
        assert_eq!(shape("if(x > 0, sin(x), 2)"), ".(s|=)");
        assert_eq!(shape("x > 0 && sin(x) > 0"), ".(s.|=)");
        // Computed before: served inside. Computed inside: computed again outside and in the other branch.
        assert_eq!(shape("sin(x)*if(x > 0, sin(x)^2, cos(x))"), "s.(p|c)p");
        assert_eq!(
            shape("if(x > 0, sin(x)^2, sin(x)*cos(x))*sin(x)"),
            ".(sp|scp)sp"
        );
        assert_eq!(
            shape("if(x > 0, if(y > 0, sin(x), cos(x)), sin(y))"),
            ".(.(s|c)=|s)"
        );
    }

    #[test]
    fn cheap_choices_are_made_without_a_split() {
        assert_eq!(shape("if(x^2 + y^2 < 0.5, -10, -8)"), "pp..?");
        assert_eq!(shape("if(x > 0 && y > 0, x*y, x - y)"), "..?p.?");
        let nine = "x*y + x - y + 2*x - 3*y + 1/x + x*x";
        assert!(shape(&format!("if(x > 0, {nine}, 0)")).contains('('));
    }

    #[test]
    fn registers_are_used_again_and_never_read_while_written() {
        let chain = program(&format!("x{}", "+sin(x+1)*y".repeat(500)));
        assert!(chain.registers <= 4, "{}", chain.registers);
        for op in program("if(x > 0, sin(x)*x + cos(x), sin(y) - x)*sin(x + sin(y))").ops {
            let mut op = op;
            let target = op.target_mut().copied();
            for operand in op.operands_mut() {
                assert!(target.is_none_or(|target| *operand != Operand::Register(target)));
            }
        }
    }
}
