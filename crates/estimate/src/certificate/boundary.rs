//! What piecewise affine boundary values do not see of the boundary heights.

use fem_core::quadrature::segment_rule;
use fem_core::{ElementValues, Field, FieldError, Mesh, Samples};

/// How far the boundary heights are from their interpolants along the edges of a mesh.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum BoundaryOscillation {
    /// Affine along every edge, but for rounding: the discrete boundary values are the given ones.
    None,
    /// (sum_i sum over boundary edges e of mu_iK h_e^-1 ||g_i - g_ih||_e^2)^(1/2), in the unit of the energy norm: the size of the energy error that
    /// the interpolation of the heights leaves, up to a constant.
    Energy(f64),
}

/// Deviations below this many spacings of the largest height are rounding.
const SPACINGS: f64 = 64.0;

/// Samples the heights g_1, g_2 along every boundary edge of a mesh.
///
/// # Errors
/// A height that is not finite.
pub fn boundary_oscillation(
    mesh: &Mesh,
    heights: [&dyn Field; 2],
    tension_mean: &[ElementValues; 2],
) -> Result<BoundaryOscillation, FieldError> {
    let rule = segment_rule();
    let (mut square, mut seen) = (0.0, false);
    for (field, mean) in heights.iter().zip(tension_mean) {
        if field.constant().is_some() {
            continue;
        }
        let (mut x, mut y, mut region) = (Vec::new(), Vec::new(), Vec::new());
        let mut weights = Vec::new();
        for (t, face) in mesh.boundary_edges() {
            let [p, q] = mesh.face(t, face).map(|v| mesh.points()[v.index()]);
            // mu h^-1 ||v||^2 on the edge: the length cancels.
            weights.push(mean[t.index()]);
            for s in std::iter::once(0.0)
                .chain(rule.iter().map(|r| r.at))
                .chain(std::iter::once(1.0))
            {
                x.push(p[0] + s * (q[0] - p[0]));
                y.push(p[1] + s * (q[1] - p[1]));
                region.push(f64::from(mesh.region()[t.index()]));
            }
        }
        let mut values = vec![0.0; x.len()];
        let samples = Samples {
            x: &x,
            y: &y,
            region: &region,
        };
        field.sample(samples, &mut values)?;
        let largest = values.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let floor = SPACINGS * f64::EPSILON * largest;
        for (values, weight) in values.chunks(rule.len() + 2).zip(&weights) {
            let (first, last) = (values[0], values[values.len() - 1]);
            for (r, value) in rule.iter().zip(&values[1..]) {
                let deviation = value - (first + r.at * (last - first));
                seen |= deviation.abs() > floor;
                square += weight * r.weight * deviation * deviation;
            }
        }
    }
    Ok(if seen {
        BoundaryOscillation::Energy(square.sqrt())
    } else {
        BoundaryOscillation::None
    })
}
