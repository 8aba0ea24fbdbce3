//! Where a solve starts: the solution of the previous mesh, carried over.

use fem_core::Mesh;

use crate::solution::Solution;

/// A guess of the solution on the mesh of a problem, one entry a vertex, boundary included.
///
/// Boundary values are ignored: the problem's heights stand there.
#[derive(Clone, Debug, PartialEq)]
pub struct Start {
    /// Displacements u1, u2.
    pub displacement: [Vec<f64>; 2],
    /// Action forces, where they are known. No solver needs them.
    pub force: Option<Vec<f64>>,
    /// Riesz representative of the action, where it is known: saves multigrid some cycles.
    pub sigma: Option<Vec<f64>>,
    /// What the first multigrid cycle did on earlier meshes ([`crate::SolveInfo::first_cycle`]).
    pub first_cycle: Option<f64>,
    /// The contact set to begin with.
    pub contact: Vec<bool>,
}

impl Start {
    /// Carries a solution to the refinement of its mesh; O(N).
    ///
    /// The first `old_vertices` vertices of `mesh` are those of the solution; the others were born as midpoints of two
    /// earlier ones, and take the mean of their values, exact for first-order functions on a polygon. A new vertex starts in
    /// contact when both its parents are; a parent on the boundary counts when its gap is zero.
    pub fn prolong(solution: &Solution, mesh: &Mesh, old_vertices: usize) -> Start {
        let vertices = mesh.vertex_count();
        let boundary = mesh.boundary();
        let births = &mesh.genealogy()[old_vertices..];
        let carried = |field: &[f64]| -> Vec<f64> {
            let mut values = Vec::with_capacity(vertices);
            values.extend_from_slice(field);
            for birth in births {
                let [a, b] = birth.parents.map(|p| p.index());
                values.push(0.5 * values[a] + 0.5 * values[b]);
            }
            values
        };
        let [u1, u2] = [0, 1].map(|i| carried(&solution.displacement[i]));
        let mut contact = Vec::with_capacity(vertices);
        contact.extend_from_slice(&solution.contact);
        for birth in births {
            let touches = |p: usize| contact[p] || boundary[p] && u1[p] == u2[p];
            let [a, b] = birth.parents.map(|p| p.index());
            contact.push(touches(a) && touches(b));
        }
        for (touching, &fixed) in contact.iter_mut().zip(boundary) {
            *touching &= !fixed;
        }
        Start {
            displacement: [u1, u2],
            force: None,
            sigma: (!solution.sigma.is_empty()).then(|| carried(&solution.sigma)),
            first_cycle: solution.info.first_cycle,
            contact,
        }
    }

    /// The solution itself, to be continued on its own mesh to a higher accuracy.
    pub fn again(solution: &Solution) -> Start {
        Start {
            displacement: solution.displacement.clone(),
            force: Some(solution.force.clone()),
            sigma: Some(solution.sigma.clone()).filter(|sigma| !sigma.is_empty()),
            first_cycle: solution.info.first_cycle,
            contact: solution.contact.clone(),
        }
    }
}
