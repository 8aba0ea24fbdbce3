//! The largest distance from the points of some triangles to a set of segments.
//!
//! The distance to one segment is a convex function, so on a triangle the distance to the nearest of all segments is at most
//! the largest of the corners' distances to any single one of them. Triangles whose bound by the segment nearest to their
//! centre exceeds the largest distance met so far are quartered.

use super::nearest::{Nearest, Segment, squared_distance};

/// A triangle whose points are asked for their distance, with a length below which distances do not matter.
#[derive(Clone, Copy)]
pub(super) struct Source {
    /// Corners.
    pub corners: [[f64; 2]; 3],
    /// Diameter of the element that the triangle is a part of.
    pub size: f64,
}

/// The result is the largest distance to this relative accuracy, or to this share of the element's diameter.
const ACCURACY: f64 = 1.0 / 1024.0;

/// A triangle is quartered at most so often.
const DEPTH: u32 = 16;

/// The largest distance; none if there are no segments, 0 if there are no triangles.
pub(super) fn largest_distance(sources: &[Source], target: &Nearest) -> Option<f64> {
    let mut largest = 0.0f64;
    let mut stack = Vec::new();
    // First a look at every triangle, so that the search below starts with a distance that leaves little to divide.
    // Triangles follow each other in space: most are settled by the segment that was nearest to the last one that was not.
    let mut hint: Option<Segment> = None;
    for source in sources {
        if hint.is_some_and(|segment| source.farthest(&segment) <= largest * (1.0 + ACCURACY)) {
            continue;
        }
        let (segment, lower, upper) = source.bounds(target)?;
        hint = Some(*segment);
        largest = largest.max(lower);
        stack.push((*source, upper, 0));
    }
    while let Some((source, upper, depth)) = stack.pop() {
        let settled = upper <= largest * (1.0 + ACCURACY) || upper <= ACCURACY * source.size;
        if settled || depth == DEPTH {
            continue;
        }
        for corner in source.corners {
            largest = largest.max(target.find(corner)?.1.sqrt());
        }
        if upper <= largest * (1.0 + ACCURACY) {
            continue;
        }
        for part in source.quarters() {
            let (_, lower, upper) = part.bounds(target)?;
            largest = largest.max(lower);
            stack.push((part, upper, depth + 1));
        }
    }
    Some(largest)
}

impl Source {
    /// The segment nearest to the centre, its distance from there, and what no point of the triangle exceeds.
    fn bounds<'t>(&self, target: &'t Nearest) -> Option<(&'t Segment, f64, f64)> {
        let [a, b, c] = self.corners;
        let centre = [(a[0] + b[0] + c[0]) / 3.0, (a[1] + b[1] + c[1]) / 3.0];
        let (segment, lower) = target.find(centre)?;
        Some((segment, lower.sqrt(), self.farthest(segment)))
    }

    /// The largest distance of a corner from a segment: no point of the triangle is farther from it.
    fn farthest(&self, segment: &Segment) -> f64 {
        let corners = self.corners.iter();
        let squares = corners.map(|&p| squared_distance(p, segment));
        squares.fold(0.0, f64::max).sqrt()
    }

    fn quarters(&self) -> [Source; 4] {
        let [a, b, c] = self.corners;
        let middle = |p: [f64; 2], q: [f64; 2]| [0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1])];
        let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
        [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]].map(|corners| Source {
            corners,
            size: self.size,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn source(corners: [[f64; 2]; 3]) -> Source {
        Source { corners, size: 1.0 }
    }

    #[test]
    fn a_maximum_between_two_segments_is_found() {
        // The farthest point of the triangle lies in its inside, halfway between the segments x = 0 and x = 2.
        let target = Nearest::new(vec![[[0.0, -9.0], [0.0, 9.0]], [[2.0, -9.0], [2.0, 9.0]]]);
        let found = largest_distance(&[source([[0.1, 0.0], [1.9, 0.1], [1.7, 1.0]])], &target);
        let found = found.unwrap();
        assert!((found - 1.0).abs() <= ACCURACY, "{found}");
    }

    #[test]
    fn the_middle_of_a_triangle_is_searched_too() {
        // The farthest point from three points is the centre (2, 1) of the circle through them.
        let corners = [[0.0, 0.0], [4.0, 0.0], [1.0, 3.0]];
        let target = Nearest::new(corners.map(|p| [p, p]).to_vec());
        let found = largest_distance(&[source(corners)], &target).unwrap();
        assert!((found / 5f64.sqrt() - 1.0).abs() <= ACCURACY, "{found}");
    }

    #[test]
    fn corners_and_empty_sets() {
        let target = Nearest::new(vec![[[0.0, 0.0], [1.0, 0.0]]]);
        let sources = [
            source([[0.0, 0.0], [1.0, 0.0], [0.5, 0.25]]),
            source([[1.0, 0.0], [4.0, 4.0], [1.0, 1.0]]),
        ];
        assert_eq!(largest_distance(&sources, &target), Some(5.0));
        assert_eq!(largest_distance(&[], &target), Some(0.0));
        assert_eq!(largest_distance(&sources, &Nearest::new(Vec::new())), None);
    }
}
