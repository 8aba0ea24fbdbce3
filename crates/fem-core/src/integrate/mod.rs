//! Integrals of data over elements, by a rule that follows jumps inside elements.
//!
//! Every element is sampled at the seven points of [`crate::quadrature`]. Where the samples do not look like
//! a smooth function, the element is quartered again and again, but only the quarters that still disagree: a jump along a curve costs points in
//! proportion to its length, a singular corner a logarithm. The tolerance is relative to the whole integral,
//! so that coarse meshes are integrated by many points and fine ones by seven.

use crate::field::{FieldError, Samples};
use crate::mesh::{Mesh, Shape};
use crate::quadrature::{POINTS, RulePoint, rule};

mod loads;

pub use loads::{
    LOAD_CONTROL, Loads, judge_load, load_pair, loads, means, smooth_error, squared_error,
};

/// Something to be integrated over every element by [`integrate`].
pub trait Integrand {
    /// Number of values sampled at each point.
    fn components(&self) -> usize;

    /// Samples all components: `out[c * at.len() + k]` is component `c` at point `k`.
    ///
    /// # Errors
    /// A value that is not finite.
    fn sample(&mut self, at: Samples<'_>, out: &mut [f64]) -> Result<(), FieldError>;

    /// Judges the samples of one piece: a magnitude of the integral and an estimate of its quadrature error.
    fn judge(&self, piece: &Piece<'_>) -> Judgement;

    /// Judges a second integral over the same points, which is compared with its own magnitude; by default there is none.
    fn judge_second(&self, _piece: &Piece<'_>) -> Judgement {
        Judgement {
            magnitude: 0.0,
            error: 0.0,
        }
    }

    /// The parts that every element is sampled in to begin with.
    fn partition(&self) -> Partition {
        Partition::Whole
    }

    /// Whether nothing is to be sampled in an element.
    fn skips(&self, _triangle: usize) -> bool {
        false
    }

    /// Forgets what was added for a triangle.
    fn clear(&mut self, triangle: usize);

    /// Adds the integral over a piece of `piece.triangle`.
    fn add(&mut self, piece: &Piece<'_>);
}

/// The parts that an element is divided into before anything is sampled.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Partition {
    /// The element itself.
    Whole,
    /// The six triangles between the medians: part 2k has the corners k, middle of the edge (k, k+1), barycentre, and part 2k + 1 the
    /// corners k, barycentre, middle of the edge (k, k+2). Parts 2k and 2k + 1 are the dual cell of corner k.
    Dual,
    /// The element itself (as part [`WHOLE_PART`]), and its six parts where that is not enough.
    WholeThenDual,
}

/// The number that [`Piece::part`] has for a whole element beside the six parts.
pub const WHOLE_PART: usize = 6;

/// Samples on one element or a part of it.
#[derive(Clone, Copy, Debug)]
pub struct Piece<'a> {
    /// The element.
    pub triangle: usize,
    /// Number of the part of the element that the piece belongs to, see [`Partition`]; 0 for the whole.
    pub part: usize,
    /// Area of the piece.
    pub area: f64,
    /// The rule.
    pub rule: &'a [RulePoint; POINTS],
    /// Barycentric coordinates of the points in the element.
    pub at: &'a [[f64; 3]; POINTS],
    values: &'a [f64],
    stride: usize,
    offset: usize,
}

impl<'a> Piece<'a> {
    /// The samples of one component.
    #[inline]
    pub fn values(&self, component: usize) -> &'a [f64] {
        let first = component * self.stride + self.offset;
        &self.values[first..first + POINTS]
    }
}

/// What [`Integrand::judge`] says of a piece.
#[derive(Clone, Copy, Debug)]
pub struct Judgement {
    /// Contribution to the magnitude that tolerances are relative to.
    pub magnitude: f64,
    /// Estimate of the quadrature error.
    pub error: f64,
}

/// How exactly [`integrate`] works.
#[derive(Clone, Copy, Debug)]
pub struct Control {
    /// Allowed error of a piece, relative to the magnitude of the whole integral (or of its element).
    pub tolerance: f64,
    /// Whether the tolerance is relative to the element's own magnitude instead of the whole.
    pub local: bool,
    /// How often an element may be quartered.
    pub depth: u32,
    /// Pieces larger than this share of the domain are quartered in any case.
    pub largest_share: f64,
}

