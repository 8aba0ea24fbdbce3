//! The entry: from a discrete problem to a solution that has been judged.

use crate::error::SolveError;
use crate::level::{INTERIOR_POINT, Level, Method};
use crate::multigrid::{self, Workspace};
use crate::problem::DiscreteProblem;
use crate::settings::{Settings, Solver, Tolerance};
use crate::solution::{Solution, Status, rounding_residual};
use crate::start::Start;

/// Relative KKT residual that the active set method must reach under [`Tolerance::Balanced`].
pub const ACTIVE_SET_LIMIT: f64 = 1e-9;

/// Relative KKT residual that the interior-point method must reach under [`Tolerance::Balanced`].
///
/// Below any discretisation error. It reaches 1e-9 to 1e-15 on ordinary data and 1e-7 with a ratio of the tensions of 1e8;
/// with 1e12 it may fail.
pub const INTERIOR_POINT_LIMIT: f64 = 1e-6;

/// Number of vertices from which [`Solver::Auto`] takes multigrid.
///
/// Milliseconds of one solve from the solution of the mesh before, with sigma, to a relative KKT residual of 1e-10 (multigrid) and to rounding
/// (active set), on adaptive meshes; in brackets multigrid to a tenth of the error estimate, without sigma. One core of two busy ones, EPYC at 2.25 GHz;
/// `cargo test --release -p membranes -p contact --test multigrid -- --ignored --nocapture`, environment `DIRECT=1`.
///
/// | vertices | active set, one field | multigrid, one field | active set, two fields | multigrid, two fields |
/// |---|---|---|---|---|
/// | 4e3 | 8 | 8 | 33 | 12 |
/// | 1.2e4 to 1.4e4 | 58 | 40 (12) | 126 | 25 (4) |
/// | 3.3e4 to 4.2e4 | 316 | 107 (32) | 404 | 89 (19) |
/// | 1.2e5 to 1.3e5 | 968 | 269 (61) | 2187 | 383 (88) |
///
/// One step is worth it from the smallest meshes on; below this size the active set method leaves rounding at a price that nobody notices.
pub const MULTIGRID_FROM: usize = 10_000;

/// Where rounding allows no better the limits give way, but never beyond this relative KKT residual.
pub const ROUNDING_LIMIT: f64 = 1e-3;

/// Solves the discrete problem, from a start on the same mesh ([`Start::prolong`]) or from nothing.
///
/// With `settings.reduce` the smallest model is taken that the tensions allow, and the contact set that is found decides what
/// it is called: [`Reduction::NoContact`](crate::Reduction::NoContact) when it is empty,
/// [`Reduction::FullContact`](crate::Reduction::FullContact) when it is everything and the heights agree on the whole
/// boundary. No solve is spent on trying: from nothing, the first linear solve of the active set method is the problem
/// without contact, or that of full contact where the loads press everywhere.
///
/// [`Solver::Auto`] is the active set method below [`MULTIGRID_FROM`] vertices and multigrid from there on. From the start of a coarser mesh it takes one to three
/// factorisations, from nothing about six, and leaves rounding. The interior-point method takes 10 to 40 factorisations of a
/// system of three times the order (five for two fields, in a slower code), cannot use a start, and leaves 1e-9 to 1e-15; it
/// was 10 to 50 times slower from nothing at 16 641 vertices. Should the active set method not confirm its set, the
/// interior-point method gives a second opinion, and the smaller KKT residual wins.
///
/// Under [`Tolerance::Balanced`] the limits are [`ACTIVE_SET_LIMIT`] and [`INTERIOR_POINT_LIMIT`], or what rounding alone
/// allows where that is more ([`rounding_residual`], at most [`ROUNDING_LIMIT`]): a soft membrane pressed hard against a stiff one has loads so much
/// larger than its stiffness times its displacement that no iterate in double precision does better.
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
    solve_in(problem, settings, start, &mut Workspace::default())
}

/// As [`solve`], with the memory of the solves before it. The result does not depend on what the workspace was used for.
///
/// # Errors
/// As [`solve`].
pub fn solve_in(
    problem: &DiscreteProblem,
    settings: &Settings,
    start: Option<&Start>,
    workspace: &mut Workspace,
) -> Result<Solution, SolveError> {
    check(problem, start)?;
    let direct = |method: Method| Level::new(problem, settings).solve(method, start);
    // Without an interior vertex there is nothing to iterate on.
    let trivial = !problem.boundary().contains(&false);
    let solution = match settings.solver {
        Solver::Clarabel if !trivial => direct(Method::InteriorPoint)?,
        Solver::Clarabel | Solver::ActiveSet => direct(Method::ActiveSet)?,
        _ if settings.iterates(problem.order()) => {
            by_multigrid(problem, settings, start, workspace)?
        }
        _ => {
            let mut level = Level::new(problem, settings);
            let first = level.solve(Method::ActiveSet, start)?;
            if first.info.status == Status::Converged {
                first
            } else {
                better(first, level.solve(Method::InteriorPoint, start))
            }
        }
    };
    judge(problem, solution, settings)
}

