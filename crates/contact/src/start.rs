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
        let mut displacement = solution.displacement.clone();
        let mut contact = solution.contact.clone();
        let mut sigma = solution.sigma.clone();
        for field in displacement.iter_mut().chain([&mut sigma]) {
            field.reserve_exact(vertices.saturating_sub(old_vertices));
        }
        for birth in mesh.genealogy().iter().skip(old_vertices) {
            let [a, b] = birth.parents.map(|p| p.index());
            for field in displacement.iter_mut().chain([&mut sigma]) {
                let mean = 0.5 * field[a] + 0.5 * field[b];
                field.push(mean);
            }
            let touches =
                |p: usize| contact[p] || boundary[p] && displacement[0][p] == displacement[1][p];
            let both = touches(a) && touches(b);
            contact.push(both);
        }
        for (touching, &fixed) in contact.iter_mut().zip(boundary) {
            *touching &= !fixed;
        }
        Start {
            displacement,
            force: None,
            sigma: Some(sigma),
            first_cycle: solution.info.first_cycle,
            contact,
        }
    }

    /// The solution itself, to be continued on its own mesh to a higher accuracy.
    pub fn again(solution: &Solution) -> Start {
        Start {
            displacement: solution.displacement.clone(),
            force: Some(solution.force.clone()),
            sigma: Some(solution.sigma.clone()),
            first_cycle: solution.info.first_cycle,
            contact: solution.contact.clone(),
        }
    }
}
