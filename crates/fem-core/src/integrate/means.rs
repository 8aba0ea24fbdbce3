//! Tensions: their means over elements.

use super::carry::kept;
use super::loads::smooth_error;
use super::whole;
use super::{Allowed, Control, Integrand, Judgement, Piece, Whole, divide};
use crate::field::{Field, FieldError, Samples};
use crate::index::TriangleId;
use crate::mesh::Mesh;
use crate::quadrature::affine_misfit;
use crate::values::ElementValues;

/// Element means of tensions are wanted to ten digits where the tension is smooth.
const MEAN_CONTROL: Control = Control {
    tolerance: 1e-12,
    local: true,
    depth: 7,
    largest_share: 2.0,
};

/// The mean of a field over every triangle, to ten digits where it is smooth.
///
/// # Errors
/// A value of the field that is not finite.
pub fn means(mesh: &Mesh, field: &dyn Field) -> Result<ElementValues, FieldError> {
    means_where(mesh, field, |_| None)
}

/// The means on a mesh made from another one by [`Mesh::refine`]: only the triangles that it bisected are sampled. The result is that of [`means`], bit
/// for bit.
///
/// `before` holds the means on the mesh before, `parent` is that of the [`crate::Refinement`].
///
/// # Errors
/// A value of the field that is not finite.
pub fn means_carried(
    mesh: &Mesh,
    field: &dyn Field,
    before: &ElementValues,
    parent: &[TriangleId],
) -> Result<ElementValues, FieldError> {
    means_where(mesh, field, |t| kept(parent, t).map(|old| before[old]))
}

/// Integrates where `known` has no value.
fn means_where(
    mesh: &Mesh,
    field: &dyn Field,
    known: impl Fn(usize) -> Option<f64>,
) -> Result<ElementValues, FieldError> {
    if let Some(value) = field.constant() {
        return Ok(ElementValues::Same(value));
    }
    let count = mesh.triangle_count();
    let mut fresh = Vec::new();
    let base = (0..count)
        .map(|t| {
            known(t).unwrap_or_else(|| {
                fresh.push(t as u32);
                0.0
            })
        })
        .collect();
    let mut sums = FieldMeans {
        field,
        base,
        shares: Vec::new(),
    };
    let mut wanting = Vec::new();
    let mut magnitudes = vec![[0.0; 2]; count];
    let tolerance = MEAN_CONTROL.tolerance;
    let sample = |at: Samples<'_>, [out]: [&mut [f64]; 1]| field.sample(at, out);
    whole::fit(mesh, &fresh, sample, |list, _, [fits]| {
        for (k, &id) in list.iter().enumerate() {
            let t = id as usize;
            sums.base[t] = fits.mean[k];
            if fits.error[k] > tolerance * fits.largest[k] {
                magnitudes[t][0] = fits.largest[k];
                wanting.push(id);
            }
        }
    })?;
    if !wanting.is_empty() {
        sums.shares = vec![0.0; count];
        let allowed = Allowed {
            control: MEAN_CONTROL,
            coarse: f64::INFINITY,
            whole: Whole::Each(&magnitudes),
        };
        divide(mesh, &allowed, &mut sums, &wanting)?;
        for &t in &wanting {
            let t = t as usize;
            sums.base[t] += sums.shares[t] / mesh.area(TriangleId(t as u32));
        }
    }
    Ok(ElementValues::Each(sums.base))
}

/// Means under way.
struct FieldMeans<'a> {
    field: &'a dyn Field,
    /// Means by seven points.
    base: Vec<f64>,
    /// Of triangles that are divided: integrals of the field minus that mean.
    shares: Vec<f64>,
}

impl Integrand for FieldMeans<'_> {
    fn components(&self) -> usize {
        1
    }

    fn sample(&mut self, at: Samples<'_>, out: &mut [f64]) -> Result<(), FieldError> {
        self.field.sample(at, out)
    }

    // The error of the element's mean; the quadrature error of a piece counts by its share of the element.
    fn judge(&self, piece: &Piece<'_>) -> Judgement {
        let f = piece.values(0);
        let largest = f.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        Judgement {
            magnitude: largest * piece.share,
            error: piece.share * smooth_error(affine_misfit(piece.rule, f), largest),
        }
    }

    fn clear(&mut self, triangle: usize) {
        self.shares[triangle] = 0.0;
    }

    fn add(&mut self, piece: &Piece<'_>) {
        let base = self.base[piece.triangle];
        let f = piece.values(0);
        for (p, v) in piece.rule.iter().zip(f) {
            self.shares[piece.triangle] += p.weight * piece.area * (v - base);
        }
    }
}
