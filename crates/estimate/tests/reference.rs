//! Indicators of given discrete solutions against the committed reference values.

mod support;

use estimate::{energy, oscillation, paper, residual, root_sum};
use fem_core::integrate::loads;
use support::{Reference, cases, difference};

#[test]
fn indicators_agree_with_the_reference() {
    for case in cases::all() {
        let reference = Reference::read(case.file, &case.tension);
        let (mesh, problem, solution) = (&reference.mesh, &reference.problem, &reference.solution);
        let indicators = paper(mesh, problem, solution);
        let local = difference(&indicators.eta_k, &reference.array("eta_K"));
        let edges = difference(&indicators.eta_e, &reference.eta_e());
        let result = energy(mesh, problem, solution);
        let totals = [
            ("eta_K", indicators.eta_k_total()),
            ("sum_eta_e", indicators.eta_e_sum()),
            ("eta_e_l2", root_sum(&indicators.eta_e)),
            ("eta_res", root_sum(&residual(mesh, problem, solution))),
            ("energy", result.energy),
            ("energy_norm", result.energy_norm),
        ];
        println!("{}: eta_K {local:.1e}, eta_e {edges:.1e}", case.file);
        assert!(local <= 1e-12, "{} eta_K {local:e}", case.file);
        assert!(edges <= 1e-12, "{} eta_e {edges:e}", case.file);
        for (key, value) in totals {
            let off = difference(&[value], &[reference.total(key)]);
            println!("    {key} {off:.1e}");
            assert!(off <= 1e-10, "{} {key} {value:e} {off:e}", case.file);
        }
        let halves: f64 = indicators.eta_e_cell.iter().sum();
        assert!((halves - indicators.eta_e_sum()).abs() <= 1e-13 * halves);
    }
}

#[test]
fn oscillation_agrees_where_loads_are_polynomials() {
    type Load = fn(f64, f64) -> f64;
    let loaded: [(&str, [Load; 2]); 3] = [
        (
            "P5_delaunay_16",
            [
                |x, y| 4.0 - 2.0 * (x * x + y * y),
                |x, y| 4.0 * (x * x + y * y) - 8.0,
            ],
        ),
        (
            "P6_cross_8",
            [
                |x, y| 2.0 - x - 2.0 * (x * x + y * y),
                |x, y| 14.0 + x - 6.0 * (x * x + y * y),
            ],
        ),
        (
            "P6c_right_16",
            [|_, _| 0.0, |x, y| 16.0 - 8.0 * (x * x + y * y)],
        ),
    ];
    for (file, fields) in loaded {
        let case = cases::all().into_iter().find(|c| c.file == file).unwrap();
        let Reference {
            mesh,
            mut problem,
            values,
            ..
        } = Reference::read(file, &case.tension);
        problem.loads = fields.map(|f| loads(&mesh, &f).unwrap());
        let total = root_sum(&oscillation(&mesh, &problem));
        let off = difference(&[total], &[values["totals"]["osc"].as_f64().unwrap()]);
        println!("{file} osc {off:.1e}");
        assert!(off <= 1e-12, "{file} {total:e} {off:e}");
    }
}
