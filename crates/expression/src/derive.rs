//! Symbolic derivatives, node by node from the leaves up.
//!
//! A factor or term that is zero by its form disappears with all it multiplies, so `step(c)*A` differentiates to
//! `step(c)*A'` and an infinite `A` does no harm. Conditions, `step`, `sign`, `floor`, `ceil` and `region` have the
//! derivative zero: the pieces are differentiated as they stand.

use crate::function::{Binary, Unary};
use crate::graph::{Graph, Id, Node, prune, renumber};

/// The derivative of the graph that ends with its root, by the leaf `variable`; pruned.
pub(crate) fn derivative(nodes: &[Node], variable: Node) -> Vec<Node> {
    let mut rules = Rules {
        graph: Graph::default(),
    };
    let mut value: Vec<Id> = Vec::with_capacity(nodes.len());
    let mut slope: Vec<Id> = Vec::with_capacity(nodes.len());
    for node in nodes {
        let id = rules.graph.add_node(renumber(*node, &value));
        let d = match *node {
            Node::Number(_) | Node::X | Node::Y | Node::Region => {
                rules.number(if *node == variable { 1.0 } else { 0.0 })
            }
            Node::Unary(op, a) => rules.unary(op, id, value[a.index()], slope[a.index()]),
            Node::Binary(op, a, b) => rules.binary(
                op,
                id,
                (value[a.index()], slope[a.index()]),
                (value[b.index()], slope[b.index()]),
            ),
            Node::If(c, a, b) => {
                rules
                    .graph
                    .choose(value[c.index()], slope[a.index()], slope[b.index()])
            }
        };
        value.push(id);
        slope.push(d);
    }
    let root = match slope.last() {
        Some(root) => *root,
        None => rules.number(0.0),
    };
    prune(rules.graph.nodes(), root)
}

struct Rules {
    graph: Graph,
}

impl Rules {
    /// `value` is the node of `op(a)`, `da` the derivative of `a`.
    fn unary(&mut self, op: Unary, value: Id, a: Id, da: Id) -> Id {
        if self.is(da, 0.0) {
            return da;
        }
        match op {
            Unary::Neg => self.neg(da),
            Unary::Not | Unary::Sign | Unary::Floor | Unary::Ceil | Unary::Step => self.number(0.0),
            Unary::Sin => {
                let cosine = self.graph.unary(Unary::Cos, a);
                self.mul(cosine, da)
            }
            Unary::Cos => {
                let sine = self.graph.unary(Unary::Sin, a);
                let product = self.mul(sine, da);
                self.neg(product)
            }
            Unary::Tan => {
                let (one, square) = (self.number(1.0), self.mul(value, value));
                let factor = self.add(one, square);
                self.mul(factor, da)
            }
            Unary::Asin => {
                let root = self.cosine_of_asin(a);
                self.div(da, root)
            }
            Unary::Acos => {
                let root = self.cosine_of_asin(a);
                let quotient = self.div(da, root);
                self.neg(quotient)
            }
            Unary::Atan => {
                let (one, square) = (self.number(1.0), self.mul(a, a));
                let sum = self.add(one, square);
                self.div(da, sum)
            }
            Unary::Sinh => {
                let cosine = self.graph.unary(Unary::Cosh, a);
                self.mul(cosine, da)
            }
            Unary::Cosh => {
                let sine = self.graph.unary(Unary::Sinh, a);
                self.mul(sine, da)
            }
            Unary::Tanh => {
                // Not 1 - tanh^2, which cancels; and divided twice, since cosh^2 overflows early.
                let cosine = self.graph.unary(Unary::Cosh, a);
                let quotient = self.div(da, cosine);
                self.div(quotient, cosine)
            }
            Unary::Exp => self.mul(value, da),
            Unary::Ln => self.div(da, a),
            Unary::Log10 => {
                let ten = self.number(std::f64::consts::LN_10);
                let product = self.mul(ten, a);
                self.div(da, product)
            }
            Unary::Sqrt => {
                let two = self.number(2.0);
                let double = self.mul(two, value);
                self.div(da, double)
            }
            Unary::Cbrt => {
                let (three, square) = (self.number(3.0), self.mul(value, value));
                let triple = self.mul(three, square);
                self.div(da, triple)
            }
            Unary::Abs => {
                let sign = self.graph.unary(Unary::Sign, a);
                self.mul(sign, da)
            }
        }
    }

