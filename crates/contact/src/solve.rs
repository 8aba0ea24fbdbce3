//! The entry: from a discrete problem to a solution that has been judged.

use crate::active_set::{self, Outcome};
use crate::error::SolveError;
use crate::free::{FreeSolver, PairFactor};
use crate::interior::{Interior, Role, ScalarFactor};
use crate::problem::DiscreteProblem;
use crate::reduce::{Proportional, initial_pair, pair_system};
use crate::settings::{Settings, Solver, Tolerance};
use crate::solution::{Reduction, Solution, SolveInfo, Status, kkt_residual};
use crate::start::Start;
use crate::system::System;

/// Relative KKT residual that the active set method must reach under [`Tolerance::Balanced`], unless rounding alone allows no better.
pub const ACTIVE_SET_LIMIT: f64 = 1e-9;

/// Solves the discrete problem, from a start on the same mesh or from nothing.
pub fn solve(
    problem: &DiscreteProblem,
    settings: &Settings,
    start: Option<&Start>,
) -> Result<Solution, SolveError> {
    check(problem, start)?;
    let interior = Interior::new(&problem.boundary);
    let solution = match settings.solver {
        Solver::ActiveSet | Solver::Auto | Solver::Clarabel => {
            solve_by_active_set(problem, &interior, settings.reduce, start)?
        }
    };
    judge(solution, settings.tolerance)
}

fn judge(mut solution: Solution, tolerance: Tolerance) -> Result<Solution, SolveError> {
    let info = &mut solution.info;
    let limit = match tolerance {
        Tolerance::Balanced => ACTIVE_SET_LIMIT,
        Tolerance::Relative(t) => t,
    };
    if info.kkt_residual <= limit {
        info.status = Status::Converged;
        return Ok(solution);
    }
    Err(SolveError::NotConverged {
        kkt_residual: info.kkt_residual,
        tolerance: limit,
        status: info.status,
    })
}

fn check(problem: &DiscreteProblem, start: Option<&Start>) -> Result<(), SolveError> {
    let expected = problem.order();
    let arrays = [
        ("upper load", &problem.loads[0].nodal),
        ("lower load", &problem.loads[1].nodal),
        ("upper height", &problem.heights[0]),
        ("lower height", &problem.heights[1]),
    ];
    let guess = start.into_iter().flat_map(|s| {
        let [u1, u2] = &s.displacement;
        [
            ("start of the upper membrane", u1),
            ("start of the lower membrane", u2),
        ]
    });
    for (what, array) in arrays.into_iter().chain(guess) {
        if array.len() != expected {
            return Err(SolveError::Length {
                what,
                expected,
                found: array.len(),
            });
        }
        if let Some(vertex) = array.iter().position(|v| !v.is_finite()) {
            return Err(SolveError::NotFinite { what, vertex });
        }
    }
    if let Some(s) = start
        && s.contact.len() != expected
    {
        return Err(SolveError::Length {
            what: "start of the contact set",
            expected,
            found: s.contact.len(),
        });
    }
    let [g1, g2] = &problem.heights;
    match (0..expected).find(|&j| problem.boundary[j] && g1[j] < g2[j]) {
        Some(vertex) => Err(SolveError::HeightsCross {
            vertex,
            upper: g1[vertex],
            lower: g2[vertex],
        }),
        None => Ok(()),
    }
}

fn solve_by_active_set(
    problem: &DiscreteProblem,
    interior: &Interior,
    reduce: bool,
    start: Option<&Start>,
) -> Result<Solution, SolveError> {
    let reduced = if reduce {
        Proportional::of(problem)
    } else {
        None
    };
    // Analysed when first needed: the two-field problem needs it for sigma only.
    let mut scalar = None;
    let (outcome, displacement, model) = match &reduced {
        Some(model) => {
            let factor = prepared(&mut scalar, problem, interior)?;
            let system = model.system(interior);
            let fields = model.initial_gap(interior, start);
            let contact = first_set(problem, &system, interior, start);
            let outcome = active_set::solve(
                &system,
                &mut FreeSolver::Scalar {
                    factor,
                    role: model.role,
                },
                fields,
                contact,
            )?;
            let mean = mean(model, interior, factor, start)?;
            let u = model.displacements(interior, &mean, &outcome.fields[0]);
            (outcome, u, model.reduction)
        }
        None => {
            let system = pair_system(problem, interior);
            let fields = initial_pair(problem, interior, start);
            let contact = first_set(problem, &system, interior, start);
            let mut factor = PairFactor::default();
            let outcome =
                active_set::solve(&system, &mut FreeSolver::Pair(&mut factor), fields, contact)?;
            let mut fields = outcome.fields.clone().into_iter();
            let u = [(); 2].map(|()| fields.next().unwrap_or_default());
            (outcome, u, Reduction::TwoField)
        }
    };
    let reduction = if reduce {
        named(problem, interior, &outcome, model)
    } else {
        Reduction::TwoField
    };
    let force = forces(problem, interior, &displacement, &outcome.contact);
    let sigma = if force.iter().all(|&z| z == 0.0) {
        vec![0.0; problem.order()]
    } else {
        let factor = prepared(&mut scalar, problem, interior)?;
        sigma(problem, interior, factor, &force)?
    };
    let n = interior.len();
    let info = SolveInfo {
        solver: if outcome.monotone {
            "active-set+monotone"
        } else {
            "active-set"
        },
        reduction,
        status: outcome.status,
        iterations: outcome.solves,
        unknowns: if reduction == Reduction::FullContact {
            n
        } else {
            2 * n
        },
        kkt_residual: kkt_residual(problem, &displacement, &force),
    };
    Ok(Solution {
        displacement,
        force,
        sigma,
        contact: outcome.contact,
        info,
    })
}

