//! Sampling whole elements, many at once: what nearly all elements of a fine mesh need.

use super::smooth_error;
use crate::field::{Field, FieldError, Samples};
use crate::index::TriangleId;
use crate::mesh::{Mesh, signed_area};
use crate::quadrature::{POINTS, rule};

/// Elements that are sampled together: their points fill a block of 256, the best size for expressions.
const BLOCK: usize = 36;

/// Elements that are worked on together: arrays so short stay in registers.
const LANES: usize = 4;

/// What the seven samples of a function tell of it on an element.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Fit {
    /// Mean.
    pub mean: f64,
    /// Means of f phi_0 and f phi_1.
    pub corners: [f64; 2],
    /// Mean of (f - mean)^2.
    pub variance: f64,
    /// The largest absolute value of a sample.
    pub largest: f64,
    /// The error of the mean that the misfit of the samples points to.
    pub error: f64,
}

/// Samples fields on the triangles of `list` and shows every triangle with its area and the fits of the fields.
///
/// # Errors
/// A value of a field that is not finite.
pub(super) fn fit<const N: usize>(
    mesh: &Mesh,
    list: impl Iterator<Item = u32>,
    fields: [&dyn Field; N],
    mut visit: impl FnMut(usize, f64, [Fit; N]),
) -> Result<(), FieldError> {
    let table = Table::new();
    let mut block = Block::new();
    let mut values = vec![[0.0; BLOCK * POINTS]; N];
    let mut list = list.peekable();
    while list.peek().is_some() {
        block.fill(mesh, &table, list.by_ref().take(BLOCK));
        let stride = block.stride();
        let samples = block.samples();
        for (field, values) in fields.iter().zip(&mut values) {
            field.sample(samples, &mut values[..stride * POINTS])?;
        }
        for first in (0..block.count).step_by(LANES) {
            let mut fits = [[Fit::default(); LANES]; N];
            for (fits, values) in fits.iter_mut().zip(&values) {
                *fits = table.fit(|q| {
                    let at = q * stride + first;
                    std::array::from_fn(|lane| values[at + lane])
                });
            }
            for lane in 0..LANES.min(block.count - first) {
                let t = block.triangles[first + lane] as usize;
                visit(
                    t,
                    block.area[first + lane],
                    fits.each_ref().map(|f| f[lane]),
                );
            }
        }
    }
    Ok(())
}

/// The points of a block of elements: point q of all elements, then point q + 1.
struct Block {
    triangles: [u32; BLOCK],
    count: usize,
    area: [f64; BLOCK],
    x: [f64; BLOCK * POINTS],
    y: [f64; BLOCK * POINTS],
    region: [f64; BLOCK * POINTS],
}

impl Block {
    fn new() -> Block {
        Block {
            triangles: [0; BLOCK],
            count: 0,
            area: [0.0; BLOCK],
            x: [0.0; BLOCK * POINTS],
            y: [0.0; BLOCK * POINTS],
            region: [0.0; BLOCK * POINTS],
        }
    }

    /// The elements and those that fill up the last lanes.
    fn stride(&self) -> usize {
        self.count.next_multiple_of(LANES)
    }

    fn samples(&self) -> Samples<'_> {
        let n = self.stride() * POINTS;
        Samples {
            x: &self.x[..n],
            y: &self.y[..n],
            region: &self.region[..n],
        }
    }

    /// Takes at most [`BLOCK`] triangles and at least one.
    fn fill(&mut self, mesh: &Mesh, table: &Table, list: impl Iterator<Item = u32>) {
        self.count = 0;
        let mut corners = [[[0.0; BLOCK]; 2]; 3];
        let mut region = [0.0; BLOCK];
        let mut put = |k: usize, t: u32| {
            let c = mesh.corners(TriangleId(t));
            for (to, from) in corners.iter_mut().zip(c) {
                to[0][k] = from[0];
                to[1][k] = from[1];
            }
            region[k] = f64::from(mesh.region()[t as usize]);
            self.area[k] = signed_area(c);
            self.triangles[k] = t;
        };
        let mut last = 0;
        for t in list {
            put(self.count, t);
            self.count += 1;
            last = t;
        }
        // The last element again, so that no lane is without one.
        for k in self.count..self.count.next_multiple_of(LANES) {
            put(k, last);
        }
        let stride = self.stride();
        for (q, at) in table.at.iter().enumerate() {
            let range = q * stride..(q + 1) * stride;
            for (axis, to) in [(0, &mut self.x), (1, &mut self.y)] {
                let [a, b, c] = corners.each_ref().map(|corner| &corner[axis][..stride]);
                for (k, to) in to[range.clone()].iter_mut().enumerate() {
                    *to = at[0] * a[k] + at[1] * b[k] + at[2] * c[k];
                }
            }
            self.region[range].copy_from_slice(&region[..stride]);
        }
    }
}

/// The rule, as the fits need it.
struct Table {
    at: [[f64; 3]; POINTS],
    weight: [f64; POINTS],
    /// Weight times (lambda_k - 1/3) for the corners 0 and 1; the three sum to zero.
    slope: [[f64; 2]; POINTS],
}

impl Table {
    fn new() -> Table {
        let rule = rule();
        Table {
            at: rule.map(|p| p.at),
            weight: rule.map(|p| p.weight),
            slope: rule.map(|p| [0, 1].map(|k| p.weight * (p.at[k] - 1.0 / 3.0))),
        }
    }

    /// Fits affine functions to the samples of some elements, see [`crate::quadrature::affine_fit`].
    #[inline(always)]
    fn fit(&self, sample: impl Fn(usize) -> [f64; LANES]) -> [Fit; LANES] {
        type Lanes = [f64; LANES];
        let base = sample(0);
        let mut largest: Lanes = base.map(f64::abs);
        let (mut mean, mut square): (Lanes, Lanes) = ([0.0; LANES], [0.0; LANES]);
        let (mut first, mut second): (Lanes, Lanes) = ([0.0; LANES], [0.0; LANES]);
        // The first sample is the base, of which nothing is left.
        for q in 1..POINTS {
            let v = sample(q);
            for l in 0..LANES {
                let d = v[l] - base[l];
                let size = v[l].abs();
                largest[l] = if size > largest[l] { size } else { largest[l] };
                mean[l] += self.weight[q] * d;
                square[l] += self.weight[q] * (d * d);
                first[l] += self.slope[q][0] * d;
                second[l] += self.slope[q][1] * d;
            }
        }
        // (lambda_k - 1/3) have mean zero, norm^2 1/18 and products -1/36: the fit is mean + 12 * sum slope_k lambda_k, and the third slope is minus
        // the sum of the others.
        let mut misfit: Lanes = [0.0; LANES];
        for q in 0..POINTS {
            let v = sample(q);
            let [a, b] = [0, 1].map(|k| 12.0 * (self.at[q][k] - self.at[q][2]));
            for l in 0..LANES {
                let off = (v[l] - base[l] - (mean[l] + a * first[l] + b * second[l])).abs();
                misfit[l] = if off > misfit[l] { off } else { misfit[l] };
            }
        }
        std::array::from_fn(|l| {
            let third = (base[l] + mean[l]) / 3.0;
            Fit {
                mean: base[l] + mean[l],
                corners: [third + first[l], third + second[l]],
                variance: (square[l] - mean[l] * mean[l]).max(0.0),
                largest: largest[l],
                error: smooth_error(misfit[l], largest[l]),
            }
        })
    }
}
