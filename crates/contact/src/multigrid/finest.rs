//! The matrices of the finest mesh, one number an edge.

use fem_core::Mesh;

use super::hierarchy::{Hierarchy, refill};
use super::unknowns::Unknowns;

/// One or two stiffness matrices over inner vertices, in the slots of a [`Hierarchy`]; 0 in every slot that is no edge any more.
#[derive(Default)]
pub(crate) struct Finest<U: Unknowns> {
    /// Entry of every slot.
    pub slot: Vec<U::Plain>,
    /// Diagonal of every rank; that of boundary vertices too.
    pub diagonal: Vec<U::Plain>,
    /// Entries between an inner vertex and one on the boundary, those of the two triangles of an edge apart.
    rim: Vec<Rim<U>>,
}

/// A part of the entry between an inner rank and a boundary vertex of the mesh.
#[derive(Clone, Copy)]
struct Rim<U: Unknowns> {
    inner: u32,
    vertex: u32,
    entry: U::Plain,
}

impl<U: Unknowns> Finest<U> {
    /// The matrices with entries `sum_K c_iK (grad phi_k, grad phi_l)_K`; `coefficient` holds c_iK for field i and triangle K. O(N).
    ///
    /// The diagonal is minus the sum of the rest of its row, so that constants lie in the kernel to rounding.
    pub fn assemble(
        &mut self,
        hierarchy: &Hierarchy,
        mesh: &Mesh,
        coefficient: impl Fn(usize, usize) -> f64,
    ) {
        let zero = U::Plain::default();
        refill(&mut self.slot, hierarchy.slots(), zero);
        refill(&mut self.diagonal, hierarchy.len(), zero);
        self.rim.clear();
        let points = mesh.points();
        for (t, v) in mesh.triangles().iter().enumerate() {
            let v = v.map(|v| v.index());
            let corner = v.map(|j| points[j]);
            let rank = v.map(|j| hierarchy.rank[j] as usize);
            let edge =
                [(1, 2), (2, 0), (0, 1)].map(|(k, l)| [0, 1].map(|i| corner[l][i] - corner[k][i]));
            let twice = edge[2][1] * edge[1][0] - edge[2][0] * edge[1][1];
            // |K| (grad phi_k, grad phi_l) = e_k . e_l / (4 |K|), e_k the edge opposite to corner k.
            let weight = 0.5 / twice;
            let tension = U::plain(|i| weight * coefficient(i, t));
            for face in 0..3 {
                let (k, l) = ((face + 1) % 3, (face + 2) % 3);
                let product = edge[k][0] * edge[l][0] + edge[k][1] * edge[l][1];
                let entry = U::plain_times(product, tension);
                let (x, y) = (rank[k].max(rank[l]), rank[k].min(rank[l]));
                self.diagonal[x] = U::plain_plus(self.diagonal[x], -1.0, entry);
                self.diagonal[y] = U::plain_plus(self.diagonal[y], -1.0, entry);
                match [hierarchy.fixed[x], hierarchy.fixed[y]] {
                    [false, false] => {
                        if let Some(s) = hierarchy.slot(x, y) {
                            self.slot[s] = U::plain_plus(self.slot[s], 1.0, entry);
                        }
                    }
                    [true, true] => {}
                    [upper, _] => {
                        let (inner, other) = if upper { (y, x) } else { (x, y) };
                        self.rim.push(Rim {
                            inner: inner as u32,
                            vertex: hierarchy.vertex[other],
                            entry,
                        });
                    }
                }
            }
        }
    }

    /// Adds `t A g` to the inner rows, g the values `at` boundary vertices of the mesh.
    pub fn add_boundary(&self, t: f64, at: impl Fn(usize) -> U::Value, y: &mut [U::Value]) {
        for rim in &self.rim {
            let part = U::plain_times(t, rim.entry);
            let row = &mut y[rim.inner as usize];
            *row = U::plus_plain(*row, part, at(rim.vertex as usize));
        }
    }

    /// The entry in a slot between two ranks.
    #[inline]
    pub fn at(&self, slot: u32) -> U::Plain {
        self.slot[slot as usize]
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
