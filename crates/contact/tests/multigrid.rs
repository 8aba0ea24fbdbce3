//! scratch
mod common;
use common::*;
use contact::*;
use fem_core::*;

fn smooth_action(membrane: usize, x: f64, y: f64) -> f64 {
    let r2 = x * x + y * y;
    let q = (r2 - 0.25).max(0.0);
    let (a, b) = (1.0 - x * x, 1.0 - y * y);
    let lp = -2.0 * (a + b);
    let lpq = if q > 0.0 {
        q * q * lp - 16.0 * q * (x * x * b + y * y * a) + a * b * (8.0 * r2 + 8.0 * q)
    } else {
        0.0
    };
    let action = (5.0 - 20.0 * r2).max(0.0);
    if membrane == 0 {
        -(lp / 3.0 + 2.0 / 3.0 * lpq) - action
    } else {
        -2.0 * (lp / 3.0 - lpq / 3.0) + action
    }
}

#[test]
fn scratch() {
    for model in 0..3 {
    let two: Function = &|_, _| 2.0;
    let var1: Function = &|x, y| 1.0 + 0.5 * x * y;
    let var2: Function = &|x, y| 2.0 + x + 0.3 * y;
    let one: Function = &|_, _| 1.0;
    let (t1, t2) = match model { 0 => (one, two), 1 => (one, two), _ => (var1, var2) };
    let data = Data {
        tensions: [t1, t2],
        loads: [&|x, y| smooth_action(0, x, y), &|x, y| smooth_action(1, x, y)],
        heights: [&|_, _| 0.0, &|_, _| 0.0],
    };
    let mut mesh = square(8);
    let mut start: Option<Start> = None;
    for level in 0..5 {
        let problem = data.on(&mesh);
        let reduce = model == 0;
        let s = Settings { solver: Solver::Multigrid, tolerance: Tolerance::Relative(1e-10), reduce, energy_target: None };
        let a = Settings { solver: Solver::ActiveSet, ..s };
        let clock = std::time::Instant::now();
        let ua = solve(&problem, &a, start.as_ref()).unwrap();
        let ta = clock.elapsed().as_secs_f64();
        let clock = std::time::Instant::now();
        let u = solve(&problem, &s, start.as_ref()).unwrap();
        let tm = clock.elapsed().as_secs_f64();
        println!("model {model} level {level} n {} as {ta:.4} {} mg {tm:.4} {:?} diff {:e}", problem.order(), ua.info.iterations, u.info, difference(&u, &ua));
        if level > 0 {
            let c = solve(&problem, &s, None).unwrap();
            println!("   cold {:?} {:e}", c.info, difference(&c, &ua));
        }
        let all: Vec<_> = mesh.triangle_ids().collect();
        let r = mesh.refine(&all, Children::Four).unwrap();
        start = Some(Start::prolong(&u, &mesh, r.old_vertices));
    }
    }
}
