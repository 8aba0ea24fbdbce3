//! Loads: their moments over elements.

use std::ops::Range;

use super::carry::kept;
use super::whole::{self, Fits};
use super::{
    Allowed, Control, ElementLoad, Integrand, Judgement, Loads, Piece, Reference, Whole, divide,
};
use crate::field::{Constant, Field, FieldError, FieldPair, Samples};
use crate::index::TriangleId;
use crate::mesh::Mesh;
use crate::parallel::{self, BLOCK};
use crate::quadrature::{POINTS, RulePoint, affine_misfit, affine_misfits};

/// The tolerance of loads: a piece cut by a jump is quartered until its area is about this share of the domain.
pub const LOAD_CONTROL: Control = Control {
    tolerance: 1e-7,
    local: false,
    depth: 14,
    largest_share: 1.0 / 16384.0,
};

/// Size of the quadrature error that a misfit of samples of size `largest` points to, for a function itself.
///
/// The misfit m is O(h^2) for smooth data, for which the rule's error is O(h^6) = O(m^3); for a jump both are of the size of the jump.
#[inline]
pub fn smooth_error(misfit: f64, largest: f64) -> f64 {
    if misfit == 0.0 {
        0.0
    } else {
        misfit * (misfit / largest) * (misfit / largest)
    }
}

/// Size of the quadrature error that a misfit of samples of size `largest` points to, for the square of a function.
///
/// A smooth function whose square is an error density is affine but for O(h) of its size, and its square is integrated with a relative error of
/// O(h^4), the fourth power of the relative misfit; a jump or a singularity leaves a misfit of its own size.
#[inline]
pub fn squared_error(misfit: f64, largest: f64) -> f64 {
    if misfit == 0.0 {
        0.0
    } else {
        (3.0 * misfit / largest).min(1.0).powi(4) * largest * largest
    }
}

/// The largest sample, and the quadrature error of their mean that their misfit points to.
fn size_and_error(rule: &[RulePoint; POINTS], samples: &[f64]) -> (f64, f64) {
    let largest = samples.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    (largest, smooth_error(affine_misfit(rule, samples), largest))
}

/// Integrates one load, see [`load_pair`].
///
/// # Errors
/// A value of the field that is not finite.
pub fn loads(mesh: &Mesh, field: &dyn Field) -> Result<Loads, FieldError> {
    load_pair(mesh, [field, &Constant(0.0)]).map(|[loads, _]| loads)
}

/// Integrates two loads on the initial mesh of a problem, see [`load_pair_relative_to`].
///
/// # Errors
/// A value of a field that is not finite.
pub fn load_pair(mesh: &Mesh, fields: [&dyn Field; 2]) -> Result<[Loads; 2], FieldError> {
    load_pair_relative_to(&Reference::of(mesh, fields)?, mesh, fields, 1)
}

/// Integrates two loads against the hat functions: nodal loads, element means and deviations from them.
///
/// Both are sampled at the same points, as many as either needs: what cancels between the loads then cancels between their integrals too. The
/// integrals over an element depend on the element and on `reference` alone, not on the number of `threads` they are found by.
///
/// # Errors
/// A value of a field that is not finite.
pub fn load_pair_relative_to(
    reference: &Reference,
    mesh: &Mesh,
    fields: [&dyn Field; 2],
    threads: usize,
) -> Result<[Loads; 2], FieldError> {
    pair(reference, mesh, fields, threads, None)
}

/// The loads on a mesh made from another one by [`Mesh::refine`]: only the triangles that it bisected are sampled. The result is what
/// [`load_pair_relative_to`] gives with the reference that the loads before were found by, bit for bit.
///
/// `before` holds the loads on the mesh before, `parent` is that of the [`crate::Refinement`].
///
/// # Errors
/// A value of a field that is not finite.
pub fn load_pair_carried(
    mesh: &Mesh,
    fields: [&dyn Field; 2],
    before: &[Loads; 2],
    parent: &[TriangleId],
    threads: usize,
) -> Result<[Loads; 2], FieldError> {
    let reference = match before[0].reference {
        Some(reference) => reference,
        None => Reference::of(mesh, fields)?,
    };
    pair(&reference, mesh, fields, threads, Some((before, parent)))
}

/// Integrates where the loads on a mesh before, with the parents of its triangles, have nothing to be taken over.
fn pair(
    reference: &Reference,
    mesh: &Mesh,
    fields: [&dyn Field; 2],
    threads: usize,
    known: Option<(&[Loads; 2], &[TriangleId])>,
) -> Result<[Loads; 2], FieldError> {
    let constants = fields.map(|f| f.constant());
    if let [Some(f), Some(g)] = constants {
        return Ok(Loads::constant(mesh, [f, g]).map(|l| l.relative_to(*reference)));
    }
    let count = mesh.triangle_count();
    let mut pair = LoadPair {
        single: fields,
        fields: FieldPair::new(fields),
        reference: *reference,
        elements: [0, 1].map(|i| {
            let room = if constants[i].is_some() { 0 } else { count };
            vec![ElementLoad::NONE; room]
        }),
        threads: parallel::worthwhile(threads, count),
        sums: [Vec::new(), Vec::new()],
    };
    pair.fill(mesh, constants, known)?;
    Ok(pair.finish(mesh, constants))
}

