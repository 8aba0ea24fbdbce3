//! One pass over the triangles for everything cheap that a level is judged by.
//!
//! The [residual estimator](crate::residual), the [oscillation](crate::oscillation), the [energy](crate::energy) and the largest contribution of the
//! loads need areas, gradients and diameters of all triangles. They are found once here, in the order of the mesh; a jump over an edge is added
//! when the later one of its triangles is met, which has the normal at hand and finds the flux of the other one stored.

use contact::{DiscreteProblem, Solution};
use fem_core::{ElementValues, Mesh};

use crate::action::nodal_action;
use crate::energy::Energy;
use crate::residual::contact_term;
use crate::squares::Squares;

/// What one pass tells of a level; scaled.
#[derive(Clone, Debug)]
pub struct Sweep {
    /// Squares of the residual estimator, if wanted.
    pub residual: Option<Squares>,
    /// Squares of the oscillation; none for constant loads, which have no oscillation.
    pub oscillation: Option<Squares>,
    /// The oscillation in the unit of the energy norm: sum_i h_K^2 ||f_i - f_ih||_K^2 / mu_iK, also none for constant loads.
    pub weighted_oscillation: Option<Squares>,
    /// J(u_h) and |||u_h|||.
    pub energy: Energy,
    /// The largest contribution (sum_i h_K^2 |K| f_ih^2)^(1/2) of the loads.
    pub largest_contribution: f64,
    /// The same in the unit of the energy norm, with the squares over mu_iK.
    pub weighted_contribution: f64,
}

/// What is known at a vertex, in one place.
#[derive(Clone, Copy)]
struct Corner {
    point: [f64; 2],
    displacement: [f64; 2],
    action: f64,
}

/// 1/mu_iK, found once for a constant.
enum Inverse<'a> {
    Same(f64),
    Each(&'a ElementValues),
}

impl Inverse<'_> {
    fn of(mean: &ElementValues) -> Inverse<'_> {
        match mean.same() {
            Some(mean) => Inverse::Same(1.0 / mean),
            None => Inverse::Each(mean),
        }
    }

    #[inline(always)]
    fn at(&self, t: usize) -> f64 {
        match self {
            Inverse::Same(value) => *value,
            Inverse::Each(mean) => 1.0 / mean[t],
        }
    }

    /// 1 / max(mu_iK, mu_iK') for two neighbours.
    #[inline(always)]
    fn stiffer(&self, t: usize, s: usize) -> f64 {
        match self {
            Inverse::Same(value) => *value,
            Inverse::Each(mean) => 1.0 / mean[t].max(mean[s]),
        }
    }
}

/// Passes over all triangles; the residual estimator is computed if it is wanted.
pub fn sweep(mesh: &Mesh, problem: &DiscreteProblem, solution: &Solution, residual: bool) -> Sweep {
    if residual {
        pass::<true>(mesh, problem, solution)
    } else {
        pass::<false>(mesh, problem, solution)
    }
}

