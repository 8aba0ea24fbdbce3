//! What an element knows of its three corners: rows, spokes and the energy of tau between them.
//!
//! Edge e_k lies opposite to corner k, all three counter-clockwise; m_k = (mu grad u_h, grad phi_k)_K. Everything is written for both membranes side by side.

use std::ops::{Add, AddAssign, Mul, Sub};

/// One number for either membrane, side by side so that one instruction works on both; also a vector of the plane.
#[derive(Clone, Copy, Default, Debug)]
pub(super) struct Pair(pub [f64; 2]);

impl Add for Pair {
    type Output = Pair;

    #[inline(always)]
    fn add(self, other: Pair) -> Pair {
        Pair([self.0[0] + other.0[0], self.0[1] + other.0[1]])
    }
}

impl AddAssign for Pair {
    #[inline(always)]
    fn add_assign(&mut self, other: Pair) {
        *self = *self + other;
    }
}

impl Sub for Pair {
    type Output = Pair;

    #[inline(always)]
    fn sub(self, other: Pair) -> Pair {
        Pair([self.0[0] - other.0[0], self.0[1] - other.0[1]])
    }
}

impl Mul for Pair {
    type Output = Pair;

    #[inline(always)]
    fn mul(self, other: Pair) -> Pair {
        Pair([self.0[0] * other.0[0], self.0[1] * other.0[1]])
    }
}

impl Mul<f64> for Pair {
    type Output = Pair;

    #[inline(always)]
    fn mul(self, factor: f64) -> Pair {
        Pair([self.0[0] * factor, self.0[1] * factor])
    }
}

impl Pair {
    /// The sum of both.
    #[inline(always)]
    pub fn sum(self) -> f64 {
        self.0[0] + self.0[1]
    }

    /// The roots.
    #[inline(always)]
    pub fn root(self) -> Pair {
        Pair([self.0[0].sqrt(), self.0[1].sqrt()])
    }

    /// What is not negative, else 0.
    #[inline(always)]
    pub fn positive(self) -> Pair {
        Pair([larger(self.0[0], 0.0), larger(self.0[1], 0.0)])
    }
}

#[inline(always)]
fn dot(p: Pair, q: Pair) -> f64 {
    (p * q).sum()
}

/// The shape of an element as the passes need it.
#[derive(Clone, Copy)]
pub(super) struct Geometry {
    pub area: f64,
    /// 1/(4|K|).
    quarter: f64,
    edges: [Pair; 3],
}

/// What an element has for the fan around one of its corners. The flux of s_i enters through the half edge to the next corner as beta, and leaves as
/// beta + `step`; the energy of tau has the derivative 2 (weight beta + `slope`) by beta.
#[derive(Clone, Copy)]
pub(super) struct Spoke {
    pub weight: f64,
    pub step: Pair,
    pub slope: Pair,
}

/// What is left to know of an element when its spokes are found.
#[derive(Clone, Copy)]
pub(super) struct Element {
    pub area: f64,
    /// h_K^2.
    pub diameter_squared: f64,
    /// |e_(l+2) - e_(l+1)|^2/(24|K|): the median of corner l, squared, over 6|K|.
    medians: [f64; 3],
    /// The divergence of s_i at the corners times |K|/6.
    sources: [Pair; 3],
    /// What tau has more than s_i on the median of the corner: half of the divergence and of the jump.
    offsets: [Pair; 3],
    /// Whether a corner has an action.
    pub pressed: bool,
}

impl Geometry {
    /// From the corners, counter-clockwise.
    #[inline(always)]
    pub fn of(corners: [[f64; 2]; 3]) -> Geometry {
        let [p, q, r] = corners.map(Pair);
        let edges = [r - q, p - r, q - p];
        let [_, Pair([x1, y1]), Pair([x2, y2])] = edges;
        let twice = y2 * x1 - x2 * y1;
        Geometry {
            area: 0.5 * twice,
            quarter: 0.5 / twice,
            edges,
        }
    }