#[derive(Clone, Copy)]
struct Part {
    triangle: u32,
    depth: u32,
    part: u32,
    /// Share of the element's area before any quartering.
    share: f64,
    corners: [[f64; 3]; 3],
}

const WHOLE: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

impl Partition {
    fn parts(self, triangle: u32, to: &mut Vec<Part>) {
        let mut push = |part: usize, share: f64, corners: [[f64; 3]; 3]| {
            to.push(Part {
                triangle,
                depth: 0,
                part: part as u32,
                share,
                corners,
            });
        };
        match self {
            Partition::Whole => push(0, 1.0, WHOLE),
            Partition::WholeThenDual => push(WHOLE_PART, 1.0, WHOLE),
            Partition::Dual => {
                let third = 1.0 / 3.0;
                let centre = [third; 3];
                for k in 0..3 {
                    let middle = |other: usize| {
                        let mut m = [0.0; 3];
                        m[k] = 0.5;
                        m[other % 3] = 0.5;
                        m
                    };
                    push(2 * k, 1.0 / 6.0, [WHOLE[k], middle(k + 1), centre]);
                    push(2 * k + 1, 1.0 / 6.0, [WHOLE[k], centre, middle(k + 2)]);
                }
            }
        }
    }

    fn count(self) -> usize {
        match self {
            Partition::Whole | Partition::WholeThenDual => 1,
            Partition::Dual => 6,
        }
    }
}

/// A piece is quartered only if its width exceeds this many spacings of the coordinates.
const SPACINGS: f64 = 64.0;

/// Pieces that are sampled together.
const BLOCK: usize = 64;

/// Integrates over every element of a mesh.
///
/// # Errors
/// Whatever the integrand's samples report.
pub fn integrate(
    mesh: &Mesh,
    control: Control,
    integrand: &mut dyn Integrand,
) -> Result<(), FieldError> {
    let rule = rule();
    let total_area = crate::norms::area(mesh);
    let mut sampler = Sampler::new(integrand.components());
    let count = mesh.triangle_count();
    let partition = integrand.partition();
    let mut errors = vec![[0.0f64; 2]; count];
    let mut magnitudes = vec![[0.0; 2]; if control.local { count } else { 0 }];
    let mut magnitude = [0.0f64; 2];
    let mut parts: Vec<Part> = Vec::with_capacity(BLOCK);
    let block = BLOCK / partition.count();
    for first in (0..count).step_by(block) {
        parts.clear();
        for t in (first..count.min(first + block)).filter(|&t| !integrand.skips(t)) {
            partition.parts(t as u32, &mut parts);
        }
        sampler.run(
            mesh,
            &rule,
            &parts,
            integrand,
            &mut |integrand, piece, _| {
                let judgements = [integrand.judge(piece), integrand.judge_second(piece)];
                integrand.add(piece);
                let coarse = piece.area > control.largest_share * total_area;
                for (k, judgement) in judgements.iter().enumerate() {
                    magnitude[k] += judgement.magnitude;
                    if control.local {
                        magnitudes[piece.triangle][k] += judgement.magnitude;
                    }
                    let error = if coarse {
                        f64::INFINITY
                    } else {
                        judgement.error
                    };
                    let worst = &mut errors[piece.triangle][k];
                    *worst = worst.max(error);
                }
            },
        )?;
    }
    // Below a few spacings of the coordinates' double precision the samples are noise, and quartering it would not end.
    let extent = mesh
        .points()
        .iter()
        .flatten()
        .fold(0.0f64, |m, x| m.max(x.abs()));
    let smallest = (SPACINGS * f64::EPSILON * extent).powi(2);
    let too_large = |t: usize, errors: [f64; 2]| {
        let whole = if control.local {
            magnitudes[t]
        } else {
            magnitude
        };
        (0..2).any(|k| errors[k] > control.tolerance * whole[k])
    };
    let mut stack: Vec<Part> = Vec::new();
    let mut begin: Vec<Part> = Vec::new();
    for t in 0..count {
        if control.depth > 0 && too_large(t, errors[t]) {
            integrand.clear(t);
            begin.clear();
            if partition == Partition::WholeThenDual {
                Partition::Dual.parts(t as u32, &mut stack);
            } else {
                partition.parts(t as u32, &mut begin);
                begin.iter().for_each(|part| quarter(part, &mut stack));
            }
        }
        // Work the stack off whenever a block is full, so that it stays small.
        while stack.len() >= BLOCK || (t + 1 == count && !stack.is_empty()) {
            let keep = stack.len().saturating_sub(BLOCK);
            parts.clear();
            parts.extend(stack.drain(keep..));
            sampler.run(
                mesh,
                &rule,
                &parts,
                integrand,
                &mut |integrand, piece, part| {
                    let errors = [integrand.judge(piece), integrand.judge_second(piece)]
                        .map(|judgement| judgement.error);
                    let coarse = piece.area > control.largest_share * total_area;
                    let divisible = part.depth < control.depth && piece.area > smallest;
                    if divisible && (coarse || too_large(piece.triangle, errors)) {
                        quarter(part, &mut stack);
                    } else {
                        integrand.add(piece);
                    }
                },
            )?;
        }
    }
    Ok(())
}

