//! A large initial mesh: multigrid over aggregates in place of a factor, since nothing below that mesh is known.
//!
//! One symmetric cycle: forward relaxation, the aggregates ([`super::aggregates`]), backward relaxation; a Cholesky factor of a few hundred
//! unknowns at the bottom. Aggregates and weights come from the untruncated matrix and are kept until its diagonal changes; the coarser
//! matrices are Galerkin products with the truncated one and are made anew with every truncation, O(n). The cycle is a fixed
//! symmetric positive definite operator between two truncations.

use super::aggregates::{Matrix, Own, Prolongation};
use super::hierarchy::{Hierarchy, refill};
use super::unknowns::{EMPTY, Unknowns};
use crate::cholesky::{Cholesky, FactorError, Lower};

/// Vertices that are left to a Cholesky factor.
const BOTTOM: usize = 400;

/// Levels, at most.
const LEVELS: usize = 30;

/// Aggregates are made anew when a diagonal has changed by more than this factor.
const CHANGE: f64 = 1.25;

/// Added to every diagonal at the bottom, relative to it: truncated functions may be linearly dependent.
const SHIFT: f64 = 1e-12;

/// Projected sweeps at the bottom in a monotone cycle, and on every level above it, each forwards and backwards.
const BOTTOM_SWEEPS: usize = 16;
const SWEEPS: usize = 1;

/// What the matrices at hand belong to.
#[derive(Clone, Copy, PartialEq)]
enum State {
    /// The finest matrix has changed.
    Stale,
    Plain,
    Truncated,
}

impl<U: Unknowns> Own<U> {
    fn matrix(&self) -> Matrix<'_, U> {
        Matrix {
            start: &self.start,
            column: &self.column,
            block: &self.block,
            pivot: &self.pivot,
        }
    }

    fn smoother(&self) -> Smoother<'_, U> {
        Smoother {
            a: self.matrix(),
            inverse: &self.inverse,
        }
    }
}

/// One level of aggregates.
struct Coarse<U: Unknowns> {
    /// From the level above, which is finer.
    from: Prolongation,
    own: Own<U>,
    /// Aggregates one of whose vertices has changed.
    dirty: Vec<bool>,
    /// Diagonals without truncation, which tell what is rounding.
    diagonal: Vec<U::Plain>,
    r: Vec<U::Value>,
    c: Vec<U::Value>,
    rest: Vec<U::Value>,
    bound: Vec<f64>,
}

/// The levels of aggregates below an initial mesh.
pub(crate) struct Algebraic<U: Unknowns> {
    state: State,
    /// The untruncated diagonals that the aggregates were made for; empty before.
    made_for: Vec<U::Plain>,
    /// Diagonals of the matrix that the coarser ones are products of.
    pivot: Vec<U::Pivot>,
    /// Vertices whose rows have changed, or a neighbour's.
    dirty: Vec<bool>,
    inverse: Vec<U::Pivot>,
    rest: Vec<U::Value>,
    coarse: Vec<Coarse<U>>,
    lower: Lower,
    source: Vec<Source>,
    factored: Vec<f64>,
    rhs: Vec<f64>,
    cholesky: Option<Cholesky>,
}

/// Where a value of the bottom matrix comes from.
enum Source {
    Pivot(u32, u8, u8),
    Edge(u32, u8, u8),
}

/// A matrix with the inverses of its diagonal blocks.
struct Smoother<'a, U: Unknowns> {
    a: Matrix<'a, U>,
    inverse: &'a [U::Pivot],
}

impl<U: Unknowns> Default for Algebraic<U> {
    fn default() -> Algebraic<U> {
        Algebraic {
            state: State::Stale,
            made_for: Vec::new(),
            pivot: Vec::new(),
            dirty: Vec::new(),
            inverse: Vec::new(),
            rest: Vec::new(),
            coarse: Vec::new(),
            lower: Lower::default(),
            source: Vec::new(),
            factored: Vec::new(),
            rhs: Vec::new(),
            cholesky: None,
        }
    }
}

impl<U: Unknowns> Algebraic<U> {
    /// The matrix of the mesh has changed.
    pub fn renew(&mut self) {
        self.state = State::Stale;
    }

    /// Whether there are no aggregates yet: an untruncated matrix has to come first.
    pub fn unmade(&self) -> bool {
        self.made_for.is_empty()
    }

