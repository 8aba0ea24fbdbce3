//! The fluxes themselves: continuous normal components, divergence, and the norms in closed form against quadrature.

use fem_core::integrate::load_pair;
use fem_core::quadrature::{POINTS, rule};
use fem_core::{Children, Constant, ElementValues, Field, Mesh, TriangleId, parallel};

use super::data::General;
use super::reconstruction::Reconstruction;
use super::shares::Shares;
use super::{Given, Grade, Moments, POINCARE, certify, rt0, rt1};
use crate::testing::{close, four_triangles};

/// A mesh of triangles of all kinds, and a pair that solves nothing: residuals, gaps and forces everywhere.
struct Case {
    mesh: Mesh,
    displacement: [Vec<f64>; 2],
    force: Vec<f64>,
    tension_mean: [ElementValues; 2],
}

fn case() -> Case {
    let mut mesh = four_triangles();
    mesh.refine(&[TriangleId(0)], Children::Four)
        .expect("refines");
    mesh.refine(&[TriangleId(1), TriangleId(2)], Children::Four)
        .expect("refines");
    on(mesh, 1.0)
}

/// The pair on a mesh, with forces times `factor`.
fn on(mesh: Mesh, factor: f64) -> Case {
    let value = |f: fn(f64, f64) -> f64| -> Vec<f64> {
        mesh.points().iter().map(|p| f(p[0], p[1])).collect()
    };
    let force = mesh
        .points()
        .iter()
        .zip(mesh.boundary())
        .map(|(p, &b)| if b { 0.0 } else { factor * (0.3 + 0.2 * p[0]) })
        .collect();
    Case {
        displacement: [
            value(|x, y| 0.5 + 0.3 * x - 0.2 * x * y),
            value(|x, y| 0.1 * x - 0.2 * y * y),
        ],
        force,
        tension_mean: [2.0, 0.5].map(ElementValues::Same),
        mesh,
    }
}

fn first_load(x: f64, y: f64) -> f64 {
    1.0 - x + 0.5 * y
}

fn second_load(x: f64, y: f64) -> f64 {
    2.0 + x * y
}

const TENSION: [Constant; 2] = [Constant(2.0), Constant(0.5)];

