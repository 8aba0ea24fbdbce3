//! The initial mesh: a sparse Cholesky factor of its truncated matrix, or multigrid over aggregates ([`super::algebraic`]) if it is large.

use std::hash::{DefaultHasher, Hash, Hasher};

use super::algebraic::Algebraic;
use super::hierarchy::Hierarchy;
use super::unknowns::{EMPTY, Unknowns};
use crate::cholesky::{Cholesky, FactorError, Lower};
use crate::error::SolveError;

/// Added to every diagonal, relative to it: truncated hat functions may be linearly dependent, and a direction without energy has no
/// effect.
const SHIFT: f64 = 1e-12;

/// A factor is renewed at every change while the initial mesh has at most one in so many of the vertices: it then costs less than a
/// cycle.
const SMALL: usize = 30;

/// Beyond that it is renewed when a diagonal has changed by more than this factor; until then it is a preconditioner nearly as good.
const CHANGE: f64 = 1.25;

/// An initial mesh with more inner vertices than this is large: aggregates take the place of its factor.
pub(super) const LARGE: usize = 5000;

/// Where a value of the factored matrix comes from.
#[derive(Clone, Copy)]
enum Source {
    /// Component (i, j) of a diagonal block.
    Pivot(u32, u8, u8),
    /// Component (i, j) of the coupling of an edge.
    Edge(u32, u8, u8),
}

/// Exact solutions on the initial mesh.
#[derive(Default)]
pub(crate) struct MacroSolver<U: Unknowns> {
    /// Inner vertices of the initial mesh, in order.
    pub inner: Vec<u32>,
    /// Diagonal blocks of the last sweep and their inverses, for projected relaxation.
    block: Vec<[U::Pivot; 2]>,
    /// Larger neighbours of every inner vertex, as (vertex, edge).
    larger: Vec<[u32; 2]>,
    larger_start: Vec<u32>,
    lower: Lower,
    source: Vec<Source>,
    cholesky: Option<Cholesky>,
    factored: Vec<f64>,
    rhs: Vec<f64>,
    always: bool,
    /// For a large mesh, and then nothing else is.
    algebraic: Option<Box<Algebraic<U>>>,
    /// Numeric factorisations since it was fitted last.
    pub factorisations: usize,
    /// What it was made for: the edges of the initial mesh and its boundary, as far as a hash tells.
    fingerprint: Option<u64>,
}

impl<U: Unknowns> MacroSolver<U> {
    /// Takes in the initial mesh of a hierarchy; pattern, analysis and factor are kept while that is the same.
    pub fn fit(&mut self, hierarchy: &Hierarchy) {
        let fingerprint = fingerprint(hierarchy);
        if self.fingerprint != Some(fingerprint) {
            *self = MacroSolver::new(hierarchy);
            self.fingerprint = Some(fingerprint);
        }
        self.always = self.inner.len() * SMALL <= hierarchy.len();
        self.factorisations = 0;
        if let Some(algebraic) = &mut self.algebraic {
            algebraic.renew();
        }
    }

    /// Whether the untruncated matrix has to come before any truncated one.
    pub fn plain_first(&self) -> bool {
        self.algebraic.as_ref().is_some_and(|a| a.unmade())
    }

    /// Whether every matrix is factored for itself, so that a solution does not depend on those before it.
    pub fn is_small(&self) -> bool {
        self.always && self.inner.len() <= LARGE
    }

    /// The pattern; it is analysed when it is factored first.
    fn new(hierarchy: &Hierarchy) -> MacroSolver<U> {
        let n0 = hierarchy.initial();
        let inner: Vec<u32> = (0..n0 as u32)
            .filter(|&x| !hierarchy.fixed[x as usize])
            .collect();
        if inner.len() > LARGE {
            return MacroSolver {
                inner,
                algebraic: Some(Box::default()),
                ..MacroSolver::default()
            };
        }
        let mut unknown = vec![u32::MAX; n0];
        for (k, &x) in inner.iter().enumerate() {
            unknown[x as usize] = k as u32;
        }
        let mut larger_start = vec![0u32; n0 + 1];
        let edges = || {
            (0..n0).flat_map(|x| {
                (hierarchy.macro_start[x]..hierarchy.macro_start[x + 1])
                    .map(move |m| (x, hierarchy.macro_end[m as usize] as usize, m))
            })
        };
        let both = |x: usize, y: usize| !hierarchy.fixed[x] && !hierarchy.fixed[y];
        for (x, y, _) in edges() {
            larger_start[y + 1] += u32::from(both(x, y));
        }
        for y in 0..n0 {
            larger_start[y + 1] += larger_start[y];
        }
        let mut next = larger_start.clone();
        let mut larger = vec![[0u32; 2]; larger_start[n0] as usize];
        for (x, y, m) in edges() {
            if both(x, y) {
                larger[next[y] as usize] = [x as u32, m];
                next[y] += 1;
            }
        }
        let mut lower = Lower {
            start: vec![0],
            ..Lower::default()
        };
        let mut source = Vec::new();
        let w = U::WIDTH;
        for (k, &y) in inner.iter().enumerate() {
            let around = larger_start[y as usize] as usize..larger_start[y as usize + 1] as usize;
            for j in 0..w {
                for i in j..w {
                    lower.row.push((w * k + i) as u32);
                    source.push(Source::Pivot(y, i as u8, j as u8));
                }
                for &[x, m] in &larger[around.clone()] {
                    for i in 0..w {
                        lower.row.push(w as u32 * unknown[x as usize] + i as u32);
                        source.push(Source::Edge(m, i as u8, j as u8));
                    }
                }
                lower.start.push(lower.row.len() as u32);
            }
        }
        lower.value = vec![0.0; lower.row.len()];
        MacroSolver {
            block: vec![[U::Pivot::default(); 2]; n0],
            larger,
            larger_start,
            rhs: vec![0.0; w * inner.len()],
            always: false,
            inner,
            lower,
            source,
            algebraic: None,
            cholesky: None,
            factored: Vec::new(),
            factorisations: 0,
            fingerprint: None,
        }
    }

