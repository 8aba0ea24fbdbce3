//! Derivatives against difference quotients, against gradients worked out elsewhere, and where there is no derivative.

use expression::{Expression, Scope, Variable};
use proptest::prelude::*;

mod fields;

fn parse(source: &str) -> Expression {
    match Expression::parse(source, &Scope::new()) {
        Ok(expression) => expression,
        Err(error) => panic!("{source}: {error}"),
    }
}

/// The difference quotient of order eight.
fn difference(f: impl Fn(f64) -> f64, h: f64) -> f64 {
    let weights = [4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0];
    let terms = weights.iter().zip(1..).map(|(weight, k)| {
        let step = f64::from(k) * h;
        weight * (f(step) - f(-step))
    });
    terms.sum::<f64>() / h
}

/// Both partial derivatives at a point, beside the difference quotients with step `h`.
fn compare(expression: &Expression, x: f64, y: f64, h: f64) -> [(f64, f64); 2] {
    let by_x = difference(|step| expression.eval_at(x + step, y, 3.0), h);
    let by_y = difference(|step| expression.eval_at(x, y + step, 3.0), h);
    let slope = |variable| expression.derivative(variable).eval_at(x, y, 3.0);
    [(slope(Variable::X), by_x), (slope(Variable::Y), by_y)]
}

#[test]
fn every_function_and_operator() {
    let sources = [
        "x*y + 3*x - y/7 + 2",
        "(x - y)*(x + y)*(1 - x*y)",
        "x/y",
        "(1 + x*y)/(3 + x - y)",
        "-x*-y",
        "sin(2*x*y)",
        "cos(x^2 - y)",
        "tan(x*y)",
        "asin(x*y/2)",
        "acos(x*y/2)",
        "atan(3*x - y)",
        "atan2(y, x)",
        "atan2(x*y, x + 3*y)",
        "atan2(-x*y, y - 3)",
        "sinh(x + y)",
        "cosh(x - 2*y)",
        "tanh(x*y)",
        "exp(x*y - y)",
        "ln(x + y^2)",
        "log(3*x*y)",
        "log10(x + y)",
        "sqrt(x + 2*y)",
        "cbrt(x*y)",
        "cbrt(-x*y)",
        "abs(x*y)",
        "abs(-x - y)*x",
        "hypot(x, 2*y)",
        "hypot(x - 2, x*y)",
        "sign(x - 5)*x*y",
        "floor(x + 5.05)*x*y",
        "ceil(y + 5.05)*x*y",
        "step(x)*x*y^2 + step(-x)*y",
        "min(x, y, x*y)*x",
        "max(x, y, x*y)*x",
        "min(x^2, x)",
        "if(x > y, x*y, x^3 - y)",
        "if(x > y && x < 4, x*y, 2)",
        "(x < y)*x + (x >= y)*y*x",
        "!x*y + (x && y)*x + (0 || x - x)*y",
        "region*x^2*y",
        "x^2",
        "(x*y)^3",
        "(x - y)^7",
        "x^-2*y",
        "(x + y)^0.5",
        "(x + y)^-1.5",
        "2^(x*y)",
        "x^y",
        "(x + y)^(x*y)",
        "x^region",
        "(x*y)^(y/3)",
        "x^1*y^0",
    ];
    for source in sources {
        let expression = parse(source);
        for (x, y) in [(0.7, 0.3), (0.4, 0.9), (0.83, 0.61)] {
            for (slope, quotient) in compare(&expression, x, y, 4e-3) {
                let scale = 1.0 + quotient.abs() + expression.eval_at(x, y, 3.0).abs();
                assert!(
                    (slope - quotient).abs() < 1e-10 * scale,
                    "{source} at {x}, {y}: {slope}, not {quotient}"
                );
            }
        }
    }
}

#[test]
fn gradients_agree_with_those_worked_out_elsewhere() {
    let table = [
        ("disk", fields::DISK_LOWER, 1e-12),
        ("disk, Riesz", fields::DISK_RIESZ, 1e-12),
        ("square", fields::SQUARE, 1e-12),
        ("series", fields::SERIES, 1e-12),
        ("corner", fields::CORNER, 1e-12),
        ("jump", fields::JUMP, 1e-12),
    ];
    for (name, field, tolerance) in table {
        let value = parse(field.value);
        let pairs = [(Variable::X, field.x), (Variable::Y, field.y)];
        for (variable, expected) in pairs {
            let (slope, expected) = (value.derivative(variable), parse(expected));
            let mut largest = 0.0f64;
            for k in 1..2000 {
                let k = f64::from(k);
                let x = 2.0 * (k * 0.754_877_666_246_692_8).fract() - 1.0;
                let y = 2.0 * (k * 0.569_840_290_998_053_3).fract() - 1.0;
                let (slope, expected) = (slope.eval_at(x, y, 0.0), expected.eval_at(x, y, 0.0));
                assert!(
                    (slope - expected).abs() <= tolerance * (1.0 + expected.abs()),
                    "{name} {variable:?} at {x}, {y}: {slope}, not {expected}"
                );
                largest = largest.max(slope.abs());
            }
            assert!(largest > 1e-3, "{name} {variable:?} is not zero");
        }
    }
}