fn quarter(part: &Part, stack: &mut Vec<Part>) {
    let [a, b, c] = part.corners;
    let middle = |p: [f64; 3], q: [f64; 3]| {
        [
            0.5 * (p[0] + q[0]),
            0.5 * (p[1] + q[1]),
            0.5 * (p[2] + q[2]),
        ]
    };
    let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
    for corners in [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]] {
        stack.push(Part {
            depth: part.depth + 1,
            corners,
            ..*part
        });
    }
}

/// Buffers for a block of pieces.
struct Sampler {
    x: Vec<f64>,
    y: Vec<f64>,
    region: Vec<f64>,
    at: Vec<[[f64; 3]; POINTS]>,
    area: Vec<f64>,
    values: Vec<f64>,
    components: usize,
}

impl Sampler {
    fn new(components: usize) -> Self {
        Sampler {
            x: vec![0.0; BLOCK * POINTS],
            y: vec![0.0; BLOCK * POINTS],
            region: vec![0.0; BLOCK * POINTS],
            at: vec![[[0.0; 3]; POINTS]; BLOCK],
            area: vec![0.0; BLOCK],
            values: vec![0.0; BLOCK * POINTS * components],
            components,
        }
    }

    fn run(
        &mut self,
        mesh: &Mesh,
        rule: &[RulePoint; POINTS],
        parts: &[Part],
        integrand: &mut dyn Integrand,
        visit: &mut dyn FnMut(&mut dyn Integrand, &Piece<'_>, &Part),
    ) -> Result<(), FieldError> {
        let n = parts.len() * POINTS;
        for (k, part) in parts.iter().enumerate() {
            let t = part.triangle as usize;
            let corners = mesh.corners(crate::TriangleId(part.triangle));
            // Quarters of quarters: the area follows from the depth.
            self.area[k] = Shape::new(corners).area * part.share * 0.25f64.powi(part.depth as i32);
            for (q, point) in rule.iter().enumerate() {
                let mut at = [0.0; 3];
                for i in 0..3 {
                    for j in 0..3 {
                        at[j] += point.at[i] * part.corners[i][j];
                    }
                }
                self.at[k][q] = at;
                let i = k * POINTS + q;
                self.x[i] = at[0] * corners[0][0] + at[1] * corners[1][0] + at[2] * corners[2][0];
                self.y[i] = at[0] * corners[0][1] + at[1] * corners[1][1] + at[2] * corners[2][1];
                self.region[i] = f64::from(mesh.region()[t]);
            }
        }
        let samples = Samples {
            x: &self.x[..n],
            y: &self.y[..n],
            region: &self.region[..n],
        };
        let values = &mut self.values[..n * self.components];
        integrand.sample(samples, values)?;
        for (k, part) in parts.iter().enumerate() {
            let piece = Piece {
                triangle: part.triangle as usize,
                part: part.part as usize,
                area: self.area[k],
                rule,
                at: &self.at[k],
                values: &self.values[..n * self.components],
                stride: n,
                offset: k * POINTS,
            };
            visit(integrand, &piece, part);
        }
        Ok(())
    }
}
