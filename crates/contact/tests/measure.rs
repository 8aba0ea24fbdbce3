mod common;
use common::*;
use contact::*;
use fem_core::Children;

fn islands(
    ratio: f64,
    g: f64,
    reduce: bool,
    levels: usize,
    n0: usize,
    uniform: bool,
    label: &str,
    tens: [Function; 2],
) {
    let pi = std::f64::consts::PI;
    let f = move |x: f64, y: f64| 60.0 * (4.0 * pi * x).sin() * (4.0 * pi * y).sin() - 15.0;
    let _ = ratio;
    let data = Data {
        tensions: tens,
        loads: [&f, &|_, _| 0.0],
        heights: [&|_, _| g, &|_, _| 0.0],
    };
    let settings = Settings {
        reduce,
        ..Settings::default()
    };
    let mut mesh = square(n0);
    let mut start = None;
    for _ in 0..levels {
        let p = data.on(&mesh);
        let t = std::time::Instant::now();
        let s = solve(&p, &settings, start.as_ref());
        let dt = t.elapsed().as_secs_f64();
        match &s {
            Ok(s) => println!(
                "{label} n {:7} {:?} {} its {} kkt {:.1e} contact {} time {:.3}",
                p.order(),
                s.info.reduction,
                s.info.solver,
                s.info.iterations,
                s.info.kkt_residual,
                s.contact.iter().filter(|c| **c).count(),
                dt
            ),
            Err(e) => {
                println!("{label} {e}");
                return;
            }
        }
        let s = s.unwrap();
        assert_exact(&p, &s);
        let r = if uniform {
            mesh.refine_uniformly(Children::Four).unwrap()
        } else {
            let marked: Vec<_> = mesh
                .triangle_ids()
                .filter(|t| {
                    let v = mesh.triangles()[t.index()];
                    let c = v.iter().filter(|v| s.contact[v.index()]).count();
                    c > 0 && c < 3 || (t.index() * 7919) % 4 == 0
                })
                .collect();
            mesh.refine(&marked, Children::Four).unwrap()
        };
        start = Some(Start::prolong(&s, &mesh, r.old_vertices));
    }
}

#[test]
fn measure() {
    let one: Function = &|_, _| 1.0;
    let two: Function = &|_, _| 2.0;
    let var: Function = &|x, y| 1.0 + 0.5 * (3.0 * x + y).sin();
    let var2: Function = &|x, y| 2.0 - (x * y - x).cos();
    let cb: Function = &|x, y| {
        if ((4.0 * x).floor() + (4.0 * y).floor()) as i64 % 2 == 0 {
            1.0
        } else {
            1000.0
        }
    };

    islands(1.0, 0.3, true, 6, 8, true, "const", [one, two]);
    islands(1.0, 0.3, true, 6, 8, true, "ratio", [var, var]);
    islands(1.0, 0.05, true, 6, 8, true, "general", [var, var2]);
    islands(1.0, 0.05, true, 6, 8, true, "checker", [cb, one]);
    islands(1.0, 0.3, true, 8, 8, false, "graded", [one, two]);
    islands(1.0, 0.0, true, 6, 8, true, "g0", [one, two]);
    islands(1.0, 0.3, true, 1, 64, true, "cold", [one, two]);
    islands(1.0, 0.3, true, 1, 256, true, "cold", [one, two]);
    islands(1.0, 0.3, true, 1, 128, true, "cold general", [var, var2]);
    println!("END");
}
