//! The fans around all vertices by blocks of triangles, which threads share.
//!
//! A block first finds what [`element`](super::element) says of every corner, then the fluxes around the vertices of its triangles, and shows every element again
//! with the fluxes found. A fan that reaches into other blocks is walked by each of them, always from the same corner, so that all find the same
//! fluxes.

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use fem_core::{Neighbour, VertexId, parallel};

use super::Given;
use super::data::Data;
use super::element::{Element, Geometry, Pair, Spoke};
use super::fan::{Corner, after, before};
use super::shares::{SIGN, Shares};

/// What is done with an element when its fluxes are known.
pub(super) trait Sink: Send {
    /// `beta` holds the fluxes of s_i through the half edges from the corners to the next ones, into the corners' parts of the dual cells.
    fn element(&mut self, t: usize, element: &Element, beta: [Pair; 3]);
}

/// What all blocks read.
pub(super) struct Blocks<'a, D> {
    pub given: &'a Given<'a>,
    pub data: &'a D,
    pub shares: &'a Shares,
    triangles: &'a [[VertexId; 3]],
    neighbours: &'a [[Neighbour; 3]],
    points: &'a [[f64; 2]],
}

/// Room for a block.
#[derive(Default)]
struct Room {
    elements: Vec<Element>,
    /// Of the three corners of every element; when their fans are done, `step` holds beta.
    spokes: Vec<Spoke>,
    done: Vec<bool>,
    fan: Vec<Visit>,
}

/// A corner of a fan, and the flux beta there.
struct Visit {
    corner: Corner,
    beta: Pair,
}

/// Sums over a fan.
#[derive(Default)]
struct Sums {
    beta: Pair,
    slope: Pair,
    weight: Pair,
}

impl Sums {
    /// Goes over a corner; beta in front of it.
    #[inline(always)]
    fn pass(&mut self, spoke: &Spoke, softness: Pair) -> Pair {
        let beta = self.beta;
        self.slope += softness * (beta * spoke.weight + spoke.slope);
        self.weight += softness * spoke.weight;
        self.beta += spoke.step;
        beta
    }

    /// What is to be added to beta all around, so that the energy is least.
    #[inline(always)]
    fn shift(&self) -> Pair {
        Pair([0, 1].map(|i| -self.slope.0[i] / self.weight.0[i]))
    }
}

