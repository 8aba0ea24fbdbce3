//! One problem on one mesh: which model is solved by which method, and the solution put together from the outcome.

use crate::active_set::{self, Guess};
use crate::error::SolveError;
use crate::free::{FreeSolver, PairFactor};
use crate::interior::{Interior, Role, ScalarFactor};
use crate::interior_point;
use crate::problem::DiscreteProblem;
use crate::reduce::{Proportional, initial_pair, pair_system};
use crate::settings::Settings;
use crate::solution::{Reduction, Solution, SolveInfo, Status, kkt_residual};
use crate::start::Start;
use crate::system::{Fields, System};

/// Name of the interior-point method in the record.
pub(crate) const INTERIOR_POINT: &str = "clarabel";

/// Rounding error of a row of a linear system, relative to the sum of the magnitudes of its terms.
pub(crate) const ROW_ROUNDING: f64 = 4.0 * f64::EPSILON;

/// Which method solves the inequality.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Method {
    /// The active set method, with its monotone fallback.
    ActiveSet,
    /// The interior-point method.
    InteriorPoint,
    /// The fallback alone.
    #[cfg(test)]
    Monotone,
}

/// What a method found out about the inequality.
struct Found {
    fields: Fields,
    contact: Vec<bool>,
    /// Multiplier of the system, where the method has its own; else it is read from the rows.
    multiplier: Option<Vec<f64>>,
    iterations: usize,
    solver: &'static str,
    status: Status,
}

/// A problem with its unknowns and the factor that is analysed once.
pub(crate) struct Level<'a> {
    /// The problem.
    pub problem: &'a DiscreteProblem,
    /// Its unknowns.
    pub interior: Interior,
    reduce: bool,
    with_sigma: bool,
    scalar: Option<ScalarFactor>,
}