/// Calls `look` with everything that a reconstruction is made from.
fn with(look: impl FnOnce(&Case, &Given<'_>, &Shares, &[[[f64; 2]; 2]])) {
    with_case(case(), look);
}

fn with_case(case: Case, look: impl FnOnce(&Case, &Given<'_>, &Shares, &[[[f64; 2]; 2]])) {
    let load: [&dyn Field; 2] = [&first_load, &second_load];
    let tension: [&dyn Field; 2] = [&TENSION[0], &TENSION[1]];
    let moments = Moments::of(&case.mesh, load, tension).expect("finite");
    let loads = load_pair(&case.mesh, load).expect("finite");
    let given = Given {
        mesh: &case.mesh,
        load,
        tension,
        moments: &moments,
        loads: &loads,
        tension_mean: &case.tension_mean,
        displacement: &case.displacement,
        force: &case.force,
        threads: 1,
    };
    let shares = Shares::of(&given, &General(&given));
    let flux = super::fluxes(&given);
    look(&case, &given, &shares, &flux);
}

/// Part of the element that a point belongs to, near its middle.
fn part_of(at: [f64; 3]) -> usize {
    let k = (0..3)
        .max_by(|&a, &b| at[a].total_cmp(&at[b]))
        .expect("three");
    let second = at[(k + 1) % 3] > at[(k + 2) % 3];
    2 * k + usize::from(!second)
}

/// s_i at one point of an element.
fn flux_at(
    fluxes: &dyn Reconstruction,
    gradient: &[[[f64; 2]; 2]],
    t: usize,
    i: usize,
    at: [f64; 3],
) -> [f64; 2] {
    let tau = fluxes.tau(t, i, part_of(at), &[at; POINTS])[0];
    [0, 1].map(|c| tau[c] - gradient[t][i][c])
}

/// The normal components of s_i from both sides of every interior edge agree.
fn is_continuous(
    case: &Case,
    fluxes: &dyn Reconstruction,
    gradient: &[[[f64; 2]; 2]],
    tolerance: f64,
) {
    let mut seen = 0.0f64;
    for edge in case.mesh.interior_edges() {
        let normal = case.mesh.shape(edge.triangles[0]).normal(edge.faces[0]);
        for s in [0.1, 0.3, 0.7, 0.9] {
            for i in 0..2 {
                let side = |which: usize| {
                    let face = edge.faces[which];
                    let mut at = [0.0; 3];
                    // The two triangles run along the edge in opposite directions.
                    let s = if which == 0 { s } else { 1.0 - s };
                    at[(face + 1) % 3] = 1.0 - s;
                    at[(face + 2) % 3] = s;
                    let t = edge.triangles[which].index();
                    let v = flux_at(fluxes, gradient, t, i, at);
                    v[0] * normal[0] + v[1] * normal[1]
                };
                let (one, other) = (side(0), side(1));
                seen = seen.max(one.abs());
                assert!((one - other).abs() < tolerance, "{one} {other}");
            }
        }
    }
    assert!(seen > 0.1);
}

#[test]
fn fluxes_of_both_grades_are_continuous() {
    with(|case, given, shares, gradient| {
        let (fluxes, _) = rt0::equilibrate(given, &General(given), shares);
        is_continuous(case, &fluxes, gradient, 1e-13);
        let (fluxes, _) = rt1::equilibrate(given, shares, gradient);
        is_continuous(case, &fluxes, gradient, 1e-13);
    });
}

/// Blocks of triangles fit together, and neither they nor the sums at the vertices tell how many threads there are.
#[test]
fn fluxes_are_continuous_across_blocks_on_any_number_of_threads() {
    let mut mesh = four_triangles();
    // Blocks that end anywhere in the triangles of this mesh.
    mesh.refine(&[TriangleId(1)], Children::Four)
        .expect("refines");
    while mesh.triangle_count() < 3 * parallel::BLOCK {
        mesh.refine_uniformly(Children::Four).expect("refines");
    }
    let area = 4.0 / mesh.triangle_count() as f64;
    with_case(on(mesh, 10.0 * area), |case, given, shares, gradient| {
        let (fluxes, squares) = rt0::equilibrate(given, &General(given), shares);
        is_continuous(case, &fluxes, gradient, 1e-11);
        let one = certify(given, Grade::Rt0, POINCARE).expect("finite");
        assert!(one.contact > 0.0);
        for threads in [2, 3] {
            let given = &Given { threads, ..*given };
            let (_, more) = rt0::equilibrate(given, &General(given), shares);
            assert_eq!(more, squares, "{threads} threads");
            let more = certify(given, Grade::Rt0, POINCARE).expect("finite");
            assert_eq!(more, one, "{threads} threads");
        }
    });
}

/// What has closed forms is bounded at least as high as by samples of every element, and hardly higher.
#[test]
fn closed_bounds_are_as_sharp_as_samples() {
    let mut mesh = four_triangles();
    for _ in 0..4 {
        mesh.refine_uniformly(Children::Four).expect("refines");
    }
    let area = 4.0 / mesh.triangle_count() as f64;
    with_case(on(mesh, 10.0 * area), |_, given, shares, gradient| {
        let fast = certify(given, Grade::Rt0, POINCARE).expect("finite");
        let (fluxes, squares) = rt0::equilibrate(given, &General(given), shares);
        let sampled = super::summed(
            given,
            Grade::Rt0,
            POINCARE,
            shares,
            gradient,
            &squares,
            &fluxes,
        )
        .expect("finite");
        let quotient = fast.eta / sampled.eta;
        assert!((0.999..1.0025).contains(&quotient), "{quotient}");
        close(fast.contact, sampled.contact, 1e-3);
        close(fast.algebraic, sampled.algebraic, 1e-3);
    });
}

/// ||tau||^2 by quadrature over the six parts of an element, where it is a polynomial of degree four at most.
fn by_quadrature(mesh: &Mesh, fluxes: &dyn Reconstruction, t: usize, i: usize) -> f64 {
    let area = mesh.shape(TriangleId(t as u32)).area;
    let corner = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let middle = |p: [f64; 3], q: [f64; 3]| [0, 1, 2].map(|k| 0.5 * (p[k] + q[k]));
    let mut sum = 0.0;
    for part in 0..6usize {
        let k = part / 2;
        let centre = [1.0 / 3.0; 3];
        let corners = if part.is_multiple_of(2) {
            [corner[k], middle(corner[k], corner[(k + 1) % 3]), centre]
        } else {
            [corner[k], centre, middle(corner[k], corner[(k + 2) % 3])]
        };
        let points = rule();
        let at =
            points.map(|p| [0, 1, 2].map(|c| (0..3).map(|v| p.at[v] * corners[v][c]).sum::<f64>()));
        for (p, tau) in points.iter().zip(fluxes.tau(t, i, part, &at)) {
            sum += area / 6.0 * p.weight * (tau[0] * tau[0] + tau[1] * tau[1]);
        }
    }
    sum
}

#[test]
fn closed_norms_are_those_of_the_fields() {
    with(|case, given, shares, gradient| {
        let (coarse, coarse_squares) = rt0::equilibrate(given, &General(given), shares);
        let (fine, fine_squares) = rt1::equilibrate(given, shares, gradient);
        for t in 0..case.mesh.triangle_count() {
            for i in 0..2 {
                close(
                    by_quadrature(&case.mesh, &coarse, t, i),
                    coarse_squares[t][i],
                    1e-12,
                );
                close(
                    by_quadrature(&case.mesh, &fine, t, i),
                    fine_squares[t][i],
                    1e-12,
                );
            }
        }
    });
}

/// The mean of the divergence is that of f_i +- lambda_h - r_i on every element: the flux through its boundary balances it.
#[test]
fn fluxes_balance_every_element() {
    with(|case, given, shares, gradient| {
        let (coarse, _) = rt0::equilibrate(given, &General(given), shares);
        let (fine, _) = rt1::equilibrate(given, shares, gradient);
        for grade in [&coarse as &dyn Reconstruction, &fine] {
            for t in 0..case.mesh.triangle_count() {
                let shape = case.mesh.shape(TriangleId(t as u32));
                let v = case.mesh.triangles()[t].map(|j| j.index());
                for i in 0..2 {
                    let mut outward = 0.0;
                    for face in 0..3 {
                        let n = shape.normal(face);
                        // The flux is affine on each half of an edge: two points of Gauss on each do.
                        for (middle, sign) in [(0.25, -1.0), (0.25, 1.0), (0.75, -1.0), (0.75, 1.0)]
                        {
                            let s = middle + sign * 0.25 / 3f64.sqrt();
                            let mut at = [0.0; 3];
                            at[(face + 1) % 3] = 1.0 - s;
                            at[(face + 2) % 3] = s;
                            let q = flux_at(grade, gradient, t, i, at);
                            outward += 0.25 * shape.lengths[face] * (q[0] * n[0] + q[1] * n[1]);
                        }
                    }
                    let sign = [1.0, -1.0][i];
                    let mut wanted = 0.0;
                    let hats = given.loads[i].moments(t, shape.area);
                    for (k, &j) in v.iter().enumerate() {
                        wanted += hats[k]
                            + sign * shares[j].theta * given.moments.action(t).hats(shape.area)[k]
                            + shares[j].cell.0[i] * shape.area / 3.0;
                    }
                    assert!((outward - wanted).abs() < 1e-13, "{outward} {wanted}");
                }
            }
        }
    });
}

/// The shares of a force add to it, and the residuals of rows that hold vanish.
#[test]
fn shares_add_to_the_forces() {
    with(|case, given, shares, _| {
        let mesh = &case.mesh;
        let mut action = vec![0.0; mesh.vertex_count()];
        for (t, v) in mesh.triangles().iter().enumerate() {
            let area = mesh.shape(TriangleId(t as u32)).area;
            for (k, v) in v.iter().enumerate() {
                action[v.index()] += given.moments.action(t).hats(area)[k];
            }
        }
        let mut parts = [0, 0];
        for j in (0..mesh.vertex_count()).filter(|&j| !mesh.boundary()[j]) {
            let sum = shares[j].theta * action[j] + shares[j].kappa * shares[j].area;
            close(sum, case.force[j], 1e-13);
            assert!((0.0..=1.0).contains(&shares[j].theta) && shares[j].kappa >= 0.0);
            parts[0] += usize::from(shares[j].theta > 0.0);
            parts[1] += usize::from(shares[j].kappa > 0.0);
        }
        assert!(parts[0] > 0 && parts[1] > 0, "{parts:?}");
    });
}

/// A problem that first-order elements solve exactly: affine displacements, no loads.
#[test]
fn an_exact_pair_is_certified_to_rounding() {
    let case = case();
    let affine: Vec<f64> = case
        .mesh
        .points()
        .iter()
        .map(|p| 1.0 + p[0] - 2.0 * p[1])
        .collect();
    let zero = Constant(0.0);
    let load: [&dyn Field; 2] = [&zero, &zero];
    let tension: [&dyn Field; 2] = [&TENSION[0], &TENSION[1]];
    let moments = Moments::of(&case.mesh, load, tension).expect("finite");
    let loads = load_pair(&case.mesh, load).expect("finite");
    let displacement = [affine.clone(), affine.iter().map(|u| u - 1.0).collect()];
    let force = vec![0.0; affine.len()];
    let given = Given {
        mesh: &case.mesh,
        load,
        tension,
        moments: &moments,
        loads: &loads,
        tension_mean: &case.tension_mean,
        displacement: &displacement,
        force: &force,
        threads: 1,
    };
    for grade in [Grade::Rt0, Grade::Rt1] {
        let found = certify(&given, grade, POINCARE).expect("finite");
        assert!(found.bound < 1e-14, "{grade:?} {}", found.bound);
    }
}
