//! Grade (a): lowest-order fluxes on the six triangles between the medians of every element, without any linear system.
//!
//! On the outer edges of a dual cell D_j the flux is -mu_iK grad u_ih . n, and its divergence on K cap D_j is the constant
//! 3 m_iKj/|K| +- kappa_j - rho_ij/|D_j| with m_iKj = (f_i +- theta_j lambda*, phi_j)_K. The fluxes through the spokes of D_j follow by a running sum; it
//! closes around an interior vertex because the rows of the discrete problem hold. One constant circulation stays free and makes
//! the misfit tau = s_i + mu_iK grad u_ih least, in the weight 1/mu_iK.
//!
//! Everything here is written for tau: no flux through the outer edges, the divergence of s_i, and jumps
//! [mu_iK grad u_ih] . n through the spokes that are parts of mesh edges.

use fem_core::quadrature::POINTS;
use fem_core::{Mesh, TriangleId};

use super::Given;
use super::fan::{Corner, Fan, beginnings};
use super::misfit::{Frame, Reconstruction};
use super::moments::Moments;
use super::shares::{SIGN, Shares};

/// Fluxes of tau and what balances the data; nothing is kept where all data are constant.
pub(super) struct Fluxes<'a> {
    mesh: &'a Mesh,
    moments: &'a Moments,
    /// `[alpha, h]` for both membranes: alpha enters the corner's part of the dual cell counter-clockwise through the half edge to the
    /// next corner, alpha + h passes the median and alpha + 2h leaves. h is the divergence times |K|/6.
    spokes: Vec<[[[f64; 2]; 2]; 3]>,
    /// The constant part of the divergence of s_i on K cap D_j that balances loads and lambda*: 3 m_iKj/|K|.
    balance: Vec<[[f64; 2]; 3]>,
}

/// Quadratic form of the energy of tau on a corner's part of the dual cell: alpha^2 a + alpha h b + h^2 c.
#[derive(Clone, Copy)]
struct Form {
    a: f64,
    b: f64,
    c: f64,
}

impl Form {
    /// From the products of the two edges that leave the corner, and the area of the element.
    ///
    /// On a triangle (v, m, b) with the flux alpha in through (v, m) and beta out through (v, b), tau = (beta (x - m) - alpha (x - b))/(2|T|).
    #[inline]
    fn of(frame: &Frame) -> Form {
        let Frame { aa, ab, bb, area } = *frame;
        // Products of the vectors to the two midpoints and the barycentre.
        let (m, n) = (0.25 * aa, 0.25 * bb);
        let c = (aa + 2.0 * ab + bb) / 9.0;
        let (mc, nc) = ((aa + ab) / 6.0, (ab + bb) / 6.0);
        let scale = 1.5 / area;
        // alpha in, alpha + h out.
        let first = [
            m - 2.0 * mc + c,
            (4.0 * m - 6.0 * mc + 2.0 * c) / 3.0,
            (c - 3.0 * mc + 3.0 * m) / 6.0,
        ];
        // beta = alpha + h in, beta + h out.
        let second = [
            n - 2.0 * nc + c,
            (2.0 * n - 6.0 * nc + 4.0 * c) / 3.0,
            (n - 3.0 * nc + 3.0 * c) / 6.0,
        ];
        Form {
            a: scale * (first[0] + second[0]),
            b: scale * (first[1] + 2.0 * second[0] + second[1]),
            c: scale * (first[2] + second[0] + second[1] + second[2]),
        }
    }

    #[inline]
    fn energy(&self, alpha: f64, h: f64) -> f64 {
        alpha * alpha * self.a + alpha * h * self.b + h * h * self.c
    }
}

