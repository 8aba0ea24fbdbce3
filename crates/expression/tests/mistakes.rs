//! What is said of a formula with a mistake, and where the mistake is.

use expression::{Expression, ParseError, Scope};
use std::ops::Range;

fn error(source: &str) -> ParseError {
    let mut scope = Scope::new();
    scope.define("g", 0.05).unwrap();
    scope.define("radius", 1.0).unwrap();
    match Expression::parse(source, &scope) {
        Ok(_) => panic!("{source} is accepted"),
        Err(error) => error,
    }
}

#[test]
fn mistakes_are_located_and_explained() {
    let table: [(&str, Range<usize>, &str, &str); 44] = [
        ("2*ga", 2..4, "unknown name `ga`", "did you mean `g`?"),
        (
            "1 + radios",
            4..10,
            "unknown name `radios`",
            "did you mean `radius`?",
        ),
        ("X + 1", 0..1, "unknown name `X`", "did you mean `x`?"),
        ("1 + xy", 4..6, "unknown name `xy`", "write `x*y`"),
        (
            "1 + z",
            4..5,
            "unknown name `z`",
            "the names are `x`, `y`, `region`, `pi`, `e`, `g`, `radius`",
        ),
        (
            "x and y",
            2..5,
            "an operator is missing before `and`",
            "write `&&`",
        ),
        (
            "sen(x)",
            0..3,
            "unknown function `sen`",
            "did you mean `sin`?",
        ),
        (
            "arctan(x)",
            0..6,
            "unknown function `arctan`",
            "did you mean `atan`?",
        ),
        ("pow(x, 2)", 0..3, "unknown function `pow`", "write `a^b`"),
        (
            "1 + sin x",
            4..7,
            "`sin` is a function and needs its arguments",
            "write `sin(a)`",
        ),
        (
            "1 + atan2(y)",
            4..12,
            "`atan2` takes 2 arguments, not 1",
            "write `atan2(y, x)`",
        ),
        (
            "min(x)",
            0..6,
            "`min` takes at least 2 arguments, not 1",
            "write `min(a, b, ...)`",
        ),
        (
            "if(x, 1)",
            0..8,
            "`if` takes 3 arguments, not 2",
            "write `if(condition, then, else)`",
        ),
        (
            "sin()",
            0..5,
            "`sin` takes 1 argument, not 0",
            "write `sin(a)`",
        ),
        (
            "sin(0,5)",
            0..8,
            "`sin` takes 1 argument, not 2",
            "decimal numbers are written with a point: `0.5`",
        ),
        (
            "x + 0,5",
            5..6,
            "unexpected `,`",
            "decimal numbers are written with a point: `0.5`",
        ),
        ("x, y", 1..2, "unexpected `,`", ""),
        ("1 + ", 4..4, "the expression ends too early", ""),
        ("-", 1..1, "the expression ends too early", ""),
        ("", 0..0, "the expression is empty", ""),
        ("  ", 0..2, "the expression is empty", ""),
        ("2*(x + 1", 2..3, "`(` without a `)` after it", ""),
        ("sin(x", 3..4, "`(` without a `)` after it", ""),
        ("x + 1)", 5..6, "`)` without a `(` before it", ""),
        ("()", 1..2, "unexpected `)`", ""),
        (
            "3 +* 4",
            3..4,
            "unexpected `*`",
            "an operand is missing before it",
        ),
        ("x $ y", 2..3, "unexpected character `$`", ""),
        ("x + µ", 4..6, "unexpected character `µ`", ""),
        ("x² + 1", 1..3, "unexpected character `²`", "write `^2`"),
        (
            "x = 1",
            2..3,
            "`=` is not an operator",
            "write `==` to compare",
        ),
        (
            "x ** 2",
            2..4,
            "`**` is not an operator",
            "write `^` for a power",
        ),
        (
            "x & y",
            2..3,
            "`&` is not an operator",
            "write `&&` for and",
        ),
        (
            "|x|",
            0..1,
            "`|` is not an operator",
            "write `||` for or, `abs(...)` for the absolute value",
        ),
        ("x => 1", 2..4, "`=>` is not an operator", "write `>=`"),
        (
            "2 + (0 < x < 1)",
            5..14,
            "comparisons cannot be chained",
            "write `0 < x && x < 1`",
        ),
        (
            "x == y != 1",
            0..11,
            "comparisons cannot be chained",
            "write `x == y && y != 1`",
        ),
        (
            "2x",
            1..2,
            "an operator is missing before `x`",
            "write `2*x`",
        ),
        (
            "2(x + 1)",
            1..2,
            "an operator is missing before `(`",
            "write `2*(...)`",
        ),
        (
            "(x)(y)",
            3..4,
            "an operator is missing before `(`",
            "write `(...)*(...)`",
        ),
        (
            "1 + 3 pi",
            6..8,
            "an operator is missing before `pi`",
            "write `3*pi`",
        ),
        ("1 2", 2..3, "an operator is missing before `2`", ""),
        (
            "1_000",
            1..5,
            "an operator is missing before `_000`",
            "write numbers without `_`",
        ),
        (
            "1 + 1e400",
            4..9,
            "the number `1e400` is out of range",
            "the size of a number is between about 5e-324 and 1.8e308",
        ),
        (
            "1e-400",
            0..6,
            "the number `1e-400` is out of range",
            "the size of a number is between about 5e-324 and 1.8e308",
        ),
    ];
    for (source, span, message, hint) in table {
        let error = error(source);
        assert_eq!(error.span, span, "{source}");
        assert_eq!(error.message, message, "{source}");
        assert_eq!(error.hint.as_deref().unwrap_or(""), hint, "{source}");
    }
}

#[test]
fn the_first_mistake_is_the_one_reported() {
    assert_eq!(error("2x + $").span, 1..2);
    assert_eq!(error("sin(qq) + 1e999").span, 4..6);
}

#[test]
fn the_hint_stands_on_its_own_line() {
    assert_eq!(
        error("2x").to_string(),
        "an operator is missing before `x`\nhint: write `2*x`"
    );
    assert_eq!(error("(").to_string(), "the expression ends too early");
}

#[test]
fn any_text_is_answered() {
    // Every short text over an alphabet of awkward pieces: accepted or refused with a span inside it.
    let pieces = [
        "x", "2", "e", ".", "(", ")", ",", "-", "^", "<", "=", "!", "|", "if", "min", "²", " ",
    ];
    let count = pieces.len();
    let (mut accepted, mut refused) = (0, 0);
    for number in 0..count.pow(4) {
        let text: String = (0..4)
            .map(|place| pieces[number / count.pow(place) % count])
            .collect();
        match Expression::parse(&text, &Scope::new()) {
            Ok(expression) => {
                expression
                    .derivative(expression::Variable::X)
                    .eval_at(0.5, 0.0, 0.0);
                accepted += 1;
            }
            Err(error) => {
                assert!(
                    text.get(error.span.clone()).is_some(),
                    "{text:?}: {error:?}"
                );
                assert!(
                    !error.message.ends_with('.') && !error.message.is_empty(),
                    "{text:?}: {error:?}"
                );
                refused += 1;
            }
        }
    }
    assert!(accepted > 500 && refused > 50_000, "{accepted} {refused}");
}
