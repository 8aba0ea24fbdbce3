//! From what was written to what is executed: integer powers and quotients by powers of two become products, `&&` and
//! `||` become choices.

use crate::function::{Binary, integer_exponent, integer_power};
use crate::graph::{Graph, Id, Node, renumber};
use crate::quotient::exact_reciprocal;

/// The graph to compile, and its roots; `roots` are the places of those in `nodes`.
pub(crate) fn lower(nodes: &[Node], roots: &[usize]) -> (Graph, Vec<Id>) {
    let mut graph = Graph::default();
    let mut moved: Vec<Id> = Vec::with_capacity(nodes.len());
    for node in nodes {
        let id = match renumber(*node, &moved) {
            Node::Binary(Binary::Pow, a, b) => power(&mut graph, a, b),
            Node::Binary(Binary::Div, a, b) => quotient(&mut graph, a, b),
            Node::Binary(Binary::And, a, b) => {
                let (then, other) = (graph.truth(b), graph.number(0.0));
                graph.choose(a, then, other)
            }
            Node::Binary(Binary::Or, a, b) => {
                let (then, other) = (graph.number(1.0), graph.truth(b));
                graph.choose(a, then, other)
            }
            node => graph.add_node(node),
        };
        moved.push(id);
    }
    let roots = roots.iter().map(|root| moved[*root]).collect();
    (graph, roots)
}

fn quotient(graph: &mut Graph, a: Id, b: Id) -> Id {
    match graph.as_number(b).and_then(exact_reciprocal) {
        Some(reciprocal) => {
            let reciprocal = graph.number(reciprocal);
            graph.binary(Binary::Mul, a, reciprocal)
        }
        None => graph.binary(Binary::Div, a, b),
    }
}

fn power(graph: &mut Graph, a: Id, b: Id) -> Id {
    let Some(n) = graph.as_number(b).and_then(integer_exponent) else {
        return graph.binary(Binary::Pow, a, b);
    };
    let one = graph.number(1.0);
    let size = n.saturating_abs();
    let product =
        integer_power(a, size, |s, t| graph.binary(Binary::Mul, s, t), |t| t).unwrap_or(one);
    if n < 0 {
        graph.binary(Binary::Div, one, product)
    } else {
        product
    }
}
