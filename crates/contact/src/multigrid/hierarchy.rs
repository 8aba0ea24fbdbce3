//! The bisection hierarchy of a mesh, read off the births of its vertices.
//!
//! Undoing all bisections above level l leaves the mesh T_l. A vertex p of level l then has exactly the four neighbours (a, b, c, d)
//! of its birth, and only the hat functions of its parents a, b differ between T_l and T_(l-1). Smoothing on every level the
//! new vertices and those *old* ones, the parents, is the local multigrid of Chen, Nochetto, Xu (2012); the rows of
//! all levels together are O(N) whatever the depth. Nothing here needs a compatible labelling: the level of a vertex is one more than the highest
//! around it, so that undoing by levels is one of the orders in which the bisections can be undone.
//!
//! Vertices are numbered level by level (*ranks*), within a level in the order in which the leaves touch them, so that the vertices of
//! T_l are a prefix of every array. Every edge of every T_l was made together with its younger end p and joins it to one of a, b, c, d:
//! it is slot 4 (p - n_0) + k of a flat array, n_0 the size of the initial mesh, whose own edges follow behind.

use fem_core::{Birth, Mesh, Neighbour, VertexId};

/// The order of elimination, the slots of all edges and the rows to be smoothed.
///
/// Its arrays are kept from one mesh to the next ([`Hierarchy::read`]): fresh memory costs more than what is written to it.
#[derive(Default)]
pub(crate) struct Hierarchy {
    /// Mesh vertex of every rank.
    pub vertex: Vec<u32>,
    /// Rank of every mesh vertex.
    pub rank: Vec<u32>,
    /// First rank of every level, and the number of vertices.
    pub level: Vec<u32>,
    /// Whether a rank lies on the boundary.
    pub fixed: Vec<bool>,
    /// The ranks on the boundary.
    pub boundary: Vec<u32>,
    /// Ranks of a, b, c, d for every rank from n_0 on; d is c again on the boundary.
    pub quad: Vec<[u32; 4]>,
    /// Slots of the edges ab, ac, bc, ad, bd for every rank from n_0 on; [`Hierarchy::nowhere`] where an end lies on the boundary.
    pub around: Vec<[u32; 5]>,
    /// Edges of the initial mesh by their larger rank: start of every list, and the end.
    pub macro_start: Vec<u32>,
    /// Smaller rank of every edge of the initial mesh.
    pub macro_end: Vec<u32>,
    /// First old row of every level from 1 on, and the number of old rows.
    pub old_level: Vec<u32>,
    /// Rank of every old row.
    pub old_vertex: Vec<u32>,
    /// Start of every old row's entries, and their number.
    pub old_start: Vec<u32>,
    /// Rank of the other end of every entry; no end lies on the boundary.
    pub old_column: Vec<u32>,
    /// Slot of every entry.
    pub old_slot: Vec<u32>,
    /// The edges of every rank in the mesh itself.
    pub rows: Rows,
}

/// The rows of the mesh T_l while it grows: other end and slot of every edge.
#[derive(Default)]
pub(crate) struct Rows {
    start: Vec<u32>,
    end: Vec<u32>,
    entry: Vec<[u32; 2]>,
}

impl Rows {
    /// Makes room for the edges of every rank, none of them there yet.
    fn clear(&mut self, degree: &[u32], vertex: &[u32]) {
        refill(&mut self.start, vertex.len(), 0);
        let mut total = 0u32;
        for (start, &j) in self.start.iter_mut().zip(vertex) {
            *start = total;
            // A vertex never loses an edge when the mesh is refined.
            total += degree[j as usize];
        }
        self.end.clear();
        self.end.extend_from_slice(&self.start);
        // What is left from the mesh before is overwritten.
        self.entry.resize(total as usize, [0; 2]);
    }

    #[inline]
    fn push(&mut self, x: u32, other: u32, slot: u32) {
        let end = &mut self.end[x as usize];
        self.entry[*end as usize] = [other, slot];
        *end += 1;
    }

