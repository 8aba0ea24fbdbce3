//! Grade (b): RT1 fluxes on the patches of all vertices.
//!
//! On the patch of vertex j the flux s_j minimises ||mu^(-1/2) (s_j + phi_j mu grad u_ih)|| (weight: the element mean of 1/mu) over all fields of the
//! Raviart-Thomas space RT1 with s_j . n = 0 on the outer edges (free on edges of the boundary that meet j) and
//!
//! ```text
//! (div s_j, q)_K = (share_ij, q)_K - (mu_i grad u_ih . grad phi_j, q)_K    for all q in P1(K),
//! share_ij = f_i phi_j +- (theta_j lambda* phi_j + kappa_j chi_Dj) - rho_ij/|D_j| chi_Dj;        s_i = sum_j s_j.
//! ```
//!
//! Written for tau = s_j + phi_j mu_iK grad u_ih, on the reference triangle with vertex j in its origin and by Piola's transform, the outer edge
//! carries no flux, the divergence has the moments of share_ij, and through the spoke e the normal flux jumps by phi_j [mu_iK
//! grad u_ih] . n. The flux through a spoke is affine. The total flux through the spokes follows by a running sum from one free constant, and in
//! every triangle the rest of tau from the slopes of the flux on its two spokes. What remains of the minimisation around a vertex with
//! n triangles is a quadratic function of the constant and of one slope a spoke, coupled along the ring: a tridiagonal system with two more
//! rows, solved by elimination in O(n).

use fem_core::Mesh;
use fem_core::quadrature::POINTS;

use super::Given;
use super::fan::{Corner, Fan, beginnings};
use super::frame::{CornerFrame, Frame, pairs};
use super::moments::Values;
use super::reconstruction::Reconstruction;
use super::ring::Ring;
use super::shares::{SIGN, Shares};

/// Number of parameters of tau in one triangle of a patch: total flux and slope on the first spoke, slope on the second one, three moments of the
/// divergence.
const LOCAL: usize = 6;

/// Coefficients of a field on the reference triangle: of the first component for 1, x, y, x^2, xy, of the second one for 1, x, y, xy, y^2.
type Field = [[f64; 5]; 2];

/// Moments of the divergence against the hat functions, and what follows for the field.
struct Divergence {
    /// The constant and the linear part of the divergence: d0 + 3 (c1 x + c2 y).
    constant: f64,
    linear: [f64; 2],
}

impl Divergence {
    fn of(moments: [f64; 3]) -> Divergence {
        let [_, s1, s2] = moments;
        let total = moments[0] + s1 + s2;
        let sum = 24.0 * (s1 + s2) - 16.0 * total;
        let difference = 8.0 * (s1 - s2);
        Divergence {
            constant: 2.0 * total - sum,
            linear: [0.5 * (sum + difference), 0.5 * (sum - difference)],
        }
    }
}

/// The field of one triangle of a patch from its parameters.
fn local_field(p: [f64; LOCAL]) -> Field {
    let [enters, first, second, s0, s1, s2] = p;
    let Divergence {
        linear: [c1, c2], ..
    } = Divergence::of([s0, s1, s2]);
    let leaves = enters + s0 + s1 + s2;
    // Flux density in through the first spoke: enters + first (x - 1/2); out through the second: leaves + second (y - 1/2).
    let (b0, b1) = (enters - 0.5 * first, first);
    let (a0, a2) = (0.5 * second - leaves, -second);
    // No flux through the outer edge x + y = 1.
    let a1 = -(a0 + b0 + b1 + c1);
    let b2 = -(a0 + b0 + a2 + c2);
    [[a0, a1, a2, c1, c2], [b0, b1, b2, c1, c2]]
}

/// The field of a whole element from the outward fluxes through its edges, at their two ends, and the moments of the divergence.
fn element_field(edges: &[[f64; 2]; 3], moments: [f64; 3]) -> Field {
    let Divergence {
        linear: [c1, c2], ..
    } = Divergence::of(moments);
    let (b0, a0) = (-edges[2][0], -edges[1][1]);
    let (b1, a2) = (-edges[2][1] - b0, -edges[1][0] - a0);
    let a1 = edges[0][0] - a0 - b0 - b1 - c1;
    let b2 = edges[0][1] - a0 - b0 - a2 - c2;
    [[a0, a1, a2, c1, c2], [b0, b1, b2, c1, c2]]
}

