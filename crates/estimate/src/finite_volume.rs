//! The second discretisation of the paper's conclusions: the action itself as a finite-volume unknown on the dual cells.
//!
//! Find u_h in first-order elements and `lambda_h = sum_j l_j chi_Dj` over the interior vertices j, `l_j >= 0`, such that
//! for all v_h
//!
//! ```text
//! a(u_h, v_h) - sum_j l_j |D_j| (v_1 - v_2)(a_j) = (f, v_h),      w_h(a_j) >= 0,      l_j w_h(a_j) = 0.
//! ```
//!
//! With `z_j = l_j |D_j|` these are the equations of the first discretisation, so the displacements are the same and
//! [`finite_volume`] needs no solve: no second Poisson problem for sigma_h either. The action is another one: a function,
//! constant on every dual cell, where the first method has -laplace sigma_h, a measure on the edges with negative parts. Its
//! error is measured in L2 ([`FiniteVolume::l2_error`]) and, since the action is a functional on H^1_0, in H^-1
//! ([`FiniteVolume::negative_error`]), which compares with |sigma - sigma_h|_1 of the first method.

mod cells;
mod poisson;
mod quarter;

use contact::{DiscreteProblem, Solution};
use fem_core::{Field, FieldError, Mesh, Shape};

/// The action of the second method: l_j, one entry a vertex, 0 on the boundary; a load (force per area).
#[derive(Clone, PartialEq, Debug)]
pub struct FiniteVolume {
    /// l_j = z_j / |D_j|.
    pub action: Vec<f64>,
}

/// How far displacements and an action are from solving the discrete problem of the second method; relative, 0 for a solution.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Defect {
    /// The largest |(f_i, phi_j) +- l_j |D_j| - a_i(u_ih, phi_j)| over a_i(phi_j, phi_j) and the largest displacement.
    pub equation: f64,
    /// The largest -w_h(a_j) over the largest displacement; 0 where the gap is nowhere negative.
    pub gap: f64,
    /// The largest -l_j over the largest |l_j|; 0 where the action is nowhere negative.
    pub action: f64,
    /// The largest |l_j w_h(a_j)| over the largest |l_j| and the largest displacement.
    pub complementarity: f64,
}

/// The action of the second method from the forces of the first.
pub fn finite_volume(problem: &DiscreteProblem, solution: &Solution) -> FiniteVolume {
    let forces = solution.force.iter().zip(&problem.dual_area);
    let action = forces
        .zip(problem.boundary())
        .map(|((z, area), boundary)| if *boundary { 0.0 } else { z / area })
        .collect();
    FiniteVolume { action }
}

impl FiniteVolume {
    /// Puts displacements and action into the discrete problem, whoever computed them.
    ///
    /// Nothing is taken from the solver: the forms are summed element by element, |D_j| from the sub-triangles, and of the
    /// problem only the data are read, which are the element means of the tensions, the load integrals (f_i, phi_j) and the
    /// boundary.
    pub fn defect(
        &self,
        mesh: &Mesh,
        problem: &DiscreteProblem,
        displacement: &[Vec<f64>; 2],
    ) -> Defect {
        let n = mesh.vertex_count();
        let mut form = [vec![0.0; n], vec![0.0; n]];
        let mut diagonal = [vec![0.0; n], vec![0.0; n]];
        let mut cell = vec![0.0; n];
        for (t, (id, v)) in mesh.triangle_ids().zip(mesh.triangles()).enumerate() {
            let shape = mesh.shape(id);
            let v = v.map(|j| j.index());
            for k in 0..3 {
                let [g, h] = shape.gradients[k];
                cell[v[k]] += cell_area(&shape, k);
                for i in 0..2 {
                    let weight = problem.tension_mean[i][t] * shape.area;
                    let [x, y] = shape.gradient(v.map(|j| displacement[i][j]));
                    form[i][v[k]] += weight * (g * x + h * y);
                    diagonal[i][v[k]] += weight * (g * g + h * h);
                }
            }
        }
        let largest =
            |values: &mut dyn Iterator<Item = f64>| values.fold(0.0f64, |m, v| m.max(v.abs()));
        let one = |value: f64| if value == 0.0 { 1.0 } else { value };
        let unit = one(largest(&mut displacement.iter().flatten().copied()));
        let most = one(largest(&mut self.action.iter().copied()));
        let mut found = Defect {
            equation: 0.0,
            gap: 0.0,
            action: 0.0,
            complementarity: 0.0,
        };
        for j in (0..n).filter(|&j| !problem.boundary()[j]) {
            let l = self.action[j];
            for (i, sign) in [(0, 1.0), (1, -1.0)] {
                let rest = problem.loads[i].nodal[j] + sign * l * cell[j] - form[i][j];
                found.equation = found.equation.max(rest.abs() / diagonal[i][j] / unit);
            }
            let gap = displacement[0][j] - displacement[1][j];
            found.gap = found.gap.max(-gap / unit);
            found.action = found.action.max(-l / most);
            found.complementarity = found.complementarity.max((l / most * (gap / unit)).abs());
        }
        found
    }

    /// ||lambda - lambda_h|| in L2, a load times a length; seven points on each of the six sub-triangles of an element, more where the exact action jumps.
    ///
    /// # Errors
    /// A value of the exact action that is not finite.
    pub fn l2_error(&self, mesh: &Mesh, exact: &dyn Field) -> Result<f64, FieldError> {
        cells::l2_error(mesh, &self.action, exact)
    }

    /// The error of the action as a functional: |r_h|_1 with `-laplace r = lambda - lambda_h`, r = 0 on the boundary, in
    /// first-order elements on the mesh with every triangle divided into four `times` times; a force.
    ///
    /// It grows with `times` towards ||lambda - lambda_h|| in H^-1. On a mesh of a disk the domain is the polygon that the
    /// mesh covers.
    ///
    /// # Errors
    /// A value of the exact action that is not finite.
    pub fn negative_error(
        &self,
        mesh: &Mesh,
        exact: &dyn Field,
        times: u32,
    ) -> Result<f64, FieldError> {
        let fine = quarter::Quartered::of(mesh, times);
        let mut load = fem_core::integrate::loads(&fine.mesh, exact)?.nodal;
        for (sum, own) in load.iter_mut().zip(cells::loads(mesh, &fine, &self.action)) {
            *sum -= own;
        }
        Ok(poisson::seminorm_of_solution(&fine, &load))
    }
}

/// The area that the dual cell of a local vertex has in an element, from its two sub-triangles.
fn cell_area(shape: &Shape, k: usize) -> f64 {
    let [a, b, c] = [0, 1, 2].map(|i| shape.corners[(k + i) % 3]);
    let middle = |p: [f64; 2], q: [f64; 2]| [0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1])];
    let centre = [(a[0] + b[0] + c[0]) / 3.0, (a[1] + b[1] + c[1]) / 3.0];
    Shape::new([a, middle(a, b), centre]).area + Shape::new([a, centre, middle(c, a)]).area
}

#[cfg(test)]
mod tests;
