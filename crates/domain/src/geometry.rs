//! Plane geometry that is exact where it decides something: orientation, containment, scaling.

use robust::{Coord, orient2d};

/// A point of the plane.
pub type Point = [f64; 2];

/// Twice the signed area of the triangle `a b c`, positive when counter-clockwise.
///
/// The sign is exact for finite input whose products neither overflow nor underflow; scale with
/// [`Frame`] first where that is not certain.
pub fn orient(a: Point, b: Point, c: Point) -> f64 {
    let coord = |p: Point| Coord { x: p[0], y: p[1] };
    orient2d(coord(a), coord(b), coord(c))
}

/// How two closed segments meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Meeting {
    /// No common point.
    Apart,
    /// They cross in one point that is interior to both.
    Cross,
    /// An end point of one lies on the other, or they share a piece of a line.
    Touch,
}

/// How the closed segments `a b` and `c d` meet (exact, see [`orient`]).
pub fn meeting(a: Point, b: Point, c: Point, d: Point) -> Meeting {
    if !boxes_meet(a, b, c, d) {
        return Meeting::Apart;
    }
    let (abc, abd) = (orient(a, b, c), orient(a, b, d));
    let (cda, cdb) = (orient(c, d, a), orient(c, d, b));
    let apart = |s: f64, t: f64| s != 0.0 && t != 0.0 && (s > 0.0) == (t > 0.0);
    if apart(abc, abd) || apart(cda, cdb) {
        return Meeting::Apart;
    }
    if abc != 0.0 && abd != 0.0 && cda != 0.0 && cdb != 0.0 {
        Meeting::Cross
    } else {
        // Some end point is collinear with the other segment, and the boxes meet: for segments
        // that are not collinear the common point of the lines is that end point; collinear ones
        // with meeting boxes overlap.
        let on = |p, q, r| in_box(p, q, r);
        let touches = (abc == 0.0 && on(a, b, c))
            || (abd == 0.0 && on(a, b, d))
            || (cda == 0.0 && on(c, d, a))
            || (cdb == 0.0 && on(c, d, b));
        if touches {
            Meeting::Touch
        } else {
            Meeting::Apart
        }
    }
}

fn boxes_meet(a: Point, b: Point, c: Point, d: Point) -> bool {
    (0..2).all(|k| a[k].min(b[k]) <= c[k].max(d[k]) && c[k].min(d[k]) <= a[k].max(b[k]))
}

/// Whether `p` lies in the closed box spanned by `a` and `b`.
pub fn in_box(a: Point, b: Point, p: Point) -> bool {
    (0..2).all(|k| a[k].min(b[k]) <= p[k] && p[k] <= a[k].max(b[k]))
}

/// Whether `p` lies strictly inside the simple polygon `ring` (either orientation).
///
/// Counts the edges that a ray to the right crosses, half-open in `y`; exact, see [`orient`].
/// A point on an edge may be reported either way.
pub fn inside(ring: &[Point], p: Point) -> bool {
    let mut odd = false;
    for (i, &b) in ring.iter().enumerate() {
        let a = ring[(i + ring.len() - 1) % ring.len()];
        if (a[1] > p[1]) != (b[1] > p[1]) {
            let (low, high) = if a[1] < b[1] { (a, b) } else { (b, a) };
            if orient(low, high, p) > 0.0 {
                odd = !odd;
            }
        }
    }
    odd
}

/// Twice the signed area of a polygon, summed relative to its first vertex.
pub fn twice_area(ring: &[Point]) -> f64 {
    let mut sum = Sum::default();
    for i in 1..ring.len().saturating_sub(1) {
        sum.add(cross(ring[0], ring[i], ring[i + 1]));
    }
    sum.value()
}

/// Twice the signed area of `a b c` in plain floating point.
pub fn cross(a: Point, b: Point, c: Point) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Distance between two points, without premature overflow or underflow.
pub fn distance(a: Point, b: Point) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// Smallest and largest coordinates, `None` without points.
pub fn bounds(points: impl IntoIterator<Item = Point>) -> Option<[Point; 2]> {
    points.into_iter().fold(None, |acc, p| {
        let [low, high] = acc.unwrap_or([p, p]);
        Some([
            [low[0].min(p[0]), low[1].min(p[1])],
            [high[0].max(p[0]), high[1].max(p[1])],
        ])
    })
}

/// A compensated sum (Neumaier).
#[derive(Clone, Copy, Debug, Default)]
pub struct Sum {
    sum: f64,
    rest: f64,
}

impl Sum {
    /// Adds one term.
    pub fn add(&mut self, term: f64) {
        let next = self.sum + term;
        self.rest += if self.sum.abs() >= term.abs() {
            (self.sum - next) + term
        } else {
            (term - next) + self.sum
        };
        self.sum = next;
    }

    /// The sum so far.
    pub fn value(self) -> f64 {
        self.sum + self.rest
    }
}

/// An exact change of coordinates to order one: a shift (only where it rounds nothing) and a
/// scaling by a power of two.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Subtracted first.
    pub shift: Point,
    /// Power of two that multiplies after the shift.
    pub scale: f64,
}

/// The largest exponent of two that a domain's extent may have, either way.
pub const MAX_EXPONENT: i32 = 500;

impl Frame {
    /// The frame that takes `points` to coordinates of order one.
    ///
    /// `Err(extent)` when the extent is zero, not finite, or beyond `2^(+-500)`.
    pub fn new(points: &[Point]) -> Result<Self, f64> {
        let Some([low, high]) = bounds(points.iter().copied()) else {
            return Err(0.0);
        };
        let extent = (high[0] - low[0]).max(high[1] - low[1]);
        let exponent = exponent(extent).ok_or(extent)?;
        let mut shift = [0.0; 2];
        for k in 0..2 {
            // A coordinate that the shift would round keeps its origin: the domain then lies
            // about the origin anyway.
            if points
                .iter()
                .all(|p| difference_is_exact(p[k], low[k], p[k] - low[k]))
            {
                shift[k] = low[k];
            }
        }
        Ok(Self {
            shift,
            scale: power_of_two(-exponent),
        })
    }

