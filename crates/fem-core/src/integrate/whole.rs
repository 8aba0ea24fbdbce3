//! Sampling whole elements, many at once: what nearly all elements of a fine mesh need.

use super::lanes;
use super::smooth_error;
use crate::field::{Field, FieldError, Samples};
use crate::index::TriangleId;
use crate::mesh::{Mesh, signed_area};
use crate::quadrature::{POINTS, rule};

/// Elements that are sampled together: their points fill a block of 256, the best size for expressions.
pub(super) const BLOCK: usize = 36;

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

/// One number for every element of a block.
pub(super) type Row = [f64; BLOCK];

/// The fits of one field on the elements of a block.
#[repr(align(32))]
#[derive(Clone, Debug)]
pub(super) struct Fits {
    mean: Row,
    corners: [Row; 2],
    variance: Row,
    largest: Row,
    error: Row,
}

impl Fits {
    pub(super) const NONE: Fits = Fits {
        mean: [0.0; BLOCK],
        corners: [[0.0; BLOCK]; 2],
        variance: [0.0; BLOCK],
        largest: [0.0; BLOCK],
        error: [0.0; BLOCK],
    };

    #[inline]
    fn at(&self, k: usize) -> Fit {
        Fit {
            mean: self.mean[k],
            corners: [self.corners[0][k], self.corners[1][k]],
            variance: self.variance[k],
            largest: self.largest[k],
            error: self.error[k],
        }
    }
}

/// The samples of a field at the points of a block.
#[repr(align(32))]
#[derive(Clone)]
pub(super) struct Values(pub(super) [f64; BLOCK * POINTS]);

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
    let mut values = Values([0.0; BLOCK * POINTS]);
    let mut fits = [const { Fits::NONE }; N];
    let mut list = list.peekable();
    while list.peek().is_some() {
        block.gather(mesh, list.by_ref().take(BLOCK));
        lanes::place(&mut block, &table);
        let stride = block.stride();
        for (field, fits) in fields.iter().zip(&mut fits) {
            field.sample(block.samples(), &mut values.0[..stride * POINTS])?;
            lanes::fit(&table, &values, stride, fits);
        }
        for k in 0..block.count {
            let t = block.triangles[k] as usize;
            visit(t, block.area[k], fits.each_ref().map(|f| f.at(k)));
        }
    }
    Ok(())
}

/// The points of a block of elements: point q of all elements, then point q + 1.
#[repr(align(32))]
pub(super) struct Block {
    /// Coordinates of the corners, `corners[corner][axis]`.
    corners: [[Row; 2]; 3],
    area: Row,
    x: [f64; BLOCK * POINTS],
    y: [f64; BLOCK * POINTS],
    region: [f64; BLOCK * POINTS],
    triangles: [u32; BLOCK],
    count: usize,
    /// What all of `region` was filled with last, if it was the same.
    same_region: Option<i32>,
}

