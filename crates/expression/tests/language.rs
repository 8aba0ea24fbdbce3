//! The grammar and the meaning of what it says: precedence, functions, truth, NaN, limits.

use expression::{Expression, Scope};
use std::f64::consts::{E, LN_10, PI};

fn value(source: &str) -> f64 {
    at(source, 0.0, 0.0)
}

fn at(source: &str, x: f64, y: f64) -> f64 {
    match Expression::parse(source, &Scope::new()) {
        Ok(expression) => expression.eval_at(x, y, 0.0),
        Err(error) => panic!("{source}: {error}"),
    }
}

#[test]
fn operators_bind_as_the_table_says() {
    let x = 3.0;
    let table = [
        ("-x^2", -9.0),
        ("(-x)^2", 9.0),
        ("2^3^2", 512.0),
        ("(2^3)^2", 64.0),
        ("2^-1", 0.5),
        ("2^-x", 0.125),
        ("2^-x^2", 2.0f64.powi(-9)),
        ("2^-2*8", 2.0),
        ("-2^2", -4.0),
        ("--x", 3.0),
        ("-+-x", 3.0),
        ("2*-x", -6.0),
        ("2--x", 5.0),
        ("1-2-3", -4.0),
        ("1-(2-3)", 2.0),
        ("12/2/3", 2.0),
        ("12/2*3", 18.0),
        ("12/(2*3)", 2.0),
        ("1+2*3", 7.0),
        ("(1+2)*3", 9.0),
        ("2*x^2", 18.0),
        ("1 + 2 < 4", 1.0),
        ("1 < 2 && 2 < 3", 1.0),
        ("1 || 0 && 0", 1.0),
        ("(1 || 0) && 0", 0.0),
        ("0 && 0 || 1", 1.0),
        ("!0 == 1", 1.0),
        ("!(0 == 1)", 1.0),
        ("!1 == 1", 0.0),
        ("!x^0", 0.0),
        ("!!x", 1.0),
        ("-!x", 0.0),
        ("x == 3 == 0 || 1", f64::NAN),
        ("1 - 1 != 0", 0.0),
        (" 1\t+\n 2 ", 3.0),
        ("x-1", 2.0),
        ("x -1", 2.0),
    ];
    for (source, expected) in table {
        if expected.is_nan() {
            assert!(
                Expression::parse(source, &Scope::new()).is_err(),
                "{source}"
            );
        } else {
            assert_eq!(at(source, x, 0.0), expected, "{source}");
        }
    }
}

#[test]
fn numbers_are_read_to_the_last_bit() {
    let table = [
        ("1e-3", 1e-3),
        ("1E+3", 1e3),
        (".5", 0.5),
        ("5.", 5.0),
        ("1.5e2", 150.0),
        ("0.1", 0.1),
        ("0.075761435208381100582", 0.075_761_435_208_381_1),
        ("5.2590727014733933521e-31", 5.259_072_701_473_393e-31),
        ("5e-324", 5e-324),
        ("1.7976931348623157e308", f64::MAX),
        ("0e9", 0.0),
        ("2*e", 2.0 * E),
        ("pi", PI),
        ("1/3", 1.0 / 3.0),
    ];
    for (source, expected) in table {
        assert_eq!(value(source), expected, "{source}");
    }
}