    /// Takes the matrix of the initial mesh; whether a bottom matrix was factored.
    pub fn prepare(
        &mut self,
        hierarchy: &Hierarchy,
        pivot: &[U::Pivot],
        coupling: &[U::Coupling],
        diagonal: &[U::Plain],
        plain: bool,
    ) -> Result<bool, FactorError> {
        if plain && self.state == State::Plain {
            return Ok(false);
        }
        let a = finest(hierarchy, coupling, pivot);
        if plain && !self.serves(pivot) {
            self.make(&a);
            self.made_for.clear();
            self.made_for.extend(pivot.iter().map(diagonal_of::<U>));
        } else {
            self.compare(&a);
            for level in 0..self.coarse.len() {
                let (above, here) = self.coarse.split_at_mut(level);
                match above.last() {
                    Some(above) => here[0].take(&above.own.matrix(), &above.dirty, plain),
                    None => here[0].take(&a, &self.dirty, plain),
                }
            }
        }
        self.pivot.clear();
        self.pivot.extend_from_slice(pivot);
        refill(&mut self.rest, a.len(), U::Value::default());
        let rows = pivot.iter().zip(diagonal);
        self.inverse.clear();
        self.inverse
            .extend(rows.map(|(&d, &plain)| U::inverse(d, plain)));
        self.state = if plain {
            State::Plain
        } else {
            State::Truncated
        };
        self.factor()
    }

    /// Finds the rows that have changed. A truncated hat function is another one exactly where its diagonal entry is.
    fn compare(&mut self, a: &Matrix<U>) {
        let known = self.pivot.len() == a.len() && self.state != State::Stale;
        refill(&mut self.dirty, a.len(), !known);
        if known {
            for x in 0..a.len() {
                let changed = self.pivot[x] != a.pivot[x];
                self.dirty[x] |= changed;
                for e in a.row(x) {
                    let y = a.column[e] as usize;
                    if changed || self.pivot[y] != a.pivot[y] {
                        self.dirty[x] = true;
                        self.dirty[y] = true;
                    }
                }
            }
        }
    }

    /// Whether the aggregates at hand were made for a matrix like this one.
    fn serves(&self, pivot: &[U::Pivot]) -> bool {
        let near = |(new, old): (&U::Pivot, &U::Plain)| {
            (0..U::WIDTH).all(|i| {
                let (new, old) = (U::pivot_at(*new, i, i), U::plain_at(*old, i));
                new <= CHANGE * old && old <= CHANGE * new
            })
        };
        self.made_for.len() == pivot.len() && pivot.iter().zip(&self.made_for).all(near)
    }

    /// Aggregates on all levels, and the pattern of the bottom.
    fn make(&mut self, a: &Matrix<U>) {
        self.coarse.clear();
        for depth in 0..LEVELS {
            let next = {
                let own = self.coarse.last().map(|c| c.own.matrix());
                let finer = own.as_ref().unwrap_or(a);
                let unknowns = finer.pivot.iter().filter(|&&d| U::pivot_at(d, 0, 0) > 0.0);
                let unknowns = unknowns.count();
                if unknowns <= BOTTOM {
                    break;
                }
                let from = Prolongation::new(finer, depth);
                // No edges any more, or nothing gained.
                if from.coarse == unknowns {
                    break;
                }
                let mut next = Coarse::new(from, finer);
                next.take(finer, &vec![true; finer.len()], true);
                next
            };
            self.coarse.push(next);
        }
        self.cholesky = None;
        self.factored.clear();
        self.lower = Lower::default();
        self.source.clear();
        let Some(bottom) = self.coarse.last() else {
            return;
        };
        let w = U::WIDTH as u32;
        let mut entries = Vec::new();
        for x in 0..bottom.own.pivot.len() as u32 {
            for j in 0..w {
                for i in j..w {
                    entries.push((w * x + j, w * x + i, Source::Pivot(x, i as u8, j as u8)));
                }
                for e in bottom.own.start[x as usize]..bottom.own.start[x as usize + 1] {
                    let y = bottom.own.column[e as usize];
                    for i in 0..w {
                        entries.push((w * y + j, w * x + i, Source::Edge(e, i as u8, j as u8)));
                    }
                }
            }
        }
        entries.sort_unstable_by_key(|&(column, row, _)| (column, row));
        self.lower.start.push(0);
        for (column, row, source) in entries {
            while self.lower.start.len() <= column as usize {
                self.lower.start.push(self.lower.row.len() as u32);
            }
            self.lower.row.push(row);
            self.source.push(source);
        }
        self.lower.start.push(self.lower.row.len() as u32);
        self.lower.value = vec![0.0; self.source.len()];
        self.rhs = vec![0.0; U::WIDTH * bottom.own.pivot.len()];
    }

