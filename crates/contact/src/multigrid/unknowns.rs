//! The unknowns of a vertex: one number, or one for each membrane.
//!
//! In contact the gap stays closed. With one field that means no correction at all; with two both displacements move by the same
//! m = theta c_1 + (1 - theta) c_2, theta = d_1/(d_1 + d_2) the share of the upper membrane in the stiffness at the vertex: the
//! vertex is *glued*. T stands for that map below; it is the identity at vertices that are free.

use super::blocks::{Block, Symmetric};

/// A diagonal block counts as empty below this part of the untruncated one: what is left of a coarse hat function is rounding.
pub(crate) const EMPTY: f64 = 1e-9;

/// Arithmetic of the unknowns of a vertex. Couplings are blocks of the matrix whose row is the younger vertex.
pub(crate) trait Unknowns: Copy + Default {
    /// Numbers at a vertex.
    const WIDTH: usize;
    /// Values at a vertex.
    type Value: Copy + Default;
    /// Entry of the untruncated matrix: the membranes are not coupled there.
    type Plain: Copy + Default;
    /// Block between two vertices.
    type Coupling: Block;
    /// The same in single precision: enough where nothing is summed up, and half the memory.
    type Light: Copy + Default;
    /// Symmetric diagonal block, or its (pseudo-)inverse.
    type Pivot: Symmetric<Self::Coupling>;

    /// Share of the upper membrane in the stiffness.
    fn share(diagonal: Self::Plain) -> f64;
    /// Entries of one or two matrices, in the order of the fields.
    fn plain(get: impl Fn(usize) -> f64) -> Self::Plain;
    /// Component of an entry of the matrix.
    fn plain_at(entry: Self::Plain, i: usize) -> f64;
    /// Component of a value.
    fn at(value: Self::Value, i: usize) -> f64;
    /// A value from its components.
    fn value(get: impl Fn(usize) -> f64) -> Self::Value;

    /// x + t y.
    fn plus(x: Self::Value, t: f64, y: Self::Value) -> Self::Value;
    /// x . y.
    fn dot(x: Self::Value, y: Self::Value) -> f64;
    /// t A of an untruncated entry A.
    fn plain_times(t: f64, a: Self::Plain) -> Self::Plain;
    /// A + t B of untruncated entries.
    fn plain_plus(a: Self::Plain, t: f64, b: Self::Plain) -> Self::Plain;
    /// x + A y with an untruncated entry A.
    fn plus_plain(x: Self::Value, a: Self::Plain, y: Self::Value) -> Self::Value;
    /// x - C y.
    fn minus(x: Self::Value, c: Self::Coupling, y: Self::Value) -> Self::Value;
    /// x - C'y.
    fn minus_transposed(x: Self::Value, c: Self::Coupling, y: Self::Value) -> Self::Value;
    /// D y.
    fn times(d: Self::Pivot, y: Self::Value) -> Self::Value;

    /// The largest component in magnitude.
    fn size(value: Self::Value) -> f64;
    /// The gap of values.
    fn gap(value: Self::Value) -> f64;
    /// What opens the gap if it is positive, from the residual at a closed vertex: r, or (1 - theta) r_1 - theta r_2.
    fn pull(residual: Self::Value, share: f64) -> f64;
    /// The nearest values without gap, in the norm of the diagonals.
    fn close(value: Self::Value, share: f64) -> Self::Value;
    /// T'r at a vertex in contact.
    fn gather(residual: Self::Value, share: f64) -> Self::Value;
    /// T c at a vertex in contact.
    fn spread(correction: Self::Value, share: f64) -> Self::Value;
    /// The least energy with a gap of at least `bound`, from the unconstrained minimiser and the inverse pivot.
    fn bounded(value: Self::Value, inverse: Self::Pivot, bound: f64) -> Self::Value;
    /// |r|/d in the rows that must vanish: all of a free vertex, the sum of a glued one over the stiffer diagonal.
    fn misfit(residual: Self::Value, diagonal: Self::Plain, contact: bool) -> f64;

