//! Cuts the outline and the lines at the vertices that lie on them, so that what is left meets
//! only in common vertices.

use std::collections::HashSet;

use super::outline::{Outline, Segment, conflict, find_conflict};
use crate::error::PartEdge;
use crate::geometry::{Point, cross, distance, orient, twice_area};
use crate::{DomainError, Part};

/// A vertex of a line this close to a vertex or edge, in a domain of extent one to two, lies on it.
const SNAP: f64 = 1e-10;

/// The vertices and edges that the triangulation must have.
#[derive(Clone, Debug)]
pub(super) struct Graph {
    /// At order one.
    pub points: Vec<Point>,
    /// As the user gave them.
    pub given: Vec<Point>,
    /// Pairs of vertices, each once.
    pub edges: Vec<[usize; 2]>,
    /// Area of the domain at order one.
    pub area: f64,
    /// Whether some edges are not on the outline.
    pub has_lines: bool,
    /// Whether the outer polygon is convex; cutting may have bent it by rounding.
    pub convex: bool,
}

impl Graph {
    pub fn new(outline: &Outline) -> Result<Self, DomainError> {
        let mut graph = Self {
            points: outline
                .rings
                .iter()
                .flat_map(|r| r.points.clone())
                .collect(),
            given: outline.rings.iter().flat_map(|r| r.given.clone()).collect(),
            edges: Vec::new(),
            area: 0.0,
            has_lines: false,
            convex: true,
        };
        let mut segments = outline.ring_segments();
        let rim = segments.len();
        let on_rings = graph.points.len();
        graph.add_lines(outline, &mut segments)?;
        let cut: Vec<Vec<usize>> = segments
            .iter()
            .enumerate()
            .map(|(k, s)| graph.cut(s, if k < rim { on_rings } else { 0 }))
            .collect();
        graph.measure(outline, &cut);

        let mut known = HashSet::new();
        let mut pieces = Vec::new();
        for (k, (segment, path)) in segments.iter().zip(&cut).enumerate() {
            for pair in path.windows(2) {
                let (u, v) = (pair[0], pair[1]);
                if known.insert((u.min(v), u.max(v))) {
                    graph.has_lines |= k >= rim;
                    graph.edges.push([u, v]);
                    pieces.push(Segment {
                        ends: [u, v],
                        from: graph.points[u],
                        to: graph.points[v],
                        origin: segment.origin,
                    });
                }
            }
        }
        if !outline.lines.is_empty()
            && let Some((first, second)) = find_conflict(&pieces)
        {
            return Err(conflict(first, second));
        }
        for piece in &pieces {
            lies_inside(outline, piece)?;
        }
        Ok(graph)
    }

    /// Adds the vertices and edges of the lines.
    fn add_lines(
        &mut self,
        outline: &Outline,
        segments: &mut Vec<Segment>,
    ) -> Result<(), DomainError> {
        for line in &outline.lines {
            let mut path: Vec<usize> = Vec::new();
            for (k, (&point, &given)) in line.points.iter().zip(&line.given).enumerate() {
                let vertex = self.vertex(point, given);
                if path.last() == Some(&vertex) {
                    return Err(DomainError::RepeatedVertex {
                        part: line.part,
                        first: k,
                        second: k + 1,
                        value: given,
                    });
                }
                path.push(vertex);
            }
            for k in 0..line.edges() {
                segments.push(Segment {
                    ends: [path[k], path[k + 1]],
                    from: self.points[path[k]],
                    to: self.points[path[k + 1]],
                    origin: line.edge(k),
                });
            }
        }
        Ok(())
    }

    /// The vertex at `point`: the closest known one within [`SNAP`], or a new one.
    fn vertex(&mut self, point: Point, given: Point) -> usize {
        let near = (0..self.points.len())
            .map(|v| (distance(self.points[v], point), v))
            .filter(|&(d, _)| d <= SNAP)
            .min_by(|x, y| x.0.total_cmp(&y.0));
        match near {
            Some((_, vertex)) => vertex,
            None => {
                self.points.push(point);
                self.given.push(given);
                self.points.len() - 1
            }
        }
    }

    /// The vertices from one end of `segment` to the other, counting those from number `first` on.
    fn cut(&self, segment: &Segment, first: usize) -> Vec<usize> {
        let (a, b) = (segment.from, segment.to);
        let length = distance(a, b);
        let d = [(b[0] - a[0]) / length, (b[1] - a[1]) / length];
        let mut between: Vec<(f64, usize)> = (first..self.points.len())
            .filter(|v| !segment.ends.contains(v))
            .filter_map(|v| {
                let p = self.points[v];
                let along = (p[0] - a[0]) * d[0] + (p[1] - a[1]) * d[1];
                let off = cross(a, b, p).abs() / length;
                (off <= SNAP && along > 0.0 && along < length).then_some((along, v))
            })
            .collect();
        between.sort_by(|x, y| x.0.total_cmp(&y.0));
        let mut path = vec![segment.ends[0]];
        path.extend(between.into_iter().map(|(_, v)| v));
        path.push(segment.ends[1]);
        path
    }

    /// Area and convexity of the domain, its outline cut at the vertices of lines on it.
    fn measure(&mut self, outline: &Outline, cut: &[Vec<usize>]) {
        let mut first = 0;
        for ring in &outline.rings {
            let last = first + ring.points.len();
            let corners: Vec<Point> = cut[first..last]
                .iter()
                .flat_map(|path| &path[..path.len() - 1])
                .map(|&v| self.points[v])
                .collect();
            let twice = twice_area(&corners);
            if ring.part == Part::Outer {
                self.area += 0.5 * twice.abs();
                let n = corners.len();
                let turn =
                    |k: usize| orient(corners[k], corners[(k + 1) % n], corners[(k + 2) % n]);
                self.convex = (0..n).all(|k| turn(k) * twice.signum() >= 0.0);
            } else {
                self.area -= 0.5 * twice.abs();
            }
            first = last;
        }
    }
}

/// Checks that a piece of a line, which meets the outline at most in its ends, is inside.
fn lies_inside(outline: &Outline, piece: &Segment) -> Result<(), DomainError> {
    let PartEdge {
        part: Part::Line(line),
        number: edge,
        from,
        to,
    } = piece.origin
    else {
        return Ok(());
    };
    let middle = [
        0.5 * (piece.from[0] + piece.to[0]),
        0.5 * (piece.from[1] + piece.to[1]),
    ];
    if outline.contains(middle) {
        return Ok(());
    }
    Err(DomainError::LineOutside {
        line,
        edge,
        from,
        to,
        at: outline.frame.leave(middle),
    })
}
