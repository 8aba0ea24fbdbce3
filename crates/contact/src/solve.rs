//! The entry: from a discrete problem to a solution that has been judged.

use crate::error::SolveError;
use crate::level::{Level, Method};
use crate::problem::DiscreteProblem;
use crate::settings::{Settings, Solver, Tolerance};
use crate::solution::{Solution, Status, rounding_residual};
use crate::start::Start;

/// Relative KKT residual that the active set method must reach under [`Tolerance::Balanced`].
pub const ACTIVE_SET_LIMIT: f64 = 1e-9;

/// Relative KKT residual that the interior-point method must reach under [`Tolerance::Balanced`].
///
/// Below any discretisation error. What is reached is 1e-9 to 1e-15 on ordinary data, and 1e-6 with a ratio of the tensions of 1e8; with 1e12 it fails.
pub const INTERIOR_POINT_LIMIT: f64 = 1e-6;

/// Solves the discrete problem, from a start on the same mesh ([`Start::prolong`]) or from nothing.
///
/// With `settings.reduce` the smallest model is taken that the tensions allow, and the contact set that is found decides what it is called:
/// [`Reduction::NoContact`](crate::Reduction::NoContact) when it is empty, [`Reduction::FullContact`](crate::Reduction::FullContact) when it is everything
/// and the heights agree on the whole boundary. No solve is spent on trying: from nothing, the first linear solve of the active
/// set method is the problem without contact, or that of full contact where the loads press everywhere.
///
/// [`Solver::Auto`] is the active set method at every size. From the start of a coarser mesh it needs two or three factorisations, from nothing about six,
/// where the interior-point method needs ten to twenty factorisations of a system twice as large, cannot use a start, and leaves a residual of
/// 1e-7 to 1e-9 instead of rounding. Should the active set method fail, the interior-point method gives a second opinion, and the smaller KKT
/// residual wins.
///
/// Under [`Tolerance::Balanced`] the limits are [`ACTIVE_SET_LIMIT`] and [`INTERIOR_POINT_LIMIT`], or what rounding alone allows where
/// that is more ([`rounding_residual`]): a soft membrane pressed hard against a stiff one has loads so much larger than its stiffness times
/// its displacement that no iterate in double precision does better.
///
/// # Errors
/// [`SolveError::Length`], [`SolveError::NotFinite`], [`SolveError::HeightsCross`] for data that make no sense;
/// [`SolveError::NotPositiveDefinite`], [`SolveError::TooLarge`], [`SolveError::InteriorPoint`] from the linear algebra;
/// [`SolveError::NotConverged`] when the KKT residual of the iterate misses the tolerance.
pub fn solve(
    problem: &DiscreteProblem,
    settings: &Settings,
    start: Option<&Start>,
) -> Result<Solution, SolveError> {
    check(problem, start)?;
    let mut level = Level::new(problem, settings.reduce);
    let mut run = |method: Method| {
        let limit = match method {
            Method::InteriorPoint => INTERIOR_POINT_LIMIT,
            _ => ACTIVE_SET_LIMIT,
        };
        let solution = level.solve(method, start)?;
        judge(problem, solution, settings.tolerance, limit)
    };
    // Without an interior vertex there is nothing to iterate on.
    let trivial = !problem.boundary.contains(&false);
    match settings.solver {
        Solver::Clarabel if !trivial => run(Method::InteriorPoint),
        Solver::Clarabel | Solver::ActiveSet => run(Method::ActiveSet),
        Solver::Auto => run(Method::ActiveSet).or_else(|first| match run(Method::InteriorPoint) {
            Ok(second) => Ok(second),
            Err(second) => Err(better(first, second)),
        }),
    }
}

/// The solution, if its KKT residual is within the tolerance.
fn judge(
    problem: &DiscreteProblem,
    mut solution: Solution,
    tolerance: Tolerance,
    limit: f64,
) -> Result<Solution, SolveError> {
    let info = &mut solution.info;
    let (tolerance, allowed) = match tolerance {
        Tolerance::Relative(t) => (t, info.kkt_residual <= t),
        Tolerance::Balanced => {
            let fine = info.kkt_residual <= limit
                || info.kkt_residual
                    <= rounding_residual(problem, &solution.displacement, &solution.force);
            (limit, fine)
        }
    };
    if allowed {
        info.status = Status::Converged;
        return Ok(solution);
    }
    Err(SolveError::NotConverged {
        kkt_residual: info.kkt_residual,
        tolerance,
        status: match info.status {
            // It claimed success.
            Status::Converged => Status::Stagnated,
            other => other,
        },
    })
}

/// Of two failures the one that came nearer to a solution.
fn better(first: SolveError, second: SolveError) -> SolveError {
    let reached = |e: &SolveError| match e {
        SolveError::NotConverged { kkt_residual, .. } => *kkt_residual,
        _ => f64::INFINITY,
    };
    if reached(&second) < reached(&first) {
        second
    } else {
        first
    }
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
