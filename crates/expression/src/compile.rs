//! From the graph to a flat list of instructions over registers.
//!
//! Nodes are computed when first needed and found again as long as the points for which they were computed are those
//! that ask: what a branch computed is forgotten at its end, what was computed before it serves inside. A choice
//! between a few plain operations is made by computing both sides and picking, which a processor does several points
//! at a time; any other choice splits the points, and each side runs over its own.

use crate::function::{Binary, Unary};
use crate::graph::{Graph, Id, Node};
use crate::quotient::Divisor;
use crate::registers::allocate;
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
    /// How many operands each node is.
    uses: Vec<u32>,
    virtuals: u32,
}

pub(crate) fn compile(graph: &Graph, root: Id) -> Program {
    let mut uses = vec![0; graph.nodes().len()];
    for id in graph.nodes().iter().flat_map(|node| node.operands()) {
        uses[id.index()] += 1;
    }
    let mut compiler = Compiler {
        graph,
        ops: Vec::new(),
        places: vec![None; graph.nodes().len()],
        placed: Vec::new(),
        branches: Vec::new(),
        uses,
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
            Node::Unary(op, a) => Op::Unary(op, target, self.operand(a)),
            Node::Binary(op, a, b) => self.binary(op, target, a, b),
            Node::If(c, a, b) => {
                Op::Select(target, self.operand(c), self.operand(a), self.operand(b))
            }
            Node::Number(_) | Node::X | Node::Y | Node::Region => return,
        };
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
        let target = Operand::Register(*copy.target_mut()?);
        let own = self.placed.last() == Some(&id) && self.places[id.index()] == Some(target);
        (own && self.uses[id.index()] == 1).then_some(last)
    }

    fn take_back(&mut self) {
        self.ops.pop();
        if let Some(id) = self.placed.pop() {
            self.places[id.index()] = None;
        }
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
                | Op::Term(last, ..)
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

    /// The instructions as one letter each: `s`, `c` sine and cosine, `p` a product, `t` other terms, `+` sums with them, `.`
    /// others, `(|)` a choice that
    /// splits, `?` one that does not, `=` a copy.
    fn shape(source: &str) -> String {
        let letter = |op: &Op| match op {
            Op::Unary(Unary::Sin, ..) => 's',
            Op::Unary(Unary::Cos, ..) => 'c',
            Op::Binary(Binary::Mul, ..) => 'p',
            Op::Unary(..) | Op::Binary(..) => '.',
            Op::Term(_, _, None) => 't',
            Op::Term(..) => '+',
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
        assert_eq!(shape("x^2 + x^4 + x^6"), "pp.+");
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
        assert_eq!(shape("if(x^2 + y^2 < 0.5, -10, -8)"), "p+.?");
        assert_eq!(shape("if(x > 0 && y > 0, x*y, x - y)"), "..?p.?");
        let nine = "x*y + x - y + 2*x - 3*y + 1/x + x*x";
        assert!(shape(&format!("if(x > 0, {nine}, 0)")).contains('('));
    }

    #[test]
    fn terms_are_joined_with_what_they_are_added_to() {
        assert_eq!(shape("y - 3*x"), "+");
        assert_eq!(shape("y - 3*x/7 + 5*x*y"), "++");
        assert_eq!(shape("y + x*y/4 - (5*x)*sin(y)"), "p+ps+");
        assert_eq!(shape("2*x*y/3"), "tt");
        // Needed twice, or not last.
        assert_eq!(shape("x*y + sin(x*y)"), "ps.");
        assert_eq!(shape("x*y + sin(x)"), "ps.");
        assert_eq!(shape("x/3/5"), "tt");
        assert_eq!(shape("if(x > 0, x*y, y/3) + sin(x)"), ".pt?s.");
        let Op::Term(_, term, Some((Join::From, Operand::Y))) = program("y - 3*x/7").ops[0] else {
            panic!("a term taken from y");
        };
        assert_eq!((term.factor, term.of), (3.0, Operand::X));
        let Op::Term(_, term, _) = program("2*x + y").ops[0] else {
            panic!("a term and y");
        };
        assert_eq!(term.of, Operand::X);
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
