//! One pass over the triangles for everything cheap that a level is judged by.
//!
//! The [residual estimator](mod@crate::residual), the [oscillation](mod@crate::oscillation), the [energy](mod@crate::energy) and the largest contribution of the
//! loads need areas, gradients and diameters of all triangles. They are found once here, in the order of the mesh and by blocks that
//! [threads](fem_core::parallel) share; a jump over an edge is added when the later one of its triangles is met, which has the normal at hand and finds the flux
//! of the other one stored. The few edges between two blocks are handled on both sides.

mod data;

use std::ops::Range;

use contact::{DiscreteProblem, Solution};
use fem_core::Mesh;
use fem_core::integrate::Loads;
use fem_core::parallel::{self, BLOCK};

use crate::action::nodal_action;
use crate::energy::Energy;
use crate::residual::contact_term;
use crate::squares::Squares;
use data::{Data, Even, Loaded};

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

/// Passes over all triangles on at most `threads` threads, whose number does not show; the residual estimator is computed if it is wanted.
pub fn sweep(
    mesh: &Mesh,
    problem: &DiscreteProblem,
    solution: &Solution,
    residual: bool,
    threads: usize,
) -> Sweep {
    let level = (mesh, problem, solution, threads);
    let Some(even) = Even::of(problem) else {
        return wanted(level, residual, &problem);
    };
    match problem.loads.each_ref().map(Loads::same) {
        [Some(f), Some(g)] => {
            let loads = [f, g];
            wanted(level, residual, &Loaded { even, loads })
        }
        _ => {
            let loads = &problem.loads;
            wanted(level, residual, &Loaded { even, loads })
        }
    }
}

/// What the pass is made on.
type Given<'a> = (&'a Mesh, &'a DiscreteProblem, &'a Solution, usize);

/// The pass with or without the estimator.
fn wanted<D: Data + Sync>(level: Given<'_>, residual: bool, data: &D) -> Sweep {
    if residual {
        pass::<true, _>(level, data)
    } else {
        pass::<false, _>(level, data)
    }
}

/// The pass; `RESIDUAL` says whether the estimator is computed.
fn pass<const RESIDUAL: bool, D: Data + Sync>(
    (mesh, problem, solution, threads): Given<'_>,
    data: &D,
) -> Sweep {
    let (corners, work) = corners::<RESIDUAL>(mesh, problem, solution);
    let count = mesh.triangle_count();
    let threads = parallel::worthwhile(threads, count);
    let varying = D::VARYING && problem.loads.iter().any(|f| f.same().is_none());
    let mut squares = vec![0.0; if RESIDUAL { count } else { 0 }];
    let room = if varying { count } else { 0 };
    let mut oscillation = [vec![0.0; room], vec![0.0; room]];
    let blocks = Blocks {
        mesh,
        problem,
        data,
        corners: &corners,
        varying,
    };
    let mut chunks = squares.chunks_mut(BLOCK);
    let mut oscillations = oscillation.each_mut().map(|o| o.chunks_mut(BLOCK));
    let jobs: Vec<_> = parallel::blocks(count)
        .map(|block| {
            let oscillation = oscillations.each_mut();
            let into = Written {
                squares: chunks.next().unwrap_or_default(),
                oscillation: oscillation.map(|o| o.next().unwrap_or_default()),
            };
            (block, into)
        })
        .collect();
    let sums = parallel::map(threads, jobs, |(block, into)| {
        blocks.pass::<RESIDUAL>(block, into)
    });
    let (mut energy, mut largest, mut weighted_largest) = (0.0, 0.0, 0.0);
    for sums in sums {
        energy += sums.energy;
        largest = larger(largest, sums.largest);
        weighted_largest = larger(weighted_largest, sums.weighted_largest);
    }
    let [oscillation, weighted_oscillation] =
        oscillation.map(|squares| varying.then(|| Squares::new(squares)));
    Sweep {
        residual: RESIDUAL.then(|| Squares::new(squares)),
        oscillation,
        weighted_oscillation,
        energy: Energy {
            energy: 0.5 * energy - work,
            energy_norm: energy.sqrt(),
        },
        largest_contribution: largest.sqrt(),
        weighted_contribution: weighted_largest.sqrt(),
    }
}

/// What all blocks read.
struct Blocks<'a, D> {
    mesh: &'a Mesh,
    problem: &'a DiscreteProblem,
    data: &'a D,
    corners: &'a [Corner],
    /// Whether a load deviates from its means.
    varying: bool,
}

/// What a block writes; empty where it is not wanted.
struct Written<'a> {
    squares: &'a mut [f64],
    /// The oscillation by itself and in the unit of the energy norm.
    oscillation: [&'a mut [f64]; 2],
}

/// What a block adds to the numbers of the level.
#[derive(Default)]
struct Sums {
    energy: f64,
    largest: f64,
    weighted_largest: f64,
}

/// A triangle as the pass sees it.
struct Element {
    area: f64,
    /// Edge k is opposite to corner k; all run counter-clockwise.
    edges: [[f64; 2]; 3],
    flux: Flux,
    /// int_K mu_i |grad u_i|^2.
    energy: [f64; 2],
}

/// mu_i grad u_i: both fields side by side for every axis, so that one instruction works on both.
type Flux = [[f64; 2]; 2];

