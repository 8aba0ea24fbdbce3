//! What fluxes tell of themselves, and the two norms that are made of them.

use fem_core::quadrature::POINTS;

use super::Given;
use super::shares::Shares;

/// What the two grades have to tell about their fluxes.
pub(super) trait Reconstruction {
    /// ||f_i +- lambda_h - r_i - div s_i||_K^2 where loads and tensions are constant in the element.
    fn uniform_remainder(
        &self,
        triangle: usize,
        membrane: usize,
        area: f64,
        shares: &Shares,
    ) -> f64;

    /// Whether the divergence of s_i lacks the parts +-kappa_j - rho_ij/|D_j| of the dual cells, which else cancel in the remainder.
    fn lacks_cells(&self) -> bool;

    /// The part of the divergence of s_i that is constant on the share of every dual cell.
    fn on_cells(&self, triangle: usize, membrane: usize) -> [f64; 3];

    /// The part of the divergence of s_i that is affine in the element: its values at the corners, if there is one.
    fn affine(&self, _triangle: usize, _membrane: usize) -> Option<[f64; 3]> {
        None
    }

    /// The action inside contact by its values at the corners, where it is an affine function instead of lambda*.
    fn action(&self, _triangle: usize) -> Option<[f64; 3]> {
        None
    }

    /// s_i + mu_iK grad u_ih at points of a part of the element, given by their barycentric coordinates; it is asked for where a tension varies.
    fn tau(
        &self,
        _triangle: usize,
        _membrane: usize,
        _part: usize,
        _at: &[[f64; 3]; POINTS],
    ) -> [[f64; 2]; POINTS] {
        [[0.0; 2]; POINTS]
    }
}

/// The two norms on every element, squared: misfit (with the weight 1/mu_i) and remainder, for both membranes.
#[derive(Clone, Copy, Default, Debug)]
pub(super) struct Norms {
    pub misfit: [f64; 2],
    pub remainder: [f64; 2],
}

impl Norms {
    /// The closed forms; of the remainder only where the data are constant in the element.
    #[inline]
    pub fn uniform(
        given: &Given<'_>,
        shares: &Shares,
        squares: &[[f64; 2]],
        fluxes: &dyn Reconstruction,
        t: usize,
        area: f64,
    ) -> Norms {
        let mut norms = Norms::default();
        for i in 0..2 {
            norms.misfit[i] = squares[t][i] / given.tension_mean[i][t];
            if given.moments.uniform(given.loads, t) {
                norms.remainder[i] = fluxes.uniform_remainder(t, i, area, shares);
            }
        }
        norms
    }
}
