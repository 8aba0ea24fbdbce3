use super::*;
use crate::function::Unary;
use crate::lower::lower;
use crate::program::{Op, Operand, Program};
use crate::scope::Scope;

fn program(source: &str) -> Program {
    together(&[source])
}

fn together(sources: &[&str]) -> Program {
    let mut all = Graph::default();
    let mut roots = Vec::new();
    for source in sources {
        let (graph, root) = crate::parser::parse(source, &Scope::new(), true).unwrap();
        let mut moved: Vec<Id> = Vec::new();
        for node in crate::graph::prune(graph.nodes(), root) {
            moved.push(all.add_node(crate::graph::renumber(node, &moved)));
        }
        roots.push(moved[moved.len() - 1].index());
    }
    let (graph, roots) = lower(all.nodes(), &roots);
    compile(&graph, &roots)
}

/// The instructions as one letter each: `s`, `c` sine and cosine, `p` a product, `t` other terms, `+` sums with them, `.`
/// others, `(|)=` a choice that
/// splits, `?` one that does not.
fn shape(source: &str) -> String {
    letters(&program(source))
}

fn letters(program: &Program) -> String {
    let letter = |op: &Op| match op {
        Op::Unary(Unary::Sin, ..) => 's',
        Op::Unary(Unary::Cos, ..) => 'c',
        Op::Binary(Binary::Mul, ..) => 'p',
        Op::Unary(..) | Op::Binary(..) => '.',
        Op::Term(_, _, None) => 't',
        Op::Term(..) => '+',
        Op::Both(..) => '*',
        Op::Select(..) => '?',
        Op::Pick(..) => '=',
        Op::Split(..) => '(',
        Op::Else(_) => '|',
        Op::Join => ')',
    };
    program.ops.iter().map(letter).collect()
}

#[test]
fn common_subexpressions_are_computed_once() {
    assert_eq!(shape("sin(x*y) + sin(y*x)"), "ps.");
    assert_eq!(shape("x^2 + x^4 + x^6"), "pp.+");
    assert_eq!(shape("x^2 + 1/x^2"), "p..");
}

#[test]
fn work_of_a_branch_stays_in_it() {
    assert_eq!(shape("if(x > 0, sin(x), cos(x))"), ".(s|c)=");
    assert_eq!(shape("if(x > 0, sin(x), 2)"), ".(s|)=");
    assert_eq!(shape("x > 0 && sin(x) > 0"), ".(s.|)=");
    // Computed before: served inside. Computed inside: computed again outside and in the other branch.
    assert_eq!(shape("sin(x)*if(x > 0, sin(x)^2, cos(x))"), "s.(p|c)=p");
    assert_eq!(
        shape("if(x > 0, sin(x)^2, sin(x)*cos(x))*sin(x)"),
        ".(sp|scp)=sp"
    );
    assert_eq!(
        shape("if(x > 0, if(y > 0, sin(x), cos(x)), sin(y))"),
        ".(.(s|c)=|s)="
    );
}

#[test]
fn choices_by_the_same_condition_split_once() {
    let shape = |sources: &[&str]| letters(&together(sources));
    let [first, second] = [
        "if(x > 0, sin(x), cos(x))*y + 1",
        "2 - if(x > 0, sin(x)*y, x)/3",
    ];
    assert_eq!(shape(&[first, second]), ".(sp|c)==++");
    // Those of a branch too, and a condition that is needed in it only there.
    let [first, second] = [
        "if(x > 0, if(y > 0, sin(x), cos(x)), 1)",
        "if(x > 0, if(y > 0, sin(y), cos(y)), if(y > 0, exp(x), 2))",
    ];
    assert_eq!(shape(&[first, second]), ".(.(ss|cc)==|.(.|)=)==");
    // Not by another condition.
    assert_eq!(
        shape(&["if(x > 0, sin(x), y)", "if(x >= 0, sin(x), y)"]),
        ".(s|)=.(s|)="
    );
}

#[test]
fn a_last_product_with_a_number_goes_with_the_result() {
    let program = program("sin(x)*3");
    assert_eq!(letters(&program), "s");
    assert_eq!(program.results[0].factor, 3.0);
    let both = together(&["sin(x)*3", "3*sin(x)/7"]);
    assert_eq!(letters(&both), "spt");
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
    assert_eq!(shape("y + x*y/4 - (5*x)*sin(y)"), "p+s+");
    assert_eq!(shape("2*x*y/3"), "tt");
    // Computed right before, whatever the order.
    assert_eq!(shape("x*y + sin(x)"), "s+");
    assert_eq!(shape("(2*x)*(y*y)"), "pt");
    // Needed twice.
    assert_eq!(shape("x*y + sin(x*y)"), "ps.");
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
        let targets: Vec<u32> = op.targets_mut().map(|target| *target).collect();
        for operand in op.operands_mut() {
            assert!(
                targets
                    .iter()
                    .all(|target| *operand != Operand::Register(*target))
            );
        }
    }
}

#[test]
fn terms_of_two_sums_are_computed_for_both() {
    let both = |sources: &[&str]| letters(&together(sources));
    // Also where the second sum must come forward for it, and in the other order.
    assert_eq!(both(&["x + y*y/3", "y - y*y/3"]), "p*");
    assert_eq!(both(&["sin(x) - x*y", "cos(y) + x*y"]), "sc*");
    assert_eq!(both(&["sin(x) - x*y + x*x", "cos(y) + x*y - x*x"]), "sc**");
    assert_eq!(both(&["x + y*y/3 - x*y*4", "y + x*y*4 + y*y/3"]), "pt.p*.");
    // Not of one sum and something else, of three, of the same sum twice, of a result, of sums that need each other, or across branches.
    assert_eq!(both(&["x + x*y", "sin(x*y)"]), "p.s");
    assert_eq!(both(&["x + x*y", "y + x*y", "3 - x*y"]), "p...");
    assert_eq!(both(&["x*y + x*y"]), "p.");
    assert_eq!(both(&["x + x*y", "y - x*y", "x*y"]), "p..");
    assert_eq!(both(&["(x + x*y) - x*y"]), "p..");
    assert_eq!(
        both(&["x + x*y", "if(x > 0, sin(x + y + x*y), x)"]),
        "p..(..s|)="
    );
}
