//! True errors of given discrete solutions against the committed reference values.

mod support;

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use estimate::{Exact, Gradient, TrueErrors, efficiency, paper, true_errors};
use fem_core::{Constant, Field, FieldError, Samples};
use support::{Reference, cases, difference};

/// Counts the points at which a field is sampled.
struct Counted(Arc<dyn Field>, Arc<AtomicUsize>);

impl Field for Counted {
    fn sample(&self, at: Samples<'_>, out: &mut [f64]) -> Result<(), FieldError> {
        self.1.fetch_add(at.len(), Ordering::Relaxed);
        self.0.sample(at, out)
    }
}

#[test]
fn errors_agree_with_the_reference() {
    for mut case in cases::all() {
        let reference = Reference::read(case.file, &case.tension);
        let points: [Arc<AtomicUsize>; 3] = Default::default();
        let [g1, g2] = &mut case.exact.displacement;
        for (g, count) in [Some(g1), Some(g2), case.exact.sigma.as_mut()]
            .into_iter()
            .zip(&points)
        {
            if let Some(g) = g {
                g[0] = Arc::new(Counted(g[0].clone(), count.clone()));
            }
        }
        let errors = true_errors(
            &reference.mesh,
            &reference.problem.tension_mean,
            &reference.solution.displacement,
            &reference.solution.sigma,
            &case.exact,
            &case.tension,
        )
        .unwrap();
        let triangles = reference.mesh.triangle_count() as f64;
        println!(
            "{}: points a triangle {:.1?}",
            case.file,
            points.map(|p| p.load(Ordering::Relaxed) as f64 / triangles)
        );
        let mut totals = vec![
            ("err_u1", errors.h1[0]),
            ("err_u2", errors.h1[1]),
            ("err_energy", errors.energy),
        ];
        if let Some(sigma) = errors.sigma {
            totals.push(("err_sigma", sigma));
        }
        for (key, value) in totals {
            let off = difference(&[value], &[reference.total(key)]);
            println!("    {key} {off:.1e}");
            assert!(off <= 1e-4, "{} {key} {value:e} {off:e}", case.file);
        }
    }
}

#[test]
fn local_constants_of_the_paper_stay_bounded() {
    for case in cases::all() {
        if case.exact.sigma.is_none() {
            continue;
        }
        let Reference {
            mesh,
            problem,
            solution,
            ..
        } = Reference::read(case.file, &case.tension);
        let errors = true_errors(
            &mesh,
            &problem.tension_mean,
            &solution.displacement,
            &solution.sigma,
            &case.exact,
            &case.tension,
        )
        .unwrap();
        let indicators = paper(&mesh, &problem, &solution);
        // Without the oscillation in the denominator the quotients are larger, if anything.
        let found = efficiency(&mesh, &problem, &indicators, &errors).unwrap();
        println!("{}: {found:.2?}", case.file);
        assert!(
            (3.0..14.0).contains(&found.element),
            "{} {found:?}",
            case.file
        );
        assert!((1.0..4.5).contains(&found.edge), "{} {found:?}", case.file);
    }
}

/// The errors of the interpolant of `value` on a reference mesh, and the points taken a triangle; `gradient` belongs to both membranes.
fn interpolation_errors(
    file: &str,
    value: impl Fn(f64, f64) -> f64,
    gradient: Gradient,
    tension: Arc<dyn Field>,
) -> (TrueErrors, f64) {
    let tension = [tension.clone(), tension];
    let Reference {
        mesh,
        problem,
        mut solution,
        ..
    } = Reference::read(file, &tension);
    let nodal: Vec<f64> = mesh.points().iter().map(|p| value(p[0], p[1])).collect();
    solution.displacement = [nodal.clone(), nodal];
    let points = Arc::new(AtomicUsize::new(0));
    let counted: Gradient = [
        Arc::new(Counted(gradient[0].clone(), points.clone())),
        gradient[1].clone(),
    ];
    let exact = Exact {
        displacement: [counted, gradient],
        sigma: None,
        action: None,
        contact: None,
    };
    let errors = true_errors(
        &mesh,
        &problem.tension_mean,
        &solution.displacement,
        &solution.sigma,
        &exact,
        &tension,
    )
    .unwrap();
    let points = points.load(Ordering::Relaxed) as f64 / mesh.triangle_count() as f64;
    (errors, points)
}