impl Block {
    fn new() -> Block {
        Block {
            corners: [[[0.0; BLOCK]; 2]; 3],
            area: [0.0; BLOCK],
            x: [0.0; BLOCK * POINTS],
            y: [0.0; BLOCK * POINTS],
            region: [0.0; BLOCK * POINTS],
            triangles: [0; BLOCK],
            count: 0,
            same_region: Some(0),
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

    /// Takes at most [`BLOCK`] triangles and at least one, with their corners and regions.
    fn gather(&mut self, mesh: &Mesh, list: impl Iterator<Item = u32>) {
        self.count = 0;
        let mut put = |k: usize, t: u32| {
            let c = mesh.corners(TriangleId(t));
            for (to, from) in self.corners.iter_mut().zip(c) {
                to[0][k] = from[0];
                to[1][k] = from[1];
            }
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
        let region = |k: usize| mesh.region()[self.triangles[k] as usize];
        let first = region(0);
        let same = (1..stride).all(|k| region(k) == first).then_some(first);
        if same.is_some() && same == self.same_region {
            return;
        }
        match same {
            Some(first) => self.region.fill(f64::from(first)),
            None => {
                for q in 0..POINTS {
                    for k in 0..stride {
                        self.region[q * stride + k] = f64::from(region(k));
                    }
                }
            }
        }
        self.same_region = same;
    }

    /// Finds the points and the areas.
    #[inline(always)]
    pub(super) fn place(&mut self, table: &Table) {
        let stride = self.stride();
        let axes = [0, 1].map(|axis| self.corners.each_ref().map(|c| &c[axis][..stride]));
        let [[ax, bx, cx], [ay, by, cy]] = axes;
        for (k, area) in self.area[..stride].iter_mut().enumerate() {
            *area = signed_area([[ax[k], ay[k]], [bx[k], by[k]], [cx[k], cy[k]]]);
        }
        for (q, at) in table.at.iter().enumerate() {
            let range = q * stride..(q + 1) * stride;
            for ([a, b, c], to) in axes.into_iter().zip([&mut self.x, &mut self.y]) {
                for (k, to) in to[range.clone()].iter_mut().enumerate() {
                    *to = at[0] * a[k] + at[1] * b[k] + at[2] * c[k];
                }
            }
        }
    }
}

/// The rule, as the fits need it.
pub(super) struct Table {
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

    /// Fits affine functions to the samples of the elements of a block, see [`crate::quadrature::affine_fit`].
    #[inline(always)]
    pub(super) fn fit(&self, values: &Values, stride: usize, fits: &mut Fits) {
        for first in (0..stride).step_by(LANES) {
            self.fit_lanes(values, stride, first, fits);
        }
    }

    #[inline(always)]
    fn fit_lanes(&self, values: &Values, stride: usize, begin: usize, fits: &mut Fits) {
        type Lanes = [f64; LANES];
        let sample = |q: usize| -> Lanes {
            let at = &values.0[q * stride + begin..][..LANES];
            std::array::from_fn(|l| at[l])
        };
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
        let put = |to: &mut Row, value: Lanes| to[begin..][..LANES].copy_from_slice(&value);
        let lanes = |f: &dyn Fn(usize) -> f64| -> Lanes { std::array::from_fn(f) };
        put(&mut fits.mean, lanes(&|l| base[l] + mean[l]));
        for (to, slope) in fits.corners.iter_mut().zip([first, second]) {
            put(to, lanes(&|l| (base[l] + mean[l]) / 3.0 + slope[l]));
        }
        put(
            &mut fits.variance,
            lanes(&|l| (square[l] - mean[l] * mean[l]).max(0.0)),
        );
        put(&mut fits.largest, largest);
        put(
            &mut fits.error,
            lanes(&|l| smooth_error(misfit[l], largest[l])),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers from -1 to 1.
    fn numbers(seed: u64) -> impl Iterator<Item = f64> {
        let mut state = seed;
        std::iter::repeat_with(move || {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        })
    }

    #[test]
    fn wide_loops_give_the_bits_of_plain_ones() {
        let table = Table::new();
        for count in [1, 4, 21, BLOCK] {
            let block = || {
                let mut block = Block::new();
                block.count = count;
                let rows = block.corners.iter_mut().flatten();
                for (k, row) in rows.enumerate() {
                    row.iter_mut()
                        .zip(numbers(k as u64))
                        .for_each(|(to, from)| *to = from);
                }
                block
            };
            let (mut plain, mut wide) = (block(), block());
            plain.place(&table);
            lanes::place(&mut wide, &table);
            assert_eq!((plain.x, plain.y, plain.area), (wide.x, wide.y, wide.area));
            let mut values = Values([0.0; BLOCK * POINTS]);
            for (k, (to, from)) in values.0.iter_mut().zip(numbers(7)).enumerate() {
                // The first elements have the same value at all points.
                *to = if k % block().stride() < 2 { 0.3 } else { from };
            }
            let (mut plain, mut wide) = (Fits::NONE, Fits::NONE);
            table.fit(&values, block().stride(), &mut plain);
            lanes::fit(&table, &values, block().stride(), &mut wide);
            assert_eq!(format!("{plain:?}"), format!("{wide:?}"));
        }
    }
}