impl<'a, D: Data> Blocks<'a, D> {
    pub fn new(given: &'a Given<'a>, data: &'a D, shares: &'a Shares) -> Blocks<'a, D> {
        Blocks {
            given,
            data,
            shares,
            triangles: given.mesh.triangles(),
            neighbours: given.mesh.neighbours(),
            points: given.mesh.points(),
        }
    }

    /// Passes over all blocks, one sink each; O(N). The sinks are returned in the same order.
    pub fn pass<S: Sink>(&self, sinks: Vec<S>) -> Vec<S> {
        let count = self.triangles.len();
        let threads = parallel::worthwhile(self.given.threads, count);
        let rooms = Mutex::new(Vec::new());
        let free = || rooms.lock().unwrap_or_else(PoisonError::into_inner);
        let jobs = parallel::blocks(count).zip(sinks).collect();
        parallel::map(threads, jobs, |(block, mut sink)| {
            let mut room: Room = free().pop().unwrap_or_default();
            self.block(block, &mut room, &mut sink);
            free().push(room);
            sink
        })
    }

    #[inline(always)]
    fn element(&self, t: usize) -> (Element, [Spoke; 3]) {
        let v = self.triangles[t].map(|j| j.index());
        let shape = Geometry::of(v.map(|j| self.points[j]));
        let [upper, lower] = self.given.displacement;
        let displacement = v.map(|j| Pair([upper[j], lower[j]]));
        let rows = shape.rows(self.data.tension(t), displacement);
        let hats = self.data.hats(t, shape.area);
        let shares = v.map(|j| &self.shares[j]);
        let sixth = shape.area * (1.0 / 6.0);
        let mut sources = [0, 1, 2].map(|k| hats[k] * 0.5 + shares[k].cell * sixth);
        let pressed = shares.iter().any(|share| share.presses());
        if pressed {
            let action = self.data.action(t, shape.area, &hats).hats(shape.area);
            for k in 0..3 {
                sources[k] += Pair(SIGN) * (0.5 * shares[k].theta * action[k]);
            }
        }
        Element::of(&shape, rows, sources, pressed)
    }

    /// 3 m_iKj/|K|.
    pub fn balance(&self, t: usize, area: f64) -> [[f64; 2]; 3] {
        let hats = self.data.hats(t, area);
        let action = self.data.action(t, area, &hats).hats(area);
        [0, 1, 2].map(|k| {
            let own = self.shares[self.triangles[t][k].index()].theta * action[k];
            ((hats[k] + Pair(SIGN) * own) * (3.0 / area)).0
        })
    }

    fn block<S: Sink>(&self, block: Range<usize>, room: &mut Room, sink: &mut S) {
        room.elements.clear();
        room.spokes.clear();
        for t in block.clone() {
            let (element, spokes) = self.element(t);
            room.elements.push(element);
            room.spokes.extend(spokes);
        }
        room.done.clear();
        room.done.resize(3 * block.len(), false);
        let mut corner = 0;
        for triangle in block.clone() {
            for local in 0..3 {
                if !room.done[corner] {
                    let first = Corner {
                        triangle: triangle as u32,
                        local,
                    };
                    if !self.within(first, &block, room) {
                        self.across(first, &block, room);
                    }
                }
                corner += 1;
            }
        }
        let (spokes, _) = room.spokes.as_chunks::<3>();
        for (t, (element, spokes)) in block.zip(room.elements.iter().zip(spokes)) {
            sink.element(t, element, spokes.each_ref().map(|spoke| spoke.step));
        }
    }

    /// Finds the fluxes around an interior vertex whose triangles all lie in the block; false, and nothing done, for any other. `first` is the corner in the triangle
    /// with the lowest number.
    #[inline(always)]
    fn within(&self, first: Corner, block: &Range<usize>, room: &mut Room) -> bool {
        let Room {
            spokes, done, fan, ..
        } = room;
        fan.clear();
        let mut sums = Sums::default();
        let mut at = first;
        loop {
            let Some(spoke) = spokes.get(place(at, block)) else {
                return false;
            };
            let beta = sums.pass(spoke, self.data.weight(at.index()));
            fan.push(Visit { corner: at, beta });
            match after(self.neighbours, at) {
                Some(next) if next != first => at = next,
                Some(_) => break,
                None => return false,
            }
        }
        let shift = sums.shift();
        for Visit { corner, beta } in fan.iter() {
            let place = place(*corner, block);
            spokes[place].step = *beta + shift;
            done[place] = true;
        }
        true
    }

    /// The same for any vertex; what lies in other blocks is computed once more. On the boundary `first` may be any corner.
    #[inline(never)]
    fn across(&self, first: Corner, block: &Range<usize>, room: &mut Room) {
        let Room {
            spokes, done, fan, ..
        } = room;
        self.collect(first, fan);
        let mut sums = Sums::default();
        for Visit { corner, beta } in fan.iter_mut() {
            let softness = self.data.weight(corner.index());
            *beta = match spokes.get(place(*corner, block)) {
                Some(own) => sums.pass(own, softness),
                None => {
                    let (_, spokes) = self.element(corner.index());
                    sums.pass(&spokes[corner.corner()], softness)
                }
            };
        }
        let shift = sums.shift();
        for Visit { corner, beta } in fan.iter() {
            let place = place(*corner, block);
            if let Some(own) = spokes.get_mut(place) {
                own.step = *beta + shift;
                done[place] = true;
            }
        }
    }

    /// The corners around a vertex, counter-clockwise: of an interior one from that in the triangle with the lowest number, on the boundary from the one after
    /// the boundary.
    fn collect(&self, first: Corner, fan: &mut Vec<Visit>) {
        let mut begin = first;
        while let Some(previous) = before(self.neighbours, begin) {
            begin = previous;
            if begin == first {
                break;
            }
        }
        fan.clear();
        let mut next = Some(begin);
        while let Some(corner) = next {
            let beta = Pair::default();
            fan.push(Visit { corner, beta });
            next = after(self.neighbours, corner).filter(|&next| next != begin);
        }
        let last = fan
            .last()
            .and_then(|last| after(self.neighbours, last.corner));
        if last.is_some() {
            let lowest = (0..fan.len()).min_by_key(|&k| fan[k].corner.triangle);
            fan.rotate_left(lowest.unwrap_or(0));
        }
    }
}

/// Where a corner is among those of a block; beyond the end if it is in none of its triangles.
#[inline(always)]
fn place(corner: Corner, block: &Range<usize>) -> usize {
    // In front of the block this wraps around.
    let place = corner.index().wrapping_sub(block.start);
    if place < block.len() {
        3 * place + corner.corner()
    } else {
        usize::MAX
    }
}
