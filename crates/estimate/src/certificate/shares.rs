//! The action of the certificate, lambda_h = lambda* sum_j theta_j phi_j + sum_j kappa_j chi_Dj, and the residual of the rows.
//!
//! Every vertex gives its force z_j to the two parts: as much as it can to lambda*, the exact action inside contact, and the rest to its dual
//! cell. That is nonnegative, and cancels against the loads before anything is divided by a soft tension.

use std::ops::{Add, Index, Range};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use fem_core::Mesh;
use fem_core::parallel::{self, BLOCK};

use super::Given;
use super::data::Data;
use super::element::{Geometry, Pair};
use crate::action::extend_to_boundary;

/// A remainder below this part of the force is rounding.
const REMAINDER: f64 = 1e-13;

/// What a vertex has.
#[derive(Clone, Copy, Default, Debug)]
pub(super) struct Share {
    /// Share of lambda*, in [0, 1].
    pub theta: f64,
    /// Action of the dual cell, not negative.
    pub kappa: f64,
    /// What the dual cell adds to the divergence of the fluxes: +-kappa_j - r_i, where r_i is the residual rho_ij of the rows over |D_j|, 0 on the boundary.
    pub cell: Pair,
    /// |D_j|.
    pub area: f64,
}

impl Share {
    /// Gives a dual cell on the boundary its action.
    fn press(&mut self, kappa: f64) {
        self.kappa = kappa;
        self.cell = Pair(SIGN) * kappa;
    }

    /// Whether the vertex has an action.
    #[inline(always)]
    pub fn presses(&self) -> bool {
        self.theta != 0.0 || self.kappa != 0.0
    }
}

/// One entry a vertex.
pub(super) struct Shares {
    each: Vec<Share>,
    /// (sum_i mu_i,min^-1 sum_j rho_ij^2/|D_j|)^(1/2) d/pi, see [`super`].
    pub algebraic: f64,
}

impl Index<usize> for Shares {
    type Output = Share;

    #[inline(always)]
    fn index(&self, vertex: usize) -> &Share {
        &self.each[vertex]
    }
}

/// Sums at a vertex: |D_j|, (lambda*, phi_j), and (f_i, phi_j) - (mu_i grad u_ih, grad phi_j) for both membranes.
type Sums = [f64; 4];

/// Sums at all vertices that several threads add to, each to vertices that no other touches.
struct Table(Vec<[AtomicU64; 4]>);

impl Table {
    fn new(count: usize) -> Table {
        Table((0..count).map(|_| Default::default()).collect())
    }

    #[inline(always)]
    fn add(&self, j: usize, values: Sums) {
        for (sum, value) in self.0[j].iter().zip(values) {
            sum.store(
                (f64::from_bits(sum.load(Relaxed)) + value).to_bits(),
                Relaxed,
            );
        }
    }

    fn at(&self, j: usize) -> Sums {
        self.0[j]
            .each_ref()
            .map(|sum| f64::from_bits(sum.load(Relaxed)))
    }
}

/// Which vertices belong to triangles of several blocks.
fn shared(mesh: &Mesh) -> Vec<bool> {
    const NONE: u32 = u32::MAX;
    let count = mesh.vertex_count();
    let (mut owner, mut shared) = (vec![NONE; count], vec![false; count]);
    for (number, block) in parallel::blocks(mesh.triangle_count()).enumerate() {
        for j in mesh.triangles()[block]
            .as_flattened()
            .iter()
            .map(|j| j.index())
        {
            shared[j] |= owner[j] != NONE && owner[j] != number as u32;
            owner[j] = number as u32;
        }
    }
    shared
}

impl Shares {
    /// Divides the forces and evaluates the residuals; O(N).
    pub fn of<D: Data>(given: &Given<'_>, data: &D) -> Shares {
        let mesh = given.mesh;
        let count = mesh.vertex_count();
        let threads = parallel::worthwhile(given.threads, mesh.triangle_count());
        let sums = Table::new(count);
        // What goes to a vertex of several blocks is put off, so that it is added in the order of the triangles too.
        let shared = if threads > 1 {
            shared(mesh)
        } else {
            Vec::new()
        };
        let late = parallel::map(
            threads,
            parallel::blocks(mesh.triangle_count()).collect(),
            |block| {
                let mut late = Vec::new();
                let touches = contributions(given, data, block, |j, values| {
                    if shared.get(j).is_some_and(|&shared| shared) {
                        late.push((j, values));
                    } else {
                        sums.add(j, values);
                    }
                });
                (late, touches)
            },
        );
        let mut touches = false;
        for (late, block) in late {
            touches |= block;
            late.into_iter().for_each(|(j, values)| sums.add(j, values));
        }
        let mut each = vec![Share::default(); count];
        let (force, boundary) = (given.force, mesh.boundary());
        let jobs = each.chunks_mut(BLOCK).enumerate().collect();
        let squares = parallel::map(threads, jobs, |(number, chunk)| {
            let mut squares = Pair::default();
            for (j, share) in (number * BLOCK..).zip(chunk) {
                let residual;
                (*share, residual) = divided(sums.at(j), force[j], boundary[j]);
                squares += residual * residual * share.area;
            }
            squares
        });
        if touches {
            extend(
                given,
                &mut each,
                |share| share.theta,
                |share, theta| share.theta = theta,
            );
            extend(given, &mut each, |share| share.kappa, Share::press);
        }
        let squares = squares.into_iter().fold(Pair::default(), Pair::add);
        let [first, second] = [0, 1].map(|i| squares.0[i] / given.moments.stiffness_low[i].least());
        Shares {
            each,
            algebraic: width(mesh) / std::f64::consts::PI * (first + second).sqrt(),
        }
    }
}