    /// m_k for both membranes, from the displacements of the corners.
    #[inline(always)]
    pub fn rows(&self, tension: Pair, displacement: [Pair; 3]) -> [Pair; 3] {
        let [_, e1, e2] = self.edges;
        let (one, mixed, two) = (dot(e1, e1), dot(e1, e2), dot(e2, e2));
        // Differences first: a large common height must not cost digits.
        let [u0, u1, u2] = displacement;
        let scale = tension * self.quarter;
        let (d1, d2) = ((u1 - u0) * scale, (u2 - u0) * scale);
        let first = d1 * one + d2 * mixed;
        let second = d1 * mixed + d2 * two;
        [Pair::default() - (first + second), first, second]
    }
}

impl Element {
    /// From the rows m_k and the divergence of s_i on the shares of the dual cells, times |K|/6.
    #[inline(always)]
    pub fn of(
        shape: &Geometry,
        rows: [Pair; 3],
        sources: [Pair; 3],
        pressed: bool,
    ) -> (Element, [Spoke; 3]) {
        let [e0, e1, e2] = shape.edges;
        let sixth = shape.quarter * (1.0 / 6.0);
        let medians = [e2 - e1, e0 - e2, e1 - e0].map(|d| dot(d, d) * sixth);
        let [m0, m1, m2] = medians;
        let offsets = [
            sources[0] + rows[2],
            sources[1] + rows[0],
            sources[2] + rows[1],
        ];
        let spoke = |k: usize, one: f64, two: f64| Spoke {
            weight: one + two,
            step: sources[k] * 2.0 - rows[k],
            slope: offsets[k] * (one + two) + sources[k] * (one - two),
        };
        let [l0, l1, l2] = [e0, e1, e2].map(|e| dot(e, e));
        let element = Element {
            area: shape.area,
            diameter_squared: larger(larger(l0, l1), l2),
            medians,
            sources,
            offsets,
            pressed,
        };
        let spokes = [spoke(0, m1, m2), spoke(1, m2, m0), spoke(2, m0, m1)];
        (element, spokes)
    }

    /// The flux of tau into the corner's part of the dual cell for both membranes, and the divergence times |K|/6.
    pub fn entering(&self, k: usize, beta: Pair) -> [[f64; 2]; 2] {
        let source = self.sources[k];
        let alpha = beta + self.offsets[k] - source;
        [0, 1].map(|i| [alpha.0[i], source.0[i]])
    }

    /// ||tau||^2 for both membranes, from the fluxes beta of the corners.
    ///
    /// With gamma through the median of corner k and h = `sources`, its part of the dual cell has the energy M_(k+1) ((gamma + h)^2 - 5h^2/6) +
    /// M_(k+2) ((gamma - h)^2 - 5h^2/6) + 5 M_k h^2/3, for the numbers M of `medians`.
    #[inline(always)]
    pub fn squares(&self, beta: [Pair; 3]) -> Pair {
        let square = |p: Pair| p * p;
        let [h0, h1, h2] = self.sources;
        let [g0, g1, g2] = [0, 1, 2].map(|k| beta[k] + self.offsets[k]);
        let (s0, s1, s2) = (square(h0), square(h1), square(h2));
        let all = (s0 + s1 + s2) * (5.0 / 6.0);
        let part = |leaving: Pair, entering: Pair, own: Pair| {
            square(leaving) + square(entering) + (own * 2.5 - all)
        };
        let squares = part(g2 + h2, g1 - h1, s0) * self.medians[0]
            + part(g0 + h0, g2 - h2, s1) * self.medians[1]
            + part(g1 + h1, g0 - h0, s2) * self.medians[2];
        squares.positive()
    }
}

/// The larger of two numbers, neither of which is a NaN: one instruction.
#[inline(always)]
pub(super) fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}
