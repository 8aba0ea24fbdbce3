//! From the data of a problem to the discrete problem on one mesh.

use std::sync::Arc;

use contact::DiscreteProblem;
use estimate::{Moments, Near};
use fem_core::integrate::{
    Loads, Reference, load_pair_carried, load_pair_relative_to, means, means_carried,
};
use fem_core::{Field, FieldError, Mesh, Samples, TriangleId};

use crate::problem::Problem;

/// Data that were found wrong on a level.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DataError {
    /// A value that is not finite.
    #[error(transparent)]
    Field(#[from] FieldError),
    /// A tension that is not positive.
    #[error(
        "the tension of the {membrane} membrane has mean {mean:e} over the triangle around ({x}, {y})"
    )]
    Tension {
        /// `upper` or `lower`.
        membrane: &'static str,
        /// The mean, scaled.
        mean: f64,
        /// Barycentre, in the user's units.
        x: f64,
        /// Barycentre, in the user's units.
        y: f64,
    },
    /// The lower membrane is fixed above the upper one.
    #[error("on the boundary at ({x}, {y}) the lower membrane is {excess:e} above the upper one")]
    Heights {
        /// First coordinate, in the user's units.
        x: f64,
        /// Second coordinate, in the user's units.
        y: f64,
        /// g2 - g1, in the user's units.
        excess: f64,
    },
}

/// The discrete problem on the mesh that another one was refined from, and how.
#[derive(Clone, Copy)]
pub struct Before<'a> {
    /// On the mesh before; found for the same problem.
    pub discrete: &'a DiscreteProblem,
    /// The parent of every triangle, see [`fem_core::Refinement`].
    pub parent: &'a [TriangleId],
}

/// Integrates the data on a mesh, on at most `threads` threads, whose number does not show.
///
/// # Errors
/// [`DataError`] where data are not finite, a tension is not positive, or g1 < g2.
pub fn discretise(
    problem: &Problem,
    mesh: &Arc<Mesh>,
    threads: usize,
) -> Result<DiscreteProblem, DataError> {
    let load = problem.loads();
    let loads = || load_pair_relative_to(&Reference::of(&problem.mesh, load)?, mesh, load, threads);
    assemble(problem, mesh, None, loads)
}

/// The same for a refined mesh, bit for bit: data are sampled on the triangles that are new.
///
/// # Errors
/// As [`discretise`].
pub fn discretise_carried(
    problem: &Problem,
    mesh: &Arc<Mesh>,
    before: Before<'_>,
    threads: usize,
) -> Result<DiscreteProblem, DataError> {
    let load = problem.loads();
    let loads = || load_pair_carried(mesh, load, &before.discrete.loads, before.parent, threads);
    assemble(problem, mesh, Some(before), loads)
}

/// The moments of the data that a certificate needs, from the same points as the loads.
///
/// # Errors
/// As [`discretise`].
pub fn moments(problem: &Problem, discrete: &DiscreteProblem) -> Result<Moments, DataError> {
    let reference = reference(problem, discrete)?;
    let (load, tension) = (problem.loads(), problem.tensions());
    let mesh = &discrete.mesh;
    Ok(Moments::relative_to(&reference, mesh, load, tension)?)
}

/// The same, with samples only where a certificate of a solution with these action forces needs them.
///
/// # Errors
/// As [`discretise`].
pub(crate) fn moments_near(
    problem: &Problem,
    discrete: &DiscreteProblem,
    force: &[f64],
) -> Result<Moments, DataError> {
    let reference = reference(problem, discrete)?;
    let (load, tension) = (problem.loads(), problem.tensions());
    let near = near(discrete, force);
    Ok(Moments::near(
        &reference,
        &discrete.mesh,
        load,
        tension,
        near,
    )?)
}

/// What tells where a certificate with these action forces needs samples.
pub(crate) fn near<'a>(discrete: &'a DiscreteProblem, force: &'a [f64]) -> Near<'a> {
    let loads = &discrete.loads;
    Near { force, loads }
}

/// What the elements were judged by.
fn reference(problem: &Problem, discrete: &DiscreteProblem) -> Result<Reference, FieldError> {
    match discrete.loads[0].reference() {
        Some(reference) => Ok(reference),
        None => Reference::of(&problem.mesh, problem.loads()),
    }
}

fn assemble(
    problem: &Problem,
    mesh: &Arc<Mesh>,
    before: Option<Before<'_>>,
    loads: impl FnOnce() -> Result<[Loads; 2], FieldError>,
) -> Result<DiscreteProblem, DataError> {
    let physical = |v: f64| fem_core::scale::times_power_of_two(v, problem.scale.length);
    let mean = |i: usize| {
        let field = &*problem.tension[i];
        match before {
            Some(b) => means_carried(mesh, field, &b.discrete.tension_mean[i], b.parent),
            None => means(mesh, field),
        }
    };
    let tension = [mean(0)?, mean(1)?];
    for (mean, membrane) in tension.iter().zip(["upper", "lower"]) {
        let wrong = |m: &f64| m.is_nan() || *m <= 0.0;
        if let Some(t) = mean.stored().iter().position(wrong) {
            let c = mesh.corners(fem_core::TriangleId(t as u32));
            let centre = [0, 1].map(|k| physical((c[0][k] + c[1][k] + c[2][k]) / 3.0));
            return Err(DataError::Tension {
                membrane,
                mean: mean[t],
                x: centre[0],
                y: centre[1],
            });
        }
    }
    let heights = heights(mesh, &problem.height)?;
    if let Some(j) = (0..mesh.vertex_count()).find(|&j| heights[0][j] < heights[1][j]) {
        let [x, y] = mesh.points()[j].map(physical);
        let excess = heights[1][j] - heights[0][j];
        let excess = fem_core::scale::times_power_of_two(excess, problem.scale.displacement());
        return Err(DataError::Heights { x, y, excess });
    }
    Ok(DiscreteProblem::new(
        mesh.clone(),
        tension,
        loads()?,
        heights,
    ))
}

/// Heights at the boundary vertices, 0 inside; `region` there is that of a triangle with an edge on the boundary.
fn heights(mesh: &Mesh, height: &[Arc<dyn Field>; 2]) -> Result<[Vec<f64>; 2], FieldError> {
    let mut region = vec![0.0; mesh.vertex_count()];
    for (t, face) in mesh.boundary_edges() {
        for v in mesh.face(t, face) {
            region[v.index()] = f64::from(mesh.region()[t.index()]);
        }
    }
    let boundary: Vec<usize> = (0..mesh.vertex_count())
        .filter(|&j| mesh.boundary()[j])
        .collect();
    let x: Vec<f64> = boundary.iter().map(|&j| mesh.points()[j][0]).collect();
    let y: Vec<f64> = boundary.iter().map(|&j| mesh.points()[j][1]).collect();
    let region: Vec<f64> = boundary.iter().map(|&j| region[j]).collect();
    let mut values = vec![0.0; boundary.len()];
    let mut result = [
        vec![0.0; mesh.vertex_count()],
        vec![0.0; mesh.vertex_count()],
    ];
    for (field, result) in height.iter().zip(&mut result) {
        field.sample(
            Samples {
                x: &x,
                y: &y,
                region: &region,
            },
            &mut values,
        )?;
        boundary
            .iter()
            .zip(&values)
            .for_each(|(&j, &v)| result[j] = v);
    }
    Ok(result)
}
