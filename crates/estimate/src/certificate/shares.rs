//! The action of the certificate, lambda_h = lambda* sum_j theta_j phi_j + sum_j kappa_j chi_Dj, and the residual of the rows.
//!
//! Every vertex gives its force z_j to the two parts: as much as it can to lambda*, the exact action inside contact, and the rest to its dual
//! cell. That is nonnegative, and cancels against the loads before anything is divided by a soft tension.

use fem_core::Mesh;

use super::Given;
use crate::action::extend_to_boundary;

/// A remainder below this part of the force is rounding.
const REMAINDER: f64 = 1e-13;

/// One entry a vertex.
pub(super) struct Shares {
    /// Shares of lambda*, in [0, 1].
    pub theta: Vec<f64>,
    /// Actions of the dual cells, not negative.
    pub kappa: Vec<f64>,
    /// r_i on the dual cells: the residual rho_ij of the rows over |D_j|; 0 on the boundary.
    pub residual: [Vec<f64>; 2],
    /// |D_j|.
    pub area: Vec<f64>,
}

impl Shares {
    /// Divides the forces and evaluates the residuals; O(N). Returns the fluxes mu_iK grad u_ih of every element too.
    pub fn of(given: &Given<'_>) -> (Shares, Vec<[[f64; 2]; 2]>) {
        let (mesh, moments) = (given.mesh, given.moments);
        let count = mesh.vertex_count();
        let mut area = vec![0.0; count];
        let mut flux = Vec::with_capacity(mesh.triangle_count());
        let boundary = mesh.boundary();
        // (lambda*, phi_j) and (f_i, phi_j) - (mu_i grad u_ih, grad phi_j).
        let mut action = vec![0.0; count];
        let mut rows = [vec![0.0; count], vec![0.0; count]];
        for (t, id) in mesh.triangle_ids().enumerate() {
            let shape = mesh.shape(id);
            let vertices = mesh.triangles()[t];
            let own = [0, 1].map(|i| {
                let g = shape.gradient(vertices.map(|v| given.displacement[i][v.index()]));
                let mu = given.tension_mean[i][t];
                [mu * g[0], mu * g[1]]
            });
            flux.push(own);
            let hats = given.loads.each_ref().map(|f| f.moments(t, shape.area));
            for (k, v) in vertices.iter().enumerate() {
                let j = v.index();
                area[j] += shape.area / 3.0;
                action[j] += moments.action_hat(t, shape.area, k);
                let g = shape.gradients[k];
                for i in 0..2 {
                    let q = own[i];
                    rows[i][j] += hats[i][k] - shape.area * (q[0] * g[0] + q[1] * g[1]);
                }
            }
        }
        let mut theta = vec![0.0; count];
        let mut kappa = vec![0.0; count];
        for j in (0..count).filter(|&j| !boundary[j]) {
            let force = given.force[j].max(0.0);
            if force > 0.0 {
                if action[j] > 0.0 {
                    theta[j] = (force / action[j]).min(1.0);
                }
                let rest = force - theta[j] * action[j];
                if rest > REMAINDER * force {
                    kappa[j] = rest / area[j];
                }
            }
            // What the two parts carry together, so that the fluxes close to rounding.
            let carried = theta[j] * action[j] + kappa[j] * area[j];
            for (i, sign) in [(0, 1.0), (1, -1.0)] {
                rows[i][j] = (rows[i][j] + sign * carried) / area[j];
            }
        }
        for row in &mut rows {
            for j in (0..count).filter(|&j| boundary[j]) {
                row[j] = 0.0;
            }
        }
        extend_to_boundary(mesh, |j| given.gap(j), &mut theta);
        extend_to_boundary(mesh, |j| given.gap(j), &mut kappa);
        let shares = Shares {
            theta,
            kappa,
            residual: rows,
            area,
        };
        (shares, flux)
    }

    /// What the dual cell of `j` adds to the divergence of the flux of membrane `i`: +-kappa_j - rho_ij/|D_j|.
    #[inline]
    pub fn cell(&self, i: usize, j: usize) -> f64 {
        SIGN[i] * self.kappa[j] - self.residual[i][j]
    }

    /// (sum_i mu_i,min^-1 sum_j rho_ij^2/|D_j|)^(1/2) d/pi, see [`super`]; `low` are lower bounds of the tensions.
    pub fn algebraic(&self, mesh: &Mesh, low: [f64; 2]) -> f64 {
        let squares: f64 = (0..2)
            .map(|i| {
                let sum: f64 = self.residual[i]
                    .iter()
                    .zip(&self.area)
                    .map(|(r, area)| r * r * area)
                    .sum();
                sum / low[i]
            })
            .sum();
        width(mesh) / std::f64::consts::PI * squares.sqrt()
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
