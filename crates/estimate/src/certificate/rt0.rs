//! Grade (a): lowest-order fluxes on the six triangles between the medians of every element, without any linear system.
//!
//! On the outer edges of a dual cell D_j the flux is -mu_iK grad u_ih . n, and its divergence on K cap D_j is the constant
//! 3 m_iKj/|K| +- kappa_j - rho_ij/|D_j| with m_iKj = (f_i +- theta_j lambda*, phi_j)_K. The fluxes through the spokes of D_j follow by a running sum; it
//! closes around an interior vertex because the rows of the discrete problem hold. One constant circulation stays free and makes
//! the misfit tau = s_i + mu_iK grad u_ih least, in the weight 1/mu_iK.

use fem_core::quadrature::POINTS;
use fem_core::{TriangleId, parallel};

use super::Given;
use super::blocks::{Blocks, Sink};
use super::closed::balanced_constant;
use super::data::Data;
use super::element::{Element, Pair};
use super::reconstruction::Reconstruction;
use super::shares::Shares;

/// Fluxes of tau and what balances the data, of all elements.
pub(super) struct Fluxes<'a> {
    given: &'a Given<'a>,
    /// `[alpha, h]` for both membranes: alpha enters the corner's part of the dual cell counter-clockwise through the half edge to the
    /// next corner, alpha + h passes the median and alpha + 2h leaves. h is the divergence times |K|/6.
    spokes: Vec<[[[f64; 2]; 2]; 3]>,
    /// The constant part of the divergence of s_i on K cap D_j that balances loads and lambda*: 3 m_iKj/|K|.
    balance: Vec<[[f64; 2]; 3]>,
}

/// Keeps the fluxes of a block.
struct Kept<'a, D> {
    blocks: &'a Blocks<'a, D>,
    first: usize,
    spokes: &'a mut [[[[f64; 2]; 2]; 3]],
    balance: &'a mut [[[f64; 2]; 3]],
    squares: &'a mut [[f64; 2]],
}

impl<D: Data> Sink for Kept<'_, D> {
    fn element(&mut self, t: usize, element: &Element, beta: [Pair; 3]) {
        let place = t - self.first;
        self.squares[place] = element.squares(beta).0;
        self.spokes[place] = [0, 1, 2].map(|k| element.entering(k, beta[k]));
        self.balance[place] = self.blocks.balance(t, element.area);
    }
}

/// Equilibrates around every vertex; O(N).
///
/// Returns the fluxes and ||tau||^2_K for every element and membrane, without the weight 1/mu.
pub(super) fn equilibrate<'a, D: Data>(
    given: &'a Given<'a>,
    data: &D,
    shares: &Shares,
) -> (Fluxes<'a>, Vec<[f64; 2]>) {
    let count = given.mesh.triangle_count();
    let mut fluxes = Fluxes {
        given,
        spokes: vec![[[[0.0; 2]; 2]; 3]; count],
        balance: vec![[[0.0; 2]; 3]; count],
    };
    let mut squares = vec![[0.0; 2]; count];
    let blocks = Blocks::new(given, data, shares);
    let kept = fluxes
        .spokes
        .chunks_mut(parallel::BLOCK)
        .zip(fluxes.balance.chunks_mut(parallel::BLOCK))
        .zip(squares.chunks_mut(parallel::BLOCK))
        .enumerate()
        .map(|(number, ((spokes, balance), squares))| Kept {
            blocks: &blocks,
            first: number * parallel::BLOCK,
            spokes,
            balance,
            squares,
        })
        .collect();
    blocks.pass(kept);
    (fluxes, squares)
}

impl Reconstruction for Fluxes<'_> {
    fn uniform_remainder(&self, t: usize, _: usize, area: f64, shares: &Shares) -> f64 {
        // The balance at corner k is f_i +- theta_k lambda*, whose interpolant meets the data.
        let action = 3.0 * self.given.moments.action(t).hats(area)[0] / area;
        let theta = self.given.mesh.triangles()[t].map(|j| shares[j.index()].theta);
        balanced_constant(theta, action, area)
    }

    fn lacks_cells(&self) -> bool {
        false
    }

    fn on_cells(&self, triangle: usize, membrane: usize) -> [f64; 3] {
        // kappa_j and rho_ij stand in data and divergence alike.
        self.balance[triangle].map(|b| b[membrane])
    }

    fn tau(
        &self,
        triangle: usize,
        membrane: usize,
        part: usize,
        at: &[[f64; 3]; POINTS],
    ) -> [[f64; 2]; POINTS] {
        let k = part / 2;
        let shape = self.given.mesh.shape(TriangleId(triangle as u32));
        let corner = |l: usize| shape.corners[(k + l) % 3];
        let v = corner(0);
        let [alpha, h] = self.spokes[triangle][k][membrane];
        // Entering and leaving flux, and the points opposite to the spokes that they pass.
        let centre = [0, 1].map(|c| (v[c] + corner(1)[c] + corner(2)[c]) / 3.0);
        let middle = |l: usize| [0, 1].map(|c| 0.5 * (v[c] + corner(l)[c]));
        let (enters, leaves, opposite, other) = if part.is_multiple_of(2) {
            (alpha, alpha + h, centre, middle(1))
        } else {
            (alpha + h, alpha + 2.0 * h, middle(2), centre)
        };
        let twice = shape.area / 3.0;
        let [p, q, r] = shape.corners;
        at.map(|at| {
            [0, 1].map(|c| {
                let x = at[0] * p[c] + at[1] * q[c] + at[2] * r[c];
                (leaves * (x - other[c]) - enters * (x - opposite[c])) / twice
            })
        })
    }
}
