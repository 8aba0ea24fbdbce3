//! The formula as a graph: operands before operations, equal subexpressions only once.
//!
//! Nothing here recurses, so a sum of a hundred thousand terms is no deeper than any other. The simplifications made
//! on the way in leave every value's bits as they are.

use crate::function::{Binary, Unary, integer_exponent, integer_power};
use std::collections::HashMap;

/// A node of a [`Graph`]; its operands have smaller numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) struct Id(u32);

impl Id {
    pub(crate) fn index(self) -> usize {
        self.0 as usize
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Node {
    Number(f64),
    X,
    Y,
    Region,
    Unary(Unary, Id),
    Binary(Binary, Id, Id),
    /// Condition, then, else.
    If(Id, Id, Id),
}

impl Node {
    /// The operands, in the order of evaluation.
    pub(crate) fn operands(self) -> impl Iterator<Item = Id> {
        let list = match self {
            Self::Number(_) | Self::X | Self::Y | Self::Region => [None; 3],
            Self::Unary(_, a) => [Some(a), None, None],
            Self::Binary(_, a, b) => [Some(a), Some(b), None],
            Self::If(c, a, b) => [Some(c), Some(a), Some(b)],
        };
        list.into_iter().flatten()
    }

    /// Whether the value is always 0 or 1.
    pub(crate) fn is_truth(self) -> bool {
        match self {
            Self::Number(value) => value == 0.0 || value == 1.0,
            Self::Unary(op, _) => op.is_truth(),
            Self::Binary(op, ..) => op.is_truth(),
            Self::X | Self::Y | Self::Region | Self::If(..) => false,
        }
    }
}

#[derive(Debug, PartialEq, Eq, Hash)]
enum Key {
    Number(u64),
    X,
    Y,
    Region,
    Unary(Unary, Id),
    Binary(Binary, Id, Id),
    If(Id, Id, Id),
}

/// A formula under construction.
#[derive(Debug, Default)]
pub(crate) struct Graph {
    nodes: Vec<Node>,
    known: HashMap<Key, Id>,
}

impl Graph {
    pub(crate) fn node(&self, id: Id) -> Node {
        self.nodes[id.index()]
    }

    pub(crate) fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// The value of a node that is a number.
    pub(crate) fn as_number(&self, id: Id) -> Option<f64> {
        match self.node(id) {
            Node::Number(value) => Some(value),
            _ => None,
        }
    }

    fn insert(&mut self, node: Node) -> Id {
        let key = match node {
            Node::Number(value) => Key::Number(value.to_bits()),
            Node::X => Key::X,
            Node::Y => Key::Y,
            Node::Region => Key::Region,
            Node::Unary(op, a) => Key::Unary(op, a),
            // Only the key is sorted: the node keeps the order of the source.
            Node::Binary(op, a, b) if op.commutes() => Key::Binary(op, a.min(b), a.max(b)),
            Node::Binary(op, a, b) => Key::Binary(op, a, b),
            Node::If(c, a, b) => Key::If(c, a, b),
        };
        *self.known.entry(key).or_insert_with(|| {
            let id = u32::try_from(self.nodes.len());
            self.nodes.push(node);
            Id(id.expect(
                "a source is bounded in length, so that four billion nodes need terabytes first",
            ))
        })
    }

    pub(crate) fn number(&mut self, value: f64) -> Id {
        self.insert(Node::Number(value))
    }

    /// A node whose operands are already of this graph, simplified.
    pub(crate) fn add_node(&mut self, node: Node) -> Id {
        match node {
            Node::Unary(op, a) => self.unary(op, a),
            Node::Binary(op, a, b) => self.binary(op, a, b),
            Node::If(c, a, b) => self.choose(c, a, b),
            leaf => self.insert(leaf),
        }
    }

    pub(crate) fn unary(&mut self, op: Unary, a: Id) -> Id {
        match (op, self.node(a)) {
            (_, Node::Number(value)) => self.number(op.apply(value)),
            (Unary::Neg, Node::Unary(Unary::Neg, inner)) => inner,
            _ => self.insert(Node::Unary(op, a)),
        }
    }

    pub(crate) fn binary(&mut self, op: Binary, a: Id, b: Id) -> Id {
        let (left, right) = (self.as_number(a), self.as_number(b));
        match (op, left, right) {
            (Binary::Pow, base, Some(exponent)) => self.power(a, base, b, exponent),
            (_, Some(left), Some(right)) => self.number(op.apply(left, right)),
            (Binary::Mul | Binary::Div, None, Some(1.0)) => a,
            (Binary::Mul, Some(1.0), None) => b,
            (Binary::And | Binary::Or, Some(left), None) => {
                // The left operand decides, or the right one does.
                if (left != 0.0) == (op == Binary::Or) {
                    self.number(op.apply(left, left))
                } else {
                    self.truth(b)
                }
            }
            (Binary::And | Binary::Or, None, Some(right)) => {
                if (right != 0.0) == (op == Binary::Or) {
                    self.number(op.apply(right, right))
                } else {
                    self.truth(a)
                }
            }
            _ => self.insert(Node::Binary(op, a, b)),
        }
    }

    fn power(&mut self, a: Id, base: Option<f64>, b: Id, exponent: f64) -> Id {
        match (base, integer_exponent(exponent)) {
            (_, Some(0)) => self.number(1.0),
            (_, Some(1)) => a,
            (Some(base), Some(n)) => {
                let value = integer_power(base, n, |s, t| s * t, |t| 1.0 / t);
                self.number(value.unwrap_or(1.0))
            }
            (Some(base), None) => self.number(base.powf(exponent)),
            (None, _) => self.insert(Node::Binary(Binary::Pow, a, b)),
        }
    }

    /// 1 where the operand is not zero, else 0.
    pub(crate) fn truth(&mut self, a: Id) -> Id {
        if self.node(a).is_truth() {
            return a;
        }
        let zero = self.number(0.0);
        self.binary(Binary::Ne, a, zero)
    }

    pub(crate) fn choose(&mut self, condition: Id, then: Id, other: Id) -> Id {
        if then == other {
            return then;
        }
        match self.as_number(condition) {
            Some(value) if value != 0.0 => then,
            Some(_) => other,
            None => self.insert(Node::If(condition, then, other)),
        }
    }
}

/// The nodes that the root needs, in order; the root is the last of them.
pub(crate) fn prune(nodes: &[Node], root: Id) -> Vec<Node> {
    let nodes = &nodes[..=root.index()];
    let mut needed = vec![false; nodes.len()];
    needed[root.index()] = true;
    for (index, node) in nodes.iter().enumerate().rev() {
        if needed[index] {
            node.operands().for_each(|id| needed[id.index()] = true);
        }
    }
    let mut graph = Graph::default();
    let mut moved = vec![Id(0); nodes.len()];
    for (index, node) in nodes.iter().enumerate().filter(|(index, _)| needed[*index]) {
        moved[index] = graph.insert(renumber(*node, &moved));
    }
    graph.nodes
}

/// The node with its operands replaced by those they have moved to.
pub(crate) fn renumber(node: Node, moved: &[Id]) -> Node {
    let at = |id: Id| moved[id.index()];
    match node {
        Node::Unary(op, a) => Node::Unary(op, at(a)),
        Node::Binary(op, a, b) => Node::Binary(op, at(a), at(b)),
        Node::If(c, a, b) => Node::If(at(c), at(a), at(b)),
        leaf => leaf,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_subexpressions_are_one_node() {
        let mut graph = Graph::default();
        let (x, y) = (graph.add_node(Node::X), graph.add_node(Node::Y));
        let sum = graph.binary(Binary::Add, x, y);
        assert_eq!(graph.binary(Binary::Add, y, x), sum);
        assert_eq!(graph.node(sum), Node::Binary(Binary::Add, x, y));
        let quotient = graph.binary(Binary::Div, x, y);
        assert_ne!(graph.binary(Binary::Div, y, x), quotient);
    }

    #[test]
    fn a_zero_factor_is_kept_since_the_other_may_be_infinite() {
        let mut graph = Graph::default();
        let (x, zero) = (graph.add_node(Node::X), graph.number(0.0));
        let product = graph.binary(Binary::Mul, zero, x);
        assert_eq!(graph.as_number(product), None);
        let sum = graph.binary(Binary::Add, zero, x);
        assert_ne!(sum, x, "0 + -0 is 0, not -0");
    }

    #[test]
    fn pruning_keeps_what_the_root_needs() {
        let mut graph = Graph::default();
        let (x, y) = (graph.add_node(Node::X), graph.add_node(Node::Y));
        let sine = graph.unary(Unary::Sin, y);
        graph.binary(Binary::Add, x, sine);
        assert_eq!(
            prune(graph.nodes(), sine),
            [Node::Y, Node::Unary(Unary::Sin, Id(0))]
        );
    }

    #[test]
    fn conditions_that_are_known_fold() {
        let mut graph = Graph::default();
        let (x, y) = (graph.add_node(Node::X), graph.add_node(Node::Y));
        let (zero, two) = (graph.number(0.0), graph.number(2.0));
        assert_eq!(graph.choose(two, x, y), x);
        assert_eq!(graph.choose(zero, x, y), y);
        assert_eq!(graph.binary(Binary::And, zero, x), zero);
        let or = graph.binary(Binary::Or, two, x);
        assert_eq!(graph.as_number(or), Some(1.0));
        let and = graph.binary(Binary::And, two, x);
        assert_eq!(graph.node(and), Node::Binary(Binary::Ne, x, zero));
    }
}
