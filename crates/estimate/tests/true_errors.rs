//! True errors of given discrete solutions against the committed reference values.

mod support;

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use estimate::true_errors;
use fem_core::{Field, FieldError, Samples};
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
            &reference.problem,
            &reference.solution,
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
            assert!(off <= 1e-3, "{} {key} {value:e} {off:e}", case.file);
        }
    }
}