impl<D: Data> Blocks<'_, D> {
    #[inline(always)]
    fn element(&self, t: usize, [a, b, c]: [&Corner; 3]) -> Element {
        let edge = |p: &Corner, q: &Corner| [q.point[0] - p.point[0], q.point[1] - p.point[1]];
        let edges = [edge(b, c), edge(c, a), edge(a, b)];
        let twice = edges[2][1] * edges[1][0] - edges[2][0] * edges[1][1];
        let area = 0.5 * twice;
        let over = 1.0 / twice;
        let difference = |p: &Corner| {
            // Differences first: a large common height must not cost digits.
            let d = [0, 1].map(|i| p.displacement[i] - a.displacement[i]);
            d.map(|d| d * over)
        };
        let (d1, d2) = (difference(b), difference(c));
        let tension = self.data.tensions(t);
        let x = [0, 1].map(|i| -(d1[i] * edges[1][1] + d2[i] * edges[2][1]));
        let y = [0, 1].map(|i| d1[i] * edges[1][0] + d2[i] * edges[2][0]);
        let flux = [x, y].map(|g| [0, 1].map(|i| tension[i] * g[i]));
        let energy = [0, 1].map(|i| area * (flux[0][i] * x[i] + flux[1][i] * y[i]));
        Element {
            area,
            edges,
            flux,
            energy,
        }
    }

    /// Passes over a block. An edge within it is handled when its second triangle is met; on its rim every block handles the edge for
    /// itself, and computes the flux behind it once more.
    fn pass<const RESIDUAL: bool>(&self, block: Range<usize>, into: Written<'_>) -> Sums {
        let Written {
            squares,
            oscillation: [oscillation, weighted_oscillation],
        } = into;
        let (problem, data) = (self.problem, self.data);
        let (triangles, neighbours) = (self.mesh.triangles(), self.mesh.neighbours());
        let begin = block.start;
        let own = triangles[block.clone()]
            .iter()
            .zip(&neighbours[block.clone()]);
        let corners = |t: usize| triangles[t].map(|j| &self.corners[j.index()]);
        let mut fluxes: Vec<Flux> = Vec::with_capacity(block.len());
        let mut sums = Sums::default();
        for (k, (v, around)) in own.enumerate() {
            let t = begin + k;
            let [a, b, c] = v.map(|j| &self.corners[j.index()]);
            let element = self.element(t, [a, b, c]);
            let Element {
                area, edges, flux, ..
            } = element;
            element.energy.iter().for_each(|e| sums.energy += e);
            let [l0, l1, l2] = edges.map(|e| e[0] * e[0] + e[1] * e[1]);
            let h2 = larger(larger(l0, l1), l2);
            let means = data.means(t);
            let softness = data.softness(t);
            let weight = h2 * area;
            let [f, g] = means.map(|f| f * f);
            sums.largest = larger(sums.largest, weight * (f + g));
            let weighted = weight * (f * softness[0] + g * softness[1]);
            sums.weighted_largest = larger(sums.weighted_largest, weighted);
            if self.varying {
                let [f, g] = problem.loads.each_ref().map(|f| f.deviation_squared(t));
                oscillation[k] = h2 * (f + g);
                weighted_oscillation[k] = h2 * (f * softness[0] + g * softness[1]);
            }
            if !RESIDUAL {
                continue;
            }
            let actions = [a.action, b.action, c.action];
            let mut square = 0.0;
            let mut terms = [0.0; 2];
            for l in actions {
                let sides = [means[0] + l, means[1] - l];
                terms = [0, 1].map(|i| terms[i] + sides[i] * sides[i]);
            }
            square += weight / 3.0 * (softness[0] * terms[0] + softness[1] * terms[1]);
            if actions != [0.0; 3] {
                let gap = |c: &Corner| c.displacement[0] - c.displacement[1];
                square += contact_term(area, actions, [gap(a), gap(b), gap(c)]);
            }
            for (edge, next) in edges.iter().zip(around) {
                let Some((other, _)) = next.get() else {
                    continue;
                };
                let s = other.index();
                // Below the block this wraps around and is far beyond it.
                let place = s.wrapping_sub(begin);
                let q = if place < k {
                    fluxes[place]
                } else if place < block.len() {
                    continue;
                } else {
                    self.element(s, corners(s)).flux
                };
                let stiffer = data.stiffer(t, s);
                let [first, second] = [0, 1].map(|i| {
                    let jump = (q[0][i] - flux[0][i]) * edge[1] - (q[1][i] - flux[1][i]) * edge[0];
                    0.5 * jump * jump * stiffer[i]
                });
                let half = first + second;
                square += half;
                if place < k {
                    squares[place] += half;
                }
            }
            squares[k] = square;
            fluxes.push(flux);
        }
        sums
    }
}

/// The larger of two numbers, neither of which is a NaN: one instruction.
#[inline(always)]
fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
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
    use fem_core::{Children, ElementValues, TriangleId};

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
        let found = sweep(&mesh, &problem, &solution, true, 1);
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
        problem.loads = Loads::constant(&mesh, [-3.0, 2.0]);
        problem.tension_mean = [0.5, 3.0].map(ElementValues::Same);
        let constant = sweep(&mesh, &problem, &solution, true, 1);
        assert_eq!(constant.oscillation, None);
        let squares = constant.residual.expect("wanted");
        agree(&squares.roots(), &residual(&mesh, &problem, &solution));
        let without = sweep(&mesh, &problem, &solution, false, 1);
        assert_eq!(without.residual, None);
        assert_eq!(without.energy, constant.energy);
    }
}
