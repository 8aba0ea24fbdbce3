//! The linear problem that is left once the contact set is fixed.

use crate::cholesky::{Cholesky, FactorError, Lower};
use crate::error::SolveError;
use crate::interior::{Role, ScalarFactor};
use crate::system::{Fields, System};

/// Solves for the fields with the gap closed on a given set of vertices and no condition elsewhere.
pub(crate) enum FreeSolver<'s> {
    /// One field: the pattern is kept, rows in contact are emptied.
    Scalar {
        /// The factor, analysed.
        factor: &'s mut ScalarFactor,
        /// What its matrix stands for.
        role: Role,
    },
    /// Two fields: a vertex in contact has one unknown and the sum of both rows; built anew for every set.
    Pair(&'s mut PairFactor),
}

/// The factor of the two-field problem on one contact set.
#[derive(Default)]
pub(crate) struct PairFactor {
    /// Unknown of either membrane at every interior vertex; equal in contact.
    unknown: Vec<[u32; 2]>,
    order: usize,
    cholesky: Option<Cholesky>,
}

impl FreeSolver<'_> {
    /// Factors the matrix that belongs to a contact set.
    pub fn prepare(&mut self, system: &System, contact: &[bool]) -> Result<(), SolveError> {
        match self {
            FreeSolver::Scalar { factor, role } => {
                if system.interior.iter().all(|j| contact[j]) {
                    return Ok(());
                }
                factor.truncated(system.matrices[0], *role, system.interior, contact)
            }
            FreeSolver::Pair(factor) => factor.prepare(system, contact),
        }
    }

    /// Adds the correction that solves the linear problem; `contact` is the set that was prepared, where the gap is closed already.
    ///
    /// Called again it is a step of iterative refinement.
    pub fn correct(
        &mut self,
        system: &System,
        u: &mut Fields,
        contact: &[bool],
    ) -> Result<(), SolveError> {
        match self {
            FreeSolver::Scalar { factor, .. } => {
                let free = |j: usize| !contact[j];
                let mut rhs: Vec<f64> = system
                    .interior
                    .iter()
                    .map(|j| {
                        if free(j) {
                            system.residual(u, 0, j)
                        } else {
                            0.0
                        }
                    })
                    .collect();
                if system.interior.iter().any(free) {
                    factor.solve(&mut rhs);
                }
                for (&step, j) in rhs.iter().zip(system.interior.iter()) {
                    if free(j) {
                        u[0][j] += step;
                    }
                }
            }
            FreeSolver::Pair(factor) => factor.correct(system, u),
        }
        for field in u.iter() {
            if let Some(vertex) = field.iter().position(|v| !v.is_finite()) {
                return Err(SolveError::NotFinite {
                    what: "solution of a linear system",
                    vertex,
                });
            }
        }
        Ok(())
    }
}

impl PairFactor {
    fn prepare(&mut self, system: &System, contact: &[bool]) -> Result<(), SolveError> {
        let interior = system.interior;
        self.unknown.clear();
        let mut order = 0u32;
        for j in interior.iter() {
            let second = order + u32::from(!contact[j]);
            self.unknown.push([order, second]);
            order = second + 1;
        }
        self.order = order as usize;
        let matrix = self.assemble(system, contact);
        // The old factor goes first: two at a time would double the memory.
        self.cholesky = None;
        let explain = |e| match e {
            FactorError::Pivot(row) => {
                let at = self.unknown.partition_point(|u| (u[1] as usize) < row);
                SolveError::NotPositiveDefinite {
                    vertex: interior.vertices[at] as usize,
                }
            }
            FactorError::TooLarge(order) => SolveError::TooLarge { order },
        };
        let mut cholesky = Cholesky::analyse(&matrix).map_err(explain)?;
        cholesky.factor(&matrix).map_err(explain)?;
        self.cholesky = Some(cholesky);
        Ok(())
    }

    /// The lower triangle; unknowns increase with the vertex, so the rows of a column come out in order.
    fn assemble(&self, system: &System, contact: &[bool]) -> Lower {
        let interior = system.interior;
        let pattern = system.matrices[0].pattern();
        let values = [system.matrices[0].values(), system.matrices[1].values()];
        let mut lower = Lower {
            start: Vec::with_capacity(self.order + 1),
            ..Lower::default()
        };
        lower.start.push(0);
        for (own, j) in interior.iter().enumerate() {
            let glued = contact[j];
            let membranes: &[&[usize]] = if glued { &[&[0, 1]] } else { &[&[0], &[1]] };
            for which in membranes {
                for (at, &k) in pattern.range(j).zip(pattern.columns(j)) {
                    let Some(other) = interior.get(k as usize).filter(|&o| o >= own) else {
                        continue;
                    };
                    if glued && contact[k as usize] {
                        lower.row.push(self.unknown[other][0]);
                        lower.value.push(values[0][at] + values[1][at]);
                    } else {
                        for &i in *which {
                            lower.row.push(self.unknown[other][i]);
                            lower.value.push(values[i][at]);
                        }
                    }
                }
                lower.start.push(lower.row.len() as u32);
            }
        }
        lower
    }

    fn correct(&mut self, system: &System, u: &mut Fields) {
        let Some(cholesky) = &mut self.cholesky else {
            return;
        };
        let mut rhs = vec![0.0; self.order];
        for (&[a, b], j) in self.unknown.iter().zip(system.interior.iter()) {
            rhs[a as usize] += system.residual(u, 0, j);
            rhs[b as usize] += system.residual(u, 1, j);
        }
        cholesky.solve(&mut rhs);
        for (&[a, b], j) in self.unknown.iter().zip(system.interior.iter()) {
            u[0][j] += rhs[a as usize];
            u[1][j] += rhs[b as usize];
        }
    }
}