/// The pass; `RESIDUAL` says whether the estimator is computed.
fn pass<const RESIDUAL: bool>(
    mesh: &Mesh,
    problem: &DiscreteProblem,
    solution: &Solution,
) -> Sweep {
    let (corners, work) = corners::<RESIDUAL>(mesh, problem, solution);
    let count = mesh.triangle_count();
    let room = if RESIDUAL { count } else { 0 };
    let inverse = problem.tension_mean.each_ref().map(Inverse::of);
    let varying = problem.loads.iter().any(|f| f.same().is_none());
    let mut squares: Vec<f64> = Vec::with_capacity(room);
    let mut fluxes: Vec<[[f64; 2]; 2]> = Vec::with_capacity(room);
    let mut oscillation = Vec::with_capacity(if varying { count } else { 0 });
    let mut weighted_oscillation = Vec::with_capacity(oscillation.capacity());
    let (mut energy, mut largest, mut weighted_largest) = (0.0, 0.0f64, 0.0f64);
    for (t, (v, around)) in mesh.triangles().iter().zip(mesh.neighbours()).enumerate() {
        let c = v.map(|j| corners[j.index()]);
        // Edge k is opposite to corner k and runs counter-clockwise.
        let edges = [0, 1, 2].map(|k| {
            let (p, q) = (c[(k + 1) % 3].point, c[(k + 2) % 3].point);
            [q[0] - p[0], q[1] - p[1]]
        });
        let twice = edges[2][1] * edges[1][0] - edges[2][0] * edges[1][1];
        let area = 0.5 * twice;
        let h2 = edges
            .iter()
            .map(|e| e[0] * e[0] + e[1] * e[1])
            .fold(0.0f64, |h, l| if l > h { l } else { h });
        let over = 1.0 / twice;
        let mut flux = [[0.0; 2]; 2];
        let mut contribution = [0.0; 2];
        for i in 0..2 {
            // Differences first: a large common height must not cost digits.
            let [d1, d2] = [1, 2].map(|k| c[k].displacement[i] - c[0].displacement[i]);
            let gradient = [
                -(d1 * edges[1][1] + d2 * edges[2][1]) * over,
                (d1 * edges[1][0] + d2 * edges[2][0]) * over,
            ];
            let mu = problem.tension_mean[i][t];
            flux[i] = gradient.map(|g| mu * g);
            energy += area * (flux[i][0] * gradient[0] + flux[i][1] * gradient[1]);
            let mean = problem.loads[i].mean(t);
            contribution[i] = h2 * area * mean * mean;
        }
        let softness = [inverse[0].at(t), inverse[1].at(t)];
        largest = largest.max(contribution[0] + contribution[1]);
        let weighted = contribution[0] * softness[0] + contribution[1] * softness[1];
        weighted_largest = weighted_largest.max(weighted);
        if varying {
            let [f, g] = [0, 1].map(|i| problem.loads[i].deviation_squared(t));
            oscillation.push(h2 * (f + g));
            weighted_oscillation.push(h2 * (f * softness[0] + g * softness[1]));
        }
        if RESIDUAL {
            let mut square = contact_term(
                area,
                c.map(|c| c.action),
                c.map(|c| c.displacement[0] - c.displacement[1]),
            );
            let weight = h2 * area / 3.0;
            for (i, sign) in [(0, 1.0), (1, -1.0)] {
                let mean = problem.loads[i].mean(t);
                let [a, b, c] = c.map(|c| mean + sign * c.action);
                square += weight * softness[i] * (a * a + b * b + c * c);
            }
            for (edge, next) in edges.iter().zip(around) {
                let Some((other, _)) = next.get() else {
                    continue;
                };
                let s = other.index();
                if s >= t {
                    continue;
                }
                let mut half = 0.0;
                for i in 0..2 {
                    let (p, q) = (flux[i], fluxes[s][i]);
                    let jump = (q[0] - p[0]) * edge[1] - (q[1] - p[1]) * edge[0];
                    half += 0.5 * jump * jump * inverse[i].stiffer(t, s);
                }
                square += half;
                squares[s] += half;
            }
            squares.push(square);
            fluxes.push(flux);
        }
    }
    Sweep {
        residual: RESIDUAL.then(|| Squares::new(squares)),
        oscillation: varying.then(|| Squares::new(oscillation)),
        weighted_oscillation: varying.then(|| Squares::new(weighted_oscillation)),
        energy: Energy {
            energy: 0.5 * energy - work,
            energy_norm: energy.sqrt(),
        },
        largest_contribution: largest.sqrt(),
        weighted_contribution: weighted_largest.sqrt(),
    }
}

