//! The unknowns: interior vertices, and the matrices that live on them.

use fem_core::{Pattern, SymmetricMatrix};

use crate::cholesky::{Cholesky, FactorError, Lower};
use crate::error::SolveError;

/// No unknown belongs to the vertex.
const NONE: u32 = u32::MAX;

/// The interior vertices in increasing order, with the way back.
#[derive(Clone, Debug)]
pub(crate) struct Interior {
    /// Vertex of every unknown.
    pub vertices: Vec<u32>,
    index: Vec<u32>,
}

impl Interior {
    /// The vertices that are not on the boundary.
    pub fn new(boundary: &[bool]) -> Interior {
        let mut vertices = Vec::new();
        let mut index = vec![NONE; boundary.len()];
        for (j, &fixed) in boundary.iter().enumerate() {
            if !fixed {
                index[j] = vertices.len() as u32;
                vertices.push(j as u32);
            }
        }
        Interior { vertices, index }
    }

    /// Number of unknowns.
    pub fn len(&self) -> usize {
        self.vertices.len()
    }

    /// Vertices of all unknowns.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = usize> + '_ {
        self.vertices.iter().map(|&j| j as usize)
    }

    /// The unknown of a vertex; `None` on the boundary.
    #[inline]
    pub fn get(&self, vertex: usize) -> Option<usize> {
        let k = self.index[vertex];
        (k != NONE).then_some(k as usize)
    }
}

/// Which matrix a [`ScalarFactor`] holds.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Role {
    /// The stiffness matrix of the displacements.
    Stiffness,
    /// K, the matrix of sigma.
    Laplacian,
}

/// Cholesky factors of matrices with one unknown an interior vertex: analysed once a mesh, factored whenever the contact set
/// changes.
///
/// Rows and columns of vertices in contact are emptied but for the diagonal, so that the pattern never changes.
pub(crate) struct ScalarFactor {
    lower: Lower,
    /// Position of every entry in the values of the mesh's matrices.
    position: Vec<u32>,
    cholesky: Cholesky,
    /// The matrix that is factored without truncation, if it is one.
    whole: Option<Role>,
}

impl ScalarFactor {
    /// Analyses the interior part of a pattern.
    pub fn new(pattern: &Pattern, interior: &Interior) -> Result<ScalarFactor, SolveError> {
        let mut lower = Lower {
            start: Vec::with_capacity(interior.len() + 1),
            ..Lower::default()
        };
        let mut position = Vec::new();
        lower.start.push(0);
        for (unknown, j) in interior.iter().enumerate() {
            for (at, &k) in pattern.range(j).zip(pattern.columns(j)) {
                // Unknowns are numbered in the order of the vertices, so rows come out increasing.
                if let Some(row) = interior.get(k as usize)
                    && row >= unknown
                {
                    lower.row.push(row as u32);
                    position.push(at as u32);
                }
            }
            lower.start.push(lower.row.len() as u32);
        }
        lower.value = vec![0.0; lower.row.len()];
        let cholesky = Cholesky::analyse(&lower).map_err(|e| explain(e, interior))?;
        Ok(ScalarFactor {
            lower,
            position,
            cholesky,
            whole: None,
        })
    }

    /// Factors `matrix` on the interior vertices that are not in `contact`.
    pub fn truncated(
        &mut self,
        matrix: &SymmetricMatrix,
        role: Role,
        interior: &Interior,
        contact: &[bool],
    ) -> Result<(), SolveError> {
        if !contact.contains(&true) {
            return self.whole(matrix, role, interior);
        }
        self.whole = None;
        let values = matrix.values();
        for (column, j) in interior.iter().enumerate() {
            let range = self.lower.start[column] as usize..self.lower.start[column + 1] as usize;
            for at in range {
                let row = self.lower.row[at] as usize;
                let off = row != column;
                let cut = off && (contact[j] || contact[interior.vertices[row] as usize]);
                self.lower.value[at] = if cut {
                    0.0
                } else {
                    values[self.position[at] as usize]
                };
            }
        }
        self.cholesky
            .factor(&self.lower)
            .map_err(|e| explain(e, interior))
    }

    /// Factors `matrix` on all interior vertices, unless that is the factor at hand.
    pub fn whole(
        &mut self,
        matrix: &SymmetricMatrix,
        role: Role,
        interior: &Interior,
    ) -> Result<(), SolveError> {
        if self.whole == Some(role) {
            return Ok(());
        }
        self.whole = None;
        let values = matrix.values();
        for (value, &at) in self.lower.value.iter_mut().zip(&self.position) {
            *value = values[at as usize];
        }
        self.cholesky
            .factor(&self.lower)
            .map_err(|e| explain(e, interior))?;
        self.whole = Some(role);
        Ok(())
    }

    /// Replaces a right-hand side over the unknowns by the solution.
    pub fn solve(&mut self, rhs: &mut [f64]) {
        self.cholesky.solve(rhs);
    }
}

fn explain(error: FactorError, interior: &Interior) -> SolveError {
    match error {
        FactorError::Pivot(row) => SolveError::NotPositiveDefinite {
            vertex: interior.vertices[row] as usize,
        },
        FactorError::TooLarge(order) => SolveError::TooLarge { order },
    }
}
