//! Symmetric sparse matrices over the vertices of a mesh, boundary vertices included.

use std::sync::Arc;

use crate::mesh::Mesh;

/// The sparsity pattern of first-order elements: row `i` holds `i` and the vertices that share an edge with it.
#[derive(Clone, Debug)]
pub struct Pattern {
    row_start: Vec<u32>,
    column: Vec<u32>,
    diagonal: Vec<u32>,
}

impl Pattern {
    /// The pattern of `mesh`, columns in increasing order; O(N).
    pub fn of(mesh: &Mesh) -> Self {
        let n = mesh.vertex_count();
        let mut degree = vec![1u32; n];
        let edges = |visit: &mut dyn FnMut(usize, usize)| {
            for (v, around) in mesh
                .triangles()
                .iter()
                .zip(mesh.neighbours())
                .enumerate()
                .map(|(t, (v, nb))| {
                    let mut own = [true; 3];
                    for face in 0..3 {
                        own[face] = nb[face].get().is_none_or(|(other, _)| other.index() > t);
                    }
                    (v, own)
                })
            {
                for face in 0..3 {
                    if around[face] {
                        visit(v[(face + 1) % 3].index(), v[(face + 2) % 3].index());
                    }
                }
            }
        };
        edges(&mut |i, j| {
            degree[i] += 1;
            degree[j] += 1;
        });
        let mut row_start = vec![0u32; n + 1];
        for i in 0..n {
            row_start[i + 1] = row_start[i] + degree[i];
        }
        let mut fill: Vec<u32> = row_start[..n].to_vec();
        let mut column = vec![0u32; row_start[n] as usize];
        let mut put = |i: usize, j: usize| {
            column[fill[i] as usize] = j as u32;
            fill[i] += 1;
        };
        for i in 0..n {
            put(i, i);
        }
        edges(&mut |i, j| {
            put(i, j);
            put(j, i);
        });
        let mut diagonal = vec![0u32; n];
        for i in 0..n {
            let row = &mut column[row_start[i] as usize..row_start[i + 1] as usize];
            row.sort_unstable();
            // The diagonal was put into every row, so the search finds it.
            let at = row.partition_point(|&j| (j as usize) < i);
            diagonal[i] = row_start[i] + at as u32;
        }
        Pattern {
            row_start,
            column,
            diagonal,
        }
    }

    /// Number of rows.
    pub fn order(&self) -> usize {
        self.diagonal.len()
    }

    /// Number of stored entries.
    pub fn entries(&self) -> usize {
        self.column.len()
    }

    /// Columns of row `i`, increasing.
    #[inline]
    pub fn columns(&self, i: usize) -> &[u32] {
        &self.column[self.range(i)]
    }

    /// Positions of row `i` in the value array.
    #[inline]
    pub fn range(&self, i: usize) -> std::ops::Range<usize> {
        self.row_start[i] as usize..self.row_start[i + 1] as usize
    }

    /// Position of the diagonal entry of row `i` in the value array.
    #[inline]
    pub fn diagonal_position(&self, i: usize) -> usize {
        self.diagonal[i] as usize
    }

    /// Position of entry (i, j) in the value array, if it is in the pattern.
    #[inline]
    pub fn position(&self, i: usize, j: usize) -> Option<usize> {
        let row = self.columns(i);
        let at = row.iter().position(|&c| c as usize == j)?;
        Some(self.row_start[i] as usize + at)
    }
}

/// A symmetric matrix, both triangles stored.
#[derive(Clone, Debug)]
pub struct SymmetricMatrix {
    pattern: Arc<Pattern>,
    values: Vec<f64>,
}

impl SymmetricMatrix {
    /// A matrix of zeros.
    pub fn zeros(pattern: Arc<Pattern>) -> Self {
        let values = vec![0.0; pattern.entries()];
        SymmetricMatrix { pattern, values }
    }

    /// The pattern, shared between matrices on one mesh.
    pub fn pattern(&self) -> &Arc<Pattern> {
        &self.pattern
    }

    /// Number of rows.
    pub fn order(&self) -> usize {
        self.pattern.order()
    }

    /// Values in the order of the pattern.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Values in the order of the pattern, to be filled; the caller keeps them symmetric.
    pub fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// The diagonal entry of row `i`.
    #[inline]
    pub fn diagonal(&self, i: usize) -> f64 {
        self.values[self.pattern.diagonal_position(i)]
    }

    /// The entries (column, value) of row `i`, columns increasing.
    #[inline]
    pub fn row(&self, i: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let range = self.pattern.range(i);
        self.pattern.column[range.clone()]
            .iter()
            .zip(&self.values[range])
            .map(|(&j, &a)| (j as usize, a))
    }

    /// Entry `i` of the product with `x`.
    #[inline]
    pub fn row_dot(&self, i: usize, x: &[f64]) -> f64 {
        self.row(i).map(|(j, a)| a * x[j]).sum()
    }

    /// The sum of `|a_ij x_j|` over row `i`: the scale of its rounding errors.
    #[inline]
    pub fn row_dot_abs(&self, i: usize, x: &[f64]) -> f64 {
        self.row(i).map(|(j, a)| (a * x[j]).abs()).sum()
    }

    /// The product with `x`.
    pub fn multiply(&self, x: &[f64]) -> Vec<f64> {
        (0..self.order()).map(|i| self.row_dot(i, x)).collect()
    }

    /// The quadratic form x' A x.
    pub fn quadratic(&self, x: &[f64]) -> f64 {
        (0..self.order()).map(|i| x[i] * self.row_dot(i, x)).sum()
    }
}