/// Integral of x^i y^j over the reference triangle: i! j! / (i + j + 2)!.
fn monomial(i: usize, j: usize) -> f64 {
    let factorial = |n: usize| (1..=n).map(|k| k as f64).product::<f64>();
    factorial(i) * factorial(j) / factorial(i + j + 2)
}

/// Exponents of the monomials of the two components.
const MONOMIALS: [[(usize, usize); 5]; 2] = [
    [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1)],
    [(0, 0), (1, 0), (0, 1), (1, 1), (0, 2)],
];

/// Integrals over the reference triangle of the products of the monomials of two components.
struct Gram {
    xx: [[f64; 5]; 5],
    xy: [[f64; 5]; 5],
    yy: [[f64; 5]; 5],
}

impl Gram {
    fn new() -> Gram {
        let table = |c: usize, d: usize| {
            MONOMIALS[c].map(|(i, j)| MONOMIALS[d].map(|(k, l)| monomial(i + k, j + l)))
        };
        Gram {
            xx: table(0, 0),
            xy: table(0, 1),
            yy: table(1, 1),
        }
    }

    /// Integrals of the products of the components: (x, x), (x, y), (y, y).
    fn products(&self, field: &Field, other: &Field) -> [f64; 3] {
        let form = |m: &[[f64; 5]; 5], p: &[f64; 5], q: &[f64; 5]| -> f64 {
            m.iter()
                .zip(p)
                .map(|(row, p)| p * row.iter().zip(q).map(|(m, q)| m * q).sum::<f64>())
                .sum()
        };
        [
            form(&self.xx, &field[0], &other[0]),
            0.5 * (form(&self.xy, &field[0], &other[1]) + form(&self.xy, &other[0], &field[1])),
            form(&self.yy, &field[1], &other[1]),
        ]
    }
}

/// ||tau||^2 on a triangle of a patch as a quadratic form of the parameters, split by the products of the edges.
struct Forms([[[f64; LOCAL]; LOCAL]; 3]);

impl Forms {
    fn new(gram: &Gram) -> Forms {
        let unit = |k: usize| {
            let mut p = [0.0; LOCAL];
            p[k] = 1.0;
            local_field(p)
        };
        let mut forms = [[[0.0; LOCAL]; LOCAL]; 3];
        for k in 0..LOCAL {
            for l in 0..LOCAL {
                let products = gram.products(&unit(k), &unit(l));
                for (form, value) in forms.iter_mut().zip(products) {
                    form[k][l] = value;
                }
            }
        }
        Forms(forms)
    }

    /// The form on an element with these edges: tau = J tau^/det, so ||tau||^2 = (1/det) int (J tau^) . (J tau^).
    #[inline]
    fn on(&self, frame: &Frame) -> [[f64; LOCAL]; FREE] {
        let det = 2.0 * frame.area;
        let factors = [frame.aa / det, 2.0 * frame.ab / det, frame.bb / det];
        let mut result = [[0.0; LOCAL]; FREE];
        for k in 0..FREE {
            for l in 0..LOCAL {
                result[k][l] = factors[0] * self.0[0][k][l]
                    + factors[1] * self.0[1][k][l]
                    + factors[2] * self.0[2][k][l];
            }
        }
        result
    }
}

/// The first parameters are free or depend on free ones: total flux and the two slopes.
const FREE: usize = 3;

/// The reconstructed tau of every element.
pub(super) struct Fluxes<'a> {
    mesh: &'a Mesh,
    /// Outward flux density (per unit of the edge's parameter) at the two ends of every edge, for both membranes.
    edges: Vec<[[[f64; 2]; 3]; 2]>,
    /// (div s_i, phi_k)_K.
    divergence: Vec<[[f64; 3]; 2]>,
}

