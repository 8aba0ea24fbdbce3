//! The matrices of the finest mesh, one number an edge.

use fem_core::Mesh;

use super::hierarchy::{Hierarchy, refill};
use super::unknowns::{Scalar, Unknowns};

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
        // One length, so that one check of an index serves all three.
        let n = hierarchy.len();
        let (points, boundary) = (&mesh.points()[..n], &mesh.boundary()[..n]);
        let ranks = &hierarchy.rank[..n];
        for (t, v) in mesh.triangles().iter().enumerate() {
            let v = v.map(|v| v.index());
            let corner = v.map(|j| points[j]);
            let rank = v.map(|j| ranks[j]);
            let fixed = v.map(|j| boundary[j]);
            let edge =
                [(1, 2), (2, 0), (0, 1)].map(|(k, l)| [0, 1].map(|i| corner[l][i] - corner[k][i]));
            let twice = edge[2][1] * edge[1][0] - edge[2][0] * edge[1][1];
            // |K| (grad phi_k, grad phi_l) = e_k . e_l / (4 |K|), e_k the edge opposite to corner k.
            let weight = 0.5 / twice;
            let tension = U::plain(|i| weight * coefficient(i, t));
            // Face by face, the edge opposite to the corner of that number.
            let faces = [[1, 2], [2, 0], [0, 1]];
            let entries = faces.map(|[k, l]| {
                let product = edge[k][0] * edge[l][0] + edge[k][1] * edge[l][1];
                U::plain_times(product, tension)
            });
            for (corner, [i, j]) in [[1, 2], [0, 2], [0, 1]].into_iter().enumerate() {
                let diagonal = &mut self.diagonal[rank[corner] as usize];
                let partly = U::plain_plus(*diagonal, -1.0, entries[i]);
                *diagonal = U::plain_plus(partly, -1.0, entries[j]);
            }
            if fixed == [false; 3] {
                for ([k, l], entry) in faces.into_iter().zip(entries) {
                    let slot = &mut self.slot[hierarchy.slot(rank[k], rank[l])];
                    *slot = U::plain_plus(*slot, 1.0, entry);
                }
                continue;
            }
            for ([k, l], entry) in faces.into_iter().zip(entries) {
                let (inner, other) = match [fixed[k], fixed[l]] {
                    [false, false] => {
                        let slot = &mut self.slot[hierarchy.slot(rank[k], rank[l])];
                        *slot = U::plain_plus(*slot, 1.0, entry);
                        continue;
                    }
                    [true, true] => continue,
                    [false, true] => (k, l),
                    [true, false] => (l, k),
                };
                self.rim.push(Rim {
                    inner: rank[inner],
                    vertex: v[other] as u32,
                    entry,
                });
            }
        }
    }

    /// Adds `t A g` to the inner rows, g the values `at` boundary vertices of the mesh.
    pub fn add_boundary(&self, t: f64, at: impl Fn(usize) -> U::Value, y: &mut [U::Value]) {
        self.add_rim(t, at, y, U::plus_plain);
    }

    fn add_rim<V: Copy>(
        &self,
        t: f64,
        at: impl Fn(usize) -> V,
        y: &mut [V],
        plus: impl Fn(V, U::Plain, V) -> V,
    ) {
        for rim in &self.rim {
            let part = U::plain_times(t, rim.entry);
            let row = &mut y[rim.inner as usize];
            *row = plus(*row, part, at(rim.vertex as usize));
        }
    }

    /// Share of the upper membrane in the stiffness at a rank.
    #[inline]
    pub fn share(&self, p: usize) -> f64 {
        U::share(self.diagonal[p])
    }

    /// y = A x over inner vertices; x is 0 on the boundary, y there is meaningless.
    pub fn multiply(&self, hierarchy: &Hierarchy, x: &[U::Value], y: &mut [U::Value]) {
        self.product(hierarchy, x, y, U::plus_plain);
    }

    /// As [`Finest::multiply`]; `plus(x, A, y)` is x + A y.
    #[inline]
    fn product<V: Copy + Default>(
        &self,
        hierarchy: &Hierarchy,
        x: &[V],
        y: &mut [V],
        plus: impl Fn(V, U::Plain, V) -> V,
    ) {
        // One length, so that one check of an index serves both.
        let n = hierarchy.len();
        let (x, y) = (&x[..n], &mut y[..n]);
        let n0 = hierarchy.initial();
        let zero = V::default();
        for p in 0..n0 {
            y[p] = plus(zero, self.diagonal[p], x[p]);
            let edges = hierarchy.macro_start[p] as usize..hierarchy.macro_start[p + 1] as usize;
            let slots = &self.slot[4 * hierarchy.quad.len()..];
            for m in edges {
                let q = hierarchy.macro_end[m] as usize;
                y[p] = plus(y[p], slots[m], x[q]);
                y[q] = plus(y[q], slots[m], x[p]);
            }
        }
        let (slots, _) = self.slot.as_chunks::<4>();
        let young = hierarchy.quad.iter().zip(slots);
        let own = self.diagonal[n0..].iter().zip(&x[n0..]);
        for (p, ((quad, a), (&d, &own))) in (n0..n).zip(young.zip(own)) {
            let mut sum = plus(zero, d, own);
            for k in 0..4 {
                let q = quad[k] as usize;
                sum = plus(sum, a[k], x[q]);
                y[q] = plus(y[q], a[k], own);
            }
            y[p] = sum;
        }
    }
}

impl Finest<Scalar> {
    /// A (u1, u2) with the values on the boundary, in the order of the hierarchy; u is 0 there.
    pub fn multiply_both(
        &self,
        hierarchy: &Hierarchy,
        u: &[[f64; 2]],
        boundary: impl Fn(usize) -> [f64; 2],
    ) -> Vec<[f64; 2]> {
        let plus = |x: [f64; 2], a: f64, y: [f64; 2]| [x[0] + a * y[0], x[1] + a * y[1]];
        let mut product = vec![[0.0; 2]; u.len()];
        self.product(hierarchy, u, &mut product, plus);
        self.add_rim(1.0, boundary, &mut product, plus);
        product
    }
}