    /// Takes the matrix of the initial mesh and factors it, unless the factor at hand still serves; `plain` says that it is not truncated.
    pub fn prepare(
        &mut self,
        hierarchy: &Hierarchy,
        pivot: &[U::Pivot],
        coupling: &[U::Coupling],
        diagonal: &[U::Plain],
        plain: bool,
    ) -> Result<(), SolveError> {
        let explain = |e| match e {
            FactorError::Pivot(row) => SolveError::NotPositiveDefinite {
                vertex: hierarchy.vertex[self.inner[row / U::WIDTH] as usize] as usize,
            },
            FactorError::TooLarge(order) => SolveError::TooLarge { order },
        };
        if let Some(algebraic) = &mut self.algebraic {
            let factored = algebraic.prepare(hierarchy, pivot, coupling, diagonal, plain);
            self.factorisations += usize::from(factored.map_err(explain)?);
            return Ok(());
        }
        for &y in &self.inner {
            let y = y as usize;
            self.block[y] = [pivot[y], U::inverse(pivot[y], diagonal[y])];
        }
        let mut same = true;
        let mut close = true;
        for (at, source) in self.source.iter().enumerate() {
            let value = match *source {
                Source::Edge(m, i, j) => {
                    U::coupling_at(coupling[m as usize], i as usize, j as usize)
                }
                Source::Pivot(y, i, j) => {
                    let own = U::pivot_at(pivot[y as usize], i as usize, j as usize);
                    let plain = U::plain_at(diagonal[y as usize], i as usize);
                    let value = if i != j {
                        own
                    } else if own > EMPTY * plain {
                        own * (1.0 + SHIFT)
                    } else {
                        plain
                    };
                    if i == j && !self.factored.is_empty() {
                        let change = value / self.factored[at];
                        close &= change < CHANGE && change * CHANGE > 1.0;
                    }
                    value
                }
            };
            same &= self.factored.get(at) == Some(&value);
            self.lower.value[at] = value;
        }
        if self.inner.is_empty() || same || (close && !self.always && !self.factored.is_empty()) {
            return Ok(());
        }
        let cholesky = match &mut self.cholesky {
            Some(cholesky) => cholesky,
            none => none.insert(Cholesky::analyse(&self.lower).map_err(explain)?),
        };
        self.factorisations += 1;
        self.factored.clear();
        cholesky.factor(&self.lower).map_err(explain)?;
        self.factored.extend_from_slice(&self.lower.value);
        Ok(())
    }

    /// c = A_0^(-1) r on the initial mesh, or one cycle on a large one. Destroys r.
    pub fn solve(
        &mut self,
        hierarchy: &Hierarchy,
        coupling: &[U::Coupling],
        r: &mut [U::Value],
        c: &mut [U::Value],
    ) {
        if let Some(algebraic) = &mut self.algebraic {
            return algebraic.cycle(hierarchy, coupling, r, c);
        }
        let w = U::WIDTH;
        let Some(cholesky) = &mut self.cholesky else {
            return;
        };
        for (k, &x) in self.inner.iter().enumerate() {
            for i in 0..w {
                self.rhs[w * k + i] = U::at(r[x as usize], i);
            }
        }
        cholesky.solve(&mut self.rhs);
        for (k, &x) in self.inner.iter().enumerate() {
            c[x as usize] = U::value(|i| self.rhs[w * k + i]);
        }
    }

    /// Relaxes every vertex under its bound, forwards and backwards; `r` is the residual that belongs to `c`, which is 0 on a large mesh:
    /// there it is one monotone cycle.
    pub fn relax_bounded(
        &mut self,
        hierarchy: &Hierarchy,
        coupling: &[U::Coupling],
        r: &mut [U::Value],
        c: &mut [U::Value],
        bound: &[f64],
        sweeps: usize,
    ) {
        if let Some(algebraic) = &mut self.algebraic {
            return algebraic.monotone_cycle(hierarchy, coupling, r, c, bound);
        }
        let mut relax = |x: usize| {
            let [block, inverse] = self.block[x];
            let free = U::plus(c[x], 1.0, U::times(inverse, r[x]));
            let new = U::bounded(free, inverse, bound[x]);
            let step = U::plus(new, -1.0, c[x]);
            c[x] = new;
            r[x] = U::plus(r[x], -1.0, U::times(block, step));
            for m in hierarchy.macro_start[x] as usize..hierarchy.macro_start[x + 1] as usize {
                let y = hierarchy.macro_end[m] as usize;
                r[y] = U::minus_transposed(r[y], coupling[m], step);
            }
            let list = self.larger_start[x] as usize..self.larger_start[x + 1] as usize;
            for &[y, m] in &self.larger[list] {
                r[y as usize] = U::minus(r[y as usize], coupling[m as usize], step);
            }
        };
        for _ in 0..sweeps {
            for &x in &self.inner {
                relax(x as usize);
            }
            for &x in self.inner.iter().rev() {
                relax(x as usize);
            }
        }
    }
}

/// A hash of the edges of the initial mesh and of its boundary.
fn fingerprint(hierarchy: &Hierarchy) -> u64 {
    let mut hash = DefaultHasher::new();
    let n0 = hierarchy.initial();
    hierarchy.macro_start.hash(&mut hash);
    hierarchy.macro_end.hash(&mut hash);
    hierarchy.fixed[..n0].hash(&mut hash);
    hash.finish()
}