    #[inline]
    fn row_mut(&mut self, x: u32) -> &mut [[u32; 2]] {
        &mut self.entry[self.start[x as usize] as usize..self.end[x as usize] as usize]
    }

    /// All edges are there: every row ends where the next begins.
    fn complete(&mut self) {
        self.start.push(self.entry.len() as u32);
        self.end = Vec::new();
    }

    /// The edges of a rank: other end and slot. Complete rows only.
    #[inline]
    pub fn row(&self, x: u32) -> &[[u32; 2]] {
        &self.entry[self.start[x as usize] as usize..self.start[x as usize + 1] as usize]
    }

    /// The edges of a rank as far as they are there.
    #[inline]
    fn present(&self, x: u32) -> &[[u32; 2]] {
        &self.entry[self.start[x as usize] as usize..self.end[x as usize] as usize]
    }

    /// Puts (p, slot) in the place of the edge to `from`; the slots of that edge and of those to `c` and `d`.
    #[inline]
    fn replace(&mut self, x: u32, from: u32, to: [u32; 2], c: u32, d: u32) -> [u32; 3] {
        let mut found = [u32::MAX; 3];
        for entry in self.row_mut(x) {
            let [other, slot] = *entry;
            if other == from {
                found[0] = slot;
                *entry = to;
            } else {
                if other == c {
                    found[1] = slot;
                }
                if other == d {
                    found[2] = slot;
                }
            }
        }
        debug_assert!(!found.contains(&u32::MAX), "births contradict the mesh");
        found
    }
}

/// Gives a vector a length and one value everywhere, in the memory that it has if that is enough.
pub(crate) fn refill<T: Clone>(vector: &mut Vec<T>, len: usize, value: T) {
    vector.clear();
    vector.reserve_exact(len);
    vector.resize(len, value);
}

impl Hierarchy {
    /// Reads the hierarchy of a mesh off its births; O(N), no searching beyond the edges of a vertex.
    ///
    /// `initial` is the order of the vertices of the initial mesh, where it is known; else they follow the leaves of this one. With `flat`
    /// the births are left aside, and the mesh itself counts as the initial one.
    pub fn read(&mut self, mesh: &Mesh, initial: Option<&[u32]>, flat: bool) {
        let degree = self.number(mesh, initial, flat);
        let n0 = self.initial();
        let boundary = mesh.boundary();
        self.fixed.clear();
        self.fixed
            .extend(self.vertex.iter().map(|&j| boundary[j as usize]));
        self.boundary.clear();
        self.boundary
            .extend((0..self.fixed.len() as u32).filter(|&p| self.fixed[p as usize]));
        let births = mesh.genealogy();
        let rank = &self.rank;
        self.quad.clear();
        self.quad.reserve_exact(self.vertex.len() - n0);
        self.quad.extend(self.vertex[n0..].iter().map(|&j| {
            let birth = &births[j as usize];
            let [a, b] = birth.parents.map(|v| rank[v.index()]);
            let c = rank[birth.opposite[0].index()];
            let d = Some(birth.opposite[1]).filter(|d| d.is_some());
            [a, b, c, d.map_or(c, |d| rank[d.index()])]
        }));
        self.macro_edges(mesh);
        self.grow(&degree);
    }

    /// The order of the vertices of the initial mesh, for [`Hierarchy::read`] on the next mesh.
    pub fn initial_order(&self) -> &[u32] {
        &self.vertex[..self.initial()]
    }

    /// Number of vertices.
    pub fn len(&self) -> usize {
        self.vertex.len()
    }

    /// Sets values on the boundary to zero.
    pub fn clear_fixed<T: Default>(&self, values: &mut [T]) {
        for &p in &self.boundary {
            values[p as usize] = T::default();
        }
    }

    /// n_0, the number of vertices of the initial mesh.
    #[inline]
    pub fn initial(&self) -> usize {
        self.level[1] as usize
    }

