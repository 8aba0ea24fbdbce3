//! What the tolerances of loads are relative to.

use super::{Control, Integrand, Judgement, Piece, integrate};
use crate::field::{Field, FieldError, FieldPair, Samples};
use crate::mesh::Mesh;

/// The size of a domain and of the two loads on it, found once for a problem.
///
/// Elements are judged by these numbers on every mesh, so that the integrals over an element depend on nothing but the element.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference {
    /// Area of the domain.
    pub area: f64,
    /// Integrals of the absolute values of the loads; infinite for a load that vanishes at all samples, of which nothing is known: seven points do for
    /// its elements once they are small.
    pub magnitude: [f64; 2],
}

/// The magnitudes are sampled on pieces of at most this share of the domain: what lies between the samples is too small to be relative to.
const SHARE: f64 = 1.0 / 4096.0;

impl Reference {
    /// Samples two loads on the initial mesh of a problem; nothing of constants.
    ///
    /// # Errors
    /// A value of a field that is not finite.
    pub fn of(mesh: &Mesh, fields: [&dyn Field; 2]) -> Result<Reference, FieldError> {
        let area = crate::norms::area(mesh);
        if let [Some(f), Some(g)] = fields.map(|f| f.constant()) {
            return Ok(Reference {
                area,
                magnitude: [f, g].map(|f| known(f.abs() * area)),
            });
        }
        let control = Control {
            tolerance: 0.0,
            local: false,
            depth: 14,
            largest_share: SHARE,
        };
        let mut sizes = Sizes {
            fields: FieldPair::new(fields),
            sums: vec![[0.0; 2]; mesh.triangle_count()],
        };
        integrate(mesh, control, &mut sizes)?;
        Ok(Reference {
            area,
            magnitude: [0, 1].map(|i| known(sizes.sums.iter().map(|s| s[i]).sum())),
        })
    }
}

fn known(magnitude: f64) -> f64 {
    if magnitude > 0.0 {
        magnitude
    } else {
        f64::INFINITY
    }
}

/// Integrals of absolute values: pieces are divided for their size alone.
struct Sizes<'a> {
    fields: FieldPair<'a>,
    sums: Vec<[f64; 2]>,
}

impl Integrand for Sizes<'_> {
    fn components(&self) -> usize {
        2
    }

    fn sample(&mut self, at: Samples<'_>, out: &mut [f64]) -> Result<(), FieldError> {
        let (first, second) = out.split_at_mut(at.len());
        self.fields.sample(at, [first, second])
    }

    fn judge(&self, _: &Piece<'_>) -> Judgement {
        Judgement {
            magnitude: 0.0,
            error: 0.0,
        }
    }

    fn clear(&mut self, triangle: usize) {
        self.sums[triangle] = [0.0; 2];
    }

    fn add(&mut self, piece: &Piece<'_>) {
        for (i, sum) in self.sums[piece.triangle].iter_mut().enumerate() {
            let samples = piece.rule.iter().zip(piece.values(i));
            *sum += piece.area * samples.map(|(p, v)| p.weight * v.abs()).sum::<f64>();
        }
    }
}