    /// Factors the bottom matrix, unless it is the same still.
    fn factor(&mut self) -> Result<bool, FactorError> {
        let Some(bottom) = self.coarse.last() else {
            return Ok(false);
        };
        for (value, source) in self.lower.value.iter_mut().zip(&self.source) {
            *value = match *source {
                Source::Edge(e, i, j) => {
                    U::coupling_at(bottom.own.block[e as usize], i as usize, j as usize)
                }
                Source::Pivot(x, i, j) => {
                    let own = U::pivot_at(bottom.own.pivot[x as usize], i as usize, j as usize);
                    let plain = U::plain_at(bottom.diagonal[x as usize], i as usize);
                    match (i == j, own > EMPTY * plain) {
                        (false, _) => own,
                        (true, true) => own * (1.0 + SHIFT),
                        (true, false) => plain,
                    }
                }
            };
        }
        if self.factored == self.lower.value {
            return Ok(false);
        }
        self.factored.clear();
        let cholesky = match &mut self.cholesky {
            Some(cholesky) => cholesky,
            none => none.insert(Cholesky::analyse(&self.lower)?),
        };
        cholesky.factor(&self.lower)?;
        self.factored.extend_from_slice(&self.lower.value);
        Ok(true)
    }

    /// c = B r. Destroys r.
    pub fn cycle(
        &mut self,
        hierarchy: &Hierarchy,
        coupling: &[U::Coupling],
        r: &mut [U::Value],
        c: &mut [U::Value],
    ) {
        let top: Smoother<'_, U> = Smoother {
            a: finest(hierarchy, coupling, &self.inverse),
            inverse: &self.inverse,
        };
        top.forwards(r, c, &mut self.rest);
        let mut finer = &self.rest;
        for next in &mut self.coarse {
            next.from.restrict::<U>(finer, &mut next.r);
            let smoother = next.own.smoother();
            smoother.forwards(&next.r, &mut next.c, &mut next.rest);
            finer = &next.rest;
        }
        // At the bottom the factor takes the place of both relaxations.
        if let (Some(bottom), Some(cholesky)) = (self.coarse.last_mut(), &mut self.cholesky) {
            let w = U::WIDTH;
            for (value, r) in self.rhs.chunks_exact_mut(w).zip(&bottom.r) {
                (0..w).for_each(|i| value[i] = U::at(*r, i));
            }
            cholesky.solve(&mut self.rhs);
            for (value, c) in self.rhs.chunks_exact(w).zip(&mut bottom.c) {
                *c = U::value(|i| value[i]);
            }
        }
        for level in (1..self.coarse.len()).rev() {
            let (above, here) = self.coarse.split_at_mut(level);
            let above = &mut above[level - 1];
            here[0].from.prolong::<U>(&here[0].c, &mut above.c);
            let smoother = above.own.smoother();
            smoother.backwards(&mut above.r, &mut above.c);
        }
        if let Some(first) = self.coarse.first() {
            first.from.prolong::<U>(&first.c, c);
        }
        top.backwards(r, c);
    }

    /// A correction c with gap(c) >= bound that does not raise the energy; the matrices must not be truncated. Destroys r.
    pub fn monotone_cycle(
        &mut self,
        hierarchy: &Hierarchy,
        coupling: &[U::Coupling],
        r: &mut [U::Value],
        c: &mut [U::Value],
        bound: &[f64],
    ) {
        let mut finer: (&[U::Value], &[f64]) = (r, bound);
        for next in &mut self.coarse {
            next.from.restrict::<U>(finer.0, &mut next.r);
            next.from.restrict_bounds(finer.1, &mut next.bound);
            next.c.fill(U::Value::default());
            finer = (&next.r, &next.bound);
        }
        let bottom = self.coarse.len();
        for level in (0..bottom).rev() {
            let (above, below) = self.coarse.split_at_mut(level + 1);
            let here = &mut above[level];
            if let Some(below) = below.first() {
                below.from.prolong::<U>(&below.c, &mut here.c);
            }
            let smoother = here.own.smoother();
            let sweeps = if level + 1 == bottom {
                BOTTOM_SWEEPS
            } else {
                SWEEPS
            };
            for _ in 0..sweeps {
                smoother.bounded(&here.r, &mut here.rest, &mut here.c, &here.bound);
            }
        }
        if let Some(first) = self.coarse.first() {
            first.from.prolong::<U>(&first.c, c);
        }
        let top: Smoother<'_, U> = Smoother {
            a: finest(hierarchy, coupling, &self.inverse),
            inverse: &self.inverse,
        };
        for _ in 0..SWEEPS {
            top.bounded(r, &mut self.rest, c, bound);
        }
    }
}