    /// The highest level.
    pub fn depth(&self) -> usize {
        self.level.len() - 2
    }

    /// Ranks of the vertices of a level.
    #[inline]
    pub fn ranks(&self, level: usize) -> std::ops::Range<usize> {
        self.level[level] as usize..self.level[level + 1] as usize
    }

    /// The old rows of a level from 1 on.
    #[inline]
    pub fn old_rows(&self, level: usize) -> std::ops::Range<usize> {
        self.old_level[level - 1] as usize..self.old_level[level] as usize
    }

    /// Number of slots, that of edges with an end on the boundary included.
    pub fn slots(&self) -> usize {
        self.nowhere() as usize + 1
    }

    /// The slot of all edges with an end on the boundary: written, never read.
    #[inline]
    pub fn nowhere(&self) -> u32 {
        (4 * self.quad.len() + self.macro_end.len()) as u32
    }

    /// The slot of an edge of the mesh between two inner ranks, the larger first.
    #[inline]
    pub fn slot(&self, x: usize, y: usize) -> Option<usize> {
        let n0 = self.initial();
        if x >= n0 {
            let q = &self.quad[x - n0];
            let k = q.iter().position(|&v| v as usize == y)?;
            Some(4 * (x - n0) + k)
        } else {
            let list = self.macro_start[x] as usize..self.macro_start[x + 1] as usize;
            let k = self.macro_end[list.clone()]
                .iter()
                .position(|&v| v as usize == y)?;
            Some(4 * self.quad.len() + list.start + k)
        }
    }

    /// Bisects level by level, and notes the slots around every new vertex and the rows of its parents.
    fn grow(&mut self, degree: &[u32]) {
        let nowhere = self.nowhere();
        let n0 = self.initial();
        let mut rows = std::mem::take(&mut self.rows);
        rows.clear(degree, &self.vertex);
        self.around.clear();
        self.around.reserve_exact(self.quad.len());
        self.old_level.clear();
        self.old_level.push(0);
        self.old_vertex.clear();
        self.old_start.clear();
        self.old_start.push(0);
        self.old_column.clear();
        self.old_slot.clear();
        for x in 0..n0 {
            for m in self.macro_start[x]..self.macro_start[x + 1] {
                let y = self.macro_end[m as usize];
                let slot = if self.fixed[x] || self.fixed[y as usize] {
                    nowhere
                } else {
                    4 * self.quad.len() as u32 + m
                };
                rows.push(x as u32, y, slot);
                rows.push(y, x as u32, slot);
            }
        }
        // The level in which a vertex was listed as old last.
        let mut listed = vec![0u16; self.len()];
        for level in 1..=self.depth() {
            for p in self.ranks(level) {
                let quad = self.quad[p - n0];
                let [a, b, c, d] = quad;
                let edge = p as u32;
                let mut own = [nowhere; 4];
                if !self.fixed[p] {
                    for k in 0..4 {
                        if !self.fixed[quad[k] as usize] {
                            own[k] = (4 * (p - n0) + k) as u32;
                        }
                    }
                }
                let [ab, ac, ad] = rows.replace(a, b, [edge, own[0]], c, d);
                let [_, bc, bd] = rows.replace(b, a, [edge, own[1]], c, d);
                rows.push(c, edge, own[2]);
                for k in 0..3 {
                    rows.push(edge, quad[k], own[k]);
                }
                if d != c {
                    rows.push(d, edge, own[3]);
                    rows.push(edge, d, own[3]);
                }
                self.around.push([ab, ac, bc, ad, bd]);
            }
            for p in self.ranks(level) {
                for q in &self.quad[p - n0][..2] {
                    let seen = &mut listed[*q as usize];
                    if self.fixed[*q as usize] || *seen == level as u16 {
                        continue;
                    }
                    *seen = level as u16;
                    self.old_vertex.push(*q);
                    for &[other, slot] in rows.present(*q) {
                        if slot != nowhere {
                            self.old_column.push(other);
                            self.old_slot.push(slot);
                        }
                    }
                    self.old_start.push(self.old_column.len() as u32);
                }
            }
            self.old_level.push(self.old_vertex.len() as u32);
        }
        rows.complete();
        for grown in [
            &mut self.old_vertex,
            &mut self.old_start,
            &mut self.old_column,
            &mut self.old_slot,
        ] {
            grown.shrink_to_fit();
        }
        self.rows = rows;
    }