/// Shows what the triangles of a block add to the sums of their vertices, in order; whether an action may reach the boundary there.
#[inline(always)]
fn contributions<D: Data>(
    given: &Given<'_>,
    data: &D,
    block: Range<usize>,
    mut add: impl FnMut(usize, Sums),
) -> bool {
    let mesh = given.mesh;
    let (points, boundary) = (mesh.points(), mesh.boundary());
    let triangles = &mesh.triangles()[block.clone()];
    let ([upper, lower], force) = (given.displacement, given.force);
    let mut touches = false;
    for (t, v) in block.zip(triangles) {
        let v = v.map(|j| j.index());
        let shape = Geometry::of(v.map(|j| points[j]));
        let rows = shape.rows(data.tension(t), v.map(|j| Pair([upper[j], lower[j]])));
        let hats = data.hats(t, shape.area);
        let mut action = [0.0; 3];
        if v.iter().any(|&j| force[j] > 0.0) {
            action = data.action(t, shape.area, &hats).hats(shape.area);
            touches |= v.iter().any(|&j| boundary[j]);
        }
        for k in 0..3 {
            let Pair([f, g]) = hats[k] - rows[k];
            add(v[k], [shape.area / 3.0, action[k], f, g]);
        }
    }
    touches
}

/// What a vertex makes of its force, and the residuals r_i.
fn divided([area, action, f, g]: Sums, force: f64, boundary: bool) -> (Share, Pair) {
    let mut share = Share {
        area,
        ..Share::default()
    };
    if boundary {
        return (share, Pair::default());
    }
    let force = force.max(0.0);
    if force > 0.0 {
        if action > 0.0 {
            share.theta = (force / action).min(1.0);
        }
        let rest = force - share.theta * action;
        if rest > REMAINDER * force {
            share.kappa = rest / area;
        }
    }
    // What the two parts carry together, so that the fluxes close to rounding.
    let carried = share.theta * action + share.kappa * area;
    let residual = Pair([f + carried, g - carried]) * (1.0 / area);
    share.cell = Pair(SIGN) * share.kappa - residual;
    (share, residual)
}

/// Gives the boundary vertices their values, which have none yet.
fn extend(given: &Given<'_>, each: &mut [Share], get: fn(&Share) -> f64, set: fn(&mut Share, f64)) {
    let mut values: Vec<f64> = each.iter().map(get).collect();
    extend_to_boundary(given.mesh, |j| given.gap(j), &mut values);
    let boundary = given.mesh.boundary();
    for ((share, value), _) in each.iter_mut().zip(values).zip(boundary).filter(|b| *b.1) {
        set(share, value);
    }
}

/// The action lifts the upper membrane and presses on the lower one.
pub(super) const SIGN: [f64; 2] = [1.0, -1.0];

/// Directions that the width is measured in.
const DIRECTIONS: usize = 64;

/// A distance between two parallel lines that hold the domain: the least over 64 directions.
///
/// Friedrichs' inequality ||v|| <= width/pi |v|_1 holds for functions that vanish on the boundary, with the width in any direction.
fn width(mesh: &Mesh) -> f64 {
    let points: Vec<[f64; 2]> = (0..mesh.vertex_count())
        .filter(|&j| mesh.boundary()[j])
        .map(|j| mesh.points()[j])
        .collect();
    (0..DIRECTIONS)
        .map(|d| {
            let (sin, cos) = (std::f64::consts::PI * d as f64 / DIRECTIONS as f64).sin_cos();
            let (low, high) = points
                .iter()
                .map(|p| cos * p[0] + sin * p[1])
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), s| {
                    (l.min(s), h.max(s))
                });
            high - low
        })
        .fold(f64::INFINITY, f64::min)
}
