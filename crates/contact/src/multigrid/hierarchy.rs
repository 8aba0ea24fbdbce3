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

use crate::problem::DiscreteProblem;

/// The order of elimination, the slots of all edges and the rows to be smoothed.
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
}

/// The rows of the mesh T_l while it grows: other end and slot of every edge.
struct Rows {
    start: Vec<u32>,
    end: Vec<u32>,
    entry: Vec<[u32; 2]>,
}

impl Rows {
    fn new(problem: &DiscreteProblem, vertex: &[u32]) -> Rows {
        let mut start = Vec::with_capacity(vertex.len());
        let mut total = 0u32;
        for &j in vertex {
            start.push(total);
            // A vertex never loses an edge when the mesh is refined.
            total += problem.pattern.range(j as usize).len() as u32 - 1;
        }
        Rows {
            end: start.clone(),
            start,
            entry: vec![[0; 2]; total as usize],
        }
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

    #[inline]
    fn row(&self, x: u32) -> &[[u32; 2]] {
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

impl Hierarchy {
    /// Reads the hierarchy off the births; O(N), no searching beyond the edges of a vertex.
    pub fn new(problem: &DiscreteProblem) -> Hierarchy {
        let (vertex, rank, level) = by_level(problem);
        let n0 = level[1] as usize;
        let fixed: Vec<bool> = vertex
            .iter()
            .map(|&j| problem.boundary[j as usize])
            .collect();
        let boundary = (0..fixed.len() as u32)
            .filter(|&p| fixed[p as usize])
            .collect();
        let quad: Vec<[u32; 4]> = vertex[n0..]
            .iter()
            .map(|&j| {
                let birth = &problem.genealogy[j as usize];
                let [a, b] = birth.parents.map(|v| rank[v.index()]);
                let c = rank[birth.opposite[0].index()];
                let d = Some(birth.opposite[1]).filter(|d| d.is_some());
                [a, b, c, d.map_or(c, |d| rank[d.index()])]
            })
            .collect();
        let (macro_start, macro_end) = macro_edges(problem, &vertex, &rank, n0);
        let mut hierarchy = Hierarchy {
            around: Vec::with_capacity(quad.len()),
            old_level: vec![0],
            old_vertex: Vec::new(),
            old_start: vec![0],
            old_column: Vec::new(),
            old_slot: Vec::new(),
            vertex,
            rank,
            level,
            fixed,
            boundary,
            quad,
            macro_start,
            macro_end,
        };
        hierarchy.grow(problem);
        hierarchy
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
    fn grow(&mut self, problem: &DiscreteProblem) {
        let nowhere = self.nowhere();
        let n0 = self.initial();
        let mut rows = Rows::new(problem, &self.vertex);
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
                    for &[other, slot] in rows.row(*q) {
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
    }
}

/// Vertices by level, within a level along the leaves; the way back; the first rank of every level.
fn by_level(problem: &DiscreteProblem) -> (Vec<u32>, Vec<u32>, Vec<u32>) {
    let births = &problem.genealogy;
    let depth = births.iter().map(|b| b.level).max().unwrap_or(0) as usize;
    let mut level = vec![0u32; depth + 2];
    for birth in births.iter() {
        level[birth.level as usize + 1] += 1;
    }
    for l in 0..=depth {
        level[l + 1] += level[l];
    }
    let mut next = level.clone();
    let mut vertex = vec![0u32; births.len()];
    let mut rank = vec![0u32; births.len()];
    for &j in problem.along_leaves.iter() {
        let at = &mut next[births[j as usize].level as usize];
        vertex[*at as usize] = j;
        rank[j as usize] = *at;
        *at += 1;
    }
    (vertex, rank, level)
}

/// The edges of the initial mesh, by their larger rank: those that are edges still, and those that were bisected.
fn macro_edges(
    problem: &DiscreteProblem,
    vertex: &[u32],
    rank: &[u32],
    n0: usize,
) -> (Vec<u32>, Vec<u32>) {
    let mut edges: Vec<[u32; 2]> = Vec::new();
    for x in 0..n0 {
        for &k in problem.pattern.columns(vertex[x] as usize) {
            let y = rank[k as usize];
            if (y as usize) < x {
                edges.push([x as u32, y]);
            }
        }
    }
    for birth in problem.genealogy.iter().filter(|b| b.level > 0) {
        let [a, b] = birth.parents.map(|v| rank[v.index()]);
        if (a as usize) < n0 && (b as usize) < n0 {
            edges.push([a.max(b), a.min(b)]);
        }
    }
    let mut start = vec![0u32; n0 + 1];
    for [x, _] in &edges {
        start[*x as usize + 1] += 1;
    }
    for x in 0..n0 {
        start[x + 1] += start[x];
    }
    let mut next = start.clone();
    let mut end = vec![0u32; edges.len()];
    for [x, y] in edges {
        end[next[x as usize] as usize] = y;
        next[x as usize] += 1;
    }
    for x in 0..n0 {
        end[start[x] as usize..start[x + 1] as usize].sort_unstable();
    }
    (start, end)
}
