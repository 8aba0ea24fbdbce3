//! Validates what the user wrote: every polygon on its own, then all of them together.
//!
//! All decisions use exact predicates on coordinates that an exact change of scale has brought to
//! order one.

use crate::error::PartEdge;
use crate::geometry::{Frame, Meeting, Point, bounds, in_box, inside, meeting, orient};
use crate::{DomainError, Part};

/// Smallest coordinate, beside a domain of extent one, that is not zero.
const TINY: f64 = 1e-30;

/// A list of points, at order one and as given.
#[derive(Clone, Debug)]
pub(super) struct Chain {
    pub part: Part,
    pub points: Vec<Point>,
    pub given: Vec<Point>,
}

impl Chain {
    /// Edge `k`, from vertex `k` to the next one (of a polygon: cyclically).
    pub fn edge(&self, k: usize) -> PartEdge {
        let next = (k + 1) % self.given.len();
        PartEdge {
            part: self.part,
            number: k + 1,
            from: self.given[k],
            to: self.given[next],
        }
    }

    /// Number of edges.
    pub fn edges(&self) -> usize {
        match self.part {
            Part::Line(_) => self.points.len() - 1,
            Part::Outer | Part::Hole(_) => self.points.len(),
        }
    }
}

/// A valid polygonal domain; its lines are only checked one by one.
#[derive(Clone, Debug)]
pub(super) struct Outline {
    pub frame: Frame,
    /// The outer polygon, then the holes.
    pub rings: Vec<Chain>,
    pub lines: Vec<Chain>,
}

/// An edge with the vertices it joins, for [`find_conflict`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Segment {
    /// Vertex numbers: equal numbers are the same point.
    pub ends: [usize; 2],
    pub from: Point,
    pub to: Point,
    pub origin: PartEdge,
}

impl Outline {
    pub fn new(
        outer: &[Point],
        holes: &[Vec<Point>],
        lines: &[Vec<Point>],
    ) -> Result<Self, DomainError> {
        let mut rings = vec![given(Part::Outer, outer)?];
        for (k, hole) in holes.iter().enumerate() {
            rings.push(given(Part::Hole(k + 1), hole)?);
        }
        let mut chains = Vec::new();
        for (k, line) in lines.iter().enumerate() {
            chains.push(given(Part::Line(k + 1), line)?);
        }
        let all: Vec<Point> = rings
            .iter()
            .chain(&chains)
            .flat_map(|c| c.given.clone())
            .collect();
        let frame = Frame::new(&all).map_err(|extent| DomainError::Extent { extent })?;
        for chain in rings.iter_mut().chain(&mut chains) {
            chain.points = chain.given.iter().map(|&p| frame.enter(p)).collect();
            not_tiny(chain)?;
        }
        let outline = Self {
            frame,
            rings,
            lines: chains,
        };
        for ring in &outline.rings {
            has_area(ring)?;
            no_repeats(ring)?;
        }
        if let Some((first, second)) = find_conflict(&outline.ring_segments()) {
            return Err(conflict(first, second));
        }
        outline.holes_inside()?;
        Ok(outline)
    }

    /// The edges of all polygons, vertices numbered through.
    pub fn ring_segments(&self) -> Vec<Segment> {
        let mut segments = Vec::new();
        let mut base = 0;
        for ring in &self.rings {
            let n = ring.points.len();
            for k in 0..n {
                let next = (k + 1) % n;
                segments.push(Segment {
                    ends: [base + k, base + next],
                    from: ring.points[k],
                    to: ring.points[next],
                    origin: ring.edge(k),
                });
            }
            base += n;
        }
        segments
    }

    /// Whether `p`, at order one, lies in the domain; for points off the outline.
    pub fn contains(&self, p: Point) -> bool {
        let (outer, holes) = (&self.rings[0], &self.rings[1..]);
        inside(&outer.points, p) && !holes.iter().any(|hole| inside(&hole.points, p))
    }

    fn holes_inside(&self) -> Result<(), DomainError> {
        let holes = &self.rings[1..];
        let boxes: Vec<_> = holes
            .iter()
            .map(|h| bounds(h.points.iter().copied()))
            .collect();
        for (k, hole) in holes.iter().enumerate() {
            let at = hole.points[0];
            if !inside(&self.rings[0].points, at) {
                return Err(DomainError::HoleOutside {
                    hole: k + 1,
                    at: hole.given[0],
                });
            }
            for (m, other) in holes.iter().enumerate() {
                let close = boxes[m].is_some_and(|[low, high]| in_box(low, high, at));
                if m != k && close && inside(&other.points, at) {
                    return Err(DomainError::HoleInHole {
                        inner: k + 1,
                        outer: m + 1,
                        at: hole.given[0],
                    });
                }
            }
        }
        Ok(())
    }
}

