//! Sampling whole elements, many at once: what nearly all elements of a fine mesh need.

use super::lanes;
use super::smooth_error;
use crate::field::{FieldError, Samples};
use crate::mesh::{Mesh, signed_area};
use crate::quadrature::{POINTS, rule};

/// Elements that are sampled together: their points are whole steps of a block of expressions.
pub(super) const BLOCK: usize = 80;

/// Elements that are worked on together: their numbers nearly fit in the registers, and what is the same for all is loaded for so many at once.
const LANES: usize = 8;

/// One number for every element of a block.
pub(super) type Row = [f64; BLOCK];

/// What the seven samples of a function tell of it on the elements of a block.
#[repr(align(32))]
#[derive(Clone, Debug)]
pub(super) struct Fits {
    /// Means.
    pub mean: Row,
    /// Means of f phi_0 and f phi_1.
    pub corners: [Row; 2],
    /// Means of (f - mean)^2.
    pub variance: Row,
    /// The largest absolute values of the samples.
    pub largest: Row,
    /// The errors of the means that the misfits of the samples point to.
    pub error: Row,
}

impl Fits {
    pub(super) const NONE: Fits = Fits {
        mean: [0.0; BLOCK],
        corners: [[0.0; BLOCK]; 2],
        variance: [0.0; BLOCK],
        largest: [0.0; BLOCK],
        error: [0.0; BLOCK],
    };
}

/// The samples of a field at the points of a block.
#[repr(align(32))]
#[derive(Clone)]
pub(super) struct Values(pub(super) [f64; BLOCK * POINTS]);

/// Samples fields on the triangles of `list` and shows every block of triangles, with their areas and the fits of the fields. `sample` samples
/// all fields.
///
/// # Errors
/// What `sample` reports.
pub(super) fn fit<const N: usize>(
    mesh: &Mesh,
    list: &[u32],
    mut sample: impl FnMut(Samples<'_>, [&mut [f64]; N]) -> Result<(), FieldError>,
    mut visit: impl FnMut(&[u32], &Row, &[Fits; N]),
) -> Result<(), FieldError> {
    let table = Table::new();
    let mut block = Block::new();
    let mut values = [const { Values([0.0; BLOCK * POINTS]) }; N];
    let mut fits = [const { Fits::NONE }; N];
    for list in list.chunks(BLOCK) {
        block.gather(mesh, list);
        lanes::place(&mut block, &table);
        let stride = block.stride();
        sample(
            block.samples(),
            values.each_mut().map(|v| &mut v.0[..stride * POINTS]),
        )?;
        for (values, fits) in values.iter().zip(&mut fits) {
            lanes::fit(&table, values, stride, fits);
        }
        visit(list, &block.area, &fits);
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
    fn gather(&mut self, mesh: &Mesh, list: &[u32]) {
        let [[ax, ay], [bx, by], [cx, cy]] = &mut self.corners;
        let (points, triangles, region) = (mesh.points(), mesh.triangles(), mesh.region());
        let mut put = |k: usize, t: u32| {
            let [a, b, c] = triangles[t as usize].map(|v| points[v.index()]);
            (ax[k], ay[k]) = (a[0], a[1]);
            (bx[k], by[k]) = (b[0], b[1]);
            (cx[k], cy[k]) = (c[0], c[1]);
        };
        self.count = list.len().min(BLOCK);
        let list = &list[..self.count];
        for (k, t) in list.iter().enumerate() {
            put(k, *t);
        }
        // The last element again, so that no lane is without one.
        let last = list[self.count - 1];
        for k in self.count..self.count.next_multiple_of(LANES) {
            put(k, last);
        }
        let first = region[list[0] as usize];
        let differs = list
            .iter()
            .fold(0, |all, t| all | (region[*t as usize] ^ first));
        let same = (differs == 0).then_some(first);
        if same.is_some() && same == self.same_region {
            return;
        }
        match same {
            Some(first) => self.region.fill(f64::from(first)),
            None => {
                let stride = self.stride();
                for q in 0..POINTS {
                    for k in 0..stride {
                        let t = list.get(k).copied().unwrap_or(last);
                        self.region[q * stride + k] = f64::from(region[t as usize]);
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
    /// What the fitted function has at a point of its slopes for the corners 0 and 1.
    fitted: [[f64; 2]; POINTS],
}

impl Table {
    fn new() -> Table {
        let rule = rule();
        Table {
            at: rule.map(|p| p.at),
            weight: rule.map(|p| p.weight),
            slope: rule.map(|p| [0, 1].map(|k| p.weight * (p.at[k] - 1.0 / 3.0))),
            fitted: rule.map(|p| [0, 1].map(|k| 12.0 * (p.at[k] - p.at[2]))),
        }
    }

    /// Fits affine functions to the samples of the elements of a block, see [`crate::quadrature::affine_fit`].
    #[inline(always)]
    pub(super) fn fit(&self, values: &Values, stride: usize, fits: &mut Fits) {
        type Lanes = [f64; LANES];
        let groups = stride / LANES;
        let rows: [&[Lanes]; POINTS] = std::array::from_fn(|q| {
            &values.0[q * stride..(q + 1) * stride].as_chunks().0[..groups]
        });
        let [first, second] = &mut fits.corners;
        let rows_out = [&mut fits.mean, first, second, &mut fits.variance];
        let [means, firsts, seconds, variances] =
            rows_out.map(|row| &mut row.as_chunks_mut::<LANES>().0[..groups]);
        let [sizes, errors] = [&mut fits.largest, &mut fits.error]
            .map(|row| &mut row.as_chunks_mut::<LANES>().0[..groups]);
        for g in 0..groups {
            let fit = self.fit_lanes(rows.map(|row| &row[g]));
            means[g] = fit.mean;
            [firsts[g], seconds[g]] = fit.corners;
            variances[g] = fit.variance;
            sizes[g] = fit.largest;
            errors[g] = fit.error;
        }
    }

    #[inline(always)]
    fn fit_lanes(&self, samples: [&[f64; LANES]; POINTS]) -> FitLanes {
        type Lanes = [f64; LANES];
        let base = *samples[0];
        let mut largest: Lanes = base.map(f64::abs);
        let (mut mean, mut square): (Lanes, Lanes) = ([0.0; LANES], [0.0; LANES]);
        let (mut first, mut second): (Lanes, Lanes) = ([0.0; LANES], [0.0; LANES]);
        // The first sample is the base, of which nothing is left.
        for q in 1..POINTS {
            let v = samples[q];
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
            let v = samples[q];
            let [a, b] = self.fitted[q];
            for l in 0..LANES {
                let off = (v[l] - base[l] - (mean[l] + a * first[l] + b * second[l])).abs();
                misfit[l] = if off > misfit[l] { off } else { misfit[l] };
            }
        }
        let lanes = |f: &dyn Fn(usize) -> f64| -> Lanes { std::array::from_fn(f) };
        FitLanes {
            mean: lanes(&|l| base[l] + mean[l]),
            corners: [first, second].map(|slope| lanes(&|l| (base[l] + mean[l]) / 3.0 + slope[l])),
            variance: lanes(&|l| (square[l] - mean[l] * mean[l]).max(0.0)),
            largest,
            error: lanes(&|l| smooth_error(misfit[l], largest[l])),
        }
    }
}

/// [`Fits`] of the elements of a group.
struct FitLanes {
    mean: [f64; LANES],
    corners: [[f64; LANES]; 2],
    variance: [f64; LANES],
    largest: [f64; LANES],
    error: [f64; LANES],
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
