//! Coarser spaces without a coarser mesh: aggregates of vertices and smoothed prolongations, from the entries of the matrix.
//!
//! Smoothed aggregation (Vanek, Mandel, Brezina 1996). Vertices x, y are *strongly connected* where in every field the entry is negative and
//! `a_xy^2 >= theta^2 a_xx a_yy`: along the short side of a needle but not along the long one, and never across a large jump of the tension.
//! Aggregates are a vertex and its strong neighbours. The hat function of an aggregate is its characteristic function after one damped
//! Jacobi step with the matrix in which only strong entries are left, the others lumped into the diagonal. Hence weights
//! are nonnegative with a sum of at most one (one away from the boundary): a bound from below, at most zero, that all coarse values
//! around a vertex obey is obeyed by the vertex too.
//!
//! With two fields both have the same aggregates and weights, so that the gap of a vertex is the mean of coarse gaps.

use super::blocks::{Block, Symmetric};
use super::unknowns::Unknowns;

/// Strength of connection on the finest level; half of it on every further one.
const STRONG: f64 = 0.08;

/// Damping of the Jacobi step: 4/3 over the largest eigenvalue, which is at most 2.
const DAMPING: f64 = 2.0 / 3.0;

/// With more aggregates than this part of the vertices all negative entries are strong.
const STALLED: f64 = 0.7;

const NONE: u32 = u32::MAX;

/// The matrix of a level: in row x the entries with y < x, y increasing, and the diagonal.
pub(crate) struct Matrix<'a, U: Unknowns> {
    pub start: &'a [u32],
    pub column: &'a [u32],
    pub block: &'a [U::Coupling],
    pub pivot: &'a [U::Pivot],
}

impl<U: Unknowns> Matrix<'_, U> {
    /// Number of vertices.
    pub fn len(&self) -> usize {
        self.start.len() - 1
    }

    /// The entries of a row.
    #[inline]
    pub fn row(&self, x: usize) -> std::ops::Range<usize> {
        self.start[x] as usize..self.start[x + 1] as usize
    }

    fn diagonal(&self, x: usize, i: usize) -> f64 {
        U::pivot_at(self.pivot[x], i, i)
    }
}

/// A matrix over aggregates.
pub(crate) struct Own<U: Unknowns> {
    pub start: Vec<u32>,
    pub column: Vec<u32>,
    pub block: Vec<U::Coupling>,
    pub pivot: Vec<U::Pivot>,
    /// Inverses of the diagonal blocks; the products leave them to others.
    pub inverse: Vec<U::Pivot>,
}

/// Weights of the aggregates at every vertex; none at vertices that are no unknowns.
#[derive(Default)]
pub(crate) struct Prolongation {
    start: Vec<u32>,
    column: Vec<u32>,
    weight: Vec<f64>,
    /// Number of aggregates.
    pub coarse: usize,
}

/// The strong connections of a matrix.
struct Graph {
    /// Whether an entry is strong.
    strong: Vec<bool>,
    start: Vec<u32>,
    /// Strong neighbours of every vertex, and the entries.
    end: Vec<[u32; 2]>,
}

impl Graph {
    fn of<U: Unknowns>(a: &Matrix<U>, theta: f64) -> Graph {
        let n = a.len();
        let mut strong = vec![false; a.column.len()];
        let mut start = vec![0u32; n + 1];
        for x in 0..n {
            for e in a.row(x) {
                let y = a.column[e] as usize;
                strong[e] = (0..U::WIDTH).all(|i| {
                    let entry = U::coupling_at(a.block[e], i, i);
                    let scale = a.diagonal(x, i) * a.diagonal(y, i);
                    entry < 0.0 && entry * entry >= theta * theta * scale
                });
                start[x + 1] += u32::from(strong[e]);
                start[y + 1] += u32::from(strong[e]);
            }
        }
        for x in 0..n {
            start[x + 1] += start[x];
        }
        let mut next = start.clone();
        let mut end = vec![[0; 2]; start[n] as usize];
        for x in 0..n {
            for e in a.row(x).filter(|&e| strong[e]) {
                let y = a.column[e] as usize;
                for (p, q) in [(x, y), (y, x)] {
                    end[next[p] as usize] = [q as u32, e as u32];
                    next[p] += 1;
                }
            }
        }
        Graph { strong, start, end }
    }