/// Equilibrates around every vertex; O(N).
///
/// Returns the fluxes and ||tau||^2_K for every element and membrane, without the weight 1/mu.
pub(super) fn equilibrate<'a>(
    given: &Given<'a>,
    shares: &Shares,
    flux: &[[[f64; 2]; 2]],
) -> (Fluxes<'a>, Vec<[f64; 2]>) {
    let Given {
        mesh,
        moments,
        loads,
        ..
    } = *given;
    let count = mesh.triangle_count();
    let kept = if moments.all_uniform(loads) { 0 } else { count };
    let mut fluxes = Fluxes {
        mesh,
        moments,
        spokes: vec![[[[0.0; 2]; 2]; 3]; kept],
        balance: vec![[[0.0; 2]; 3]; kept],
    };
    let mut squares = vec![[0.0; 2]; count];
    let mut fan = Fan::default();
    let mut links: Vec<Link> = Vec::new();
    for first in beginnings(mesh) {
        fan.walk(mesh, first);
        let j = mesh.triangles()[first.index()][first.corner()].index();
        let cell = [shares.cell(0, j), shares.cell(1, j)];
        let theta = shares.theta[j];
        links.clear();
        // Entering flux relative to the first spoke, and the sums for the free constant.
        let mut alpha = [0.0f64; 2];
        let mut slope = [0.0f64; 2];
        let mut weight = [0.0f64; 2];
        let mut before: Option<Corner> = None;
        for &corner in &fan.corners {
            let (t, k) = (corner.index(), corner.corner());
            let frame = Frame::of(mesh, corner);
            if let Some(previous) = before {
                // Half the jump of the flux through the mesh edge between the two triangles, its normal counter-clockwise.
                let normal = frame.first_normal;
                let last = previous.index();
                for i in 0..2 {
                    let (p, q) = (flux[last][i], flux[t][i]);
                    alpha[i] += 0.5 * ((q[0] - p[0]) * normal[0] + (q[1] - p[1]) * normal[1]);
                }
            }
            let form = Form::of(&frame.products);
            let area = frame.products.area;
            let action = theta * moments.action_hat(t, area, k);
            let hats = loads.each_ref().map(|f| f.moments(t, area)[k]);
            let mut link = Link {
                form,
                flux: [[0.0; 2]; 2],
            };
            for i in 0..2 {
                let balanced = 3.0 / area * (hats[i] + SIGN[i] * action);
                let h = (balanced + cell[i]) * area / 6.0;
                let w = moments.softness[i].at(t);
                slope[i] += w * (2.0 * alpha[i] * form.a + h * form.b);
                weight[i] += w * form.a;
                link.flux[i] = [alpha[i], h];
                if kept > 0 {
                    fluxes.balance[t][k][i] = balanced;
                }
                alpha[i] += 2.0 * h;
            }
            links.push(link);
            before = Some(corner);
        }
        let shift = [0, 1].map(|i| -0.5 * slope[i] / weight[i]);
        for (corner, link) in fan.corners.iter().zip(&mut links) {
            let t = corner.index();
            for i in 0..2 {
                let [alpha, h] = &mut link.flux[i];
                *alpha += shift[i];
                squares[t][i] += link.form.energy(*alpha, *h);
            }
            if kept > 0 {
                fluxes.spokes[t][corner.corner()] = link.flux;
            }
        }
    }
    (fluxes, squares)
}

/// One triangle around a vertex.
struct Link {
    form: Form,
    /// `[alpha, h]` for both membranes.
    flux: [[f64; 2]; 2],
}

/// Share of |K| in ||sum_k P_k (phi_k - chi_Dk)||^2 = 5/108 |K| sum over pairs of (P_k - P_l)^2.
const UNIFORM: f64 = 5.0 / 108.0;

impl Reconstruction for Fluxes<'_> {
    fn uniform_remainder(&self, t: usize, _: usize, area: f64, shares: &Shares) -> f64 {
        // The balance at corner k is f_i +- theta_k lambda*, whose interpolant meets the data.
        let action = 3.0 * self.moments.action_hat(t, area, 0) / area;
        let theta = self.mesh.triangles()[t].map(|j| shares.theta[j.index()]);
        UNIFORM * area * action * action * super::misfit::pairs(theta)
    }

    fn lacks_cells(&self) -> bool {
        false
    }

    fn on_cells(&self, triangle: usize, membrane: usize) -> [f64; 3] {
        // kappa_j and rho_ij stand in data and divergence alike.
        self.balance[triangle].map(|b| b[membrane])
    }

    fn affine(&self, _: usize, _: usize) -> Option<[f64; 3]> {
        None
    }

    fn tau(
        &self,
        triangle: usize,
        membrane: usize,
        part: usize,
        at: &[[f64; 3]; POINTS],
    ) -> [[f64; 2]; POINTS] {
        let k = part / 2;
        let shape = self.mesh.shape(TriangleId(triangle as u32));
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
