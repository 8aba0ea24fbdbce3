//! One cycle over all levels: the symmetric V(1,1) that preconditions, and the monotone V(0,1) that never leaves the constraint.

use super::galerkin::Levels;
use super::hierarchy::Hierarchy;
use super::unknowns::Unknowns;

/// Projected sweeps on the initial mesh in a monotone cycle.
const MACRO_SWEEPS: usize = 8;

impl<U: Unknowns> Levels<U> {
    /// c = B r: down, old rows backwards, then new ones; the initial mesh exactly; up, new rows, then old ones forwards. Destroys r.
    ///
    /// New vertices of a level are not neighbours of one another and are solved exactly, so their residual is zero and restriction
    /// is plain injection. On the way up they need no interpolated value for the same reason. `r` at a new vertex keeps
    /// what was there before its relaxation, so that c_p comes out complete; old vertices keep their first step
    /// and the residual in which neither they nor the new ones have moved.
    pub fn cycle(&mut self, hierarchy: &Hierarchy, r: &mut [U::Value], c: &mut [U::Value]) {
        let n0 = hierarchy.initial();
        for level in (1..=hierarchy.depth()).rev() {
            let rows = hierarchy.old_rows(level);
            let vertices = &hierarchy.old_vertex[rows.clone()];
            let starts = &hierarchy.old_start[rows.start..=rows.end];
            let pivots = self.old_pivot[rows.clone()].iter();
            let steps = pivots.zip(&mut self.old_step[rows.clone()]);
            let mut end = starts[rows.len()] as usize;
            let backwards = vertices.iter().zip(&starts[..rows.len()]).zip(steps);
            for ((&q, &start), (&pivot, kept)) in backwards.rev() {
                let own = &mut r[q as usize];
                let step = U::times(pivot, *own);
                *kept = step;
                *own = U::Value::default();
                let entries = start as usize..end;
                end = start as usize;
                let couplings = &self.old_coupling[entries.clone()];
                for (&edge, &a) in hierarchy.old_entry[entries].iter().zip(couplings) {
                    let other = &mut r[edge.other()];
                    *other = U::minus_transposed(*other, U::full(a), step);
                }
            }
            for (rest, &q) in self.old_residual[rows].iter_mut().zip(vertices) {
                *rest = r[q as usize];
            }
            let new = hierarchy.ranks(level);
            let young = new.start - n0..new.end - n0;
            let couplings = &self.coupling[4 * young.start..4 * young.end];
            let couplings = couplings.as_chunks::<4>().0.iter();
            let (older, own) = r.split_at_mut(new.start);
            let own = own.iter().zip(&self.pivot[new]);
            let rows = hierarchy.quad[young].iter().zip(couplings);
            for ((quad, a), (&rest, &pivot)) in rows.zip(own) {
                let step = U::times(pivot, rest);
                for k in 0..4 {
                    let other = &mut older[quad[k] as usize];
                    *other = U::minus_transposed(*other, a[k], step);
                }
            }
        }
        c[..n0].fill(U::Value::default());
        let edges = 4 * hierarchy.quad.len();
        let slots = edges..edges + hierarchy.macro_end.len();
        self.initial
            .solve(hierarchy, &self.coupling[slots], &mut r[..n0], &mut c[..n0]);
        for level in 1..=hierarchy.depth() {
            let new = hierarchy.ranks(level);
            let young = new.start - n0..new.end - n0;
            let couplings = &self.coupling[4 * young.start..4 * young.end];
            let couplings = couplings.as_chunks::<4>().0.iter();
            let (older, own) = c.split_at_mut(new.start);
            let own = own.iter_mut().zip(&r[new.clone()]);
            let own = own.zip(&self.pivot[new]);
            let rows = hierarchy.quad[young].iter().zip(couplings);
            for ((quad, a), ((own, &rest), &pivot)) in rows.zip(own) {
                let mut rest = rest;
                for k in 0..4 {
                    rest = U::minus(rest, a[k], older[quad[k] as usize]);
                }
                *own = U::times(pivot, rest);
            }
            let rows = hierarchy.old_rows(level);
            let vertices = &hierarchy.old_vertex[rows.clone()];
            let mut start = hierarchy.old_start[rows.start] as usize;
            let ends = &hierarchy.old_start[rows.start + 1..=rows.end];
            let kept = self.old_residual[rows.clone()].iter();
            let kept = kept.zip(&self.old_pivot[rows.clone()]);
            for ((&q, &end), (&rest, &pivot)) in vertices.iter().zip(ends).zip(kept) {
                let entries = start..end as usize;
                start = end as usize;
                let mut rest = rest;
                let couplings = &self.old_coupling[entries.clone()];
                for (&edge, &a) in hierarchy.old_entry[entries].iter().zip(couplings) {
                    rest = U::minus(rest, U::full(a), c[edge.other()]);
                }
                c[q as usize] = U::times(pivot, rest);
            }
            for (&q, &step) in vertices.iter().zip(&self.old_step[rows]) {
                let c = &mut c[q as usize];
                *c = U::plus(*c, 1.0, step);
            }
        }
    }