    fn around(&self, x: usize) -> &[[u32; 2]] {
        &self.end[self.start[x] as usize..self.start[x + 1] as usize]
    }

    /// The aggregate of every unknown, and their number: vertices all of whose strong neighbours are left with these; others go
    /// to the aggregate that they are drawn to most; what is left then stands together.
    fn aggregates<U: Unknowns>(&self, a: &Matrix<U>) -> (Vec<u32>, usize) {
        let n = a.len();
        let unknown = |x: usize| a.diagonal(x, 0) > 0.0;
        let mut of = vec![NONE; n];
        let mut count = 0;
        for x in (0..n).filter(|&x| unknown(x)) {
            let around = self.around(x);
            let free = of[x] == NONE && around.iter().all(|&[y, _]| of[y as usize] == NONE);
            if free && !around.is_empty() {
                of[x] = count;
                for &[y, _] in around {
                    of[y as usize] = count;
                }
                count += 1;
            }
        }
        let first = of.clone();
        for x in (0..n).filter(|&x| unknown(x) && first[x] == NONE) {
            let pull = |e: u32| -> f64 {
                (0..U::WIDTH)
                    .map(|i| -U::coupling_at(a.block[e as usize], i, i) / a.diagonal(x, i))
                    .sum()
            };
            let taken = self.around(x).iter();
            let taken = taken.filter(|&&[y, _]| first[y as usize] != NONE);
            if let Some(&[y, _]) = taken.max_by(|p, q| pull(p[1]).total_cmp(&pull(q[1]))) {
                of[x] = first[y as usize];
            }
        }
        for x in (0..n).filter(|&x| unknown(x)) {
            if of[x] == NONE {
                of[x] = count;
                for &[y, _] in self.around(x) {
                    if of[y as usize] == NONE {
                        of[y as usize] = count;
                    }
                }
                count += 1;
            }
        }
        (of, count as usize)
    }
}

impl Prolongation {
    /// Aggregates and weights for an untruncated matrix, `depth` levels below the finest; O(n).
    pub fn new<U: Unknowns>(a: &Matrix<U>, depth: usize) -> Prolongation {
        let unknowns = (0..a.len()).filter(|&x| a.diagonal(x, 0) > 0.0).count();
        let mut graph = Graph::of(a, STRONG * 0.5f64.powi(depth as i32));
        let (mut of, mut coarse) = graph.aggregates(a);
        if coarse as f64 > STALLED * unknowns as f64 {
            graph = Graph::of(a, 0.0);
            (of, coarse) = graph.aggregates(a);
        }
        // Diagonals with everything lumped that is not strong; at least what keeps weights nonnegative.
        let mut lumped: Vec<[f64; 2]> = (0..a.len())
            .map(|x| [0, 1].map(|i| a.diagonal(x, i.min(U::WIDTH - 1))))
            .collect();
        let mut least = vec![[0.0; 2]; a.len()];
        for x in 0..a.len() {
            for e in a.row(x) {
                for i in 0..U::WIDTH {
                    let entry = U::coupling_at(a.block[e], i, i);
                    for p in [x, a.column[e] as usize] {
                        if graph.strong[e] {
                            least[p][i] -= entry;
                        } else {
                            lumped[p][i] += entry;
                        }
                    }
                }
            }
        }
        let mut p = Prolongation {
            start: vec![0],
            coarse,
            ..Prolongation::default()
        };
        for x in 0..a.len() {
            let first = p.column.len();
            if of[x] != NONE {
                let around = graph.around(x);
                p.column.push(of[x]);
                p.weight.push(if around.is_empty() {
                    1.0
                } else {
                    1.0 - DAMPING
                });
                for &[y, e] in around {
                    let part: f64 = (0..U::WIDTH)
                        .map(|i| {
                            -U::coupling_at(a.block[e as usize], i, i)
                                / lumped[x][i].max(least[x][i])
                        })
                        .sum();
                    let weight = DAMPING * part / U::WIDTH as f64;
                    let column = of[y as usize];
                    match p.column[first..].iter().position(|&c| c == column) {
                        Some(k) => p.weight[first + k] += weight,
                        None => {
                            p.column.push(column);
                            p.weight.push(weight);
                        }
                    }
                }
            }
            p.start.push(p.column.len() as u32);
        }
        p
    }