/// How one load is judged on a piece: by the misfit of its samples, for the integrals of [`load_pair`].
pub fn judge_load(piece: &Piece<'_>, component: usize) -> Judgement {
    let f = piece.values(component);
    let (_, error) = size_and_error(piece.rule, f);
    let magnitude: f64 = piece
        .rule
        .iter()
        .zip(f)
        .map(|(p, v)| p.weight * v.abs())
        .sum();
    Judgement {
        magnitude: magnitude * piece.area,
        error: error * piece.area,
    }
}

/// Two loads under way.
struct LoadPair<'a> {
    single: [&'a dyn Field; 2],
    fields: FieldPair<'a>,
    reference: Reference,
    /// What is known of the triangles; nothing of a constant.
    elements: [Vec<ElementLoad>; 2],
    /// How many threads may work.
    threads: usize,
    /// Of triangles that are divided: (f, phi_k) for the corners 0 and 1, then the first and second moment of f minus the mean that the seven points give, so
    /// that the second one does not cancel.
    sums: [Vec<[f64; 4]>; 2],
}

impl LoadPair<'_> {
    /// Fills the elements: takes over, samples, and divides what seven points do not do for.
    fn fill(
        &mut self,
        mesh: &Mesh,
        constants: [Option<f64>; 2],
        known: Option<(&[Loads; 2], &[TriangleId])>,
    ) -> Result<(), FieldError> {
        let count = mesh.triangle_count();
        let control = LOAD_CONTROL;
        let allowed = Allowed {
            control,
            coarse: control.largest_share * self.reference.area,
            whole: Whole::Same(self.reference.magnitude),
        };
        let largest = self
            .reference
            .magnitude
            .map(|whole| control.tolerance * whole);
        let (single, fields) = (self.single, self.fields);
        let mut chunks = self.elements.each_mut().map(|e| e.chunks_mut(BLOCK));
        let jobs: Vec<_> = parallel::blocks(count)
            .map(|block| {
                let own = chunks.each_mut().map(|c| c.next().unwrap_or_default());
                (block, own)
            })
            .collect();
        // Every block of triangles by itself; returns those that are to be divided.
        let results = parallel::map(self.threads, jobs, |(block, mut elements)| {
            let begin = block.start;
            let fresh = match known {
                Some((before, parent)) => {
                    take_over(&mut elements, constants, before, parent, block)
                }
                None => block.map(|t| t as u32).collect(),
            };
            let mut wanting = Vec::new();
            // A constant has no say in how often an element is divided.
            let mut put = |list: &[u32], area: &whole::Row, loads: &[(usize, &Fits)]| {
                for &(i, fits) in loads {
                    store(elements[i], begin, list, area, fits);
                }
                let area = &area[..list.len()];
                // Nearly always all are good: one test for all of them.
                let mut wrong = area
                    .iter()
                    .fold(false, |wrong, area| wrong | (*area > allowed.coarse));
                for &(i, fits) in loads {
                    let errors = area
                        .iter()
                        .zip(&fits.error)
                        .map(|(area, error)| error * area);
                    wrong = errors.fold(wrong, |wrong, error| wrong | (error > largest[i]));
                }
                if !wrong {
                    return;
                }
                for (k, (&t, &area)) in list.iter().zip(area).enumerate() {
                    let is_wrong = |&(i, fits): &(usize, &Fits)| fits.error[k] * area > largest[i];
                    if area > allowed.coarse || loads.iter().any(is_wrong) {
                        wanting.push(t);
                    }
                }
            };
            match constants {
                [None, None] => {
                    let sample = |at: Samples<'_>, out: [&mut [f64]; 2]| fields.sample(at, out);
                    whole::fit(mesh, &fresh, sample, |list, area, [f, g]| {
                        put(list, area, &[(0, f), (1, g)]);
                    })?;
                }
                _ => {
                    let i = usize::from(constants[0].is_some());
                    let sample =
                        |at: Samples<'_>, [out]: [&mut [f64]; 1]| single[i].sample(at, out);
                    whole::fit(mesh, &fresh, sample, |list, area, [f]| {
                        put(list, area, &[(i, f)]);
                    })?;
                }
            }
            Ok(wanting)
        });
        let mut wanting: Vec<u32> = Vec::new();
        for result in results {
            wanting.extend(result?);
        }
        if wanting.is_empty() {
            return Ok(());
        }
        self.sums = [vec![[0.0; 4]; count], vec![[0.0; 4]; count]];
        divide(mesh, &allowed, self, &wanting)?;
        for (elements, sums) in self.elements.iter_mut().zip(&self.sums) {
            if elements.is_empty() {
                continue;
            }
            for &t in &wanting {
                let area = mesh.area(TriangleId(t));
                let [first, second, one, two] = sums[t as usize];
                let element = &mut elements[t as usize];
                *element = ElementLoad {
                    corners: [first, second],
                    mean: element.mean + one / area,
                    deviation_squared: (two - one * one / area).max(0.0),
                };
            }
        }
        Ok(())
    }

    fn finish(self, mesh: &Mesh, constants: [Option<f64>; 2]) -> [Loads; 2] {
        let reference = self.reference;
        if self.threads <= 1 && constants == [None; 2] {
            return Loads::pair(mesh, self.elements).map(|loads| loads.relative_to(reference));
        }
        let [first, second] = self.elements;
        let [f, g] = constants;
        let one = |constant: Option<f64>, elements: Vec<ElementLoad>| {
            let loads = match constant {
                Some(value) => {
                    let [loads] = Loads::constant(mesh, [value]);
                    loads
                }
                None => Loads::new(mesh, elements),
            };
            loads.relative_to(reference)
        };
        parallel::both(self.threads, || one(f, first), || one(g, second)).into()
    }
}

