//! Time for an evaluation: formulas of the scene file, in batches of several sizes, beside the same formula written in
//! Rust.
//!
//! `cargo bench -p expression`; one thread, the best of several rounds, nanoseconds.

use expression::{Expression, Scope, Variable};
use std::f64::consts::PI;
use std::hint::black_box;
use std::time::Instant;

const POINTS: usize = 1 << 16;
const ROUNDS: usize = 15;

/// A field on a square whose normal derivative decays from its corners: two hundred operations with much in common.
fn series() -> String {
    let mut text = String::from("0.0757");
    for k in 1..=24 {
        let size = 0.07 * 0.03f64.powi(k);
        text += &format!("-{size:e}*(x^2+y^2)^{}*cos({}*atan2(y,x))", 2 * k, 4 * k);
    }
    text
}

/// Best time for `work` on all points, divided by `count`.
fn best(count: usize, mut work: impl FnMut()) -> f64 {
    let seconds = (0..ROUNDS).map(|_| {
        let start = Instant::now();
        work();
        start.elapsed().as_secs_f64()
    });
    seconds.fold(f64::INFINITY, f64::min) * 1e9 / count as f64
}

fn main() {
    let mut scope = Scope::new();
    scope.define("g", 0.05).expect("`g` is a free name");
    let product = "step(x^2 + y^2 - 1/4)*(2*(1 - x^2)*(1 - y^2)*(x^2 + y^2 - 1/4)^2/3 + (1 - x^2)*(1 - y^2)/3)\
                   + (1-step(x^2 + y^2 - 1/4))*((1 - x^2)*(1 - y^2)/3)";
    let smooth = "sin(pi*x)*cos(2*pi*y)*exp(-x^2)+0.5*x*y";
    let lazy = "if(x^2 + y^2 < 0.5, sin(pi*x)*exp(y), ln(x^2 + y^2)*cos(y))";
    let series = series();
    let formulas = [
        ("piecewise", "if(x^2 + y^2 < 0.5, -10*g, -8*g)"),
        ("smooth", smooth),
        ("lazy branches", lazy),
        ("step products", product),
        ("series, 24 terms", &series),
    ];
    // A low-discrepancy set in [-1, 1]^2, so that neighbours in a batch lie in different branches.
    let (x, y): (Vec<f64>, Vec<f64>) = (0..POINTS)
        .map(|k| {
            let k = k as f64;
            let spread = |ratio: f64| 2.0 * (k * ratio).fract() - 1.0;
            (
                spread(0.754_877_666_246_692_8),
                spread(0.569_840_290_998_053_3),
            )
        })
        .unzip();
    let mut out = vec![0.0; POINTS];

    println!(
        "{:<20} {:>8} {:>8} {:>8} {:>8} {:>10} {:>10} {:>10}",
        "ns per evaluation", "256", "64", "7", "1", "call of 7", "d/dx, 256", "parse us"
    );
    for (name, source) in formulas {
        let expression = Expression::parse(source, &scope).expect("the formulas parse");
        let slope = expression.derivative(Variable::X);
        let mut time = |expression: &Expression, size: usize| {
            best(POINTS / size * size, || {
                let batches = x.chunks_exact(size).zip(y.chunks_exact(size));
                for ((x, y), out) in batches.zip(out.chunks_exact_mut(size)) {
                    expression.eval(black_box(x), black_box(y), &[], black_box(out));
                }
            })
        };
        let [full, quarter, seven, one] = [256, 64, 7, 1].map(|size| time(&expression, size));
        let derivative = time(&slope, 256);
        let parse = best(1, || {
            black_box(Expression::parse(black_box(source), &scope).is_ok());
        });
        println!(
            "{name:<20} {full:>8.1} {quarter:>8.1} {seven:>8.1} {one:>8.1} {:>10.0} {derivative:>10.1} {:>10.1}",
            7.0 * seven,
            parse / 1e3
        );
    }

    let native = |f: &dyn Fn(f64, f64) -> f64| {
        let mut sink = vec![0.0; POINTS];
        best(POINTS, || {
            for ((x, y), out) in x.iter().zip(&y).zip(&mut sink) {
                *out = f(black_box(*x), black_box(*y));
            }
            black_box(&sink);
        })
    };
    let piecewise = native(&|x, y| if x * x + y * y < 0.5 { -0.5 } else { -0.4 });
    let smooth =
        native(&|x, y| (PI * x).sin() * (2.0 * PI * y).cos() * (-(x * x)).exp() + 0.5 * x * y);
    println!("the same in Rust, point by point: piecewise {piecewise:.1}, smooth {smooth:.1}");
}
