//! A formula ready for use.

use crate::compile::compile;
use crate::derive;
use crate::error::ParseError;
use crate::eval;
use crate::function::Binary;
use crate::graph::{Graph, Id, Node, prune, renumber};
use crate::lower::lower;
use crate::parser;
use crate::program::Program;
use crate::scope::Scope;

/// A variable to differentiate by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Variable {
    /// The first coordinate, `x`.
    X,
    /// The second coordinate, `y`.
    Y,
}

impl Variable {
    fn node(self) -> Node {
        match self {
            Self::X => Node::X,
            Self::Y => Node::Y,
        }
    }
}

/// A formula of `x`, `y` and `region`, parsed, folded and compiled. Evaluation takes `&self` and may be called
/// from any number of threads.
#[derive(Debug, Clone)]
pub struct Expression {
    source: String,
    /// What was written, with parameters put in and constants folded; the root is the last.
    nodes: Vec<Node>,
    program: Program,
}

impl Expression {
    /// Parses a formula; the names in it are those of the language and of `scope`.
    ///
    /// # Errors
    ///
    /// [`ParseError`], with the place in `source`, when it is no formula or uses an unknown name.
    pub fn parse(source: &str, scope: &Scope) -> Result<Self, ParseError> {
        let (graph, root) = parser::parse(source, scope, true)?;
        Ok(Self::build(source.to_owned(), prune(graph.nodes(), root)))
    }

    /// Parses a formula without `x`, `y` and `region` and works it out.
    ///
    /// # Errors
    ///
    /// As [`Expression::parse`], and when one of those three is used or the value is not finite.
    pub fn parse_constant(source: &str, scope: &Scope) -> Result<f64, ParseError> {
        let (graph, root) = parser::parse(source, scope, false)?;
        let value =
            Self::build(source.to_owned(), prune(graph.nodes(), root)).eval_at(0.0, 0.0, 0.0);
        if value.is_finite() {
            Ok(value)
        } else {
            let message = format!("the value is {value}, not a finite number");
            Err(ParseError::new(0..source.len(), message))
        }
    }

    /// The formula that is a number everywhere.
    pub fn number(value: f64) -> Self {
        Self::build(value.to_string(), vec![Node::Number(value)])
    }

    fn build(source: String, nodes: Vec<Node>) -> Self {
        let (graph, roots) = lower(&nodes, &[nodes.len() - 1]);
        let program = compile(&graph, &roots);
        Self {
            source,
            nodes,
            program,
        }
    }

    /// The same formula in other units: of coordinates that are multiplied by `length` before they go into it, with a value that is multiplied by one of the
    /// `factors` and then by the other.
    pub fn in_units(&self, length: f64, factors: [f64; 2]) -> Self {
        let mut graph = Graph::default();
        let length = graph.number(length);
        let mut moved = Vec::with_capacity(self.nodes.len());
        for node in &self.nodes {
            let id = graph.add_node(renumber(*node, &moved));
            moved.push(match node {
                Node::X | Node::Y => graph.binary(Binary::Mul, id, length),
                _ => id,
            });
        }
        let mut root = moved.last().copied().unwrap_or(length);
        for factor in factors {
            let factor = graph.number(factor);
            root = graph.binary(Binary::Mul, root, factor);
        }
        Self::build(self.source.clone(), prune(graph.nodes(), root))
    }

    /// The text it was parsed from; for a derivative `d/dx (text)`, which is not meant to be parsed.
    pub fn source(&self) -> &str {
        &self.source
    }

    /// The value, when it depends on none of `x`, `y` and `region`.
    pub fn constant(&self) -> Option<f64> {
        match self.nodes.last() {
            Some(Node::Number(value)) => Some(*value),
            _ => None,
        }
    }

    /// Whether the value may depend on `region`.
    pub fn uses_region(&self) -> bool {
        self.nodes.contains(&Node::Region)
    }

    /// Whether the value may depend on the coordinate.
    pub fn uses(&self, variable: Variable) -> bool {
        self.nodes.contains(&variable.node())
    }

    /// Evaluates at the points `(x[i], y[i])` of the regions `region[i]` into `out[i]`. `region` may be empty: then it
    /// is 0 everywhere. Values that are not finite are written as they are; the answer is whether all are finite.
    ///
    /// Nothing is allocated once the thread has evaluated a formula as large; some hundred points at a time cost least, best a multiple of 16.
    ///
    /// # Panics
    ///
    /// When the lengths differ.
    pub fn eval(&self, x: &[f64], y: &[f64], region: &[f64], out: &mut [f64]) -> bool {
        checked(&self.program, x, y, region, [out])
    }

    /// The value at one point; [`Expression::eval`] gives the same bits for less work a point.
    pub fn eval_at(&self, x: f64, y: f64, region: f64) -> f64 {
        let mut out = [0.0];
        eval::evaluate(&self.program, &[x], &[y], &[region], [&mut out]);
        out[0]
    }

    /// The partial derivative, as a formula. Branches of `if` are differentiated as they stand; conditions, `step`,
    /// `sign`, `floor`, `ceil` and `region` count as constant, `abs` gives `sign`, and `min` and `max` give the
    /// derivative of the operand they pick.
    pub fn derivative(&self, variable: Variable) -> Self {
        let name = match variable {
            Variable::X => "x",
            Variable::Y => "y",
        };
        let nodes = derive::derivative(&self.nodes, variable.node());
        Self::build(format!("d/d{name} ({})", self.source), nodes)
    }
}

/// Several formulas that are evaluated at the same points: what they have in common is computed once.
#[derive(Debug, Clone)]
pub struct Joint<const N: usize> {
    program: Program,
}

impl<const N: usize> Joint<N> {
    /// Joins formulas.
    pub fn new(formulas: [&Expression; N]) -> Self {
        let mut graph = Graph::default();
        let roots = formulas.map(|formula| {
            let mut moved: Vec<Id> = Vec::with_capacity(formula.nodes.len());
            for node in &formula.nodes {
                moved.push(graph.add_node(renumber(*node, &moved)));
            }
            moved[moved.len() - 1].index()
        });
        let (graph, roots) = lower(graph.nodes(), &roots);
        let program = compile(&graph, &roots);
        Self { program }
    }

    /// What [`Expression::eval`] gives for each of the formulas, bit for bit; the answer is whether all values of all are finite.
    ///
    /// # Panics
    ///
    /// When the lengths differ.
    pub fn eval(&self, x: &[f64], y: &[f64], region: &[f64], out: [&mut [f64]; N]) -> bool {
        checked(&self.program, x, y, region, out)
    }
}

fn checked<const N: usize>(
    program: &Program,
    x: &[f64],
    y: &[f64],
    region: &[f64],
    out: [&mut [f64]; N],
) -> bool {
    for out in &out {
        assert!(
            x.len() == out.len() && y.len() == out.len(),
            "as many values of `x` ({}) and `y` ({}) as results ({})",
            x.len(),
            y.len(),
            out.len()
        );
    }
    assert!(
        region.is_empty() || region.len() == x.len(),
        "as many values of `region` ({}) as results ({}), or none",
        region.len(),
        x.len()
    );
    eval::evaluate(program, x, y, region, out)
}
