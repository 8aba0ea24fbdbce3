//! The method that cannot fail to converge: projected Gauss-Seidel with a truncated exact correction.
//!
//! The truncated nonsmooth Newton multigrid method of Graeser and Kornhuber (2009) with a direct solver in place of the multigrid cycle.
//! A step relaxes every vertex forwards and backwards under its constraint, solves exactly on the vertices whose gap is open, projects
//! the result to nonnegative gaps, and goes along that direction to the least energy. No part raises the energy, and the
//! relaxation alone converges for any symmetric positive definite matrix, M-matrix or not; the correction makes it end.

use crate::active_set::{Outcome, ROUNDING, finish};
use crate::error::SolveError;
use crate::free::FreeSolver;
use crate::solution::Status;
use crate::system::{Fields, System};

/// Steps from a guess of the fields, feasible or not, until the contact set confirms itself as in the active set method.
///
/// `solves` counts the linear solves done before.
pub(crate) fn solve(
    system: &System,
    solver: &mut FreeSolver,
    mut fields: Fields,
    solves: usize,
) -> Result<Outcome, SolveError> {
    for j in system.interior.iter() {
        if system.gap(&fields, j) < 0.0 {
            system.close(&mut fields, j);
        }
    }
    let limit = 200 + 4 * (system.interior.len() as f64).sqrt() as usize;
    let mut contact = vec![false; fields[0].len()];
    for step in 1..=limit {
        relax(system, &mut fields);
        for j in system.interior.iter() {
            contact[j] = system.gap(&fields, j) == 0.0;
        }
        let mut candidate = fields.clone();
        solver.prepare(system, &contact)?;
        solver.correct(system, &mut candidate, &contact)?;
        if system.violations(&candidate, &contact).worst <= ROUNDING {
            finish(system, solver, &mut candidate, &contact)?;
            return Ok(Outcome {
                fields: candidate,
                contact,
                solves: solves + step,
                monotone: true,
                status: Status::Converged,
            });
        }
        descend(system, &mut fields, candidate);
    }
    Ok(Outcome {
        fields,
        contact,
        solves: solves + limit,
        monotone: true,
        status: Status::Limit,
    })
}

/// One projected Gauss-Seidel sweep forwards and one backwards.
pub(crate) fn relax(system: &System, fields: &mut Fields) {
    for j in system.interior.iter() {
        system.relax(fields, j);
    }
    for j in system.interior.iter().rev() {
        system.relax(fields, j);
    }
}

/// Moves from feasible fields towards the projection of the candidate, to the least energy that keeps the gaps nonnegative.
fn descend(system: &System, fields: &mut Fields, mut candidate: Fields) {
    for j in system.interior.iter() {
        if system.gap(&candidate, j) < 0.0 {
            system.close(&mut candidate, j);
        }
    }
    let direction: Fields = fields
        .iter()
        .zip(&candidate)
        .map(|(u, v)| u.iter().zip(v).map(|(u, v)| v - u).collect())
        .collect();
    let (mut slope, mut curvature) = (0.0, 0.0);
    for (i, d) in direction.iter().enumerate() {
        for j in system.interior.iter() {
            slope += d[j] * system.residual(fields, i, j);
            curvature += d[j] * system.matrices[i].row_dot(j, d);
        }
    }
    if !(slope > 0.0 && curvature > 0.0) {
        return;
    }
    let mut length = slope / curvature;
    for j in system.interior.iter() {
        let change = system.gap(&direction, j);
        if change < 0.0 {
            // The candidate is feasible, so at least a full step is.
            length = length.min((system.gap(fields, j) / -change).max(1.0));
        }
    }
    if length == 1.0 {
        *fields = candidate;
        return;
    }
    for (u, d) in fields.iter_mut().zip(&direction) {
        for j in system.interior.iter() {
            u[j] += length * d[j];
        }
    }
    for j in system.interior.iter() {
        if system.gap(fields, j) < 0.0 {
            system.close(fields, j);
        }
    }
}