/// A list of enough finite points, neighbours different; the closing point of a polygon dropped.
fn given(part: Part, points: &[Point]) -> Result<Chain, DomainError> {
    for (k, &value) in points.iter().enumerate() {
        if !value.iter().all(|x| x.is_finite()) {
            return Err(DomainError::VertexNotFinite {
                part,
                vertex: k + 1,
                value,
            });
        }
    }
    let closed = !matches!(part, Part::Line(_));
    let mut points = points;
    if let [first, .., last] = points
        && closed
        && first == last
    {
        points = &points[..points.len() - 1];
    }
    let needed = if closed { 3 } else { 2 };
    if points.len() < needed {
        return Err(DomainError::TooFewPoints {
            part,
            found: points.len(),
            needed,
        });
    }
    let n = points.len();
    for k in 0..if closed { n } else { n - 1 } {
        let next = (k + 1) % n;
        if points[k] == points[next] {
            return Err(DomainError::RepeatedVertex {
                part,
                first: k + 1,
                second: next + 1,
                value: points[k],
            });
        }
    }
    Ok(Chain {
        part,
        points: Vec::new(),
        given: points.to_vec(),
    })
}

fn not_tiny(chain: &Chain) -> Result<(), DomainError> {
    let tiny = |p: &Point| p.iter().any(|&x| x != 0.0 && x.abs() < TINY);
    match chain.points.iter().position(tiny) {
        None => Ok(()),
        Some(k) => Err(DomainError::VertexTiny {
            part: chain.part,
            vertex: k + 1,
            value: chain.given[k],
        }),
    }
}

fn has_area(ring: &Chain) -> Result<(), DomainError> {
    let [a, b, rest @ ..] = ring.points.as_slice() else {
        return Err(DomainError::ZeroArea { part: ring.part });
    };
    if rest.iter().all(|&c| orient(*a, *b, c) == 0.0) {
        return Err(DomainError::ZeroArea { part: ring.part });
    }
    Ok(())
}

fn no_repeats(ring: &Chain) -> Result<(), DomainError> {
    let mut order: Vec<usize> = (0..ring.points.len()).collect();
    let key = |k: usize| ring.points[k];
    order.sort_by(|&i, &j| {
        key(i)
            .partial_cmp(&key(j))
            .unwrap_or(std::cmp::Ordering::Equal)
            .then(i.cmp(&j))
    });
    match order.windows(2).find(|pair| key(pair[0]) == key(pair[1])) {
        None => Ok(()),
        Some(pair) => Err(DomainError::RepeatedVertex {
            part: ring.part,
            first: pair[0] + 1,
            second: pair[1] + 1,
            value: ring.given[pair[0]],
        }),
    }
}

/// Two segments that have more in common than a vertex they both name.
///
/// A sweep along the longer side of the bounding box: only segments whose shadows overlap are
/// compared.
pub(super) fn find_conflict(segments: &[Segment]) -> Option<(PartEdge, PartEdge)> {
    let [low, high] = bounds(segments.iter().flat_map(|s| [s.from, s.to]))?;
    let axis = usize::from(high[1] - low[1] > high[0] - low[0]);
    let start = |s: &Segment| s.from[axis].min(s.to[axis]);
    let end = |s: &Segment| s.from[axis].max(s.to[axis]);
    let mut order: Vec<&Segment> = segments.iter().collect();
    order.sort_by(|s, t| start(s).total_cmp(&start(t)));
    for (i, s) in order.iter().enumerate() {
        for t in order[i + 1..].iter().take_while(|t| start(t) <= end(s)) {
            if in_conflict(s, t) {
                let (s, t) = (s.origin, t.origin);
                // Polygons before lines, and by number.
                let rank = |e: &PartEdge| match e.part {
                    Part::Outer => (0, 0, e.number),
                    Part::Hole(k) => (1, k, e.number),
                    Part::Line(k) => (2, k, e.number),
                };
                return Some(if rank(&s) <= rank(&t) { (s, t) } else { (t, s) });
            }
        }
    }
    None
}

fn in_conflict(s: &Segment, t: &Segment) -> bool {
    let shared = s.ends.iter().position(|v| t.ends.contains(v));
    let Some(i) = shared else {
        return meeting(s.from, s.to, t.from, t.to) != Meeting::Apart;
    };
    // They name a common vertex `p`; the other ends must not lie in the same direction.
    let pick = |s: &Segment, first: bool| if first { s.from } else { s.to };
    let (p, a) = (pick(s, i == 0), pick(s, i != 0));
    let b = pick(t, t.ends[0] != s.ends[i]);
    orient(p, a, b) == 0.0 && (in_box(p, a, b) || in_box(p, b, a))
}

/// The error for two edges in conflict.
pub(super) fn conflict(first: PartEdge, second: PartEdge) -> DomainError {
    match (first.part, second.part) {
        (Part::Line(_), _) | (_, Part::Line(_)) => DomainError::LineCrosses {
            first: second,
            second: first,
        },
        (p, q) if p == q => DomainError::SelfIntersection { first, second },
        _ => DomainError::PolygonsMeet { first, second },
    }
}