    /// Numbers the vertices by level, within a level along the leaves; the number of edges of every vertex of the mesh.
    fn number(&mut self, mesh: &Mesh, initial: Option<&[u32]>, flat: bool) -> Vec<u32> {
        let births = mesh.genealogy();
        let level = |birth: &Birth| if flat { 0 } else { birth.level as usize };
        let depth = births.iter().map(level).max().unwrap_or(0);
        refill(&mut self.level, depth + 2, 0);
        for birth in births {
            self.level[level(birth) + 1] += 1;
        }
        for l in 0..=depth {
            self.level[l + 1] += self.level[l];
        }
        let n0 = self.level[1] as usize;
        let mut next = self.level.clone();
        refill(&mut self.vertex, births.len(), 0);
        refill(&mut self.rank, births.len(), u32::MAX);
        if let Some(initial) = initial.filter(|order| order.len() == n0) {
            for (p, &j) in initial.iter().enumerate() {
                self.vertex[p] = j;
                self.rank[j as usize] = p as u32;
            }
        }
        let mut degree = vec![0u32; births.len()];
        for (v, around) in mesh.triangles().iter().zip(mesh.neighbours()) {
            for (i, v) in v.iter().enumerate() {
                let j = v.index();
                // Every corner of a triangle begins one edge of it; an edge on the boundary has no triangle that would count its end.
                degree[j] += 1 + u32::from(around[(i + 1) % 3] == Neighbour::BOUNDARY);
                if self.rank[j] == u32::MAX {
                    let at = &mut next[level(&births[j])];
                    self.vertex[*at as usize] = j as u32;
                    self.rank[j] = *at;
                    *at += 1;
                }
            }
        }
        degree
    }

    /// The edges of the initial mesh, by their larger rank: those that are edges still, and those that were bisected.
    fn macro_edges(&mut self, mesh: &Mesh) {
        let n0 = self.initial();
        let rank = &self.rank;
        let mut edges: Vec<[u32; 2]> = Vec::new();
        let mut add = |a: VertexId, b: VertexId| {
            let [x, y] = [a, b].map(|v| rank[v.index()]);
            edges.push([x.max(y), x.min(y)]);
        };
        // Vertices keep their numbers, so those of the initial mesh come first there too.
        let initial = |v: VertexId| v.index() < n0;
        for (t, (v, around)) in mesh.triangles().iter().zip(mesh.neighbours()).enumerate() {
            if v.iter().filter(|&&v| initial(v)).count() < 2 {
                continue;
            }
            for face in 0..3 {
                let (a, b) = (v[(face + 1) % 3], v[(face + 2) % 3]);
                let own = around[face]
                    .get()
                    .is_none_or(|(other, _)| other.index() > t);
                if own && initial(a) && initial(b) {
                    add(a, b);
                }
            }
        }
        for birth in &mesh.genealogy()[n0..] {
            let [a, b] = birth.parents;
            if initial(a) && initial(b) {
                add(a, b);
            }
        }
        let start = &mut self.macro_start;
        refill(start, n0 + 1, 0);
        for [x, _] in &edges {
            start[*x as usize + 1] += 1;
        }
        for x in 0..n0 {
            start[x + 1] += start[x];
        }
        let mut next = start.clone();
        refill(&mut self.macro_end, edges.len(), 0);
        for [x, y] in edges {
            self.macro_end[next[x as usize] as usize] = y;
            next[x as usize] += 1;
        }
        for x in 0..n0 {
            self.macro_end[start[x] as usize..start[x + 1] as usize].sort_unstable();
        }
    }
}