#[test]
fn a_quadratic_function_takes_seven_points_and_has_the_error_of_the_formula() {
    // On a right triangle with legs h along the axes the interpolation error of x^2 has the gradient 2 x - (the sum of the ends), whose square
    // integrates to h^2/3 times the area: h = 1/8 on an area of 4.
    let gradient: Gradient = [Arc::new(|x: f64, _: f64| 2.0 * x), Arc::new(Constant(0.0))];
    let tension: Arc<dyn Field> = Arc::new(Constant(3.0));
    let (errors, points) = interpolation_errors("P2_right_16", |x, _| x * x, gradient, tension);
    let expected = f64::sqrt(4.0 / 3.0) / 8.0;
    assert_eq!(points, 7.0);
    for value in errors.h1 {
        assert!((value - expected).abs() < 1e-14, "{value}");
    }
    assert!((errors.h1_total - 2f64.sqrt() * expected).abs() < 1e-14);
    assert!((errors.energy - 6f64.sqrt() * expected).abs() < 1e-14);
    assert_eq!(errors.sigma, None);
}

#[test]
fn rounding_noise_takes_no_more_points() {
    let gradient: Gradient = [
        Arc::new(|x: f64, _: f64| 0.3 * ((1e3 * x).sin().powi(2) + (1e3 * x).cos().powi(2))),
        Arc::new(|x: f64, y: f64| 0.1 + 1e-14 * (1e5 * x * y).sin()),
    ];
    let tension: Arc<dyn Field> = Arc::new(Constant(1.0));
    let value = |x: f64, y: f64| 0.3 * x + 0.1 * y;
    let (errors, points) = interpolation_errors("P8_delaunay_24", value, gradient, tension);
    assert_eq!(points, 7.0);
    assert!(errors.energy < 1e-13);
}

#[test]
fn the_energy_weighs_with_the_tension_at_the_point() {
    // A tension that is even but for x/2, and one that jumps along edges by a factor that needs points of its own for the seminorm.
    let gradient: Gradient = [Arc::new(|x: f64, _: f64| 2.0 * x), Arc::new(Constant(0.0))];
    let tension: Arc<dyn Field> = Arc::new(|x: f64, _: f64| 1.0 + 0.5 * x);
    let (errors, _) = interpolation_errors("P2_right_16", |x, _| x * x, gradient, tension);
    // By symmetry in x the odd part of the tension cancels over the domain, so the energy is that of the tension 1.
    let expected = f64::sqrt(8.0 / 3.0) / 8.0;
    assert!(
        (errors.energy - expected).abs() < 1e-12,
        "{}",
        errors.energy
    );
    let wide: Arc<dyn Field> = Arc::new(|x: f64, _: f64| if x > 0.0 { 1e6 } else { 1.0 });
    let gradient: Gradient = [Arc::new(|x: f64, _: f64| 2.0 * x), Arc::new(Constant(0.0))];
    let (errors, _) = interpolation_errors("P2_right_16", |x, _| x * x, gradient, wide);
    let expected = f64::sqrt((1e6 + 1.0) * 4.0 / 3.0) / 8.0;
    assert!((errors.energy / expected - 1.0).abs() < 1e-14);
}

#[test]
fn a_value_that_is_not_finite_is_reported() {
    let gradient: Gradient = [Arc::new(|x: f64, _: f64| x.ln()), Arc::new(Constant(0.0))];
    let tension: [Arc<dyn Field>; 2] = [Arc::new(Constant(1.0)), Arc::new(Constant(1.0))];
    let Reference {
        mesh,
        problem,
        solution,
        ..
    } = Reference::read("P6_cross_8", &tension);
    let exact = Exact {
        displacement: [gradient.clone(), gradient],
        sigma: None,
        action: None,
        contact: None,
    };
    let errors = true_errors(
        &mesh,
        &problem.tension_mean,
        &solution.displacement,
        &solution.sigma,
        &exact,
        &tension,
    );
    assert!(errors.is_err());
}