#[test]
fn functions_have_their_values() {
    let table = [
        ("sin(pi/2)", 1.0),
        ("cos(0)", 1.0),
        ("tan(x)", 0.5f64.tan()),
        ("asin(x)", 0.5f64.asin()),
        ("acos(x)", 0.5f64.acos()),
        ("atan(x)", 0.5f64.atan()),
        ("atan2(y, x)", (-2.0f64).atan2(0.5)),
        ("sinh(x)", 0.5f64.sinh()),
        ("cosh(x)", 0.5f64.cosh()),
        ("tanh(x)", 0.5f64.tanh()),
        ("exp(1)", 1.0f64.exp()),
        ("ln(10)", LN_10),
        ("log(10)", LN_10),
        ("log10(1000)", 3.0),
        ("sqrt(9)", 3.0),
        ("cbrt(-27)", -3.0),
        ("abs(y)", 2.0),
        ("sign(y)", -1.0),
        ("sign(0)", 0.0),
        ("sign(7)", 1.0),
        ("min(x, y)", -2.0),
        ("max(x, y)", 0.5),
        ("min(4, 3, 2, 5)", 2.0),
        ("max(4, x, y, 5, 1)", 5.0),
        ("hypot(3, 4)", 5.0),
        ("floor(-0.5)", -1.0),
        ("ceil(x)", 1.0),
        ("step(x)", 1.0),
        ("step(0)", 0.0),
        ("step(y)", 0.0),
        ("if(x < 1, 10, 20)", 10.0),
        ("if(0, 10, 20)", 20.0),
        ("if(y, 10, 20)", 10.0),
        ("x != 0.5", 0.0),
        ("x <= 0.5", 1.0),
        ("x >= 0.5", 1.0),
        ("x > 0.5", 0.0),
        ("y && x", 1.0),
        ("0 || y", 1.0),
        ("x && 2 - 2", 0.0),
    ];
    for (source, expected) in table {
        assert_eq!(at(source, 0.5, -2.0), expected, "{source}");
    }
}

#[test]
fn parameters_are_put_in_and_constants_folded() {
    let mut scope = Scope::new();
    scope.define("g", 0.05).unwrap();
    let constant = |source: &str| Expression::parse(source, &scope).unwrap().constant();
    assert_eq!(constant("-10*g"), Some(-0.5));
    assert_eq!(constant("if(g < 1, sin(pi/2), x)"), Some(1.0));
    assert_eq!(constant("0 && x"), Some(0.0));
    assert_eq!(constant("2 || x"), Some(1.0));
    assert_eq!(constant("x^0"), Some(1.0));
    assert_eq!(constant("0*x"), None, "0 times infinity is not 0");
    assert_eq!(constant("region"), None);
    let uses_region = |source: &str| Expression::parse(source, &scope).unwrap().uses_region();
    assert!(uses_region("if(region == 2, 1, 0)"));
    assert!(!uses_region("if(1, x, region)"));
    assert_eq!(Expression::number(2.5).constant(), Some(2.5));
    assert_eq!(
        Expression::parse(" x + 1", &scope).unwrap().source(),
        " x + 1"
    );
}

#[test]
fn a_constant_is_worked_out_or_refused() {
    let mut scope = Scope::new();
    scope.define("g", 0.05).unwrap();
    assert_eq!(Expression::parse_constant("2*g + cos(0)", &scope), Ok(1.1));
    for (source, span) in [("1 + x", 4..5), ("if(1, 2, region)", 9..15), ("1/0", 0..3)] {
        let error = Expression::parse_constant(source, &scope).unwrap_err();
        assert_eq!(error.span, span, "{source}");
    }
}

#[test]
fn not_a_number_is_handed_on_and_never_equal() {
    let nan = f64::NAN;
    for source in [
        "x + 1",
        "0*x",
        "min(x, 1)",
        "min(1, x)",
        "max(x, 1)",
        "max(1, x)",
        "sign(x)",
        "abs(x)",
        "floor(x)",
        "x^2",
        "2^x",
        "hypot(x, 1)",
        "x - x",
    ] {
        assert!(at(source, nan, 0.0).is_nan(), "{source}");
    }
    let table = [
        ("x < 1", 0.0),
        ("x >= 1", 0.0),
        ("x == x", 0.0),
        ("x != x", 1.0),
        ("step(x)", 0.0),
        ("!x", 0.0),
        ("x && 1", 1.0),
        ("if(x, 1, 2)", 1.0),
        ("if(x > 0, 1, 2)", 2.0),
    ];
    for (source, expected) in table {
        assert_eq!(at(source, nan, 0.0), expected, "{source}");
    }
    assert_eq!(value("1/0"), f64::INFINITY);
    assert!(value("0/0").is_nan());
    assert!(value("sqrt(-1)").is_nan());
    assert_eq!(value("ln(0)"), f64::NEG_INFINITY);
}

