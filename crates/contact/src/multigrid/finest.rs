//! The matrices of the finest mesh, one number an edge.

use fem_core::SymmetricMatrix;

use super::hierarchy::Hierarchy;
use super::unknowns::Unknowns;

/// One or two stiffness matrices over inner vertices, in the slots of a [`Hierarchy`]; 0 in every slot that is no edge any more.
pub(crate) struct Finest<U: Unknowns> {
    /// Entry of every slot.
    pub slot: Vec<U::Plain>,
    /// Diagonal of every rank; that of boundary vertices too.
    pub diagonal: Vec<U::Plain>,
}

impl<U: Unknowns> Finest<U> {
    /// Sorts the entries of matrices of one pattern into the slots; O(N).
    pub fn new(hierarchy: &Hierarchy, matrices: &[&SymmetricMatrix]) -> Finest<U> {
        let pattern = matrices[0].pattern();
        let mut slot = vec![U::Plain::default(); hierarchy.slots()];
        let entry = |at: usize| U::plain(|i| matrices[i].values()[at]);
        for x in (0..hierarchy.len()).filter(|&x| !hierarchy.fixed[x]) {
            let j = hierarchy.vertex[x] as usize;
            for (at, &k) in pattern.range(j).zip(pattern.columns(j)) {
                let y = hierarchy.rank[k as usize] as usize;
                if y < x
                    && !hierarchy.fixed[y]
                    && let Some(s) = hierarchy.slot(x, y)
                {
                    slot[s] = entry(at);
                }
            }
        }
        let diagonal: Vec<U::Plain> = hierarchy
            .vertex
            .iter()
            .map(|&j| entry(pattern.diagonal_position(j as usize)))
            .collect();
        Finest { slot, diagonal }
    }

    /// Share of the upper membrane in the stiffness at a rank.
    #[inline]
    pub fn share(&self, p: usize) -> f64 {
        U::share(self.diagonal[p])
    }

    /// y = A x over inner vertices; x is 0 on the boundary, y there is meaningless.
    pub fn multiply(&self, hierarchy: &Hierarchy, x: &[U::Value], y: &mut [U::Value]) {
        let n0 = hierarchy.initial();
        let zero = U::Value::default();
        for p in 0..n0 {
            y[p] = U::plus_plain(zero, self.diagonal[p], x[p]);
            let edges = hierarchy.macro_start[p] as usize..hierarchy.macro_start[p + 1] as usize;
            let slots = &self.slot[4 * hierarchy.quad.len()..];
            for m in edges {
                let q = hierarchy.macro_end[m] as usize;
                y[p] = U::plus_plain(y[p], slots[m], x[q]);
                y[q] = U::plus_plain(y[q], slots[m], x[p]);
            }
        }
        let young = hierarchy.quad.iter().zip(self.slot.chunks_exact(4));
        for ((p, (quad, a)), d) in young.enumerate().zip(&self.diagonal[n0..]) {
            let p = n0 + p;
            let own = x[p];
            let mut sum = U::plus_plain(zero, *d, own);
            for k in 0..4 {
                let q = quad[k] as usize;
                sum = U::plus_plain(sum, a[k], x[q]);
                y[q] = U::plus_plain(y[q], a[k], own);
            }
            y[p] = sum;
        }
    }
}