/// Solves on all patches; O(N).
///
/// Returns the fluxes and ||tau||^2_K for every element and membrane, without the weight 1/mu.
pub(super) fn equilibrate<'a>(
    given: &Given<'a>,
    shares: &Shares,
    flux: &[[[f64; 2]; 2]],
) -> (Fluxes<'a>, Vec<[f64; 2]>) {
    let (mesh, moments) = (given.mesh, given.moments);
    let count = mesh.triangle_count();
    let gram = Gram::new();
    let forms = Forms::new(&gram);
    let mut edges = vec![[[[0.0; 2]; 3]; 2]; count];
    let mut divergence = vec![[[0.0; 3]; 2]; count];
    let mut fan = Fan::default();
    let mut links: Vec<Link> = Vec::new();
    let mut ring = Ring::default();
    for first in beginnings(mesh) {
        fan.walk(mesh, first);
        links.clear();
        links.extend(
            fan.corners
                .iter()
                .map(|&corner| Link::new(given, shares, &forms, corner)),
        );
        for i in 0..2 {
            solve(&fan, &mut links, i, flux, &moments.softness[i], &mut ring);
            for link in &links {
                let (t, k) = (link.corner.index(), link.corner.corner());
                let [enters, first, second] = link.found;
                let leaves = enters + link.total(i);
                let (one, two) = ((k + 1) % 3, (k + 2) % 3);
                // The first spoke runs from the vertex to corner k + 1, opposite to corner k + 2; edges run counter-clockwise.
                edges[t][i][two][0] -= enters - 0.5 * first;
                edges[t][i][two][1] -= enters + 0.5 * first;
                edges[t][i][one][1] += leaves - 0.5 * second;
                edges[t][i][one][0] += leaves + 0.5 * second;
                for l in 0..3 {
                    divergence[t][i][(k + l) % 3] += link.moments[i][l];
                }
            }
        }
    }
    let mut squares = vec![[0.0; 2]; count];
    for t in 0..count {
        let corner = Corner {
            triangle: t as u32,
            local: 0,
        };
        let Frame { aa, ab, bb, area } = Frame::of(mesh, corner).products;
        for i in 0..2 {
            let field = element_field(&edges[t][i], divergence[t][i]);
            let [xx, xy, yy] = gram.products(&field, &field);
            squares[t][i] = ((aa * xx + 2.0 * ab * xy + bb * yy) / (2.0 * area)).max(0.0);
        }
    }
    (
        Fluxes {
            mesh,
            edges,
            divergence,
        },
        squares,
    )
}

/// One triangle of a patch.
struct Link {
    corner: Corner,
    frame: CornerFrame,
    /// ||tau||^2 as a form of the parameters; the rows of the free ones.
    form: [[f64; LOCAL]; FREE],
    /// Moments of share_ij against the hat functions, the vertex first, then counter-clockwise.
    moments: [[f64; 3]; 2],
    /// Parameters before anything free is added, for the membrane under way.
    fixed: [f64; LOCAL],
    /// Total flux and slopes found for that membrane.
    found: [f64; FREE],
}

impl Link {
    fn new(given: &Given<'_>, shares: &Shares, forms: &Forms, corner: Corner) -> Link {
        let mesh = given.mesh;
        let (t, k) = (corner.index(), corner.corner());
        let j = mesh.triangles()[t][k].index();
        let frame = Frame::of(mesh, corner);
        let area = frame.products.area;
        // (chi_Dj, phi) for the vertex itself and the two other corners.
        let cell = [11.0 * area / 54.0, 7.0 * area / 108.0, 7.0 * area / 108.0];
        let theta = shares[j].theta;
        let moments = [0, 1].map(|i| {
            let own = shares[j].cell.0[i];
            let mean = given.loads[i].mean(t);
            let mut result = [0.0; 3];
            for l in 0..3 {
                let m = (k + l) % 3;
                result[l] = given.moments.load_product(i, t, area, mean, (k, m))
                    + SIGN[i] * theta * given.moments.action_product(t, area, k, m)
                    + own * cell[l];
            }
            result
        });
        Link {
            corner,
            form: forms.on(&frame.products),
            frame,
            moments,
            fixed: [0.0; LOCAL],
            found: [0.0; FREE],
        }
    }

    /// The total divergence.
    fn total(&self, membrane: usize) -> f64 {
        let [a, b, c] = self.moments[membrane];
        a + b + c
    }
}