/// The matrix of the initial mesh of a hierarchy.
fn finest<'a, U: Unknowns>(
    hierarchy: &'a Hierarchy,
    block: &'a [U::Coupling],
    pivot: &'a [U::Pivot],
) -> Matrix<'a, U> {
    Matrix {
        start: &hierarchy.macro_start,
        column: &hierarchy.macro_end,
        block,
        pivot,
    }
}

fn diagonal_of<U: Unknowns>(pivot: &U::Pivot) -> U::Plain {
    U::plain(|i| U::pivot_at(*pivot, i, i))
}

impl<U: Unknowns> Coarse<U> {
    fn new(from: Prolongation, finer: &Matrix<U>) -> Coarse<U> {
        let n = from.coarse;
        let (start, column) = from.pattern(finer);
        Coarse {
            own: Own {
                block: vec![U::Coupling::default(); column.len()],
                pivot: vec![U::Pivot::default(); n],
                inverse: vec![U::Pivot::default(); n],
                start,
                column,
            },
            diagonal: vec![U::Plain::default(); n],
            r: vec![U::Value::default(); n],
            c: vec![U::Value::default(); n],
            rest: vec![U::Value::default(); n],
            bound: vec![0.0; n],
            dirty: vec![true; n],
            from,
        }
    }

    /// The Galerkin product with the matrix of the level above, some of whose rows have changed.
    fn take(&mut self, finer: &Matrix<U>, changed: &[bool], plain: bool) {
        self.dirty.fill(false);
        for x in (0..finer.len()).filter(|&x| changed[x]) {
            self.from.row(x).for_each(|(k, _)| self.dirty[k] = true);
        }
        self.from.product(finer, &self.dirty, &mut self.own);
        for k in 0..self.dirty.len() {
            if plain {
                self.diagonal[k] = diagonal_of::<U>(&self.own.pivot[k]);
            }
            self.own.inverse[k] = U::inverse(self.own.pivot[k], self.diagonal[k]);
        }
    }
}

impl<U: Unknowns> Smoother<'_, U> {
    /// Gauss-Seidel from nothing, forwards; `rest` becomes r - A c.
    fn forwards(&self, r: &[U::Value], c: &mut [U::Value], rest: &mut [U::Value]) {
        let a = &self.a;
        for x in 0..a.len() {
            let mut own = r[x];
            for e in a.row(x) {
                own = U::minus(own, a.block[e], c[a.column[e] as usize]);
            }
            let new = U::times(self.inverse[x], own);
            c[x] = new;
            rest[x] = U::Value::default();
            for e in a.row(x) {
                let other = &mut rest[a.column[e] as usize];
                *other = U::minus_transposed(*other, a.block[e], new);
            }
        }
    }

    /// Gauss-Seidel backwards. Destroys r.
    fn backwards(&self, r: &mut [U::Value], c: &mut [U::Value]) {
        let a = &self.a;
        for x in (0..a.len()).rev() {
            let mut own = r[x];
            for e in a.row(x) {
                own = U::minus(own, a.block[e], c[a.column[e] as usize]);
            }
            let new = U::times(self.inverse[x], own);
            c[x] = new;
            for e in a.row(x) {
                let other = &mut r[a.column[e] as usize];
                *other = U::minus_transposed(*other, a.block[e], new);
            }
        }
    }

    /// Projected Gauss-Seidel, backwards and forwards; `scratch` is overwritten.
    fn bounded(&self, r: &[U::Value], scratch: &mut [U::Value], c: &mut [U::Value], bound: &[f64]) {
        let a = &self.a;
        let relax = |c: &mut [U::Value], mut own: U::Value, x: usize| {
            for e in a.row(x) {
                own = U::minus(own, a.block[e], c[a.column[e] as usize]);
            }
            c[x] = U::bounded(U::times(self.inverse[x], own), self.inverse[x], bound[x]);
        };
        scratch.copy_from_slice(r);
        for x in (0..a.len()).rev() {
            relax(c, scratch[x], x);
            for e in a.row(x) {
                let other = &mut scratch[a.column[e] as usize];
                *other = U::minus_transposed(*other, a.block[e], c[x]);
            }
        }
        for x in 0..a.len() {
            relax(c, scratch[x], x);
        }
    }
}
