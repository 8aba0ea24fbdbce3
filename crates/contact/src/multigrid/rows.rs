//! The rows of the meshes of a hierarchy: the edges around every vertex, while the mesh grows and when it is complete.

use super::hierarchy::{Hierarchy, refill};

/// An edge seen from one of its ends: the rank of the other, and which of the younger one's four slots it has.
#[derive(Clone, Copy, Default, PartialEq, Eq, Debug)]
pub(crate) struct Edge(pub(super) u32);

impl Edge {
    #[inline]
    pub(super) fn new(other: u32, k: usize) -> Edge {
        Edge(other << 2 | k as u32)
    }

    /// The rank of the other end.
    #[inline]
    pub fn other(self) -> usize {
        (self.0 >> 2) as usize
    }
}

/// The edges of every rank.
#[derive(Default)]
pub(crate) struct Rows {
    pub(super) start: Vec<u32>,
    pub(super) edge: Vec<Edge>,
}

/// The place of an edge in a row has no room in a byte: it is searched.
pub(super) const FAR: u8 = u8::MAX;

/// The rows of the mesh T_l while it grows.
pub(super) struct Growing {
    pub(super) rows: Rows,
    pub(super) end: Vec<u32>,
    /// For every slot the place of its edge in the row of the older end; in that of the younger end it is the number of the slot.
    pub(super) place: Vec<u8>,
    /// Whether a row has had an edge to the boundary.
    pub(super) near: Vec<bool>,
}

impl Growing {
    /// Room for the edges of every rank, none of them there yet.
    pub(super) fn new(mut rows: Rows, hierarchy: &Hierarchy) -> Growing {
        let (n, n0) = (hierarchy.len(), hierarchy.initial());
        let start = &mut rows.start;
        refill(start, n + 1, 0);
        // A vertex never loses an edge when the mesh is refined.
        for x in 0..n0 {
            for &y in hierarchy.macro_row(x) {
                start[x] += 1;
                start[y as usize] += 1;
            }
        }
        for (p, &[_, _, c, d]) in (n0..).zip(&hierarchy.quad) {
            start[p] += 3;
            start[c as usize] += 1;
            if d != c {
                start[p] += 1;
                start[d as usize] += 1;
            }
        }
        let mut total = 0;
        for start in start.iter_mut() {
            total += std::mem::replace(start, total);
        }
        // What is left from the mesh before is overwritten.
        rows.edge.resize(total as usize, Edge::default());
        Growing {
            end: rows.start[..n].to_vec(),
            place: vec![0; 4 * hierarchy.quad.len()],
            near: vec![false; n],
            rows,
        }
    }

    /// Appends an edge to a row; its place.
    #[inline]
    pub(super) fn push(&mut self, x: u32, edge: Edge) -> u8 {
        let x = x as usize;
        let end = &mut self.end[x];
        self.rows.edge[*end as usize] = edge;
        let place = *end - self.rows.start[x];
        *end += 1;
        place.min(u32::from(FAR)) as u8
    }

    /// Puts an edge in the place of another.
    #[inline]
    pub(super) fn put(&mut self, x: u32, place: u8, other: u32, edge: Edge) -> u8 {
        if place == FAR {
            return self.put_far(x, other, edge);
        }
        self.rows.edge[self.rows.start[x as usize] as usize + place as usize] = edge;
        place
    }

    /// Puts an edge in the place of that to `other`, which is searched.
    #[cold]
    fn put_far(&mut self, x: u32, other: u32, edge: Edge) -> u8 {
        let x = x as usize;
        let row = self.rows.start[x] as usize..self.end[x] as usize;
        let row = &mut self.rows.edge[row];
        let at = row.iter().position(|e| e.other() == other as usize);
        debug_assert!(at.is_some(), "births contradict the mesh");
        let at = at.unwrap_or(0);
        row[at] = edge;
        at.min(FAR as usize) as u8
    }

    /// The edges of a rank as far as they are there.
    #[inline]
    pub(super) fn row(&self, x: u32) -> &[Edge] {
        let x = x as usize;
        &self.rows.edge[self.rows.start[x] as usize..self.end[x] as usize]
    }
}
