//! The method that cannot fail to converge: projected Gauss-Seidel with a truncated exact correction.
//!
//! The truncated nonsmooth Newton multigrid method of Graeser and Kornhuber (2009) with a direct solver in place of the
//! multigrid cycle. A step relaxes every vertex a few times under its constraint, solves exactly on the vertices whose gap is
//! open, projects the result to nonnegative gaps, and goes along that direction to the least energy. No part raises the
//! energy, and the relaxation alone converges for any symmetric positive definite matrix, M-matrix or not; the correction
//! makes it end.

use crate::active_set::{self, Outcome, ROUNDING, SWEEPS};
use crate::error::SolveError;
use crate::free::FreeSolver;
use crate::solution::Status;
use crate::system::{Fields, System};

/// A violation up to this size is kept in case rounding, on a badly shaped mesh, allows none smaller.
const NEARLY: f64 = 1e-11;

/// Steps without improvement after which such an iterate is taken.
const PATIENCE: usize = 10;

/// Steps from a guess of the fields, feasible or not, until the contact set confirms itself as in the active set method.
///
/// `solves` counts the linear solves done before.
pub(crate) fn solve(
    system: &System,
    solver: &mut FreeSolver,
    mut fields: Fields,
    solves: usize,
) -> Result<Outcome, SolveError> {
    let limit = 200 + 4 * (system.interior.len() as f64).sqrt() as usize;
    let mut contact = vec![false; fields[0].len()];
    let mut best: Option<Outcome> = None;
    let mut least = f64::INFINITY;
    let mut idle = 0;
    for taken in 1..=limit {
        system.relaxed_contact(&mut fields, &mut contact, SWEEPS);
        let mut candidate = fields.clone();
        let found = active_set::step(system, solver, &mut candidate, &contact)?;
        let converged = found.worst <= ROUNDING;
        if found.worst < least {
            idle = 0;
            least = found.worst;
        } else {
            idle += 1;
        }
        if converged || (idle == 0 && least <= NEARLY) {
            best = Some(Outcome {
                fields: candidate.clone(),
                contact: contact.clone(),
                solves: solves + taken,
                monotone: true,
                status: if converged {
                    Status::Converged
                } else {
                    Status::Stagnated
                },
            });
        }
        if converged || (idle >= PATIENCE && best.is_some()) {
            break;
        }
        descend(system, &mut fields, candidate);
    }
    match best {
        Some(mut outcome) => {
            if outcome.contact != contact {
                solver.prepare(system, &outcome.contact)?;
            }
            active_set::finish(system, solver, &mut outcome.fields, &outcome.contact)?;
            Ok(outcome)
        }
        None => Ok(Outcome {
            fields,
            contact,
            solves: solves + limit,
            monotone: true,
            status: Status::Limit,
        }),
    }
}

/// Moves from feasible fields towards the projection of the candidate, to the least energy that keeps the gaps nonnegative.
pub(crate) fn descend(system: &System, fields: &mut Fields, mut candidate: Fields) {
    system.project(&mut candidate);
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
    system.project(fields);
}
