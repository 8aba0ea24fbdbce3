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

use fem_core::{Birth, Mesh, VertexId};

use super::rows::{Edge, FAR, Growing, Rows};

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
    /// Every entry: its edge, seen from the old vertex; no end lies on the boundary.
    pub old_entry: Vec<Edge>,
    /// The edges of every rank in the mesh itself.
    pub rows: Rows,
}

/// Gives a vector a length and one value everywhere, in the memory that it has if that is enough.
pub(crate) fn refill<T: Clone>(vector: &mut Vec<T>, len: usize, value: T) {
    vector.clear();
    vector.reserve_exact(len);
    vector.resize(len, value);
}

/// Which of four neighbours one of them is; the first, if it is two of them.
#[inline]
fn number_in(quad: &[u32; 4], y: u32) -> usize {
    // Which one it is cannot be foretold: no branches.
    let mut k = 3;
    for i in [2, 1, 0] {
        k = if quad[i] == y { i } else { k };
    }
    debug_assert!(quad[k] == y, "no edge joins these vertices");
    k
}

impl Hierarchy {
    /// Reads the hierarchy of a mesh off its births; O(N), no searching beyond the edges of a vertex.
    ///
    /// `initial` is the order of the vertices of the initial mesh, where it is known; else they follow the leaves of this one. With `flat`
    /// the births are left aside, and the mesh itself counts as the initial one.
    pub fn read(&mut self, mesh: &Mesh, initial: Option<&[u32]>, flat: bool) {
        self.number(mesh, initial, flat);
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
        self.grow();
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

    /// The slot of an edge of some T_l between two ranks.
    #[inline]
    pub fn slot(&self, x: u32, y: u32) -> usize {
        let n0 = self.level[1];
        let (x, y) = (x.max(y), x.min(y));
        if x >= n0 {
            let k = number_in(&self.quad[(x - n0) as usize], y);
            4 * (x - n0) as usize + k
        } else {
            self.macro_slot(x, y)
        }
    }

    /// The slot of an edge of the initial mesh, the larger rank first.
    #[cold]
    fn macro_slot(&self, x: u32, y: u32) -> usize {
        let at = self.macro_row(x as usize).iter().position(|&v| v == y);
        debug_assert!(at.is_some(), "no edge joins these vertices");
        let first = self.macro_start[x as usize] as usize;
        4 * self.quad.len() + first + at.unwrap_or(0)
    }

    /// The smaller ranks that the edges of the initial mesh join to one of its ranks.
    #[inline]
    pub fn macro_row(&self, x: usize) -> &[u32] {
        &self.macro_end[self.macro_start[x] as usize..self.macro_start[x + 1] as usize]
    }

    /// The slot of an edge that is seen from x.
    #[inline]
    pub fn slot_of(&self, x: u32, edge: Edge) -> usize {
        // Both ends would call the edge so if it were theirs; it is the younger one's.
        let theirs = edge.0.max(x << 2 | edge.0 & 3);
        match theirs.checked_sub(4 * self.level[1]) {
            Some(slot) => slot as usize,
            None => {
                let other = edge.0 >> 2;
                self.macro_slot(x.max(other), x.min(other))
            }
        }
    }

    /// The edges of a rank in the mesh itself: other end and slot.
    #[inline]
    pub fn edges(&self, x: usize) -> impl Iterator<Item = (usize, usize)> + '_ {
        let row = self.rows.start[x] as usize..self.rows.start[x + 1] as usize;
        let edges = self.rows.edge[row].iter();
        edges.map(move |&edge| (edge.other(), self.slot_of(x as u32, edge)))
    }

