//! scratch
mod common;
use common::*;
use contact::*;

#[test]
fn measure() {
    let pi = std::f64::consts::PI;
    let f = move |x: f64, y: f64| 60.0 * (4.0 * pi * x).sin() * (4.0 * pi * y).sin() - 15.0;
    let var: Function = &|x, y| 1.0 + 0.5 * (3.0 * x + y).sin();
    let var2: Function = &|x, y| 2.0 - (x * y - x).cos();
    for n in [8, 32, 64, 128] {
        for e in [-12, -8, -4, 0, 4, 8, 12] {
            if n > 32 && e != 0 && e != -8 {
                continue;
            }
            let m = 10f64.powi(e);
            // manufactured-like: displacement of order one
            let one = |_: f64, _: f64| 1.0;
            let mm = move |_: f64, _: f64| m;
            let k = m / (1.0 + m);
            let lam = |x: f64, y: f64| if x * x + y * y < 0.25 { 4.0 } else { 0.0 };
            let f1 = move |x: f64, y: f64| m * (1.0 + x) + k * f(x, y) - lam(x, y);
            let f2 = move |x: f64, y: f64| (1.0 + x) - k * f(x, y) + lam(x, y);
            let data = Data {
                tensions: [&mm, &one],
                loads: [&f1, &f2],
                heights: [&|_, _| 0.1, &|_, _| 0.0],
            };
            let mesh = distorted(n, 0.3, 5);
            let p = data.on(&mesh);
            let a = solve(
                &p,
                &Settings {
                    solver: Solver::ActiveSet,
                    ..Settings::default()
                },
                None,
            )
            .unwrap();
            let b = solve(
                &p,
                &Settings {
                    solver: Solver::ActiveSet,
                    reduce: false,
                    ..Settings::default()
                },
                None,
            )
            .unwrap();
            assert_exact(&p, &a);
            assert_exact(&p, &b);
            print!(
                "n {n} ratio 1e{e} AS its {} kkt {:.1e} {} | 2f its {} kkt {:.1e} diff {:.1e} sets {}",
                a.info.iterations,
                a.info.kkt_residual,
                a.contact.iter().filter(|c| **c).count(),
                b.info.iterations,
                b.info.kkt_residual,
                difference(&a, &b),
                a.contact == b.contact
            );
            let u = unit(&a);
            for reduce in [true, false] {
                let t = std::time::Instant::now();
                let c = solve(
                    &p,
                    &Settings {
                        solver: Solver::Clarabel,
                        reduce,
                        tolerance: Tolerance::Relative(1.0),
                    },
                    None,
                );
                match c {
                    Ok(c) => {
                        let wrong = (0..p.order())
                            .filter(|&j| !p.boundary[j] && a.contact[j] != c.contact[j])
                            .map(|j| (a.gap(j) / u).max(a.force[j] / p.harmonic_diagonal(j) / u))
                            .fold(0.0, f64::max);
                        print!(
                            " | cl its {} kkt {:.1e} diff {:.1e} wrong {:.1e} {:.2}s",
                            c.info.iterations,
                            c.info.kkt_residual,
                            difference(&a, &c),
                            wrong,
                            t.elapsed().as_secs_f64()
                        )
                    }
                    Err(e) => print!(" | {e}"),
                }
            }
            println!();
        }
    }
    let data = Data {
        tensions: [var, var2],
        loads: [&f, &|_, _| 0.0],
        heights: [&|_, _| 0.1, &|_, _| 0.0],
    };
    for n in [16, 64] {
        let p = data.on(&distorted(n, 0.45, 3));
        let a = solve(&p, &Settings::default(), None).unwrap();
        let c = solve(
            &p,
            &Settings {
                solver: Solver::Clarabel,
                tolerance: Tolerance::Relative(1.0),
                ..Settings::default()
            },
            None,
        )
        .unwrap();
        println!(
            "general its {} kkt {:.1e} | cl {} kkt {:.1e} diff {:.1e}",
            a.info.iterations,
            a.info.kkt_residual,
            c.info.iterations,
            c.info.kkt_residual,
            difference(&a, &c)
        );
    }
}