impl<'a> Level<'a> {
    /// No work yet.
    pub fn new(problem: &'a DiscreteProblem, settings: &Settings) -> Level<'a> {
        Level {
            problem,
            interior: Interior::new(problem.boundary()),
            reduce: settings.reduce,
            with_sigma: settings.sigma,
            scalar: None,
        }
    }

    /// Solves by one method; the KKT residual is measured, not judged.
    pub fn solve(&mut self, method: Method, start: Option<&Start>) -> Result<Solution, SolveError> {
        let reduced = Proportional::of(self.problem).filter(|_| self.reduce);
        match reduced {
            Some(model) => self.solve_reduced(&model, method, start),
            None => self.solve_pair(method, start),
        }
    }

    fn solve_reduced(
        &mut self,
        model: &Proportional,
        method: Method,
        start: Option<&Start>,
    ) -> Result<Solution, SolveError> {
        let mut scalar = self.take_scalar()?;
        let interior = &self.interior;
        let system = model.system(interior);
        let guess = Guess {
            fields: model.initial_gap(interior, start),
            contact: self.first_set(&system, start),
            warm: start.is_some(),
        };
        let mut solver = FreeSolver::Scalar {
            factor: &mut scalar,
            role: model.role,
        };
        let mut found = run(&system, &mut solver, guess, method)?;
        let mean = mean(model, interior, &mut scalar, start)?;
        self.scalar = Some(scalar);
        let displacement = model.fields(&self.interior, &mean, &found.fields[0]);
        if let Some(multiplier) = &mut found.multiplier {
            model.forces(multiplier);
        }
        let reduction = named(self.problem, &found.contact, model.reduction);
        self.finish(displacement, found, reduction)
    }

    fn solve_pair(
        &mut self,
        method: Method,
        start: Option<&Start>,
    ) -> Result<Solution, SolveError> {
        let interior = &self.interior;
        let system = pair_system(self.problem, interior);
        let guess = Guess {
            fields: initial_pair(self.problem, interior, start),
            contact: self.first_set(&system, start),
            warm: start.is_some(),
        };
        let mut factor = PairFactor::default();
        let mut found = run(&system, &mut FreeSolver::Pair(&mut factor), guess, method)?;
        // Gone before the factor of sigma comes.
        drop(factor);
        let mut fields = std::mem::take(&mut found.fields).into_iter();
        let displacement = [(); 2].map(|()| fields.next().unwrap_or_default());
        let reduction = if self.reduce {
            named(self.problem, &found.contact, Reduction::TwoField)
        } else {
            Reduction::TwoField
        };
        self.finish(displacement, found, reduction)
    }

    /// Forces, sigma and the record.
    fn finish(
        &mut self,
        mut displacement: [Vec<f64>; 2],
        found: Found,
        reduction: Reduction,
    ) -> Result<Solution, SolveError> {
        self.uncross(&mut displacement);
        let force = match found.multiplier {
            Some(force) => force,
            None => self.forces(&displacement, &found.contact),
        };
        let sigma = if !self.with_sigma {
            Vec::new()
        } else if force.iter().all(|&z| z == 0.0) {
            vec![0.0; self.problem.order()]
        } else {
            self.sigma(&force)?
        };
        let n = self.interior.len();
        let info = SolveInfo {
            solver: found.solver,
            reduction,
            status: found.status,
            iterations: found.iterations,
            unknowns: if reduction == Reduction::FullContact {
                n
            } else {
                2 * n
            },
            kkt_residual: kkt_residual(self.problem, &displacement, &force),
            algebraic_error: None,
            contraction: None,
            first_cycle: None,
            cycles: None,
        };
        Ok(Solution {
            displacement,
            force,
            sigma,
            contact: found.contact,
            info,
        })
    }

    /// Where rounding has left u1 < u2, both displacements take their mean weighted by stiffness.
    fn uncross(&self, displacement: &mut [Vec<f64>; 2]) {
        for j in self.interior.iter() {
            let [u1, u2] = [displacement[0][j], displacement[1][j]];
            if u1 < u2 {
                let share = 1.0 / (1.0 + self.problem.diagonal(1, j) / self.problem.diagonal(0, j));
                let common = u2 + share * (u1 - u2);
                displacement[0][j] = common;
                displacement[1][j] = common;
            }
        }
    }

    fn take_scalar(&mut self) -> Result<ScalarFactor, SolveError> {
        match self.scalar.take() {
            Some(factor) => Ok(factor),
            None => ScalarFactor::new(self.problem.pattern(), &self.interior),
        }
    }

    /// The contact set to begin with: the start's; from nothing all vertices when the loads press everywhere and the membranes share
    /// their boundary, else none.
    fn first_set(&self, system: &System, start: Option<&Start>) -> Vec<bool> {
        let mut contact = vec![false; self.problem.order()];
        let pressed = || {
            shares_boundary(self.problem)
                && self.interior.iter().all(|j| {
                    let free = |i: usize| system.loads[i][j] / system.matrices[i].diagonal(j);
                    if system.is_pair() {
                        free(0) <= free(1)
                    } else {
                        free(0) <= 0.0
                    }
                })
        };
        let all = start.is_none() && pressed();
        for j in self.interior.iter() {
            contact[j] = start.map_or(all, |s| s.contact[j]);
        }
        contact
    }

    /// z on the contact set, from the row of the softer membrane; 0 elsewhere, and where it is not positive beyond rounding.
    fn forces(&self, displacement: &[Vec<f64>; 2], contact: &[bool]) -> Vec<f64> {
        let problem = self.problem;
        let mut force = vec![0.0; problem.order()];
        for j in self.interior.iter().filter(|&j| contact[j]) {
            let i = usize::from(problem.diagonal(1, j) < problem.diagonal(0, j));
            let (matrix, load) = (problem.stiffness(i), problem.loads[i].nodal[j]);
            let residual = load - matrix.row_dot(j, &displacement[i]);
            let z = if i == 0 { -residual } else { residual };
            let terms = load.abs() + matrix.row_dot_abs(j, &displacement[i]);
            if z > ROW_ROUNDING * terms {
                force[j] = z;
            }
        }
        force
    }

    /// The Riesz representative: K sigma = z, zero on the boundary.
    pub fn sigma(&mut self, force: &[f64]) -> Result<Vec<f64>, SolveError> {
        let mut factor = self.take_scalar()?;
        factor.whole(self.problem.laplacian(), Role::Laplacian, &self.interior)?;
        let mut rhs: Vec<f64> = self.interior.iter().map(|j| force[j]).collect();
        factor.solve(&mut rhs);
        self.scalar = Some(factor);
        let mut sigma = vec![0.0; self.problem.order()];
        for (&value, j) in rhs.iter().zip(self.interior.iter()) {
            sigma[j] = value;
        }
        finite("sigma", sigma)
    }
}

/// Whether the two heights are equal on the whole boundary.
fn shares_boundary(problem: &DiscreteProblem) -> bool {
    let [g1, g2] = &problem.heights;
    let boundary = problem.boundary();
    (0..problem.order()).all(|j| !boundary[j] || g1[j] == g2[j])
}

/// What the contact set found says about the model: without contact, or with nothing else, no inequality was left.
pub(crate) fn named(problem: &DiscreteProblem, contact: &[bool], model: Reduction) -> Reduction {
    let boundary = problem.boundary();
    if !contact.contains(&true) {
        Reduction::NoContact
    } else if contact.iter().zip(boundary).all(|(&c, &b)| c || b) && shares_boundary(problem) {
        Reduction::FullContact
    } else {
        model
    }
}

/// Solves the inequality by one method.
fn run(
    system: &System,
    solver: &mut FreeSolver,
    guess: Guess,
    method: Method,
) -> Result<Found, SolveError> {
    let outcome = match method {
        Method::ActiveSet => active_set::solve(system, solver, guess)?,
        #[cfg(test)]
        Method::Monotone => crate::monotone::solve(system, solver, guess.fields, 0)?,
        Method::InteriorPoint => {
            let mut fields = guess.fields;
            if !guess.warm {
                // Only the size of these displacements is used.
                let none = vec![false; guess.contact.len()];
                active_set::step(system, solver, &mut fields, &none)?;
                system.project(&mut fields);
            }
            let outcome = interior_point::solve(system, &fields)?;
            return Ok(Found {
                fields: outcome.fields,
                contact: outcome.contact,
                multiplier: Some(outcome.multiplier),
                iterations: outcome.iterations,
                solver: INTERIOR_POINT,
                status: outcome.status,
            });
        }
    };
    Ok(Found {
        fields: outcome.fields,
        contact: outcome.contact,
        multiplier: None,
        iterations: outcome.solves,
        solver: if outcome.monotone {
            "active-set+monotone"
        } else {
            "active-set"
        },
        status: outcome.status,
    })
}

/// The mean of the displacements weighted by tension: one linear solve and a step of refinement.
fn mean(
    model: &Proportional,
    interior: &Interior,
    factor: &mut ScalarFactor,
    start: Option<&Start>,
) -> Result<Vec<f64>, SolveError> {
    let mut mean = model.initial_mean(interior, start);
    let matrix = model.matrix();
    factor.whole(matrix, model.role, interior)?;
    for _ in 0..2 {
        let mut rhs: Vec<f64> = interior
            .iter()
            .map(|j| model.mean_load(j) - matrix.row_dot(j, &mean))
            .collect();
        factor.solve(&mut rhs);
        for (step, j) in rhs.iter().zip(interior.iter()) {
            mean[j] += step;
        }
    }
    finite("mean displacement", mean)
}

fn finite(what: &'static str, values: Vec<f64>) -> Result<Vec<f64>, SolveError> {
    match values.iter().position(|v| !v.is_finite()) {
        Some(vertex) => Err(SolveError::NotFinite { what, vertex }),
        None => Ok(values),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::common::{Data, square};

    #[test]
    fn displacements_that_cross_meet_at_their_mean() {
        let data = Data {
            tensions: [&|_, _| 1.0, &|_, _| 3.0],
            loads: [&|_, _| -1.0, &|_, _| 0.0],
            heights: [&|_, _| 0.5, &|_, _| 0.0],
        };
        let problem = data.on(&square(4));
        let level = Level::new(&problem, &Settings::default());
        let mut displacement = problem.heights.clone();
        let inner: Vec<usize> = level.interior.iter().collect();
        // Crossed by rounding, far crossed, and apart.
        let next = f64::from_bits(1.0f64.to_bits() + 1);
        for (&j, [u1, u2]) in inner.iter().zip([[1.0, next], [1.0, 5.0], [2.0, 1.0]]) {
            displacement[0][j] = u1;
            displacement[1][j] = u2;
        }
        level.uncross(&mut displacement);
        let at = |k: usize| [displacement[0][inner[k]], displacement[1][inner[k]]];
        assert!(at(0)[0] == at(0)[1] && (1.0..=next).contains(&at(0)[0]));
        // A quarter of the stiffness belongs to the upper membrane.
        assert_eq!(at(1), [4.0, 4.0]);
        assert_eq!(at(2), [2.0, 1.0]);
    }
}