    /// The kept residual of an old row minus its couplings times c.
    #[inline]
    fn old_rest(&self, hierarchy: &Hierarchy, row: usize, c: &[U::Value]) -> U::Value {
        let entries = hierarchy.old_start[row] as usize..hierarchy.old_start[row + 1] as usize;
        let mut rest = self.old_residual[row];
        for (&edge, &a) in hierarchy.old_entry[entries.clone()]
            .iter()
            .zip(&self.old_coupling[entries])
        {
            rest = U::minus(rest, U::full(a), c[edge.other()]);
        }
        rest
    }

    /// A correction c with gap(c) >= bound that does not raise the energy; the matrices must not be truncated. Destroys r and bound.
    ///
    /// Monotone multigrid (Kornhuber 1994). `bound` is minus the gap of the iterate, 0 on the boundary. A vertex p between a and b asks of
    /// its parents `bound_a = max(bound_a, bound_p + min(0, bound_p - bound_b))`: whatever they then choose, the mean obeys the
    /// bound of p.
    pub fn monotone_cycle(
        &mut self,
        hierarchy: &Hierarchy,
        r: &mut [U::Value],
        c: &mut [U::Value],
        bound: &mut [f64],
        old_bound: &mut Vec<f64>,
    ) {
        let n0 = hierarchy.initial();
        old_bound.clear();
        old_bound.resize(hierarchy.old_vertex.len(), 0.0);
        for level in (1..=hierarchy.depth()).rev() {
            for row in hierarchy.old_rows(level) {
                let q = hierarchy.old_vertex[row] as usize;
                self.old_residual[row] = r[q];
                old_bound[row] = bound[q];
            }
            for p in hierarchy.ranks(level).filter(|&p| !hierarchy.fixed[p]) {
                let [a, b, ..] = hierarchy.quad[p - n0].map(|q| q as usize);
                for (q, other) in [(a, b), (b, a)] {
                    if !hierarchy.fixed[q] {
                        r[q] = U::plus(r[q], 0.5, r[p]);
                        let asked = bound[p] + (bound[p] - bound[other]).min(0.0);
                        bound[q] = bound[q].max(asked);
                    }
                }
            }
        }
        c[..n0].fill(U::Value::default());
        let edges = 4 * hierarchy.quad.len();
        let slots = edges..edges + hierarchy.macro_end.len();
        self.initial.relax_bounded(
            hierarchy,
            &self.coupling[slots],
            &mut r[..n0],
            &mut c[..n0],
            &bound[..n0],
            MACRO_SWEEPS,
        );
        for level in 1..=hierarchy.depth() {
            for p in hierarchy.ranks(level) {
                let mut rest = r[p];
                for k in 0..4 {
                    let q = hierarchy.quad[p - n0][k] as usize;
                    rest = U::minus(rest, self.coupling[4 * (p - n0) + k], c[q]);
                }
                c[p] = if hierarchy.fixed[p] {
                    U::Value::default()
                } else {
                    U::bounded(U::times(self.pivot[p], rest), self.pivot[p], bound[p])
                };
            }
            for row in hierarchy.old_rows(level) {
                let q = hierarchy.old_vertex[row] as usize;
                let pivot = self.old_pivot[row];
                let free = U::times(pivot, self.old_rest(hierarchy, row, c));
                c[q] = U::bounded(free, pivot, old_bound[row]);
            }
        }
    }
}