    /// Into the frame.
    pub fn enter(&self, p: Point) -> Point {
        [
            (p[0] - self.shift[0]) * self.scale,
            (p[1] - self.shift[1]) * self.scale,
        ]
    }

    /// Out of the frame.
    pub fn leave(&self, p: Point) -> Point {
        [
            p[0] / self.scale + self.shift[0],
            p[1] / self.scale + self.shift[1],
        ]
    }
}

/// Whether `d = fl(a - b)` is the exact difference (Knuth's two-sum).
fn difference_is_exact(a: f64, b: f64, d: f64) -> bool {
    let b_virtual = a - d;
    let a_virtual = d + b_virtual;
    (a - a_virtual) + (b_virtual - b) == 0.0
}

/// The exponent `e` with `2^e <= x < 2^(e + 1)`, `None` where `x` is not positive or beyond
/// `2^(+-500)`.
pub fn exponent(x: f64) -> Option<i32> {
    if !(x > 0.0 && x.is_finite()) {
        return None;
    }
    let biased = i32::try_from(x.to_bits() >> 52).ok()?;
    let exponent = biased - 1023;
    (exponent.abs() <= MAX_EXPONENT).then_some(exponent)
}

/// `2^exponent` for a normal result.
pub fn power_of_two(exponent: i32) -> f64 {
    debug_assert!((-1022..=1023).contains(&exponent));
    f64::from_bits(((exponent + 1023) as u64) << 52)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orientation_is_exact_where_rounding_would_lie() {
        // Kettner et al.: near (0.5, 0.5) the naive determinant has the wrong sign.
        let ulp = f64::EPSILON / 2.0;
        let p = [0.5 + ulp, 0.5];
        assert!(orient([12.0, 12.0], [24.0, 24.0], p) < 0.0);
        assert_eq!(orient([12.0, 12.0], [24.0, 24.0], [0.5, 0.5]), 0.0);
    }

    #[test]
    fn segments_meet_in_every_way() {
        let m = |a, b, c, d| meeting(a, b, c, d);
        assert_eq!(m([0., 0.], [2., 2.], [0., 2.], [2., 0.]), Meeting::Cross);
        assert_eq!(m([0., 0.], [2., 0.], [1., 0.], [1., 1.]), Meeting::Touch);
        assert_eq!(m([0., 0.], [2., 0.], [1., 0.], [3., 0.]), Meeting::Touch);
        assert_eq!(m([0., 0.], [1., 0.], [1., 0.], [2., 0.]), Meeting::Touch);
        assert_eq!(m([0., 0.], [1., 0.], [2., 0.], [3., 0.]), Meeting::Apart);
        assert_eq!(m([0., 0.], [2., 2.], [1.5, 0.], [2., 1.]), Meeting::Apart);
        // The line through one passes an end point of the other beyond the segment.
        assert_eq!(m([0., 0.], [1., 1.], [2., 2.], [0., 1.5]), Meeting::Apart);
        assert_eq!(m([0., 0.], [4., 4.], [5., 5.], [3., 0.]), Meeting::Apart);
    }

    #[test]
    fn inside_a_notched_polygon() {
        let ring = [[0., 0.], [4., 0.], [4., 4.], [2., 1.], [0., 4.]];
        assert!(inside(&ring, [0.5, 2.0]));
        assert!(inside(&ring, [2.0, 0.5]));
        assert!(!inside(&ring, [2.0, 3.0]));
        assert!(!inside(&ring, [5.0, 1.0]));
        assert!(!inside(&ring, [-1.0, 0.0]));
    }

    #[test]
    fn frames_are_exact() {
        let points = [[1e7, -3.0], [1e7 + 0.3, -2.9], [1e7 + 1.7, -1.0]];
        let frame = Frame::new(&points).unwrap();
        assert_eq!(frame.shift, [1e7, -3.0]);
        assert_eq!(frame.scale, 0.5);
        for p in points {
            assert_eq!(frame.leave(frame.enter(p)), p);
        }
        // Here the shift would lose the small coordinate, so there is none.
        let frame = Frame::new(&[[-1.0, 0.0], [1e-20, 1.0]]).unwrap();
        assert_eq!(frame.shift, [0.0, 0.0]);
        assert_eq!(frame.enter([1e-20, 1.0]), [1e-20, 1.0]);
    }

    #[test]
    fn extents_out_of_range_are_refused() {
        assert_eq!(Frame::new(&[]), Err(0.0));
        assert_eq!(Frame::new(&[[1.0, 1.0]]), Err(0.0));
        assert!(Frame::new(&[[0.0, 0.0], [1e200, 0.0]]).is_err());
        assert!(Frame::new(&[[0.0, 0.0], [1e-200, 0.0]]).is_err());
        assert!(Frame::new(&[[-f64::MAX, 0.0], [f64::MAX, 0.0]]).is_err());
        assert_eq!(exponent(1.5), Some(0));
        assert_eq!(exponent(0.75), Some(-1));
        assert_eq!(power_of_two(-3), 0.125);
    }

    #[test]
    fn sums_keep_small_terms() {
        let mut sum = Sum::default();
        for term in [1e16, 1.0, -1e16] {
            sum.add(term);
        }
        assert_eq!(sum.value(), 1.0);
    }
}
