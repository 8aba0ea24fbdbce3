//! The primal-dual active set method: solve on a contact set, let go what is pulled, attach what has crossed, until nothing changes.
//!
//! Equivalent to a semismooth Newton method (Hintermueller, Ito, Kunisch 2002). It ends in finitely many steps
//! for M-matrices; on other meshes nothing proves it, so a set that comes back, or a long time without progress, hands over to
//! [`crate::monotone`]. From the contact set of a coarser mesh two to four steps are usual; from nothing the count
//! grows like 1/h, since a set that is too large shrinks by one layer of vertices a step.

use std::collections::HashSet;
use std::hash::{DefaultHasher, Hash, Hasher};

use crate::error::SolveError;
use crate::free::FreeSolver;
use crate::monotone;
use crate::solution::Status;
use crate::system::{Fields, System, Violations};

/// Violations up to this size, relative to the largest displacement, are rounding: the gap is closed there and the set stays.
pub(crate) const ROUNDING: f64 = 16.0 * f64::EPSILON;

/// Steps without a new least number of changes before the method counts as stuck.
const PATIENCE: usize = 25;

/// What the method ends with.
#[derive(Clone, Debug)]
pub(crate) struct Outcome {
    /// The fields; gap exactly zero in contact and nowhere negative.
    pub fields: Fields,
    /// The contact set.
    pub contact: Vec<bool>,
    /// Linear solves, the confirming one included.
    pub solves: usize,
    /// Whether the monotone method finished.
    pub monotone: bool,
    /// `Converged` when the set confirms itself to rounding.
    pub status: Status,
}

/// Solves the inequality from a guess of the fields (boundary values in place) and of the contact set.
pub(crate) fn solve(
    system: &System,
    solver: &mut FreeSolver,
    mut fields: Fields,
    mut contact: Vec<bool>,
) -> Result<Outcome, SolveError> {
    let limit = 50 + 2 * (system.interior.len() as f64).sqrt() as usize;
    let env = |k: &str| std::env::var(k).ok().and_then(|v| v.parse::<usize>().ok()).unwrap_or(0);
    let (pre, mid) = (env("PRE"), env("MID"));
    let smooth = |fields: &mut Fields, contact: &mut Vec<bool>, k: usize| {
        if k == 0 { return; }
        for j in system.interior.iter() { if system.gap(fields, j) < 0.0 { system.close(fields, j); } }
        for _ in 0..k { monotone::relax(system, fields); }
        for j in system.interior.iter() { contact[j] = system.gap(fields, j) == 0.0; }
    };
    smooth(&mut fields, &mut contact, pre);
    let mut seen = HashSet::from([fingerprint(&contact)]);
    let mut fewest = usize::MAX;
    let mut idle = 0;
    for solves in 1..=limit {
        let found = step(system, solver, &mut fields, &contact)?;
        if found.worst <= ROUNDING {
            finish(system, solver, &mut fields, &contact)?;
            return Ok(Outcome {
                fields,
                contact,
                solves,
                monotone: false,
                status: Status::Converged,
            });
        }
        let changes = found.release.len() + found.attach.len();
        idle = if changes < fewest { 0 } else { idle + 1 };
        fewest = fewest.min(changes);
        apply(&found, &mut contact);
        smooth(&mut fields, &mut contact, mid);
        if idle > PATIENCE || !seen.insert(fingerprint(&contact)) {
            return monotone::solve(system, solver, fields, solves);
        }
    }
    monotone::solve(system, solver, fields, limit)
}

/// One linear solve on a contact set, and what contradicts the set afterwards.
pub(crate) fn step(
    system: &System,
    solver: &mut FreeSolver,
    fields: &mut Fields,
    contact: &[bool],
) -> Result<Violations, SolveError> {
    for j in system.interior.iter().filter(|&j| contact[j]) {
        system.close(fields, j);
    }
    solver.prepare(system, contact)?;
    solver.correct(system, fields, contact)?;
    Ok(system.violations(fields, contact))
}

/// Refines the last solution once and closes gaps that are negative by rounding.
pub(crate) fn finish(
    system: &System,
    solver: &mut FreeSolver,
    fields: &mut Fields,
    contact: &[bool],
) -> Result<(), SolveError> {
    solver.correct(system, fields, contact)?;
    for j in system.interior.iter() {
        if system.gap(fields, j) < 0.0 {
            system.close(fields, j);
        }
    }
    Ok(())
}

fn apply(found: &Violations, contact: &mut [bool]) {
    for &j in &found.release {
        contact[j as usize] = false;
    }
    for &j in &found.attach {
        contact[j as usize] = true;
    }
}

fn fingerprint(contact: &[bool]) -> u64 {
    let mut hasher = DefaultHasher::new();
    contact.hash(&mut hasher);
    hasher.finish()
}
