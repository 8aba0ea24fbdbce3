//! A rule of high order, independent of the program's own: conical products of Gauss rules with eight points a direction.

use fem_core::{Field, Mesh, Samples};

/// Element means of a field, exact to rounding for smooth fields; no point lies on an edge.
pub fn means(mesh: &Mesh, field: &dyn Field) -> Vec<f64> {
    let gauss = gauss8();
    let mut result = Vec::with_capacity(mesh.triangle_count());
    for id in mesh.triangle_ids() {
        let [a, b, c] = mesh.corners(id);
        let (mut x, mut y, mut weights) = (Vec::new(), Vec::new(), Vec::new());
        for &(s, ws) in &gauss {
            for &(t, wt) in &gauss {
                // (s, t) in the unit square to a + s ((1 - t)(b - a) + t (c - a)), with the density 2 s over the area.
                let at = |k: usize| a[k] + s * ((1.0 - t) * (b[k] - a[k]) + t * (c[k] - a[k]));
                x.push(at(0));
                y.push(at(1));
                weights.push(2.0 * s * ws * wt);
            }
        }
        let region = vec![0.0; x.len()];
        let mut values = vec![0.0; x.len()];
        let samples = Samples {
            x: &x,
            y: &y,
            region: &region,
        };
        field.sample(samples, &mut values).unwrap();
        result.push(values.iter().zip(&weights).map(|(v, w)| v * w).sum());
    }
    result
}

/// Points and weights of the Gauss rule with eight points on (0, 1).
fn gauss8() -> Vec<(f64, f64)> {
    let n = 8;
    (1..=n)
        .map(|k| {
            // Newton's method for the zeros of the Legendre polynomial.
            let mut x = (std::f64::consts::PI * (k as f64 - 0.25) / (n as f64 + 0.5)).cos();
            let mut slope = 1.0;
            for _ in 0..20 {
                let (mut p, mut q) = (x, 1.0);
                for j in 2..=n {
                    let j = j as f64;
                    (p, q) = (((2.0 * j - 1.0) * x * p - (j - 1.0) * q) / j, p);
                }
                slope = n as f64 * (x * p - q) / (x * x - 1.0);
                x -= p / slope;
            }
            (0.5 * (1.0 + x), 1.0 / ((1.0 - x * x) * slope * slope))
        })
        .collect()
}