#[test]
fn the_region_is_zero_unless_given() {
    let expression = Expression::parse("10*region + x", &Scope::new()).unwrap();
    let mut out = [0.0; 3];
    expression.eval(&[1.0, 2.0, 3.0], &[0.0; 3], &[7.0, 8.0, 9.0], &mut out);
    assert_eq!(out, [71.0, 82.0, 93.0]);
    expression.eval(&[1.0, 2.0, 3.0], &[0.0; 3], &[], &mut out);
    assert_eq!(out, [1.0, 2.0, 3.0]);
    let chosen = Expression::parse("if(region == 0, sin(x), cos(x))", &Scope::new()).unwrap();
    chosen.eval(&[1.0, 2.0, 3.0], &[0.0; 3], &[], &mut out);
    assert_eq!(out, [1.0f64.sin(), 2.0f64.sin(), 3.0f64.sin()]);
    let only = Expression::parse("region", &Scope::new()).unwrap();
    only.eval(&[1.0; 3], &[0.0; 3], &[], &mut out);
    assert_eq!(out, [0.0; 3]);
    only.eval(&[], &[], &[], &mut []);
}

#[test]
#[should_panic(expected = "as many values")]
fn lengths_must_agree() {
    let expression = Expression::parse("x", &Scope::new()).unwrap();
    expression.eval(&[1.0, 2.0], &[0.0], &[], &mut [0.0, 0.0]);
}

/// On a thread with a small stack, so that a recursion over the length of a formula would be seen.
fn on_a_small_stack(work: impl FnOnce() + Send + 'static) {
    let thread = std::thread::Builder::new()
        .stack_size(1 << 20)
        .spawn(work)
        .unwrap();
    thread.join().unwrap();
}

#[test]
fn deep_nesting_is_refused_not_crashed_on() {
    on_a_small_stack(|| {
        let many = 100_000;
        let towers = [
            "(".repeat(many) + "x" + &")".repeat(many),
            "(".repeat(many),
            "-".repeat(many) + "x",
            "!".repeat(many) + "x",
            "sin(".repeat(many) + "x" + &")".repeat(many),
            "x^".repeat(many) + "x",
            "if(x, 1, ".repeat(many) + "x" + &")".repeat(many),
            "0||1&&1<1+1*2^(".repeat(many),
            "max(1,".repeat(many),
        ];
        for tower in towers {
            let error = Expression::parse(&tower, &Scope::new()).unwrap_err();
            assert_eq!(
                error.message,
                "the expression is nested too deeply",
                "{}",
                &tower[..20]
            );
            assert!(error.span.end <= 6000, "{:?}", error.span);
        }
        let inside = "(".repeat(200) + "x" + &")".repeat(200);
        assert_eq!(at(&inside, 4.0, 0.0), 4.0);
        let just_inside = "1+2*(".repeat(130) + "x" + &")".repeat(130);
        assert!(at(&just_inside, 4.0, 0.0) > 1e39);
    });
}

#[test]
fn long_chains_work() {
    use expression::Variable::X;
    on_a_small_stack(|| {
        let many = 100_000;
        let parse = |source: &str| Expression::parse(source, &Scope::new()).unwrap();
        let sum = parse(&("x".to_owned() + &"+x".repeat(many - 1)));
        assert_eq!(sum.eval_at(0.5, 0.0, 0.0), 0.5 * many as f64);
        assert_eq!(sum.derivative(X).constant(), Some(many as f64));
        let product = parse(&("x".to_owned() + &"*x".repeat(many - 1)));
        assert_eq!(product.eval_at(1.0, 0.0, 0.0), 1.0);
        assert_eq!(product.derivative(X).eval_at(1.0, 0.0, 0.0), many as f64);
        let and = parse(&("x".to_owned() + &"&& sin(x)".repeat(many - 1)));
        assert_eq!(and.eval_at(1.0, 0.0, 0.0), 1.0);
        let arguments: Vec<String> = (0..10_000).map(|k| format!("sin({k}*x)")).collect();
        let largest = parse(&format!("max({})", arguments.join(",")));
        let x = 0.3f64;
        let sines = (0..10_000).map(|k| ((f64::from(k) * x).sin(), f64::from(k)));
        let (height, k) = sines.fold(
            (-1.0, 0.0),
            |best, one| if one.0 > best.0 { one } else { best },
        );
        assert_eq!(largest.eval_at(x, 0.0, 0.0), height);
        let slope = largest.derivative(X).eval_at(x, 0.0, 0.0);
        assert_eq!(slope, (k * x).cos() * k);
    });
}

