//! Sparse Cholesky factors: faer's supernodal factorisation behind four calls.
//!
//! Always sequential: the digits of a result must not depend on the number of threads.

use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::cholesky::llt::factor::LltError;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side};

/// Lower triangle of a symmetric matrix, column by column, rows increasing, the diagonal first.
#[derive(Clone, Debug, Default)]
pub(crate) struct Lower {
    /// Start of every column and the end of the last.
    pub start: Vec<u32>,
    /// Row of every entry.
    pub row: Vec<u32>,
    /// Value of every entry.
    pub value: Vec<f64>,
}

impl Lower {
    /// Number of columns.
    pub fn order(&self) -> usize {
        self.start.len() - 1
    }

    fn pattern(&self) -> SymbolicSparseColMatRef<'_, u32> {
        let n = self.order();
        SymbolicSparseColMatRef::new_checked(n, n, &self.start, None, &self.row)
    }
}

/// Why a factorisation failed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum FactorError {
    /// The pivot of this row is not positive.
    Pivot(usize),
    /// Memory or indices.
    TooLarge(usize),
}

/// A factor with its symbolic analysis and its memory, for any number of matrices of one pattern.
pub(crate) struct Cholesky {
    symbolic: SymbolicCholesky<u32>,
    factor: Vec<f64>,
    memory: MemBuffer,
}

impl Cholesky {
    /// Orders the unknowns by approximate minimum degree and finds the pattern of the factor.
    pub fn analyse(matrix: &Lower) -> Result<Cholesky, FactorError> {
        let too_large = || FactorError::TooLarge(matrix.order());
        let symbolic = factorize_symbolic_cholesky(
            matrix.pattern(),
            Side::Lower,
            SymmetricOrdering::Amd,
            CholeskySymbolicParams::default(),
        )
        .map_err(|_| too_large())?;
        let need = StackReq::any_of(&[
            symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default()),
            symbolic.solve_in_place_scratch::<f64>(1, Par::Seq),
        ]);
        let memory = MemBuffer::try_new(need).map_err(|_| too_large())?;
        let mut factor = Vec::new();
        factor
            .try_reserve_exact(symbolic.len_val())
            .map_err(|_| too_large())?;
        factor.resize(symbolic.len_val(), 0.0);
        Ok(Cholesky {
            symbolic,
            factor,
            memory,
        })
    }

    /// Factors a matrix of the pattern that was analysed.
    pub fn factor(&mut self, matrix: &Lower) -> Result<(), FactorError> {
        let view = SparseColMatRef::new(matrix.pattern(), &matrix.value);
        let result = self.symbolic.factorize_numeric_llt(
            &mut self.factor,
            view,
            Side::Lower,
            Default::default(),
            Par::Seq,
            MemStack::new(&mut self.memory),
            Default::default(),
        );
        match result {
            Ok(_) => Ok(()),
            Err(LltError::NonPositivePivot { index }) => {
                // The index counts in the fill-reducing order.
                let row = match self.symbolic.perm() {
                    Some(order) => order.arrays().0[index] as usize,
                    None => index,
                };
                Err(FactorError::Pivot(row))
            }
        }
    }

    /// Replaces the right-hand side by the solution.
    pub fn solve(&mut self, rhs: &mut [f64]) {
        let n = rhs.len();
        LltRef::new(&self.symbolic, &self.factor).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(rhs, n, 1),
            Par::Seq,
            MemStack::new(&mut self.memory),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tridiagonal(n: usize, diagonal: f64) -> Lower {
        let mut m = Lower {
            start: vec![0],
            ..Lower::default()
        };
        for j in 0..n {
            m.row.push(j as u32);
            m.value.push(diagonal);
            if j + 1 < n {
                m.row.push(j as u32 + 1);
                m.value.push(-1.0);
            }
            m.start.push(m.row.len() as u32);
        }
        m
    }

    #[test]
    fn solves_systems_of_every_small_order() {
        for n in [0, 1, 2, 5, 300] {
            let matrix = tridiagonal(n, 2.5);
            let mut cholesky = Cholesky::analyse(&matrix).unwrap();
            cholesky.factor(&matrix).unwrap();
            let exact: Vec<f64> = (0..n).map(|i| (i as f64).sin()).collect();
            let at = |i: isize| {
                if i < 0 || i >= n as isize {
                    0.0
                } else {
                    exact[i as usize]
                }
            };
            let mut x: Vec<f64> = (0..n as isize)
                .map(|i| 2.5 * at(i) - at(i - 1) - at(i + 1))
                .collect();
            cholesky.solve(&mut x);
            for (a, b) in x.iter().zip(&exact) {
                assert!((a - b).abs() < 1e-14, "order {n}: {a} {b}");
            }
        }
    }

    #[test]
    fn a_failing_pivot_is_named_in_the_order_of_the_matrix() {
        let mut matrix = tridiagonal(50, 2.5);
        let at = matrix.start[17] as usize;
        matrix.value[at] = -40.0;
        let mut cholesky = Cholesky::analyse(&matrix).unwrap();
        // The pivot found negative is that row or one eliminated after it.
        match cholesky.factor(&matrix) {
            Err(FactorError::Pivot(row)) => assert!(row.abs_diff(17) <= 1, "row {row}"),
            other => panic!("{other:?}"),
        }
    }
}
