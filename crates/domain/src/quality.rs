//! Shape of the triangles of a mesh.

use crate::RawMesh;
use crate::geometry::{cross, distance};

/// The angle, in degrees, that a polygon's mesh is refined towards.
pub const ANGLE_LIMIT: f64 = 30.0;

/// Measured shape of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quality {
    /// Smallest angle of all triangles, in degrees (at most 60).
    pub min_angle: f64,
    /// Triangle that has it.
    pub min_angle_triangle: usize,
    /// Largest aspect ratio: longest edge over `2 sqrt(3)` times the inradius, 1 for an
    /// equilateral triangle.
    pub max_aspect_ratio: f64,
    /// Longest edge of the mesh.
    pub longest_edge: f64,
    /// Shortest edge of the mesh.
    pub shortest_edge: f64,
}

impl Quality {
    /// Whether every angle reaches [`ANGLE_LIMIT`], to round-off. Where the outline has smaller
    /// angles it cannot.
    pub fn meets_angle_limit(&self) -> bool {
        self.min_angle >= ANGLE_LIMIT * (1.0 - 1e-9)
    }
}

/// Measures the triangles of `mesh`; of an empty mesh everything is the neutral element.
pub fn quality(mesh: &RawMesh) -> Quality {
    let mut worst = Quality {
        min_angle: 60.0,
        min_angle_triangle: 0,
        max_aspect_ratio: 1.0,
        longest_edge: 0.0,
        shortest_edge: f64::INFINITY,
    };
    let mut found = f64::INFINITY;
    for index in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.corners(index);
        let mut edges = [distance(b, c), distance(c, a), distance(a, b)];
        edges.sort_by(f64::total_cmp);
        let [short, middle, long] = edges;
        // Relative to the longest edge, so that no scale overflows or underflows.
        let unit = |p: [f64; 2]| [(p[0] - a[0]) / long, (p[1] - a[1]) / long];
        let area2 = cross([0.0, 0.0], unit(b), unit(c)).abs();
        let (p, q) = (short / long, middle / long);
        // The smallest angle lies between the two longer edges.
        let dot = 0.5 * (1.0 + q * q - p * p);
        let angle = area2.atan2(dot).to_degrees();
        let aspect = (1.0 + p + q) / (2.0 * 3f64.sqrt() * area2);
        if angle < found {
            found = angle;
            worst.min_angle = angle;
            worst.min_angle_triangle = index;
        }
        worst.max_aspect_ratio = worst.max_aspect_ratio.max(aspect);
        worst.longest_edge = worst.longest_edge.max(long);
        worst.shortest_edge = worst.shortest_edge.min(short);
    }
    worst
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(points: [[f64; 2]; 3]) -> Quality {
        quality(&RawMesh {
            points: points.to_vec(),
            triangles: vec![[0, 1, 2]],
            regions: vec![0],
        })
    }

    #[test]
    fn known_triangles() {
        let right = one([[0., 0.], [1., 0.], [0., 1.]]);
        assert!((right.min_angle - 45.0).abs() < 1e-12);
        assert!(
            (right.max_aspect_ratio - (2.0 + 2f64.sqrt()) / (3f64.sqrt() * 2f64.sqrt())).abs()
                < 1e-12
        );
        assert_eq!(right.shortest_edge, 1.0);
        let equal = one([[0., 0.], [1., 0.], [0.5, 0.75f64.sqrt()]]);
        assert!((equal.min_angle - 60.0).abs() < 1e-12);
        assert!((equal.max_aspect_ratio - 1.0).abs() < 1e-12);
        assert!(equal.meets_angle_limit());
        let thin = one([[0., 0.], [1., 0.], [1., 5f64.to_radians().tan()]]);
        assert!((thin.min_angle - 5.0).abs() < 1e-12);
        assert!(!thin.meets_angle_limit());
    }

    #[test]
    fn scale_does_not_matter() {
        let unit = one([[0., 0.], [1., 0.], [0.3, 0.4]]);
        for s in [2f64.powi(-400), 2f64.powi(400)] {
            let scaled = one([[0., 0.], [s, 0.], [0.3 * s, 0.4 * s]]);
            assert_eq!(scaled.min_angle, unit.min_angle);
            assert_eq!(scaled.max_aspect_ratio, unit.max_aspect_ratio);
            assert_eq!(scaled.longest_edge, s);
        }
    }
}