/// Computes sigma, K sigma = z, for a solution that was found without it ([`Settings::sigma`]).
///
/// # Errors
/// As [`solve`] from the linear algebra.
pub fn add_sigma(
    problem: &DiscreteProblem,
    settings: &Settings,
    solution: &mut Solution,
    workspace: &mut Workspace,
) -> Result<(), SolveError> {
    let found = if settings.iterates(problem.order()) {
        multigrid::sigma(problem, settings, &solution.force, workspace).unwrap_or_default()
    } else {
        None
    };
    solution.sigma = match found {
        Some(sigma) => sigma,
        None if solution.force.iter().all(|&z| z == 0.0) => vec![0.0; problem.order()],
        None => Level::new(problem, settings).sigma(&solution.force)?,
    };
    Ok(())
}

/// Multigrid where there is a hierarchy, and the active set method from its last iterate should it miss its goal.
fn by_multigrid(
    problem: &DiscreteProblem,
    settings: &Settings,
    start: Option<&Start>,
    workspace: &mut Workspace,
) -> Result<Solution, SolveError> {
    let mut cycles = None;
    let again = match multigrid::solve(problem, settings, start, workspace) {
        Ok(None) => return Level::new(problem, settings).solve(Method::ActiveSet, start),
        Ok(Some(mut solution)) if meets(problem, &solution, settings) => {
            if settings.sigma && solution.sigma.is_empty() {
                solution.sigma = Level::new(problem, settings).sigma(&solution.force)?;
            }
            return Ok(solution);
        }
        Ok(Some(solution)) => {
            cycles = solution.info.cycles;
            let finite = solution
                .displacement
                .iter()
                .flatten()
                .all(|u| u.is_finite());
            finite.then(|| Start::again(&solution))
        }
        // The factor of the initial mesh failed: let the whole matrix say so, or not.
        Err(_) => None,
    };
    let mut level = Level::new(problem, settings);
    let mut solution = level.solve(Method::ActiveSet, again.as_ref().or(start))?;
    solution.info.cycles = cycles;
    solution.info.solver = match solution.info.solver {
        "active-set" => "multigrid+active-set",
        _ => "multigrid+active-set+monotone",
    };
    Ok(solution)
}

/// Whether a solution by multigrid reached its goal and its KKT residual is within the limit.
fn meets(problem: &DiscreteProblem, solution: &Solution, settings: &Settings) -> bool {
    solution.info.status == Status::Converged
        && (meets_target(solution, settings)
            || solution.info.kkt_residual <= limit(problem, solution, settings.tolerance))
}

/// Whether the estimated algebraic error is within a target that was set.
fn meets_target(solution: &Solution, settings: &Settings) -> bool {
    match (
        settings.tolerance,
        settings.energy_target,
        solution.info.algebraic_error,
    ) {
        (Tolerance::Balanced, Some(target), Some(error)) => {
            error <= target && solution.info.kkt_residual.is_finite()
        }
        _ => false,
    }
}

/// Of a solution and a second opinion the one with the smaller KKT residual.
fn better(first: Solution, second: Result<Solution, SolveError>) -> Solution {
    match second {
        Ok(second) if second.info.kkt_residual < first.info.kkt_residual => second,
        _ => first,
    }
}

/// The solution, if its KKT residual is within the tolerance.
fn judge(
    problem: &DiscreteProblem,
    mut solution: Solution,
    settings: &Settings,
) -> Result<Solution, SolveError> {
    let residual = solution.info.kkt_residual;
    let converged = solution.info.status == Status::Converged;
    if converged && meets_target(&solution, settings) {
        return Ok(solution);
    }
    let tolerance = limit(problem, &solution, settings.tolerance);
    if residual.is_finite() && residual <= tolerance {
        solution.info.status = Status::Converged;
        return Ok(solution);
    }
    Err(SolveError::NotConverged {
        kkt_residual: residual,
        tolerance,
        status: match solution.info.status {
            // It claimed success.
            Status::Converged => Status::Stagnated,
            other => other,
        },
    })
}