/// The corners, and the work sum_i F_i' u_i of the loads.
fn corners<const RESIDUAL: bool>(
    mesh: &Mesh,
    problem: &DiscreteProblem,
    solution: &Solution,
) -> (Vec<Corner>, f64) {
    let action = if RESIDUAL {
        nodal_action(mesh, problem, solution)
    } else {
        Vec::new()
    };
    let [first, second] = &solution.displacement;
    let [upper, lower] = problem.loads.each_ref().map(|f| &f.nodal[..]);
    let mut work = [0.0; 2];
    let corners = mesh
        .points()
        .iter()
        .zip(first.iter().zip(second).zip(upper.iter().zip(lower)))
        .enumerate()
        .map(|(j, (&point, ((u1, u2), (f1, f2))))| {
            work[0] += u1 * f1;
            work[1] += u2 * f2;
            Corner {
                point,
                displacement: [*u1, *u2],
                action: if RESIDUAL { action[j] } else { 0.0 },
            }
        })
        .collect();
    (corners, work[0] + work[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{close, deviating, four_triangles, problem, solution};
    use crate::{energy, oscillation, residual};
    use fem_core::{Children, TriangleId};

    #[test]
    fn a_sweep_says_what_every_estimator_says_by_itself() {
        let mut mesh = four_triangles();
        for t in [0, 3, 5] {
            mesh.refine(&[TriangleId(t)], Children::Four)
                .expect("refines");
        }
        let count = mesh.triangle_count();
        let some = |scale: f64| -> Vec<f64> {
            (0..count).map(|t| scale * (1.0 + (t % 5) as f64)).collect()
        };
        let mut problem = problem(&mesh, [some(0.5), vec![3.0; count]], [-3.0, 2.0]);
        problem.loads[0] = deviating(&problem.loads[0], &some(0.125));
        let value = |f: fn(f64, f64) -> f64| -> Vec<f64> {
            mesh.points().iter().map(|p| f(p[0], p[1])).collect()
        };
        let upper = value(|x, y| 1.0 + x * y + (x - y).abs());
        let lower = value(|x, y| x * y - 0.25 * x);
        let force = value(|x, y| if x * x + y * y < 0.6 { 0.5 - x } else { 0.0 });
        let solution = solution([upper, lower], force, value(|_, _| 0.0));
        let found = sweep(&mesh, &problem, &solution, true);
        let agree = |found: &[f64], expected: &[f64]| {
            assert_eq!(found.len(), expected.len());
            for (a, b) in found.iter().zip(expected) {
                close(*a, *b, 1e-14);
            }
        };
        let squares = found.residual.expect("wanted");
        agree(&squares.roots(), &residual(&mesh, &problem, &solution));
        let squares = found.oscillation.expect("the loads vary");
        agree(&squares.roots(), &oscillation(&mesh, &problem));
        close(
            squares.total(),
            crate::root_sum(&oscillation(&mesh, &problem)),
            1e-14,
        );
        let alone = energy(&mesh, &problem, &solution);
        close(found.energy.energy, alone.energy, 1e-13);
        close(found.energy.energy_norm, alone.energy_norm, 1e-14);
        let (mut largest, mut weighted) = (0.0f64, 0.0f64);
        let squares = found.weighted_oscillation.expect("the loads vary");
        for t in mesh.triangle_ids() {
            let shape = mesh.shape(t);
            let (h2, t) = (shape.diameter().powi(2), t.index());
            let mu = [problem.tension_mean[0][t], 3.0];
            largest = largest.max(h2 * shape.area * (9.0 + 4.0));
            weighted = weighted.max(h2 * shape.area * (9.0 / mu[0] + 4.0 / mu[1]));
            let deviation = problem.loads[0].deviation_squared(t);
            close(squares.squares()[t], h2 * deviation / mu[0], 1e-14);
        }
        close(found.largest_contribution, largest.sqrt(), 1e-14);
        close(found.weighted_contribution, weighted.sqrt(), 1e-14);
        let without = sweep(&mesh, &problem, &solution, false);
        assert_eq!(without.residual, None);
        assert_eq!(without.energy, found.energy);
    }
}
