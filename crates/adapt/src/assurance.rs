//! What a certificate holds for, in words.

use estimate::{BoundaryOscillation, Certificate, boundary_oscillation};
use fem_core::scale::times_power_of_two;
use fem_core::{Circle, ElementValues, FieldError, Mesh};

use crate::problem::Problem;

/// Whether a bound is proved, and what a reader has to know about it.
#[derive(Clone, Debug, PartialEq)]
pub struct Assurance {
    /// Whether the bound holds for the problem of the scene, but for rounding and the quadrature of data that are not constant.
    pub guaranteed: bool,
    /// One sentence each.
    pub caveats: Vec<String>,
}

impl Assurance {
    /// Looks at the boundary of a mesh, at the heights on it and at the tensions inside the elements; numbers in the user's units.
    ///
    /// # Errors
    /// A height that is not finite.
    pub fn of(
        mesh: &Mesh,
        tension_mean: &[ElementValues; 2],
        problem: &Problem,
        certificate: &Certificate,
    ) -> Result<Assurance, FieldError> {
        let scale = problem.scale;
        let mut assurance = Assurance {
            guaranteed: true,
            caveats: Vec::new(),
        };
        if let Some(circle) = mesh.curve() {
            assurance.guaranteed = false;
            let distance = times_power_of_two(sagitta(mesh, circle), scale.length);
            assurance.caveats.push(format!(
                "the bound holds for the polygon of the mesh, which is up to {distance:.1e} away from the circle"
            ));
        }
        let heights = [&*problem.height[0], &*problem.height[1]];
        if let BoundaryOscillation::Energy(norm) =
            boundary_oscillation(mesh, heights, tension_mean)?
        {
            assurance.guaranteed = false;
            let norm = times_power_of_two(norm, scale.energy_norm());
            assurance.caveats.push(format!(
                "the boundary heights are not affine along the edges of the mesh: their oscillation {norm:.1e} is not in the bound"
            ));
        }
        if certificate.jumps > 0 {
            let triangles = match certificate.jumps {
                1 => "1 triangle".to_owned(),
                n => format!("{n} triangles"),
            };
            assurance.caveats.push(format!(
                "tension jump inside {triangles}: the bound is far from the error there; align the mesh with the jump (`domain.polygon.lines`, or `region` with a mesh file)"
            ));
        }
        Ok(assurance)
    }
}

/// The largest distance between an edge on the boundary and the circle that it stands for.
fn sagitta(mesh: &Mesh, circle: Circle) -> f64 {
    let mut largest = 0.0f64;
    for (t, face) in mesh.boundary_edges() {
        let [p, q] = mesh.face(t, face).map(|v| mesh.points()[v.index()]);
        let middle = [0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1])];
        let foot = circle.project(middle);
        largest = largest.max((foot[0] - middle[0]).hypot(foot[1] - middle[1]));
    }
    largest
}