fn prepared<'f>(
    scalar: &'f mut Option<ScalarFactor>,
    problem: &DiscreteProblem,
    interior: &Interior,
) -> Result<&'f mut ScalarFactor, SolveError> {
    Ok(match scalar {
        Some(factor) => factor,
        None => scalar.insert(ScalarFactor::new(&problem.pattern, interior)?),
    })
}

/// The contact set to begin with: the start's; from nothing all vertices when the loads press everywhere and the membranes share their
/// boundary, else none.
fn first_set(
    problem: &DiscreteProblem,
    system: &System,
    interior: &Interior,
    start: Option<&Start>,
) -> Vec<bool> {
    if let Some(s) = start {
        let mut contact = s.contact.clone();
        for (touching, &fixed) in contact.iter_mut().zip(&problem.boundary) {
            *touching &= !fixed;
        }
        return contact;
    }
    let mut contact = vec![false; problem.order()];
    let pressed = interior.iter().all(|j| {
        let free = |i: usize| system.loads[i][j] / system.matrices[i].diagonal(j);
        if system.is_pair() {
            free(0) <= free(1)
        } else {
            free(0) <= 0.0
        }
    });
    if pressed && shares_boundary(problem) {
        for j in interior.iter() {
            contact[j] = true;
        }
    }
    contact
}

/// Whether the two heights are equal on the whole boundary.
fn shares_boundary(problem: &DiscreteProblem) -> bool {
    let [g1, g2] = &problem.heights;
    (0..problem.order()).all(|j| !problem.boundary[j] || g1[j] == g2[j])
}

/// What the contact set found says about the model: without contact, or with nothing else, no inequality was left.
fn named(
    problem: &DiscreteProblem,
    interior: &Interior,
    outcome: &Outcome,
    model: Reduction,
) -> Reduction {
    if !outcome.contact.contains(&true) {
        Reduction::NoContact
    } else if interior.iter().all(|j| outcome.contact[j]) && shares_boundary(problem) {
        Reduction::FullContact
    } else {
        model
    }
}

/// The mean of the displacements weighted by tension: one linear solve and a step of refinement.
fn mean(
    model: &Proportional,
    interior: &Interior,
    factor: &mut ScalarFactor,
    start: Option<&Start>,
) -> Result<Vec<f64>, SolveError> {
    let mut mean = model.initial_mean(interior, start);
    factor.whole(model.matrix, model.role, interior)?;
    for _ in 0..2 {
        let mut rhs: Vec<f64> = interior
            .iter()
            .map(|j| model.mean_load(j) - model.matrix.row_dot(j, &mean))
            .collect();
        factor.solve(&mut rhs);
        for (step, j) in rhs.iter().zip(interior.iter()) {
            mean[j] += step;
        }
    }
    finite("mean displacement", mean)
}

/// z on the contact set, from the row of the softer membrane; 0 elsewhere, nowhere negative.
fn forces(
    problem: &DiscreteProblem,
    interior: &Interior,
    displacement: &[Vec<f64>; 2],
    contact: &[bool],
) -> Vec<f64> {
    let mut force = vec![0.0; problem.order()];
    for j in interior.iter().filter(|&j| contact[j]) {
        let i = usize::from(problem.diagonal(1, j) < problem.diagonal(0, j));
        let residual =
            problem.loads[i].nodal[j] - problem.stiffness[i].row_dot(j, &displacement[i]);
        force[j] = if i == 0 { -residual } else { residual }.max(0.0);
    }
    force
}

/// The Riesz representative: K sigma = z, zero on the boundary.
fn sigma(
    problem: &DiscreteProblem,
    interior: &Interior,
    factor: &mut ScalarFactor,
    force: &[f64],
) -> Result<Vec<f64>, SolveError> {
    factor.whole(&problem.laplacian, Role::Laplacian, interior)?;
    let mut rhs: Vec<f64> = interior.iter().map(|j| force[j]).collect();
    factor.solve(&mut rhs);
    let mut sigma = vec![0.0; problem.order()];
    for (&value, j) in rhs.iter().zip(interior.iter()) {
        sigma[j] = value;
    }
    finite("sigma", sigma)
}

fn finite(what: &'static str, values: Vec<f64>) -> Result<Vec<f64>, SolveError> {
    match values.iter().position(|v| !v.is_finite()) {
        Some(vertex) => Err(SolveError::NotFinite { what, vertex }),
        None => Ok(values),
    }
}