    /// Aggregates and weights at a vertex.
    #[inline]
    pub fn row(&self, x: usize) -> impl Iterator<Item = (usize, f64)> + Clone + '_ {
        let list = self.start[x] as usize..self.start[x + 1] as usize;
        let columns = self.column[list.clone()].iter();
        columns
            .zip(&self.weight[list])
            .map(|(&c, &w)| (c as usize, w))
    }

    /// coarse = P' fine.
    pub fn restrict<U: Unknowns>(&self, fine: &[U::Value], coarse: &mut [U::Value]) {
        coarse.fill(U::Value::default());
        for (x, &value) in fine.iter().enumerate() {
            for (k, w) in self.row(x) {
                coarse[k] = U::plus(coarse[k], w, value);
            }
        }
    }

    /// fine += P coarse.
    pub fn prolong<U: Unknowns>(&self, coarse: &[U::Value], fine: &mut [U::Value]) {
        for (x, value) in fine.iter_mut().enumerate() {
            for (k, w) in self.row(x) {
                *value = U::plus(*value, w, coarse[k]);
            }
        }
    }

    /// The largest bound among the vertices of every aggregate: bounds of at most zero.
    pub fn restrict_bounds(&self, fine: &[f64], coarse: &mut [f64]) {
        coarse.fill(f64::NEG_INFINITY);
        for (x, &bound) in fine.iter().enumerate() {
            for (k, _) in self.row(x) {
                coarse[k] = coarse[k].max(bound);
            }
        }
    }

    /// Rows and columns of P'AP below the diagonal, in the form of a [`Matrix`].
    pub fn pattern<U: Unknowns>(&self, a: &Matrix<U>) -> (Vec<u32>, Vec<u32>) {
        let mut start = vec![0u32; self.coarse + 1];
        let mut list: Vec<u32> = Vec::new();
        // First how many there are, with repetitions, then which.
        for filling in [false, true] {
            let mut put = |k: usize, l: usize| {
                if k != l {
                    let (k, l) = (k.max(l), k.min(l));
                    if filling {
                        list[start[k] as usize] = l as u32;
                    }
                    start[k] += 1;
                }
            };
            for x in 0..a.len() {
                let row = self.row(x);
                for (k, _) in row.clone() {
                    row.clone()
                        .filter(|&(l, _)| l < k)
                        .for_each(|(l, _)| put(k, l));
                }
                for e in a.row(x) {
                    for (l, _) in self.row(a.column[e] as usize) {
                        row.clone().for_each(|(k, _)| put(k, l));
                    }
                }
            }
            if !filling {
                let mut total = 0;
                for s in &mut start {
                    total += std::mem::replace(s, total);
                }
                list = vec![0; total as usize];
            }
        }
        // Every start has moved to the end of its list.
        let mut begin = 0;
        let mut kept = 0;
        for s in &mut start[..self.coarse] {
            let end = *s as usize;
            list[begin..end].sort_unstable();
            *s = kept as u32;
            for i in begin..end {
                let value = list[i];
                if kept == *s as usize || list[kept - 1] != value {
                    list[kept] = value;
                    kept += 1;
                }
            }
            begin = end;
        }
        start[self.coarse] = kept as u32;
        list.truncate(kept);
        list.shrink_to_fit();
        (start, list)
    }

    /// The values of P'AP between aggregates that are `dirty`, in a pattern that holds all its entries; O(n).
    ///
    /// Every entry is a sum in the same order whatever else is made anew.
    pub fn product<U: Unknowns>(&self, a: &Matrix<U>, dirty: &[bool], coarse: &mut Own<U>) {
        let Own {
            start,
            column,
            block,
            pivot,
            ..
        } = coarse;
        for k in (0..self.coarse).filter(|&k| dirty[k]) {
            pivot[k] = U::Pivot::default();
            for s in start[k] as usize..start[k + 1] as usize {
                if dirty[column[s] as usize] {
                    block[s] = U::Coupling::default();
                }
            }
        }
        let slot = |k: usize, l: usize| {
            let list = start[k] as usize..start[k + 1] as usize;
            let at = column[list.clone()].iter().position(|&c| c as usize == l);
            at.map(|at| list.start + at)
        };
        let nothing = U::Pivot::default();
        for x in 0..a.len() {
            let own = a.pivot[x];
            // Without a diagonal entry the row is empty.
            if own == nothing {
                continue;
            }
            let row = self.row(x).filter(|&(k, _)| dirty[k]);
            if row.clone().next().is_none() {
                continue;
            }
            for (k, w) in row.clone() {
                pivot[k] = pivot[k].plus(w * w, own);
                for (l, v) in row.clone().filter(|&(l, _)| l < k) {
                    if let Some(s) = slot(k, l) {
                        block[s] = block[s].plus(w * v, own.full());
                    }
                }
            }
            for e in a.row(x) {
                let y = a.column[e] as usize;
                if a.pivot[y] == nothing {
                    continue;
                }
                let c = a.block[e];
                for (l, v) in self.row(y).filter(|&(l, _)| dirty[l]) {
                    for (k, w) in row.clone() {
                        if k == l {
                            pivot[k] = pivot[k].plus_both(w * v, c);
                        } else if let Some(s) = slot(k.max(l), k.min(l)) {
                            let c = if k > l { c } else { c.transposed() };
                            block[s] = block[s].plus(w * v, c);
                        }
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::unknowns::Scalar;
    use super::*;

    /// The five-point matrix of n by n cells, couplings 1 along rows and `weak` across, and an obtuse pair of entries here and there.
    #[test]
    fn weights_are_nonnegative_and_follow_strong_couplings() {
        let n = 12;
        for weak in [1.0, 1e-3] {
            let (mut start, mut column, mut block) = (vec![0u32], Vec::new(), Vec::new());
            for x in 0..n * n {
                let mut put = |y: usize, value: f64| {
                    column.push(y as u32);
                    block.push(value);
                };
                if x >= n {
                    put(x - n, -weak);
                }
                if x % n > 0 {
                    let obtuse = x % 7 == 0 && (2..n - 1).contains(&(x % n));
                    put(x - 1, if obtuse { 0.1 } else { -1.0 });
                }
                start.push(column.len() as u32);
            }
            // A row sum of zero but for the boundary.
            let mut pivot = vec![0.0; n * n];
            for x in 0..n * n {
                for e in start[x] as usize..start[x + 1] as usize {
                    pivot[x] -= block[e];
                    pivot[column[e] as usize] -= block[e];
                }
                if x < n {
                    pivot[x] += weak;
                }
            }
            let a: Matrix<Scalar> = Matrix {
                start: &start,
                column: &column,
                block: &block,
                pivot: &pivot,
            };
            let p = Prolongation::new(&a, 0);
            assert!(p.coarse < n * n / 2);
            for x in 0..n * n {
                assert!(p.row(x).all(|(_, w)| w >= 0.0));
                let sum: f64 = p.row(x).map(|(_, w)| w).sum();
                let boundary = x < n && weak == 1.0;
                let near = if boundary { sum < 1.0 } else { sum > 0.99 };
                assert!(near && sum <= 1.0 + 1e-14, "{weak} {x}: {sum}");
                // Across weak couplings nothing is interpolated.
                if weak < 1.0 {
                    let rows = (0..n * n)
                        .filter(|&y| p.row(y).any(|(k, _)| p.row(x).any(|(l, _)| k == l)));
                    assert!(rows.into_iter().all(|y| y / n == x / n));
                }
            }
        }
    }
}
