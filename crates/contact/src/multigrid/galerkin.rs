//! The matrices of all levels: Galerkin products on truncated hat functions, by undoing one bisection after the other.

use super::coarse::MacroSolver;
use super::finest::Finest;
use super::hierarchy::Hierarchy;
use super::unknowns::Unknowns;
use crate::error::SolveError;

/// Up to one vertex in so many in contact, the edges around those alone are truncated.
const FEW: usize = 4;

/// Rows of every level that are smoothed there, and the solver of the initial mesh.
#[derive(Default)]
pub(crate) struct Levels<U: Unknowns> {
    /// After a sweep: of every vertex the couplings on the level that it belongs to.
    pub coupling: Vec<U::Coupling>,
    /// After a sweep: of every vertex the inverse diagonal block on that level.
    pub pivot: Vec<U::Pivot>,
    /// Entries of the old rows, seen from the old vertex; only the cycle reads them, and nothing comes of their rounding.
    pub old_coupling: Vec<U::Light>,
    /// Inverse diagonal blocks of the old rows.
    pub old_pivot: Vec<U::Pivot>,
    /// Scratch of a cycle: what the way down did to the old rows.
    pub old_step: Vec<U::Value>,
    /// Scratch of a cycle: residuals of the old rows on their level.
    pub old_residual: Vec<U::Value>,
    /// Vectors of the last descent, for the next: fresh memory costs more than the arithmetic on it.
    pub spare: Vec<Vec<U::Value>>,
    /// The initial mesh.
    pub initial: MacroSolver<U>,
}

impl<U: Unknowns> Levels<U> {
    /// Memory for the matrices of a hierarchy; no values yet.
    pub fn fit(&mut self, hierarchy: &Hierarchy) {
        let rows = hierarchy.old_vertex.len();
        // These are filled by every sweep.
        self.coupling.clear();
        self.coupling.reserve_exact(hierarchy.slots());
        self.pivot.clear();
        self.pivot.reserve_exact(hierarchy.len());
        let entries = hierarchy.old_entry.len();
        self.old_coupling.resize(entries, U::Light::default());
        self.old_pivot.resize(rows, U::Pivot::default());
        self.old_step.resize(rows, U::Value::default());
        self.old_residual.resize(rows, U::Value::default());
        self.initial.fit(hierarchy);
    }

    /// Gives up all memory but that of the initial mesh and the spare vectors.
    pub fn forget(&mut self) {
        *self = Levels {
            initial: std::mem::take(&mut self.initial),
            spare: std::mem::take(&mut self.spare),
            ..Levels::default()
        };
    }

    /// A vector of some length from the spare ones; its values are whatever they were.
    pub fn vector(&mut self, len: usize) -> Vec<U::Value> {
        let mut vector = self.spare.pop().unwrap_or_default();
        vector.reserve_exact(len.saturating_sub(vector.len()));
        vector.resize(len, U::Value::default());
        vector
    }

    /// A vector with given values in the memory of a spare one.
    pub fn filled(&mut self, values: impl ExactSizeIterator<Item = U::Value>) -> Vec<U::Value> {
        let mut vector = self.spare.pop().unwrap_or_default();
        vector.clear();
        vector.reserve_exact(values.len());
        vector.extend(values);
        vector
    }

    /// The matrices of all levels with the hat functions truncated on `contact`, which is empty for none; O(N).
    ///
    /// With c_p = (c_a + c_b)/2 for the vertex p that halved the edge ab, its couplings al, be, ga, de to a, b, c, d and its diagonal
    /// block pi, undoing the bisection means: aa += (al + al')/2 + pi/4, bb likewise, ab = (al' + be)/2 + pi/4, ac, bc += ga/2, ad,
    /// bd += de/2 (rows a and b).
    pub fn sweep(
        &mut self,
        hierarchy: &Hierarchy,
        finest: &Finest<U>,
        contact: &[bool],
    ) -> Result<(), SolveError> {
        let plain = contact.is_empty() || !contact.contains(&true);
        if !plain && self.initial.plain_first() {
            self.sweep(hierarchy, finest, &[])?;
        }
        self.fill(hierarchy, finest, if plain { &[] } else { contact });
        let n0 = hierarchy.initial();
        for level in (1..=hierarchy.depth()).rev() {
            self.copy_old_rows(hierarchy, finest, level);
            let ranks = hierarchy.ranks(level);
            let young = ranks.start - n0..ranks.end - n0;
            let vertices = hierarchy.quad[young.clone()].iter();
            let vertices = vertices.zip(&hierarchy.around[young.clone()]);
            let (older, pivots) = self.pivot.split_at_mut(ranks.start);
            let pivots = pivots.iter_mut().zip(&finest.diagonal[ranks]);
            let coupling = &mut self.coupling[..];
            for ((own, (quad, around)), (pivot, &diagonal)) in young.zip(vertices).zip(pivots) {
                let (own, _) = coupling[4 * own..4 * own + 4].as_chunks::<4>();
                let [al, be, ga, de] = own[0];
                let &[a, b, c, d] = quad;
                for (q, to) in [(a, al), (b, be)] {
                    let parent = &mut older[q as usize];
                    *parent = U::inherit(*parent, to, *pivot);
                }
                let [ab, ac, bc, ad, bd] = around.map(|slot| slot as usize);
                let row_a = U::rejoin(al, be, *pivot);
                coupling[ab] = if a > b { row_a } else { U::transpose(row_a) };
                for (slot, row, column, half) in [
                    (ac, a, c, ga),
                    (bc, b, c, ga),
                    (ad, a, d, de),
                    (bd, b, d, de),
                ] {
                    let half = if row > column {
                        half
                    } else {
                        U::transpose(half)
                    };
                    let entry = &mut coupling[slot];
                    *entry = U::plus_half(*entry, half);
                }
                *pivot = U::inverse(*pivot, diagonal);
            }
        }
        let edges = 4 * hierarchy.quad.len();
        let slots = edges..edges + hierarchy.macro_end.len();
        self.initial.prepare(
            hierarchy,
            &self.pivot[..n0],
            &self.coupling[slots],
            &finest.diagonal[..n0],
            plain,
        )
    }

