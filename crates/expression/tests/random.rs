//! Random formulas: printed, parsed and evaluated in batches, against an interpreter that walks the tree.

use expression::{Expression, Joint, Scope};
use proptest::prelude::*;

#[derive(Debug, Clone)]
enum Tree {
    Number(f64),
    Name(&'static str),
    Prefix(char, Box<Tree>),
    Infix(Box<Tree>, &'static str, Box<Tree>),
    Call(&'static str, Vec<Tree>),
}

use Tree::{Call, Infix, Name, Number, Prefix};

/// How tightly the outermost operation binds.
fn level(tree: &Tree) -> u8 {
    match tree {
        Infix(_, "||", _) => 1,
        Infix(_, "&&", _) => 2,
        Infix(_, "<" | "<=" | ">" | ">=" | "==" | "!=", _) => 3,
        Infix(_, "+" | "-", _) => 4,
        Infix(_, "*" | "/", _) => 5,
        Prefix(..) => 6,
        Infix(..) => 7,
        Number(_) | Name(_) | Call(..) => 8,
    }
}

/// As text with no more parentheses than needed.
fn print(tree: &Tree) -> String {
    let at_least = |tree: &Tree, least: u8| {
        let text = print(tree);
        if level(tree) < least {
            format!("({text})")
        } else {
            text
        }
    };
    match tree {
        Number(value) => format!("{value:?}"),
        Name(name) => (*name).to_owned(),
        Prefix(op, a) => format!("{op}{}", at_least(a, 6)),
        Infix(a, "^", b) => format!("{}^{}", at_least(a, 8), at_least(b, 6)),
        Infix(a, op, b) => {
            let own = level(tree);
            let left = if own == 3 { own + 1 } else { own };
            format!("{} {op} {}", at_least(a, left), at_least(b, own + 1))
        }
        Call(name, arguments) => {
            let arguments: Vec<String> = arguments.iter().map(print).collect();
            format!("{name}({})", arguments.join(", "))
        }
    }
}

fn power(base: f64, exponent: &Tree, value: f64) -> f64 {
    let constant = match exponent {
        Number(_) => true,
        Prefix('-', inner) => matches!(**inner, Number(_)),
        _ => false,
    };
    if !constant || value.fract() != 0.0 {
        return base.powf(value);
    }
    let mut product = None;
    let mut square = base;
    let mut left = value.abs() as u32;
    while left > 0 {
        if left % 2 == 1 {
            product = Some(product.map_or(square, |p: f64| p * square));
        }
        square *= square;
        left /= 2;
    }
    match product {
        None => 1.0,
        Some(product) if value < 0.0 => 1.0 / product,
        Some(product) => product,
    }
}

/// The value by a walk through the tree.
fn interpret(tree: &Tree, point: [f64; 3]) -> f64 {
    let value = |tree: &Tree| interpret(tree, point);
    let truth = |holds: bool| f64::from(u8::from(holds));
    match tree {
        Number(value) => *value,
        Name("x") => point[0],
        Name("y") => point[1],
        Name("region") => point[2],
        Name("pi") => std::f64::consts::PI,
        Name(_) => std::f64::consts::E,
        Prefix('-', a) => -value(a),
        Prefix('!', a) => truth(value(a) == 0.0),
        Prefix(_, a) => value(a),
        Infix(a, "&&", b) => truth(value(a) != 0.0 && value(b) != 0.0),
        Infix(a, "||", b) => truth(value(a) != 0.0 || value(b) != 0.0),
        Infix(a, "^", b) => power(value(a), b, value(b)),
        Infix(a, op, b) => {
            let (a, b) = (value(a), value(b));
            match *op {
                "+" => a + b,
                "-" => a - b,
                "*" => a * b,
                "/" => a / b,
                "<" => truth(a < b),
                "<=" => truth(a <= b),
                ">" => truth(a > b),
                ">=" => truth(a >= b),
                "==" => truth(a == b),
                _ => truth(a != b),
            }
        }
        Call("if", parts) => value(if value(&parts[0]) != 0.0 {
            &parts[1]
        } else {
            &parts[2]
        }),
        Call(name, arguments) => {
            let arguments: Vec<f64> = arguments.iter().map(value).collect();
            let a = arguments[0];
            let pick = |first: fn(f64, f64) -> bool| {
                arguments[1..].iter().fold(a, |one, two| {
                    if one.is_nan() || first(one, *two) {
                        one
                    } else {
                        *two
                    }
                })
            };
            match *name {
                "sin" => a.sin(),
                "cos" => a.cos(),
                "tan" => a.tan(),
                "asin" => a.asin(),
                "acos" => a.acos(),
                "atan" => a.atan(),
                "sinh" => a.sinh(),
                "cosh" => a.cosh(),
                "tanh" => a.tanh(),
                "exp" => a.exp(),
                "ln" | "log" => a.ln(),
                "log10" => a.log10(),
                "sqrt" => a.sqrt(),
                "cbrt" => a.cbrt(),
                "abs" => a.abs(),
                "sign" if a > 0.0 => 1.0,
                "sign" if a < 0.0 => -1.0,
                "sign" => a,
                "floor" => a.floor(),
                "ceil" => a.ceil(),
                "step" => truth(a > 0.0),
                "atan2" => a.atan2(arguments[1]),
                "hypot" => a.hypot(arguments[1]),
                "min" => pick(|one, two| one < two),
                "max" => pick(|one, two| one > two),
                unknown => panic!("no function {unknown}"),
            }
        }
    }
}

const UNARY: [&str; 21] = [
    "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "ln", "log",
    "log10", "sqrt", "cbrt", "abs", "sign", "floor", "ceil", "step", "step",
];
const INFIX: [&str; 14] = [
    "+", "-", "*", "/", "+", "*", "<", "<=", ">", ">=", "==", "!=", "&&", "||",
];

fn number() -> impl Strategy<Value = Tree> {
    prop_oneof![
        prop::sample::select(vec![0.0, 1.0, 2.0, 0.5, 3.0, 1e-3, 1e300, 5e-324]),
        0.0..10.0f64,
    ]
    .prop_map(Number)
}

fn exponent() -> impl Strategy<Value = Tree> {
    let constant = prop::sample::select(vec![0.0, 1.0, 2.0, 3.0, 5.0, 6.0, 16.0, 47.0, 0.5, 1.5]);
    (constant, any::<bool>()).prop_map(|(value, negative)| {
        if negative {
            Prefix('-', Box::new(Number(value)))
        } else {
            Number(value)
        }
    })
}

fn tree() -> impl Strategy<Value = Tree> {
    let leaf = prop_oneof![
        number(),
        prop::sample::select(vec!["x", "y", "x", "y", "region", "pi", "e"]).prop_map(Name),
    ];
    leaf.prop_recursive(7, 80, 4, |inner| {
        let boxed = || inner.clone().prop_map(Box::new);
        let many = prop::collection::vec(inner.clone(), 2..5);
        prop_oneof![
            8 => (boxed(), prop::sample::select(INFIX.to_vec()), boxed()).prop_map(|(a, op, b)| Infix(a, op, b)),
            2 => (prop::sample::select(vec!['-', '+', '!']), boxed()).prop_map(|(op, a)| Prefix(op, a)),
            2 => (boxed(), exponent()).prop_map(|(a, n)| Infix(a, "^", Box::new(n))),
            // Never a constant, whatever is folded: sums with `x` stay.
            1 => (boxed(), boxed()).prop_map(|(a, b)| {
                Infix(a, "^", Box::new(Infix(b, "+", Box::new(Name("x")))))
            }),
            4 => (prop::sample::select(UNARY.to_vec()), inner.clone()).prop_map(|(name, a)| Call(name, vec![a])),
            4 => (inner.clone(), inner.clone(), inner.clone()).prop_map(|(c, a, b)| Call("if", vec![c, a, b])),
            1 => (prop::sample::select(vec!["min", "max"]), many).prop_map(|(name, list)| Call(name, list)),
            1 => (prop::sample::select(vec!["atan2", "hypot"]), inner.clone(), inner.clone())
                .prop_map(|(name, a, b)| Call(name, vec![a, b])),
        ]
    })
}

/// 600 points, so that a second block is begun, with awkward values among them.
fn points() -> Vec<[f64; 3]> {
    let awkward = [
        0.0,
        -0.0,
        1.0,
        -1.0,
        1e300,
        -1e-300,
        f64::INFINITY,
        f64::NAN,
        5e-324,
    ];
    (0..600usize)
        .map(|k| {
            let spread = |ratio: f64| 4.0 * (k as f64 * ratio).fract() - 2.0;
            let (mut x, mut y) = (spread(0.754_877), spread(0.569_84));
            if k % 5 == 0 {
                x = awkward[k / 5 % awkward.len()];
            }
            if k % 7 == 0 {
                y = awkward[k / 7 % awkward.len()];
            }
            [x, y, (k % 3) as f64]
        })
        .collect()
}

/// Terms of sums, with awkward factors.
const POOL: [&str; 9] = [
    "x*y",
    "3*x*y/7",
    "x^2/3",
    "36*x^2*y^2",
    "x^4*y^2*0.1",
    "y/12",
    "sin(x)*y",
    "x",
    "(x*y + 2)*y",
];

proptest! {
    #![proptest_config(ProptestConfig { cases: 3000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn batches_points_and_the_walk_agree_to_the_bit(tree in tree()) {
        let source = print(&tree);
        let expression = match Expression::parse(&source, &Scope::new()) {
            Ok(expression) => expression,
            Err(error) => panic!("{source}: {error}"),
        };
        let points = points();
        let [x, y, region] = [0, 1, 2].map(|k| points.iter().map(|point| point[k]).collect::<Vec<_>>());
        let mut batch = vec![7e77; points.len()];
        expression.eval(&x, &y, &region, &mut batch);
        for (point, value) in points.into_iter().zip(batch) {
            let alone = expression.eval_at(point[0], point[1], point[2]);
            let walked = interpret(&tree, point);
            // The sign and payload of a NaN are nobody's business.
            let same = |a: f64, b: f64| a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan());
            prop_assert!(same(value, alone), "{source} at {point:?}: {value} in a batch, {alone} alone");
            prop_assert!(same(value, walked), "{source} at {point:?}: {value}, not {walked}");
        }
        if let Some(constant) = expression.constant() {
            let walked = interpret(&tree, [0.3, 0.4, 1.0]);
            prop_assert!(constant == walked || (constant.is_nan() && walked.is_nan()), "{source}: {constant}");
        }
    }

    #[test]
    fn joined_formulas_give_the_bits_of_each(trees in (tree(), tree(), tree(), tree(), tree()), one in any::<bool>()) {
        // The same condition in both, and parts in common.
        let (c, a, b, d, e) = trees;
        let choice = |c: &Tree, a: Tree, b: Tree| Call("if", vec![c.clone(), a, b]);
        let sum = |a: &Tree, b: &Tree| Infix(Box::new(a.clone()), "+", Box::new(b.clone()));
        let first = choice(&c, sum(&a, &d), sum(&b, &c));
        let second = if one {
            sum(&a, &choice(&c, choice(&d, a.clone(), b.clone()), e.clone()))
        } else {
            choice(&c, sum(&d, &a), e.clone())
        };
        let sources = [&first, &second, &d].map(print);
        let parsed = sources.each_ref().map(|source| Expression::parse(source, &Scope::new()));
        let [Ok(first), Ok(second), Ok(third)] = parsed else {
            panic!("{sources:?}");
        };
        let points = points();
        // Points in order, and points that are nearly alike.
        for (range, stretch) in [(0..600, 1.0), (3..4, 1.0), (10..43, 1e-3)] {
            let [x, y, region] = [0, 1, 2].map(|k| {
                points[range.clone()].iter().map(|point| 0.4 + stretch * point[k]).collect::<Vec<_>>()
            });
            let mut together = [0, 1, 2].map(|_| vec![7e77; x.len()]);
            let joint = Joint::new([&first, &second, &third]);
            let finite = joint.eval(&x, &y, &region, together.each_mut().map(|out| &mut out[..]));
            prop_assert_eq!(finite, together.iter().flatten().all(|value| value.is_finite()));
            for ((own, expression), source) in together.iter().zip([&first, &second, &third]).zip(&sources) {
                let mut alone = vec![7e77; x.len()];
                let finite = expression.eval(&x, &y, &region, &mut alone);
                prop_assert_eq!(finite, alone.iter().all(|value| value.is_finite()));
                for (k, (one, two)) in own.iter().zip(&alone).enumerate() {
                    let same = one.to_bits() == two.to_bits() || (one.is_nan() && two.is_nan());
                    prop_assert!(same, "{source} at {} {}: {one} joined with {sources:?}, {two} alone", x[k], y[k]);
                }
            }
        }
    }

    #[test]
    fn joined_sums_give_the_bits_of_each(order in prop::collection::vec((0..POOL.len(), any::<bool>(), 0..7), 2..12)) {
        // One sum has the terms in this order, and the other one most of them, some with the other sign or elsewhere.
        let (mut first, mut second) = ("x - 7".to_owned(), "y".to_owned());
        let mut late = String::new();
        for (term, minus, how) in order {
            let [own, other] = if minus { ['-', '+'] } else { ['+', '-'] };
            let term = POOL[term];
            first += &format!(" {own} {term}");
            match how {
                0 => late += &format!(" {other} {term}"),
                1 => second += &format!(" {own} sin(y)/{term}"),
                2 | 3 => second += &format!(" {other} {term}"),
                4 => second = format!("{term} {own} ({second})"),
                _ => second += &format!(" {own} {term}"),
            }
        }
        let sources = [first, second + &late];
        let parsed = sources.each_ref().map(|source| Expression::parse(source, &Scope::new()));
        let [Ok(first), Ok(second)] = parsed else {
            panic!("{sources:?}");
        };
        let points = points();
        let [x, y] = [0, 1].map(|k| points.iter().map(|point| point[k]).collect::<Vec<_>>());
        let mut together = [0, 1].map(|_| vec![7e77; x.len()]);
        Joint::new([&first, &second]).eval(&x, &y, &[], together.each_mut().map(|out| &mut out[..]));
        for (own, expression) in together.iter().zip([&first, &second]) {
            for (k, value) in own.iter().enumerate() {
                let alone = expression.eval_at(x[k], y[k], 0.0);
                let same = value.to_bits() == alone.to_bits() || (value.is_nan() && alone.is_nan());
                prop_assert!(same, "{sources:?} at {} {}: {value} joined, {alone} alone", x[k], y[k]);
            }
        }
    }
}
