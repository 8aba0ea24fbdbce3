//! The matrices of all levels: Galerkin products on truncated hat functions, by undoing one bisection after the other.

use super::coarse::MacroSolver;
use super::finest::Finest;
use super::hierarchy::Hierarchy;
use super::unknowns::Unknowns;
use crate::error::SolveError;

/// Rows of every level that are smoothed there, and the solver of the initial mesh.
#[derive(Default)]
pub(crate) struct Levels<U: Unknowns> {
    /// After a sweep: of every vertex the couplings on the level that it belongs to.
    pub coupling: Vec<U::Coupling>,
    /// After a sweep: of every vertex the inverse diagonal block on that level.
    pub pivot: Vec<U::Pivot>,
    /// Entries of the old rows, seen from the old vertex.
    pub old_coupling: Vec<U::Coupling>,
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
        self.coupling
            .resize(hierarchy.slots(), U::Coupling::default());
        self.pivot.resize(hierarchy.len(), U::Pivot::default());
        let entries = hierarchy.old_slot.len();
        self.old_coupling.resize(entries, U::Coupling::default());
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
        self.fill(hierarchy, finest, contact);
        let n0 = hierarchy.initial();
        for level in (1..=hierarchy.depth()).rev() {
            self.copy_old_rows(hierarchy, finest, level);
            for p in hierarchy.ranks(level) {
                let quad = &hierarchy.quad[p - n0];
                let [ab, ac, bc, ad, bd] = hierarchy.around[p - n0].map(|s| s as usize);
                let own = 4 * (p - n0);
                let [al, be, ga, de] = [0, 1, 2, 3].map(|k| self.coupling[own + k]);
                let pivot = self.pivot[p];
                let [a, b, c, d] = *quad;
                let parents = [a as usize, b as usize];
                for (q, to) in parents.into_iter().zip([al, be]) {
                    self.pivot[q] = U::inherit(self.pivot[q], to, pivot);
                }
                let row_a = U::rejoin(al, be, pivot);
                self.coupling[ab] = if a > b { row_a } else { U::transpose(row_a) };
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
                    self.coupling[slot] = U::plus_half(self.coupling[slot], half);
                }
                self.pivot[p] = U::inverse(pivot, finest.diagonal[p]);
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

    /// The truncated matrix of the finest mesh.
    fn fill(&mut self, hierarchy: &Hierarchy, finest: &Finest<U>, contact: &[bool]) {
        let n0 = hierarchy.initial();
        let free = contact.is_empty() || !contact.contains(&true);
        let glued = |q: usize| (!free && contact[q]).then(|| finest.share(q));
        for p in 0..hierarchy.len() {
            self.pivot[p] = if hierarchy.fixed[p] {
                U::Pivot::default()
            } else {
                U::truncated_pivot(finest.diagonal[p], glued(p))
            };
        }
        let slots = finest.slot.chunks_exact(4);
        let couplings = self.coupling.chunks_exact_mut(4).zip(slots);
        if free {
            for (to, from) in couplings.take(hierarchy.quad.len()) {
                for k in 0..4 {
                    to[k] = U::truncated(from[k], None, None);
                }
            }
        } else {
            for ((p, quad), (to, from)) in hierarchy.quad.iter().enumerate().zip(couplings) {
                let row = glued(n0 + p);
                for k in 0..4 {
                    to[k] = U::truncated(from[k], row, glued(quad[k] as usize));
                }
            }
        }
        let edges = 4 * hierarchy.quad.len();
        for x in 0..n0 {
            let list = hierarchy.macro_start[x] as usize..hierarchy.macro_start[x + 1] as usize;
            for m in list {
                self.coupling[edges + m] = U::truncated(
                    finest.slot[edges + m],
                    glued(x),
                    glued(hierarchy.macro_end[m] as usize),
                );
            }
        }
    }

    fn copy_old_rows(&mut self, hierarchy: &Hierarchy, finest: &Finest<U>, level: usize) {
        for row in hierarchy.old_rows(level) {
            let q = hierarchy.old_vertex[row];
            self.old_pivot[row] = U::inverse(self.pivot[q as usize], finest.diagonal[q as usize]);
            let entries = hierarchy.old_start[row] as usize..hierarchy.old_start[row + 1] as usize;
            for e in entries {
                let c = self.coupling[hierarchy.old_slot[e] as usize];
                self.old_coupling[e] = if q > hierarchy.old_column[e] {
                    c
                } else {
                    U::transpose(c)
                };
            }
        }
    }
}