/// Takes over what is known of the triangles of a block, and lists the others. Nothing is stored of constants.
fn take_over(
    elements: &mut [&mut [ElementLoad]; 2],
    constants: [Option<f64>; 2],
    before: &[Loads; 2],
    parent: &[TriangleId],
    block: Range<usize>,
) -> Vec<u32> {
    let mut fresh = Vec::with_capacity(block.len());
    let mut taken = Vec::with_capacity(block.len());
    for t in block.clone() {
        match kept(parent, t) {
            Some(old) => taken.push((t - block.start, old)),
            None => fresh.push(t as u32),
        }
    }
    for i in (0..2).filter(|i| constants[*i].is_none()) {
        let elements = &mut *elements[i];
        match before[i].each() {
            Some(each) => taken.iter().for_each(|&(t, old)| elements[t] = each[old]),
            None => taken
                .iter()
                .for_each(|&(t, old)| elements[t] = before[i].element(old)),
        }
    }
    fresh
}

/// Stores what the samples of a load tell of the triangles of `list`; `elements` are those from the triangle `begin` on.
fn store(elements: &mut [ElementLoad], begin: usize, list: &[u32], area: &whole::Row, fits: &Fits) {
    let n = list.len();
    let [first, second] = fits.corners.each_ref().map(|row| &row[..n]);
    let [mean, variance, area] = [&fits.mean, &fits.variance, area].map(|row| &row[..n]);
    for k in 0..n {
        let area = area[k];
        elements[list[k] as usize - begin] = ElementLoad {
            corners: [first[k] * area, second[k] * area],
            mean: mean[k],
            deviation_squared: variance[k] * area,
        };
    }
}

impl Integrand for LoadPair<'_> {
    fn components(&self) -> usize {
        2
    }

    fn sample(&mut self, at: Samples<'_>, out: &mut [f64]) -> Result<(), FieldError> {
        let (first, second) = out.split_at_mut(at.len());
        self.fields.sample(at, [first, second])
    }

    fn judge(&self, piece: &Piece<'_>) -> Judgement {
        judge_load(piece, 0)
    }

    fn judge_second(&self, piece: &Piece<'_>) -> Judgement {
        judge_load(piece, 1)
    }

    fn errors(&self, piece: &Piece<'_>) -> [f64; 2] {
        let samples = [0, 1].map(|i| piece.values(i));
        let misfits = affine_misfits(piece.rule, samples);
        [0, 1].map(|i| {
            let largest = samples[i].iter().fold(0.0f64, |m, v| m.max(v.abs()));
            smooth_error(misfits[i], largest) * piece.area
        })
    }

    fn clear(&mut self, triangle: usize) {
        for sums in &mut self.sums {
            sums[triangle] = [0.0; 4];
        }
    }

    fn add(&mut self, piece: &Piece<'_>) {
        for (i, sums) in self.sums.iter_mut().enumerate() {
            let Some(base) = self.elements[i].get(piece.triangle).map(|e| e.mean) else {
                continue;
            };
            // By itself first: a large element has very many points, and rounding goes with the number of additions to one sum.
            let mut own = [0.0; 4];
            for ((p, at), v) in piece.rule.iter().zip(piece.at).zip(piece.values(i)) {
                let d = v - base;
                own[0] += p.weight * at[0] * v;
                own[1] += p.weight * at[1] * v;
                own[2] += p.weight * d;
                own[3] += p.weight * d * d;
            }
            for (sum, own) in sums[piece.triangle].iter_mut().zip(own) {
                *sum += piece.area * own;
            }
        }
    }
}