/// Minimises around one vertex for one membrane.
fn solve(
    fan: &Fan,
    links: &mut [Link],
    membrane: usize,
    flux: &[[[f64; 2]; 2]],
    softness: &Values,
    ring: &mut Ring,
) {
    let n = links.len();
    let jump = |links: &[Link], from: usize, to: usize| {
        let (p, q) = (
            flux[links[from].corner.index()][membrane],
            flux[links[to].corner.index()][membrane],
        );
        let normal = links[to].frame.first_normal;
        (q[0] - p[0]) * normal[0] + (q[1] - p[1]) * normal[1]
    };
    // The slope on the second spoke of a triangle is that on the first spoke of the next one plus the jump.
    let mut enters = 0.0;
    for k in 0..n {
        let next = if k + 1 < n {
            Some(k + 1)
        } else {
            fan.closed.then_some(0)
        };
        let jump = next.map_or(0.0, |next| jump(links, k, next));
        let [s0, s1, s2] = links[k].moments[membrane];
        links[k].fixed = [enters, 0.0, jump, s0, s1, s2];
        enters += links[k].total(membrane) + 0.5 * jump;
    }
    let spokes = if fan.closed { n } else { n + 1 };
    ring.begin(spokes);
    for (k, link) in links.iter().enumerate() {
        let w = softness.at(link.corner.index());
        let next = (k + 1) % spokes;
        let gradient = link
            .form
            .map(|row| w * row.iter().zip(&link.fixed).map(|(h, p)| h * p).sum::<f64>());
        let h = |a: usize, b: usize| w * link.form[a][b];
        ring.add_constant(h(0, 0), gradient[0]);
        ring.add_spoke(k, h(1, 1), h(0, 1), gradient[1]);
        ring.add_spoke(next, h(2, 2), h(0, 2), gradient[2]);
        ring.couple(k, next, h(1, 2));
    }
    ring.solve();
    for (k, link) in links.iter_mut().enumerate() {
        link.found = [
            link.fixed[0] + ring.constant(),
            ring.spoke(k),
            link.fixed[2] + ring.spoke((k + 1) % spokes),
        ];
    }
}

/// Share of |K| in ||(I - Pi_1) sum_k p_k chi_Dk||^2 = 11/324 |K| sum over pairs of (p_k - p_l)^2, Pi_1 the projection to affine functions.
const UNIFORM: f64 = 11.0 / 324.0;

impl Reconstruction for Fluxes<'_> {
    fn uniform_remainder(
        &self,
        triangle: usize,
        membrane: usize,
        area: f64,
        shares: &Shares,
    ) -> f64 {
        let v = self.mesh.triangles()[triangle];
        UNIFORM * area * pairs(v.map(|j| shares[j.index()].cell.0[membrane]))
    }

    fn lacks_cells(&self) -> bool {
        true
    }

    fn on_cells(&self, _: usize, _: usize) -> [f64; 3] {
        [0.0; 3]
    }

    fn affine(&self, triangle: usize, membrane: usize) -> Option<[f64; 3]> {
        let Divergence {
            constant,
            linear: [c1, c2],
        } = Divergence::of(self.divergence[triangle][membrane]);
        let det = 2.0 * self.area(triangle);
        Some([constant, constant + 3.0 * c1, constant + 3.0 * c2].map(|d| d / det))
    }

    fn tau(
        &self,
        triangle: usize,
        membrane: usize,
        _: usize,
        at: &[[f64; 3]; POINTS],
    ) -> [[f64; 2]; POINTS] {
        let field = element_field(
            &self.edges[triangle][membrane],
            self.divergence[triangle][membrane],
        );
        let shape = self.mesh.shape(fem_core::TriangleId(triangle as u32));
        let [p, q, r] = shape.corners;
        let det = 2.0 * shape.area;
        at.map(|[_, x, y]| {
            let monomials = [[1.0, x, y, x * x, x * y], [1.0, x, y, x * y, y * y]];
            let value = [0, 1]
                .map(|c| -> f64 { field[c].iter().zip(&monomials[c]).map(|(f, m)| f * m).sum() });
            [0, 1].map(|c| ((q[c] - p[c]) * value[0] + (r[c] - p[c]) * value[1]) / det)
        })
    }
}

impl Fluxes<'_> {
    fn area(&self, triangle: usize) -> f64 {
        self.mesh.shape(fem_core::TriangleId(triangle as u32)).area
    }
}