    /// T_p' A T_q of an entry of the matrix, p the row; `None` at a free vertex, the share at one in contact.
    fn truncated(entry: Self::Plain, row: Option<f64>, column: Option<f64>) -> Self::Coupling;
    /// T'A T of a diagonal entry.
    fn truncated_pivot(entry: Self::Plain, contact: Option<f64>) -> Self::Pivot;

    /// The transposed block.
    fn transpose(c: Self::Coupling) -> Self::Coupling;
    /// Rounds a block to single precision.
    fn light(c: Self::Coupling) -> Self::Light;
    /// A rounded block.
    fn full(c: Self::Light) -> Self::Coupling;
    /// x + y/2.
    fn plus_half(x: Self::Coupling, y: Self::Coupling) -> Self::Coupling;
    /// Row a, column b: the edge that p halved, (C_pa' + C_pb)/2 + D_p/4.
    fn rejoin(pa: Self::Coupling, pb: Self::Coupling, pivot: Self::Pivot) -> Self::Coupling;
    /// Diagonal block of a parent: D_a + (C_pa + C_pa')/2 + D_p/4.
    fn inherit(a: Self::Pivot, pa: Self::Coupling, pivot: Self::Pivot) -> Self::Pivot;
    /// Inverse of a diagonal block on its range; `diagonal` is the untruncated diagonal that tells what is rounding.
    fn inverse(pivot: Self::Pivot, diagonal: Self::Plain) -> Self::Pivot;
    /// Component of a block.
    fn coupling_at(c: Self::Coupling, i: usize, j: usize) -> f64;
    /// Component of a diagonal block.
    fn pivot_at(d: Self::Pivot, i: usize, j: usize) -> f64;
}

/// One field: the gap, the mean, or sigma.
#[derive(Clone, Copy, Default)]
pub(crate) struct Scalar;

impl Unknowns for Scalar {
    const WIDTH: usize = 1;
    type Value = f64;
    type Plain = f64;
    type Coupling = f64;
    type Light = f32;
    type Pivot = f64;