#[test]
fn integer_powers_are_products() {
    let x = 1.1f64;
    let x2 = x * x;
    let x4 = x2 * x2;
    assert_eq!(at("x^2", x, 0.0), x2);
    assert_eq!(at("x^6", x, 0.0), x2 * x4);
    assert_eq!(at("x^7", x, 0.0), x * x2 * x4);
    assert_eq!(at("x^-3", x, 0.0), 1.0 / (x * x2));
    assert_eq!(at("x^0.5", x, 0.0), x.powf(0.5));
    assert_eq!(at("1.1^7", 0.0, 0.0), at("x^7", x, 0.0));
    assert_eq!(at("x^-1", 0.0, 0.0), f64::INFINITY);
    assert_eq!(at("(-x)^3", 2.0, 0.0), -8.0);
    assert_eq!(at("x^y", 2.0, 10.0), 1024.0);
}

#[test]
fn scaling_by_powers_of_two_scales_the_bits() {
    // Homogeneous of degree 3 (the first three) and 0.
    let formulas = [
        (3, "x^3/3 - 0.7*y*x^2 + abs(x)*y^2 - hypot(x, y)*x*y/1.3"),
        (
            3,
            "if(x^2 + y^2 < 0.3*x*y + x^2, x^3*1.7, y^5/(x^2 + y^2)) + sqrt(x^2 + y^2)*x^2",
        ),
        (
            3,
            "x^13*y^-10*0.1 - min(x, y, x + y)^3/7 + step(x - y)*x^48/y^45",
        ),
        (0, "atan2(y, x)*sin(x/y) + x^17/(y^17 + x^17)"),
    ];
    let points: Vec<(f64, f64)> = (1..200)
        .map(|k| {
            let k = f64::from(k);
            ((k * 0.754_877).fract() - 0.4, (k * 0.569_84).fract() - 0.6)
        })
        .collect();
    for (degree, formula) in formulas {
        for power in [-9, -1, 1, 8] {
            let scale = 2.0f64.powi(power);
            for (x, y) in &points {
                let scaled = at(formula, scale * x, scale * y);
                let expected = at(formula, *x, *y) * scale.powi(degree);
                assert_eq!(
                    scaled.to_bits(),
                    expected.to_bits(),
                    "{formula} at {x}, {y} by 2^{power}"
                );
            }
        }
    }
}

#[test]
fn units_are_products_before_and_after() {
    let scope = Scope::new();
    let text = "if(x > 0.3, x^2/3 - y*region, 2 - x)";
    let plain = Expression::parse(text, &scope).unwrap();
    let scaled = plain.in_units(0.7, [1.1, 1e-3]);
    for (x, y) in [(0.5, -2.0), (0.1, 3.0), (-1.0 / 3.0, 0.9)] {
        assert_eq!(
            scaled.eval_at(x, y, 5.0),
            plain.eval_at(x * 0.7, y * 0.7, 5.0) * 1.1 * 1e-3
        );
    }
    assert_eq!(scaled.source(), text);
    let number = Expression::parse("3", &scope).unwrap();
    assert_eq!(number.in_units(4.0, [0.5, 0.5]).constant(), Some(0.75));
}