    /// Bisects level by level, and notes the slots around every new vertex and the rows of its parents.
    fn grow(&mut self) {
        let n0 = self.initial();
        let mut growing = Growing::new(std::mem::take(&mut self.rows), self);
        let mut around = std::mem::take(&mut self.around);
        around.clear();
        around.reserve_exact(self.quad.len());
        let [mut old_level, mut old_vertex, mut old_start] = [
            &mut self.old_level,
            &mut self.old_vertex,
            &mut self.old_start,
        ]
        .map(std::mem::take);
        old_level.clear();
        old_level.push(0);
        old_vertex.clear();
        old_start.clear();
        old_start.push(0);
        let mut old_entry = std::mem::take(&mut self.old_entry);
        old_entry.clear();
        for x in 0..n0 {
            for &y in self.macro_row(x) {
                growing.push(x as u32, Edge::new(y, 0));
                growing.push(y, Edge::new(x as u32, 0));
                growing.near[x] |= self.fixed[y as usize];
                growing.near[y as usize] |= self.fixed[x];
            }
        }
        // The level in which a vertex was listed as old last; one on the boundary never is.
        let never = |&fixed: &bool| if fixed { u16::MAX } else { 0 };
        let mut listed: Vec<u16> = self.fixed.iter().map(never).collect();
        for level in 1..=self.depth() {
            let first = old_vertex.len();
            let ranks = self.ranks(level);
            let quads = &self.quad[ranks.start - n0..ranks.end - n0];
            for (p, quad) in ranks.zip(quads) {
                let rim = self.fixed[p] || quad.iter().any(|&q| self.fixed[q as usize]);
                let ab = self.bisect(&mut growing, p, quad, rim);
                around.push(self.slots_around(quad, ab, rim));
                for &q in &quad[..2] {
                    let seen = &mut listed[q as usize];
                    if *seen < level as u16 {
                        *seen = level as u16;
                        old_vertex.push(q);
                    }
                }
            }
            for &q in &old_vertex[first..] {
                let row = growing.row(q);
                if growing.near[q as usize] {
                    let inner = |edge: &&Edge| !self.fixed[edge.other()];
                    old_entry.extend(row.iter().filter(inner));
                } else {
                    old_entry.extend_from_slice(row);
                }
                old_start.push(old_entry.len() as u32);
            }
            old_level.push(old_vertex.len() as u32);
        }
        old_vertex.shrink_to_fit();
        old_start.shrink_to_fit();
        old_entry.shrink_to_fit();
        self.around = around;
        self.old_level = old_level;
        self.old_vertex = old_vertex;
        self.old_start = old_start;
        self.old_entry = old_entry;
        self.rows = growing.rows;
    }

    /// Bisects the edge ab at p: in the rows of a and b the edge to p stands where that between them stood. `rim` tells whether one of the
    /// five lies on the boundary. The slot of ab.
    #[inline]
    fn bisect(&self, growing: &mut Growing, p: usize, quad: &[u32; 4], rim: bool) -> usize {
        let n0 = self.initial();
        let &[a, b, c, d] = quad;
        let (young, old) = (a.max(b), a.min(b));
        let mut place = [FAR; 2];
        let slot = if young as usize >= n0 {
            let at = young as usize - n0;
            let k = number_in(&self.quad[at], old);
            let slot = 4 * at + k;
            let other = growing.place[slot];
            place = if a > b {
                [k as u8, other]
            } else {
                [other, k as u8]
            };
            slot
        } else {
            self.macro_slot(young, old)
        };
        let edge = p as u32;
        let mut own = [
            growing.put(a, place[0], b, Edge::new(edge, 0)),
            growing.put(b, place[1], a, Edge::new(edge, 1)),
            growing.push(c, Edge::new(edge, 2)),
            0,
        ];
        let end = growing.rows.start[p] as usize + 3;
        growing.rows.edge[end - 3..end].copy_from_slice(&[
            Edge::new(a, 0),
            Edge::new(b, 1),
            Edge::new(c, 2),
        ]);
        growing.end[p] = end as u32;
        if d != c {
            own[3] = growing.push(d, Edge::new(edge, 3));
            growing.push(edge, Edge::new(d, 3));
        }
        growing.place[4 * (p - n0)..][..4].copy_from_slice(&own);
        if rim {
            for &q in quad {
                growing.near[q as usize] |= self.fixed[p];
                growing.near[p] |= self.fixed[q as usize];
            }
        }
        slot
    }

    /// The slots of the edges ab (which is known), ac, bc, ad, bd around a new vertex; `rim` as in [`Hierarchy::bisect`].
    #[inline]
    fn slots_around(&self, quad: &[u32; 4], ab: usize, rim: bool) -> [u32; 5] {
        let &[a, b, c, d] = quad;
        let edges = [[a, c], [b, c], [a, d], [b, d]];
        let [ac, bc, ad, bd] = edges.map(|[x, y]| self.slot(x, y) as u32);
        let around = [ab as u32, ac, bc, ad, bd];
        if !rim {
            return around;
        }
        let [a, b, c, d] = quad.map(|q| self.fixed[q as usize]);
        let fixed = [a || b, a || c, b || c, a || d, b || d];
        [0, 1, 2, 3, 4].map(|i| if fixed[i] { self.nowhere() } else { around[i] })
    }

    /// Numbers the vertices by level, within a level along the leaves.
    fn number(&mut self, mesh: &Mesh, initial: Option<&[u32]>, flat: bool) {
        let births = mesh.genealogy();
        let level = |birth: &Birth| if flat { 0 } else { birth.level as usize };
        refill(&mut self.level, 2, 0);
        for birth in births {
            let after = level(birth) + 1;
            if after >= self.level.len() {
                self.level.resize(after + 1, 0);
            }
            self.level[after] += 1;
        }
        for l in 1..self.level.len() {
            self.level[l] += self.level[l - 1];
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
        for v in mesh.triangles().as_flattened() {
            let j = v.index();
            let rank = &mut self.rank[j];
            if *rank == u32::MAX {
                let at = &mut next[level(&births[j])];
                self.vertex[*at as usize] = j as u32;
                *rank = *at;
                *at += 1;
            }
        }
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
