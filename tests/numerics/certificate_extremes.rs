//! The certificate at the extremes: an error of zero, tensions in all ratios, needles.

use std::sync::Arc;

use adapt::Problem;
use adapt::settings::Estimator;
use estimate::Grade;
use estimate::certificate::POINCARE;
use fem_core::scale::times_power_of_two;
use fem_core::{Field, FieldError, Mesh, Samples};

use crate::cases::{Grid, case, levels, on, solve, uniform};
use crate::certificate::{Table, certificate};

/// A case whose discrete error is zero: nothing but rounding may be left.
#[test]
fn certificate_of_an_exact_solution() {
    for n in [4, 16, 64] {
        let problem = on("P6b", &Grid::right(n), 0);
        let level = solve(&problem);
        for grade in [Grade::Rt0, Grade::Rt1] {
            let found = certificate(&problem, &level, grade, POINCARE).bound;
            let bound = times_power_of_two(found, problem.scale.energy_norm());
            println!("P6b {n} {grade:?}: {bound:.1e}");
            assert!(bound <= 1e-12, "{bound}");
        }
    }
}

/// A sum of fields with weights.
struct Combination(Vec<(f64, Arc<dyn Field>)>);

impl Field for Combination {
    fn sample(&self, at: Samples<'_>, out: &mut [f64]) -> Result<(), FieldError> {
        out.fill(0.0);
        let mut values = vec![0.0; out.len()];
        for (weight, field) in &self.0 {
            field.sample(at, &mut values)?;
            for (o, v) in out.iter_mut().zip(&values) {
                *o += weight * v;
            }
        }
        Ok(())
    }
}

fn combination<const N: usize>(terms: [(f64, &Arc<dyn Field>); N]) -> Arc<dyn Field> {
    Arc::new(Combination(terms.map(|(w, f)| (w, f.clone())).to_vec()))
}

/// The solution of a case with constant tensions, carried over to the tensions M1, M2: same action, same gap.
fn rescaled(problem: &Problem, [large1, large2]: [f64; 2]) -> Problem {
    let tension = [0, 1].map(|i| problem.tension[i].constant().expect("constant"));
    let [m1, m2] = tension;
    // In the formulas the tensions are the scaled ones, and so are M1, M2.
    let (m, large) = (m1 + m2, large1 + large2);
    let k = large1 * large2 / large;
    let [f1, f2] = [&problem.load[0], &problem.load[1]];
    let exact = problem.exact.as_ref().expect("known");
    let action = exact.action.as_ref().expect("known");
    // F_i = M_i a +- k b -+ lambda, a = (f1 + f2)/m, b = ((m2 f1 - m1 f2)/m + lambda) m/(m1 m2).
    let load = |own: f64, sign: f64| {
        let b = m / (m1 * m2);
        combination([
            (own / m + sign * k * b * m2 / m, f1),
            (own / m - sign * k * b * m1 / m, f2),
            (sign * (k * b - 1.0), action),
        ])
    };
    // U_1 = S + M2 w/M, U_2 = S - M1 w/M with S = (m1 u1 + m2 u2)/m, w = u1 - u2.
    let pair = |u1: &Arc<dyn Field>, u2: &Arc<dyn Field>| {
        let other = [large2 / large, -large1 / large];
        other.map(|share| combination([(m1 / m + share, u1), (m2 / m - share, u2)]))
    };
    let mut result = problem.clone();
    result.tension = [large1, large2].map(|t| Arc::new(fem_core::Constant(t)) as Arc<dyn Field>);
    result.load = [load(large1, 1.0), load(large2, -1.0)];
    result.height = pair(&problem.height[0], &problem.height[1]);
    let [x, y] = [0, 1].map(|c| pair(&exact.displacement[0][c], &exact.displacement[1][c]));
    let [x1, x2] = x;
    let [y1, y2] = y;
    result.exact = Some(estimate::Exact {
        displacement: [[x1, y1], [x2, y2]],
        ..exact.clone()
    });
    result
}

#[test]
fn certificate_at_all_ratios_of_the_tensions() {
    let mut table = Table::default();
    for name in ["P2", "P8"] {
        for exponent in [-6, -4, -2, 0, 2, 4, 6] {
            let ratio = 10f64.powi(exponent);
            let problem = rescaled(&on(name, &Grid::right(8), 0), [ratio, 1.0]);
            let mut settings = uniform(3);
            settings.estimate.estimator = Estimator::Certified;
            settings.estimate.also.clear();
            for level in levels(&problem, &settings) {
                let n = level.mesh.vertex_count();
                let error = level.estimates.errors.as_ref().expect("exact").energy;
                let fast = level.estimates.certificate.as_ref().expect("wanted").bound;
                let sharp = certificate(&problem, &level, Grade::Rt1, POINCARE).bound;
                let what = format!("{name} 1e{exponent}:1 {n}");
                let a = table.note(&format!("{what} rt0"), fast, error);
                let b = table.note(&format!("{what} rt1"), sharp, error);
                assert!(n < 1000 || (a <= 1.40 && b <= 1.10), "{what}: {a} {b}");
            }
        }
    }
}

/// Squares of (-1, 1)^2 with a column of width `thin` beside x = 0, so that its triangles are needles.
fn needles(problem: &Problem, thin: f64) -> Mesh {
    let exponent = -problem.scale.length;
    let x: Vec<f64> = [-1.0, -0.75, -0.5, -0.25, 0.0, thin, 0.25, 0.5, 0.75, 1.0].to_vec();
    let y: Vec<f64> = (0..9).map(|k| -1.0 + 0.25 * k as f64).collect();
    let mut points = Vec::new();
    for x in &x {
        for y in &y {
            points.push([*x, *y].map(|v| times_power_of_two(v, exponent)));
        }
    }
    let rows = y.len() as u32;
    let mut triangles = Vec::new();
    for i in 0..x.len() as u32 - 1 {
        for j in 0..rows - 1 {
            let c = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)].map(|(i, j)| i * rows + j);
            triangles.extend([[c[0], c[1], c[2]], [c[0], c[2], c[3]]]);
        }
    }
    Mesh::new(points, &triangles, &[], None).expect("a grid")
}

#[test]
fn certificate_on_needles() {
    let mut table = Table::default();
    for name in ["P2", "P5", "P8"] {
        for exponent in [-1, -2, -4, -6, -8] {
            // The needles' angle is about four times their width.
            let mut problem = case(name);
            problem.mesh = needles(&problem, 0.25 * 10f64.powi(exponent));
            let level = solve(&problem);
            let error = level.estimates.errors.as_ref().expect("exact").energy;
            let what = format!("{name} angle 1e{exponent}");
            let fast = certificate(&problem, &level, Grade::Rt0, POINCARE).bound;
            let sharp = certificate(&problem, &level, Grade::Rt1, POINCARE).bound;
            table.note(&format!("{what} rt0"), fast, error);
            let b = table.note(&format!("{what} rt1"), sharp, error);
            assert!(b <= 1.2, "{what}: {b}");
        }
    }
}