    /// `value` is the node of `op(a, b)`; each operand comes with its derivative.
    fn binary(&mut self, op: Binary, value: Id, (a, da): (Id, Id), (b, db): (Id, Id)) -> Id {
        if self.is(da, 0.0) && self.is(db, 0.0) {
            return self.number(0.0);
        }
        match op {
            Binary::Add => self.add(da, db),
            Binary::Sub => self.sub(da, db),
            Binary::Mul => {
                let (left, right) = (self.mul(da, b), self.mul(a, db));
                self.add(left, right)
            }
            Binary::Div => {
                let part = self.mul(value, db);
                let top = self.sub(da, part);
                self.div(top, b)
            }
            Binary::Pow => self.power(value, (a, da), (b, db)),
            Binary::Min => {
                let condition = self.graph.binary(Binary::Lt, a, b);
                self.graph.choose(condition, da, db)
            }
            Binary::Max => {
                let condition = self.graph.binary(Binary::Gt, a, b);
                self.graph.choose(condition, da, db)
            }
            Binary::Hypot => {
                // Quotients first: a*da may overflow where hypot does not.
                let (left, right) = (
                    self.graph.binary(Binary::Div, a, value),
                    self.graph.binary(Binary::Div, b, value),
                );
                let (left, right) = (self.mul(left, da), self.mul(right, db));
                self.add(left, right)
            }
            Binary::Atan2 => {
                let (left, right) = (self.mul(da, b), self.mul(a, db));
                let top = self.sub(left, right);
                let (aa, bb) = (self.mul(a, a), self.mul(b, b));
                let bottom = self.add(aa, bb);
                self.div(top, bottom)
            }
            Binary::And | Binary::Or => self.number(0.0),
            Binary::Lt | Binary::Le | Binary::Gt | Binary::Ge | Binary::Eq | Binary::Ne => {
                self.number(0.0)
            }
        }
    }

    /// `(a^b)' = b*a^(b-1)*a' + a^b*ln(a)*b'`, the last term zero where `a` is.
    fn power(&mut self, value: Id, (a, da): (Id, Id), (b, db): (Id, Id)) -> Id {
        let zero = self.number(0.0);
        let base_part = if self.is(da, 0.0) {
            zero
        } else {
            let one = self.number(1.0);
            let lower = self.sub(b, one);
            let power = self.graph.binary(Binary::Pow, a, lower);
            let factor = self.mul(b, power);
            self.mul(factor, da)
        };
        let exponent_part = if self.is(db, 0.0) {
            zero
        } else {
            let logarithm = self.graph.unary(Unary::Ln, a);
            let factor = self.mul(value, logarithm);
            let part = self.mul(factor, db);
            let vanishes = self.graph.binary(Binary::Eq, a, zero);
            self.graph.choose(vanishes, zero, part)
        };
        self.add(base_part, exponent_part)
    }

    /// `sqrt((1 - a)*(1 + a))`
    fn cosine_of_asin(&mut self, a: Id) -> Id {
        let one = self.number(1.0);
        let (minus, plus) = (self.sub(one, a), self.add(one, a));
        let product = self.mul(minus, plus);
        self.graph.unary(Unary::Sqrt, product)
    }

    fn number(&mut self, value: f64) -> Id {
        self.graph.number(value)
    }

    fn is(&self, id: Id, value: f64) -> bool {
        self.graph.as_number(id) == Some(value)
    }

    /// The operand of a negation.
    fn negated(&self, id: Id) -> Option<Id> {
        match self.graph.node(id) {
            Node::Unary(Unary::Neg, inner) => Some(inner),
            _ => None,
        }
    }

    fn neg(&mut self, a: Id) -> Id {
        self.graph.unary(Unary::Neg, a)
    }

    fn add(&mut self, a: Id, b: Id) -> Id {
        if self.is(a, 0.0) {
            b
        } else if self.is(b, 0.0) {
            a
        } else if let Some(inner) = self.negated(b) {
            self.graph.binary(Binary::Sub, a, inner)
        } else {
            self.graph.binary(Binary::Add, a, b)
        }
    }

    fn sub(&mut self, a: Id, b: Id) -> Id {
        if self.is(b, 0.0) {
            a
        } else if self.is(a, 0.0) {
            self.neg(b)
        } else if let Some(inner) = self.negated(b) {
            self.graph.binary(Binary::Add, a, inner)
        } else {
            self.graph.binary(Binary::Sub, a, b)
        }
    }

    fn mul(&mut self, a: Id, b: Id) -> Id {
        if self.is(a, 0.0) || self.is(b, 0.0) {
            self.number(0.0)
        } else if self.is(a, -1.0) {
            self.neg(b)
        } else if self.is(b, -1.0) {
            self.neg(a)
        } else {
            self.graph.binary(Binary::Mul, a, b)
        }
    }

    fn div(&mut self, a: Id, b: Id) -> Id {
        if self.is(a, 0.0) {
            return a;
        }
        self.graph.binary(Binary::Div, a, b)
    }
}
