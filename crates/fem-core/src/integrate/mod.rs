//! Integrals of data over elements, by a rule that follows jumps inside elements.
//!
//! Every element is sampled at the seven points of [`crate::quadrature`]. Where the samples do not look like
//! a smooth function, the element is quartered again and again, but only the quarters that still disagree: a jump along a curve costs points in
//! proportion to its length, a singular corner a logarithm. The tolerance is relative to the whole integral,
//! so that coarse meshes are integrated by many points and fine ones by seven.
//!
//! Loads and tensions of a refined mesh are taken over where elements stayed what they were ([`load_pair_carried`], [`means_carried`]). That needs
//! a tolerance that does not depend on the mesh: the [`Reference`] of a problem is found once, on its initial mesh.

use std::collections::VecDeque;

use crate::field::{FieldError, Samples};
use crate::index::TriangleId;
use crate::mesh::{Mesh, signed_area};
use crate::quadrature::{POINTS, RulePoint, rule};

mod carry;
mod data;
mod lanes;
mod loads;
mod means;
mod reference;
mod whole;

pub use data::{ElementLoad, Loads};
pub use loads::{
    LOAD_CONTROL, judge_load, load_pair, load_pair_carried, load_pair_relative_to, loads,
    smooth_error, squared_error,
};
pub use means::{means, means_carried};
pub use reference::Reference;

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

    /// The errors of both judgements.
    fn errors(&self, piece: &Piece<'_>) -> [f64; 2] {
        [self.judge(piece), self.judge_second(piece)].map(|judgement| judgement.error)
    }

    /// The parts that every element is sampled in to begin with.
    fn partition(&self) -> Partition {
        Partition::Whole
    }

    /// What tolerances are relative to, where that is not the mesh integrated over and the magnitudes of the samples on it.
    fn reference(&self) -> Option<Reference> {
        None
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
    /// Its share of the element's area.
    pub share: f64,
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
    /// Share of the element's area.
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
    let reference = integrand.reference();
    let total_area = match reference {
        Some(reference) => reference.area,
        None => crate::norms::area(mesh),
    };
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
    if let Some(reference) = reference {
        magnitude = reference.magnitude;
    }
    let whole = if control.local {
        Whole::Each(&magnitudes)
    } else {
        Whole::Same(magnitude)
    };
    let allowed = Allowed {
        control,
        coarse: control.largest_share * total_area,
        whole,
    };
    let wanting: Vec<u32> = (0..count)
        .filter(|&t| control.depth > 0 && allowed.too_large(t, errors[t]))
        .map(|t| t as u32)
        .collect();
    wanting.iter().for_each(|&t| integrand.clear(t as usize));
    divide(mesh, &allowed, integrand, &wanting)
}

/// What errors are compared with.
enum Whole<'a> {
    /// One magnitude for either integral.
    Same([f64; 2]),
    /// That of the element.
    Each(&'a [[f64; 2]]),
}

/// The errors and sizes that pieces may have.
struct Allowed<'a> {
    control: Control,
    /// The largest area of a piece.
    coarse: f64,
    whole: Whole<'a>,
}

impl Allowed<'_> {
    #[inline]
    fn too_large(&self, t: usize, errors: [f64; 2]) -> bool {
        let whole = match self.whole {
            Whole::Same(magnitude) => magnitude,
            Whole::Each(magnitudes) => magnitudes[t],
        };
        (0..2).any(|k| errors[k] > self.control.tolerance * whole[k])
    }
}

/// Divides elements that seven points do not do for, and integrates over the parts; nothing is added for these elements before.
fn divide(
    mesh: &Mesh,
    allowed: &Allowed<'_>,
    integrand: &mut dyn Integrand,
    wanting: &[u32],
) -> Result<(), FieldError> {
    if wanting.is_empty() {
        return Ok(());
    }
    let rule = rule();
    let control = allowed.control;
    let mut sampler = Sampler::new(integrand.components());
    let partition = integrand.partition();
    let mut parts: Vec<Part> = Vec::with_capacity(BLOCK);
    // First in, first out: the pieces of an element are added in an order that does not depend on the elements around it.
    let mut queue: VecDeque<Part> = VecDeque::new();
    let mut begin: Vec<Part> = Vec::new();
    let mut wanting = wanting.iter();
    loop {
        // Another element is begun only when the block is not full, so that the queue stays small.
        while queue.len() < BLOCK
            && let Some(&t) = wanting.next()
        {
            begin.clear();
            if partition == Partition::WholeThenDual {
                Partition::Dual.parts(t, &mut begin);
                queue.extend(begin.drain(..));
            } else {
                partition.parts(t, &mut begin);
                begin.iter().for_each(|part| quarter(part, &mut queue));
            }
        }
        if queue.is_empty() {
            return Ok(());
        }
        parts.clear();
        parts.extend(queue.drain(..BLOCK.min(queue.len())));
        sampler.run(
            mesh,
            &rule,
            &parts,
            integrand,
            &mut |integrand, piece, part| {
                let errors = integrand.errors(piece);
                let divisible = part.depth < control.depth
                    && piece.area > smallest(mesh, TriangleId(part.triangle));
                let coarse = piece.area > allowed.coarse;
                if (coarse || allowed.too_large(piece.triangle, errors)) && divisible {
                    quarter(part, &mut queue);
                } else {
                    integrand.add(piece);
                }
            },
        )?;
    }
}

/// The area below which a piece of an element is not divided: a few spacings of its coordinates' double precision wide, its samples are
/// noise, and quartering it would not end.
fn smallest(mesh: &Mesh, t: TriangleId) -> f64 {
    let extent = mesh
        .corners(t)
        .iter()
        .flatten()
        .fold(0.0f64, |m, x| m.max(x.abs()));
    (SPACINGS * f64::EPSILON * extent).powi(2)
}

fn quarter(part: &Part, queue: &mut VecDeque<Part>) {
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
        queue.push_back(Part {
            depth: part.depth + 1,
            share: 0.25 * part.share,
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
            let corners = mesh.corners(TriangleId(part.triangle));
            self.area[k] = signed_area(corners) * part.share;
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
                share: part.share,
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