    #[inline]
    fn share(_: f64) -> f64 {
        0.0
    }
    #[inline]
    fn plain(get: impl Fn(usize) -> f64) -> f64 {
        get(0)
    }
    #[inline]
    fn plain_at(entry: f64, _: usize) -> f64 {
        entry
    }
    #[inline]
    fn at(value: f64, _: usize) -> f64 {
        value
    }
    #[inline]
    fn value(get: impl Fn(usize) -> f64) -> f64 {
        get(0)
    }
    #[inline]
    fn plus(x: f64, t: f64, y: f64) -> f64 {
        x + t * y
    }
    #[inline]
    fn dot(x: f64, y: f64) -> f64 {
        x * y
    }
    #[inline]
    fn plain_times(t: f64, a: f64) -> f64 {
        t * a
    }
    #[inline]
    fn plain_plus(a: f64, t: f64, b: f64) -> f64 {
        a + t * b
    }
    #[inline]
    fn plus_plain(x: f64, a: f64, y: f64) -> f64 {
        x + a * y
    }
    #[inline]
    fn minus(x: f64, c: f64, y: f64) -> f64 {
        x - c * y
    }
    #[inline]
    fn minus_transposed(x: f64, c: f64, y: f64) -> f64 {
        x - c * y
    }
    #[inline]
    fn times(d: f64, y: f64) -> f64 {
        d * y
    }
    #[inline]
    fn size(value: f64) -> f64 {
        value.abs()
    }
    #[inline]
    fn gap(value: f64) -> f64 {
        value
    }
    #[inline]
    fn pull(residual: f64, _: f64) -> f64 {
        residual
    }
    #[inline]
    fn close(_: f64, _: f64) -> f64 {
        0.0
    }
    #[inline]
    fn gather(_: f64, _: f64) -> f64 {
        0.0
    }
    #[inline]
    fn spread(_: f64, _: f64) -> f64 {
        0.0
    }
    #[inline]
    fn bounded(value: f64, _: f64, bound: f64) -> f64 {
        value.max(bound)
    }
    #[inline]
    fn misfit(residual: f64, diagonal: f64, contact: bool) -> f64 {
        if contact {
            0.0
        } else {
            residual.abs() / diagonal
        }
    }
    #[inline]
    fn truncated(entry: f64, row: Option<f64>, column: Option<f64>) -> f64 {
        if row.is_some() || column.is_some() {
            0.0
        } else {
            entry
        }
    }
    #[inline]
    fn truncated_pivot(entry: f64, contact: Option<f64>) -> f64 {
        if contact.is_some() { 0.0 } else { entry }
    }
    #[inline]
    fn transpose(c: f64) -> f64 {
        c
    }
    #[inline]
    fn light(c: f64) -> f32 {
        c as f32
    }
    #[inline]
    fn full(c: f32) -> f64 {
        f64::from(c)
    }
    #[inline]
    fn plus_half(x: f64, y: f64) -> f64 {
        x + 0.5 * y
    }
    #[inline]
    fn rejoin(pa: f64, pb: f64, pivot: f64) -> f64 {
        0.5 * (pa + pb) + 0.25 * pivot
    }
    #[inline]
    fn inherit(a: f64, pa: f64, pivot: f64) -> f64 {
        a + pa + 0.25 * pivot
    }
    #[inline]
    fn inverse(pivot: f64, diagonal: f64) -> f64 {
        if pivot > EMPTY * diagonal {
            1.0 / pivot
        } else {
            0.0
        }
    }
    #[inline]
    fn coupling_at(c: f64, _: usize, _: usize) -> f64 {
        c
    }
    #[inline]
    fn pivot_at(d: f64, _: usize, _: usize) -> f64 {
        d
    }
}

/// Two fields: the displacements of both membranes. A symmetric block is stored as (11, 12, 22).
#[derive(Clone, Copy, Default)]
pub(crate) struct Pair;

impl Unknowns for Pair {
    const WIDTH: usize = 2;
    type Value = [f64; 2];
    type Plain = [f64; 2];
    type Coupling = [[f64; 2]; 2];
    type Light = [[f32; 2]; 2];
    type Pivot = [f64; 3];

