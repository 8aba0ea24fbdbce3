//! Branches not taken do not show, in batches of every size and mixture.

use expression::{Expression, Scope};

fn batch(source: &str, x: &[f64]) -> Vec<f64> {
    let expression = Expression::parse(source, &Scope::new()).unwrap();
    let mut out = vec![7e77; x.len()];
    expression.eval(x, &vec![0.25; x.len()], &[], &mut out);
    out
}

/// Signs in every mixture: all of one kind in a block, alternating, single exceptions.
fn mixtures() -> Vec<Vec<f64>> {
    let mut list = Vec::new();
    for length in [1, 2, 7, 64, 255, 256, 257, 700] {
        list.push(vec![1.5; length]);
        list.push(vec![-1.5; length]);
        list.push(
            (0..length)
                .map(|k| if k % 2 == 0 { 2.0 } else { -2.0 })
                .collect(),
        );
        list.push(
            (0..length)
                .map(|k| {
                    if k == length / 2 {
                        3.0
                    } else {
                        -0.5 - k as f64
                    }
                })
                .collect(),
        );
        list.push(
            (0..length)
                .map(|k| {
                    if k == length - 1 {
                        -3.0
                    } else {
                        0.5 + k as f64
                    }
                })
                .collect(),
        );
    }
    list
}

type Native = fn(f64) -> f64;

#[test]
fn the_branch_not_taken_never_shows() {
    let native: [(&str, Native); 6] = [
        (
            "if(x > 0, ln(x), 0)",
            |x| if x > 0.0 { x.ln() } else { 0.0 },
        ),
        ("if(x > 0, 1/sqrt(x), sqrt(-x))", |x| {
            if x > 0.0 { 1.0 / x.sqrt() } else { (-x).sqrt() }
        }),
        ("if(x > 0, 3, 0/0) - if(x <= 0, 0/0, 1)", |x| {
            if x > 0.0 { 2.0 } else { f64::NAN }
        }),
        (
            "if(x > 0, if(x > 2, ln(x - 2), if(x > 1, sqrt(x), exp(x))), if(x < -1, ln(-x), cos(x)))",
            |x| {
                if x > 2.0 {
                    (x - 2.0).ln()
                } else if x > 1.0 {
                    x.sqrt()
                } else if x > 0.0 {
                    x.exp()
                } else if x < -1.0 {
                    (-x).ln()
                } else {
                    x.cos()
                }
            },
        ),
        ("x > 0 && ln(x) > 0.5", |x| {
            f64::from(x > 0.0 && x.ln() > 0.5)
        }),
        ("x <= 0 || sqrt(x) > 1.3", |x| {
            f64::from(x <= 0.0 || x.sqrt() > 1.3)
        }),
    ];
    for (source, native) in native {
        for x in mixtures() {
            for (x, value) in x.iter().zip(batch(source, &x)) {
                let expected = native(*x);
                let same = value == expected || (value.is_nan() && expected.is_nan());
                assert!(same, "{source} at {x}: {value}, not {expected}");
            }
        }
    }
}

#[test]
fn what_branches_share_is_right_in_each_and_after() {
    // sin(x) in both branches and after; exp(x) before, in one branch and after.
    let source = "exp(x) + if(x > 0, sin(x)*exp(x) + cos(x), if(x < -1, sin(x) - cos(x), sin(x)*2)) + sin(x)*exp(x)";
    for x in mixtures() {
        for (x, value) in x.iter().zip(batch(source, &x)) {
            let branch = if *x > 0.0 {
                x.sin() * x.exp() + x.cos()
            } else if *x < -1.0 {
                x.sin() - x.cos()
            } else {
                x.sin() * 2.0
            };
            assert_eq!(value, x.exp() + branch + x.sin() * x.exp(), "at {x}");
        }
    }
}

#[test]
fn a_thread_keeps_nothing_from_one_formula_to_the_next() {
    let x: Vec<f64> = (0..300).map(|k| f64::from(k) - 150.0).collect();
    let first = batch("if(x > 0, ln(x), sin(x)) + cos(x)", &x);
    let many = (0..700)
        .map(|k| format!("sin({k}*x)*sin({k}*x + 1)"))
        .collect::<Vec<_>>()
        .join("+");
    let nested = format!("if(x > 0, {many}, 1) + {many}");
    assert!(batch(&nested, &x).iter().all(|value| value.is_finite()));
    assert_eq!(batch("if(x > 0, ln(x), sin(x)) + cos(x)", &x), first);
}

#[test]
fn threads_share_a_formula() {
    let expression = Expression::parse("if(x > 0, ln(x), sin(x)) + x^5", &Scope::new()).unwrap();
    let x: Vec<f64> = (0..1000).map(|k| f64::from(k) / 100.0 - 5.0).collect();
    let run = || {
        let mut out = vec![0.0; x.len()];
        expression.eval(&x, &x, &[], &mut out);
        out
    };
    let expected = run();
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..4).map(|_| scope.spawn(run)).collect();
        for thread in threads {
            assert_eq!(thread.join().unwrap(), expected);
        }
    });
}