#[test]
fn a_vanishing_factor_takes_an_infinite_one_with_it() {
    // ln(x^2) is infinite at 0; the parts must not turn into 0*infinity.
    let at_zero = |source: &str| parse(source).derivative(Variable::Y).eval_at(0.0, 2.0, 0.0);
    assert_eq!(at_zero("ln(x)*step(x - 1) + y"), 1.0);
    assert_eq!(at_zero("ln(x)*sign(x) + y^2"), 4.0);
    assert_eq!(at_zero("if(x > 0, ln(x)*y, 3*y)"), 3.0);
    let by_x = |source: &str, x: f64| parse(source).derivative(Variable::X).eval_at(x, 0.0, 0.0);
    assert_eq!(by_x("if(x > 0, sqrt(x), x)", 0.0), 1.0);
    assert_eq!(by_x("if(x > 0, x^1.5, 0)", 0.0), 0.0);
    assert_eq!(by_x("x^3", 0.0), 0.0);
    assert_eq!(by_x("x^1", 0.0), 1.0);
    assert_eq!(by_x("x^2 + x", 0.0), 1.0);
    assert_eq!(by_x("(x*0)^(x + 2)", 0.0), 0.0);
    assert_eq!(by_x("tanh(x)", 800.0), 0.0);
    let slanted = by_x("hypot(x, 1e200)", 1e200) - std::f64::consts::FRAC_1_SQRT_2;
    assert!(slanted.abs() < 1e-15);
}

#[test]
fn what_is_flat_has_no_slope() {
    for source in [
        "step(x)",
        "sign(x)",
        "floor(7*x)",
        "ceil(x)",
        "region",
        "x < y",
        "x && y",
        "!x",
        "y^2 + 3",
        "if(x > 0, 1, 2)",
        "x^0",
        "7",
    ] {
        let slope = parse(source).derivative(Variable::X);
        assert_eq!(slope.constant(), Some(0.0), "{source}");
    }
    assert_eq!(
        parse("3*x - x/4").derivative(Variable::X).constant(),
        Some(2.75)
    );
    assert_eq!(
        parse("abs(x)")
            .derivative(Variable::X)
            .eval_at(0.0, 0.0, 0.0),
        0.0
    );
    assert_eq!(parse("x*y").derivative(Variable::Y).source(), "d/dy (x*y)");
}

#[test]
fn derivatives_can_be_taken_again() {
    let field = parse("sin(x)*exp(y) + x^3*y^2");
    let mixed = field.derivative(Variable::X).derivative(Variable::Y);
    let (x, y) = (0.3f64, 0.7f64);
    let expected = x.cos() * y.exp() + 6.0 * x * x * y;
    assert!((mixed.eval_at(x, y, 0.0) - expected).abs() < 1e-15 * 10.0);
    let third = (0..3).fold(field, |field, _| field.derivative(Variable::X));
    assert!((third.eval_at(x, y, 0.0) - (-x.cos() * y.exp() + 6.0 * y * y)).abs() < 1e-14);
}

/// Formulas that are smooth and of moderate size on the unit square.
fn smooth() -> impl Strategy<Value = String> {
    let leaf = prop_oneof![
        Just("x".to_owned()),
        Just("y".to_owned()),
        (1..20u32).prop_map(|k| format!("{}", f64::from(k) / 8.0)),
    ];
    leaf.prop_recursive(4, 24, 2, |inner| {
        let pair = (inner.clone(), inner.clone());
        prop_oneof![
            pair.clone().prop_map(|(a, b)| format!("({a} + {b})")),
            pair.clone().prop_map(|(a, b)| format!("({a} - {b})")),
            pair.clone().prop_map(|(a, b)| format!("{a}*({b})")),
            pair.clone()
                .prop_map(|(a, b)| format!("({a})/(2 + sin({b}))")),
            pair.clone()
                .prop_map(|(a, b)| format!("atan2({a}, 3 + cos({b}))")),
            pair.clone()
                .prop_map(|(a, b)| format!("hypot({a}, 2 + cos({b}))")),
            pair.clone()
                .prop_map(|(a, b)| format!("(2 + sin({a}))^sin({b})")),
            pair.clone()
                .prop_map(|(a, b)| format!("if(x < 1, {a}, {b})")),
            pair.clone()
                .prop_map(|(a, b)| format!("max({a}, {b} - 1e6)")),
            pair.prop_map(|(a, b)| format!("step(x + 2)*{a} + step(x - 2)*{b}")),
            inner.clone().prop_map(|a| format!("-{a}")),
            inner.clone().prop_map(|a| format!("sin({a})")),
            inner.clone().prop_map(|a| format!("cos({a})")),
            inner.clone().prop_map(|a| format!("tanh({a})")),
            inner.clone().prop_map(|a| format!("atan({a})")),
            inner.clone().prop_map(|a| format!("exp(sin({a}))")),
            inner.clone().prop_map(|a| format!("ln(3 + cos({a}))")),
            inner.clone().prop_map(|a| format!("sqrt(2 + sin({a}))")),
            inner.clone().prop_map(|a| format!("asin(0.8*sin({a}))")),
            (inner, 2..5u32).prop_map(|(a, n)| format!("(sin({a}))^{n}")),
        ]
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 600, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_formulas(source in smooth(), x in 0.1..0.9f64, y in 0.1..0.9f64) {
        let expression = parse(&source);
        let coarse = compare(&expression, x, y, 2e-3);
        let fine = compare(&expression, x, y, 1e-3);
        let value = expression.eval_at(x, y, 3.0);
        for ((slope, rough), (_, quotient)) in coarse.into_iter().zip(fine) {
            let scale = 1.0 + quotient.abs() + value.abs();
            // Formulas that turn too fast for the quotient say nothing.
            prop_assume!((rough - quotient).abs() < 1e-7 * scale);
            prop_assert!((slope - quotient).abs() < 1e-7 * scale, "{source} at {x}, {y}: {slope}, not {quotient}");
        }
    }
}