    #[inline]
    fn share(d: [f64; 2]) -> f64 {
        1.0 / (1.0 + d[1] / d[0])
    }
    #[inline]
    fn plain(get: impl Fn(usize) -> f64) -> [f64; 2] {
        [get(0), get(1)]
    }
    #[inline]
    fn plain_at(entry: [f64; 2], i: usize) -> f64 {
        entry[i]
    }
    #[inline]
    fn at(value: [f64; 2], i: usize) -> f64 {
        value[i]
    }
    #[inline]
    fn value(get: impl Fn(usize) -> f64) -> [f64; 2] {
        [get(0), get(1)]
    }
    #[inline]
    fn plus(x: [f64; 2], t: f64, y: [f64; 2]) -> [f64; 2] {
        [x[0] + t * y[0], x[1] + t * y[1]]
    }
    #[inline]
    fn dot(x: [f64; 2], y: [f64; 2]) -> f64 {
        x[0] * y[0] + x[1] * y[1]
    }
    #[inline]
    fn plain_times(t: f64, a: [f64; 2]) -> [f64; 2] {
        [t * a[0], t * a[1]]
    }
    #[inline]
    fn plain_plus(a: [f64; 2], t: f64, b: [f64; 2]) -> [f64; 2] {
        [a[0] + t * b[0], a[1] + t * b[1]]
    }
    #[inline]
    fn plus_plain(x: [f64; 2], a: [f64; 2], y: [f64; 2]) -> [f64; 2] {
        [x[0] + a[0] * y[0], x[1] + a[1] * y[1]]
    }
    #[inline]
    fn minus(x: [f64; 2], c: [[f64; 2]; 2], y: [f64; 2]) -> [f64; 2] {
        [
            x[0] - (c[0][0] * y[0] + c[0][1] * y[1]),
            x[1] - (c[1][0] * y[0] + c[1][1] * y[1]),
        ]
    }
    #[inline]
    fn minus_transposed(x: [f64; 2], c: [[f64; 2]; 2], y: [f64; 2]) -> [f64; 2] {
        [
            x[0] - (c[0][0] * y[0] + c[1][0] * y[1]),
            x[1] - (c[0][1] * y[0] + c[1][1] * y[1]),
        ]
    }
    #[inline]
    fn times(d: [f64; 3], y: [f64; 2]) -> [f64; 2] {
        [d[0] * y[0] + d[1] * y[1], d[1] * y[0] + d[2] * y[1]]
    }
    #[inline]
    fn size(u: [f64; 2]) -> f64 {
        u[0].abs().max(u[1].abs())
    }
    #[inline]
    fn gap(u: [f64; 2]) -> f64 {
        u[0] - u[1]
    }
    #[inline]
    fn pull(r: [f64; 2], share: f64) -> f64 {
        (1.0 - share) * r[0] - share * r[1]
    }
    #[inline]
    fn close(u: [f64; 2], share: f64) -> [f64; 2] {
        [u[1] + share * (u[0] - u[1]); 2]
    }
    #[inline]
    fn gather(r: [f64; 2], share: f64) -> [f64; 2] {
        let sum = r[0] + r[1];
        [share * sum, (1.0 - share) * sum]
    }
    #[inline]
    fn spread(c: [f64; 2], share: f64) -> [f64; 2] {
        [share * c[0] + (1.0 - share) * c[1]; 2]
    }
    #[inline]
    fn bounded(u: [f64; 2], inverse: [f64; 3], bound: f64) -> [f64; 2] {
        let gap = u[0] - u[1];
        let give = inverse[0] - 2.0 * inverse[1] + inverse[2];
        if gap < bound && give > 0.0 {
            let z = (bound - gap) / give;
            let [x, y] = Pair::times(inverse, [z, -z]);
            // The softer membrane follows the stiffer one, so that the gap comes out as asked for to rounding of the result.
            if inverse[0] <= inverse[2] {
                [u[0] + x, u[0] + x - bound]
            } else {
                [u[1] + y + bound, u[1] + y]
            }
        } else {
            u
        }
    }
    #[inline]
    fn misfit(r: [f64; 2], d: [f64; 2], contact: bool) -> f64 {
        if contact {
            (r[0] + r[1]).abs() / d[0].max(d[1])
        } else {
            (r[0].abs() / d[0]).max(r[1].abs() / d[1])
        }
    }
    #[inline]
    fn truncated(a: [f64; 2], row: Option<f64>, column: Option<f64>) -> [[f64; 2]; 2] {
        // Columns first: A T, then T'(A T).
        let c = match column {
            None => [[a[0], 0.0], [0.0, a[1]]],
            Some(t) => [[a[0] * t, a[0] * (1.0 - t)], [a[1] * t, a[1] * (1.0 - t)]],
        };
        match row {
            None => c,
            Some(t) => {
                let sum = [c[0][0] + c[1][0], c[0][1] + c[1][1]];
                [
                    [t * sum[0], t * sum[1]],
                    [(1.0 - t) * sum[0], (1.0 - t) * sum[1]],
                ]
            }
        }
    }
    #[inline]
    fn truncated_pivot(a: [f64; 2], contact: Option<f64>) -> [f64; 3] {
        match contact {
            None => [a[0], 0.0, a[1]],
            Some(t) => {
                let sum = a[0] + a[1];
                let s = 1.0 - t;
                [t * t * sum, t * s * sum, s * s * sum]
            }
        }
    }
    #[inline]
    fn transpose(c: [[f64; 2]; 2]) -> [[f64; 2]; 2] {
        [[c[0][0], c[1][0]], [c[0][1], c[1][1]]]
    }
    #[inline]
    fn light(c: [[f64; 2]; 2]) -> [[f32; 2]; 2] {
        c.map(|row| row.map(|c| c as f32))
    }
    #[inline]
    fn full(c: [[f32; 2]; 2]) -> [[f64; 2]; 2] {
        c.map(|row| row.map(f64::from))
    }
    #[inline]
    fn plus_half(x: [[f64; 2]; 2], y: [[f64; 2]; 2]) -> [[f64; 2]; 2] {
        [
            [x[0][0] + 0.5 * y[0][0], x[0][1] + 0.5 * y[0][1]],
            [x[1][0] + 0.5 * y[1][0], x[1][1] + 0.5 * y[1][1]],
        ]
    }
    #[inline]
    fn rejoin(pa: [[f64; 2]; 2], pb: [[f64; 2]; 2], d: [f64; 3]) -> [[f64; 2]; 2] {
        [
            [
                0.5 * (pa[0][0] + pb[0][0]) + 0.25 * d[0],
                0.5 * (pa[1][0] + pb[0][1]) + 0.25 * d[1],
            ],
            [
                0.5 * (pa[0][1] + pb[1][0]) + 0.25 * d[1],
                0.5 * (pa[1][1] + pb[1][1]) + 0.25 * d[2],
            ],
        ]
    }
    #[inline]
    fn inherit(a: [f64; 3], pa: [[f64; 2]; 2], d: [f64; 3]) -> [f64; 3] {
        [
            a[0] + pa[0][0] + 0.25 * d[0],
            a[1] + 0.5 * (pa[0][1] + pa[1][0]) + 0.25 * d[1],
            a[2] + pa[1][1] + 0.25 * d[2],
        ]
    }
    fn inverse(d: [f64; 3], diagonal: [f64; 2]) -> [f64; 3] {
        if d[1] == 0.0 {
            return [
                Scalar::inverse(d[0], diagonal[0]),
                0.0,
                Scalar::inverse(d[2], diagonal[1]),
            ];
        }
        // Scaled so that a free vertex is the identity; then the eigenvalues tell range from rounding.
        let s = [1.0 / diagonal[0].sqrt(), 1.0 / diagonal[1].sqrt()];
        let [x, y, z] = [d[0] * s[0] * s[0], d[1] * s[0] * s[1], d[2] * s[1] * s[1]];
        let (mean, half) = (0.5 * (x + z), 0.5 * (x - z));
        let large = mean + (half * half + y * y).sqrt();
        if large <= EMPTY {
            return [0.0; 3];
        }
        let determinant = x * z - y * y;
        let scaled = if determinant > EMPTY * large * large {
            [z / determinant, -y / determinant, x / determinant]
        } else {
            // v v'/large with the unit eigenvector v; of its two formulas the one that does not cancel.
            let v = if half >= 0.0 {
                [large - z, y]
            } else {
                [y, large - x]
            };
            let by = 1.0 / ((v[0] * v[0] + v[1] * v[1]) * large);
            [v[0] * v[0] * by, v[0] * v[1] * by, v[1] * v[1] * by]
        };
        [
            scaled[0] * s[0] * s[0],
            scaled[1] * s[0] * s[1],
            scaled[2] * s[1] * s[1],
        ]
    }
    #[inline]
    fn coupling_at(c: [[f64; 2]; 2], i: usize, j: usize) -> f64 {
        c[i][j]
    }
    #[inline]
    fn pivot_at(d: [f64; 3], i: usize, j: usize) -> f64 {
        d[i + j]
    }
}