    /// The matrix of the finest mesh, truncated on `contact`, which is empty for none.
    fn fill(&mut self, hierarchy: &Hierarchy, finest: &Finest<U>, contact: &[bool]) {
        let diagonal = finest.diagonal.iter();
        self.pivot.clear();
        self.pivot
            .extend(diagonal.map(|&d| U::truncated_pivot(d, None)));
        hierarchy.clear_fixed(&mut self.pivot);
        let slots = finest.slot.iter();
        self.coupling.clear();
        self.coupling
            .extend(slots.map(|&a| U::truncated(a, None, None)));
        // Nothing joins the boundary in the first place.
        let touching = contact.iter().zip(&hierarchy.fixed).enumerate();
        let touching = touching.filter(|(_, (contact, fixed))| **contact && !**fixed);
        let mut count = 0;
        for (p, _) in touching.clone() {
            self.pivot[p] = U::truncated_pivot(finest.diagonal[p], Some(finest.share(p)));
            count += 1;
        }
        let glued = |q: usize| contact[q].then(|| finest.share(q));
        if count * FEW <= contact.len() {
            for (p, _) in touching {
                for (q, slot) in hierarchy.edges(p).filter(|&(q, _)| !hierarchy.fixed[q]) {
                    let (row, column) = (p.max(q), p.min(q));
                    self.coupling[slot] =
                        U::truncated(finest.slot[slot], glued(row), glued(column));
                }
            }
            return;
        }
        let n0 = hierarchy.initial();
        let (own, initial) = self.coupling.split_at_mut(4 * hierarchy.quad.len());
        let (own, _) = own.as_chunks_mut::<4>();
        let young = hierarchy.quad.iter().zip(own).zip(&contact[n0..]);
        for (p, ((quad, own), &row)) in young.enumerate() {
            let column = quad.map(|q| contact[q as usize]);
            if row || column != [false; 4] {
                let row = glued(n0 + p);
                for k in 0..4 {
                    let entry = finest.slot[4 * p + k];
                    own[k] = U::truncated(entry, row, glued(quad[k] as usize));
                }
            }
        }
        for x in 0..n0 {
            let first = hierarchy.macro_start[x] as usize;
            for (m, &y) in (first..).zip(hierarchy.macro_row(x)) {
                let entry = finest.slot[4 * hierarchy.quad.len() + m];
                initial[m] = U::truncated(entry, glued(x), glued(y as usize));
            }
        }
    }

    fn copy_old_rows(&mut self, hierarchy: &Hierarchy, finest: &Finest<U>, level: usize) {
        let rows = hierarchy.old_rows(level);
        let mut start = hierarchy.old_start[rows.start] as usize;
        let pivots = self.old_pivot[rows.clone()].iter_mut();
        let ends = &hierarchy.old_start[rows.start + 1..=rows.end];
        for ((pivot, &end), &q) in pivots.zip(ends).zip(&hierarchy.old_vertex[rows]) {
            *pivot = U::inverse(self.pivot[q as usize], finest.diagonal[q as usize]);
            let entries = start..end as usize;
            start = end as usize;
            let couplings = self.old_coupling[entries.clone()].iter_mut();
            for (to, &edge) in couplings.zip(&hierarchy.old_entry[entries]) {
                let c = self.coupling[hierarchy.slot_of(q, edge)];
                *to = U::light(if q as usize > edge.other() {
                    c
                } else {
                    U::transpose(c)
                });
            }
        }
    }
}