/// The relative KKT residual that a solution must reach: the tolerance of its method, or what rounding allows where that is more and
/// the tolerance was left to the method.
fn limit(problem: &DiscreteProblem, solution: &Solution, tolerance: Tolerance) -> f64 {
    let limit = match tolerance {
        Tolerance::Relative(t) => return t,
        Tolerance::Balanced if solution.info.solver == INTERIOR_POINT => INTERIOR_POINT_LIMIT,
        Tolerance::Balanced => ACTIVE_SET_LIMIT,
    };
    if solution.info.kkt_residual <= limit {
        return limit;
    }
    let rounding = rounding_residual(problem, &solution.displacement, &solution.force);
    limit.max(rounding.min(ROUNDING_LIMIT))
}

/// The first value that is not finite; a block at a time, since nearly always there is none.
fn not_finite(values: &[f64]) -> Option<usize> {
    const BLOCK: usize = 64;
    let blocks = values.chunks(BLOCK).enumerate();
    for (block, values) in blocks {
        if !values.iter().fold(true, |all, v| all & v.is_finite()) {
            let at = values.iter().position(|v| !v.is_finite());
            return at.map(|at| BLOCK * block + at);
        }
    }
    None
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
    let sigma = start.and_then(|s| s.sigma.as_ref());
    let guess = guess.chain(sigma.map(|sigma| ("start of sigma", sigma)));
    for (what, array) in arrays.into_iter().chain(guess) {
        if array.len() != expected {
            return Err(SolveError::Length {
                what,
                expected,
                found: array.len(),
            });
        }
        if let Some(vertex) = not_finite(array) {
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
    match (0..expected).find(|&j| problem.boundary()[j] && g1[j] < g2[j]) {
        Some(vertex) => Err(SolveError::HeightsCross {
            vertex,
            upper: g1[vertex],
            lower: g2[vertex],
        }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::common::{Data, square};
    use crate::solution::Reduction;

    fn example() -> (DiscreteProblem, Solution) {
        let data = Data {
            tensions: [&|_, _| 1.0, &|_, _| 2.0],
            loads: [&|x, _| -20.0 - x, &|_, _| 1.0],
            heights: [&|_, _| 0.3, &|_, _| 0.0],
        };
        let problem = data.on(&square(8));
        let solution = solve(&problem, &Settings::default(), None).unwrap();
        assert_eq!(solution.info.reduction, Reduction::ConstantTensions);
        (problem, solution)
    }

    #[test]
    fn the_better_opinion_wins() {
        let (_, solution) = example();
        let with = |kkt: f64, solver: &'static str| {
            let mut s = solution.clone();
            s.info.kkt_residual = kkt;
            s.info.solver = solver;
            s
        };
        let first = || with(1e-5, "active-set+monotone");
        let name = |s: Solution| s.info.solver;
        assert_eq!(
            name(better(first(), Ok(with(1e-8, INTERIOR_POINT)))),
            INTERIOR_POINT
        );
        assert_eq!(
            name(better(first(), Ok(with(1e-3, INTERIOR_POINT)))),
            "active-set+monotone"
        );
        let failed = Err(SolveError::TooLarge { order: 7 });
        assert_eq!(name(better(first(), failed)), "active-set+monotone");
    }

    #[test]
    fn the_residual_decides_whatever_the_solver_claims() {
        let (problem, solution) = example();
        for (kkt, solver, tolerance, fine) in [
            (1e-8, "active-set", Tolerance::Balanced, false),
            (1e-10, "active-set", Tolerance::Balanced, true),
            (1e-8, INTERIOR_POINT, Tolerance::Balanced, true),
            (1e-5, INTERIOR_POINT, Tolerance::Balanced, false),
            (1e-5, INTERIOR_POINT, Tolerance::Relative(1e-4), true),
            (
                f64::INFINITY,
                "active-set",
                Tolerance::Relative(f64::INFINITY),
                false,
            ),
            (f64::NAN, "active-set", Tolerance::Relative(1.0), false),
        ] {
            let mut s = solution.clone();
            s.info.kkt_residual = kkt;
            s.info.solver = solver;
            let settings = Settings {
                tolerance,
                ..Settings::default()
            };
            let judged = judge(&problem, s, &settings);
            assert_eq!(judged.is_ok(), fine, "{kkt:e} {solver} {tolerance:?}");
            if let Err(SolveError::NotConverged { status, .. }) = judged {
                assert_eq!(status, Status::Stagnated);
            }
        }
    }
}
