//! Rectangles and disks.

use std::f64::consts::FRAC_1_SQRT_2;

use crate::geometry::{Point, exponent};
use crate::{DomainError, MAX_TRIANGLES, RawMesh};

/// Slack of the cell count: an extent of `n (1 + 1e-9)` sizes still gets `n` cells.
const ROUND_OFF: f64 = 1e-9;

/// A size may be missed by this factor before one more uniform refinement is asked for.
const SIZE_SLACK: f64 = 1.25;

/// A bound on the longest edge of a fan of radius 1 after `k` uniform refinements: `2^-k`, but for
/// the outer ring, which putting midpoints on the circle stretches.
fn longest_edge(k: u32) -> f64 {
    let shrunk = 0.5f64.powi(k as i32);
    if k == 0 {
        1.0
    } else {
        shrunk * (1.2755 - 0.265 * shrunk)
    }
}

pub(crate) fn check_size(size: f64) -> Result<(), DomainError> {
    if size > 0.0 && size.is_finite() {
        Ok(())
    } else {
        Err(DomainError::Size { size })
    }
}

fn check_finite(name: &'static str, value: Point) -> Result<(), DomainError> {
    if value.iter().all(|x| x.is_finite()) {
        Ok(())
    } else {
        Err(DomainError::NotFinite { name, value })
    }
}

/// The rectangle with corners `lower` and `upper`, in `nx x ny` equal cells.
///
/// `nx` is the least number of cells no wider than `size` (an excess of one part in 10^9 is put
/// down to round-off), `ny` likewise. Each cell is cut along its diagonal from lower left to upper
/// right. Vertices are numbered row by row from the lower left, triangles likewise, the one below
/// the diagonal first.
pub fn rectangle(lower: Point, upper: Point, size: f64) -> Result<RawMesh, DomainError> {
    check_size(size)?;
    check_finite("lower", lower)?;
    check_finite("upper", upper)?;
    if !(lower[0] < upper[0] && lower[1] < upper[1]) {
        return Err(DomainError::EmptyRectangle { lower, upper });
    }
    let mut counts = [0.0; 2];
    for k in 0..2 {
        let extent = upper[k] - lower[k];
        if exponent(extent).is_none() {
            return Err(DomainError::Extent { extent });
        }
        counts[k] = (extent / size * (1.0 - ROUND_OFF)).ceil().max(1.0);
    }
    let triangles = 2.0 * counts[0] * counts[1];
    if triangles > MAX_TRIANGLES {
        return Err(DomainError::TooManyTriangles { triangles, size });
    }
    let xs = divide(lower[0], upper[0], counts[0] as u32);
    let ys = divide(lower[1], upper[1], counts[1] as u32);
    for (k, line) in [&xs, &ys].into_iter().enumerate() {
        if let Some(pair) = line.windows(2).find(|pair| pair[0] >= pair[1]) {
            let mut at = lower;
            at[k] = pair[0];
            return Err(DomainError::TooFine { size, at });
        }
    }
    let (nx, ny) = (xs.len() as u32 - 1, ys.len() as u32 - 1);
    let points = ys
        .iter()
        .flat_map(|&y| xs.iter().map(move |&x| [x, y]))
        .collect();
    let mut cells = Vec::with_capacity(2 * nx as usize * ny as usize);
    for j in 0..ny {
        for i in 0..nx {
            let a = j * (nx + 1) + i;
            let (b, c, d) = (a + 1, a + nx + 2, a + nx + 1);
            cells.extend([[a, b, c], [a, c, d]]);
        }
    }
    let regions = vec![0; cells.len()];
    Ok(RawMesh {
        points,
        triangles: cells,
        regions,
    })
}

/// `n + 1` equidistant numbers from `lower` to exactly `upper`.
fn divide(lower: f64, upper: f64, n: u32) -> Vec<f64> {
    let extent = upper - lower;
    (0..=n)
        .map(|i| {
            if i == n {
                upper
            } else {
                lower + extent * (f64::from(i) / f64::from(n))
            }
        })
        .collect()
}

/// A disk, to be refined uniformly with new boundary vertices put on the circle.
#[derive(Clone, Debug, PartialEq)]
pub struct Disk {
    /// A fan of 8 triangles: vertex 0 is the centre, 1 to 8 lie on the circle at multiples of
    /// 45 degrees.
    pub fan: RawMesh,
    /// How often each triangle is to be split in four to reach the mesh size: the least number
    /// whose longest edge, stretched towards the circle, is at most 1.25 times the size.
    pub refinements: u32,
}

/// The disk about `center`: a fan of 8 triangles and the refinements that reach `size`.
///
/// About the origin the fan is exactly symmetric under reflection in the axes and diagonals.
pub fn disk(center: Point, radius: f64, size: f64) -> Result<Disk, DomainError> {
    check_size(size)?;
    check_finite("center", center)?;
    check_finite("radius", [radius; 2])?;
    if radius <= 0.0 {
        return Err(DomainError::Radius { radius });
    }
    if exponent(radius).is_none() {
        return Err(DomainError::Extent { extent: radius });
    }
    let mut refinements = 0;
    while radius * longest_edge(refinements) > SIZE_SLACK * size {
        refinements += 1;
        if 8.0 * 4f64.powi(refinements as i32) > MAX_TRIANGLES {
            // Not the number just passed, but what the size asks for.
            let triangles = 8.0 * (radius / size).powi(2);
            return Err(DomainError::TooManyTriangles { triangles, size });
        }
    }
    let finest = radius * longest_edge(refinements);
    let s = radius * FRAC_1_SQRT_2;
    let r = radius;
    let rim = [
        [r, 0.0],
        [s, s],
        [0.0, r],
        [-s, s],
        [-r, 0.0],
        [-s, -s],
        [0.0, -r],
        [s, -s],
    ];
    let mut points = vec![center];
    points.extend(rim.map(|p| [center[0] + p[0], center[1] + p[1]]));
    let triangles: Vec<[u32; 3]> = (0..8).map(|i| [0, 1 + i, 1 + (i + 1) % 8]).collect();
    let fan = RawMesh {
        points,
        triangles,
        regions: vec![0; 8],
    };
    // A centre so far out that the rim rounds onto it, or loses its shape.
    if crate::check::check(&fan).is_err() || finest <= 64.0 * f64::EPSILON * reach(center) {
        return Err(DomainError::TooFine { size, at: center });
    }
    Ok(Disk { fan, refinements })
}

fn reach(p: Point) -> f64 {
    p[0].abs().max(p[1].abs())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::check;

    fn area(mesh: &RawMesh) -> f64 {
        (0..mesh.triangles.len())
            .map(|t| {
                let [a, b, c] = mesh.corners(t);
                0.5 * crate::geometry::cross(a, b, c)
            })
            .sum()
    }

    #[test]
    fn unit_square_by_hand() {
        let mesh = rectangle([0.0, 0.0], [1.0, 1.0], 0.5).unwrap();
        assert_eq!(mesh.points.len(), 9);
        assert_eq!(mesh.points[1], [0.5, 0.0]);
        assert_eq!(mesh.points[3], [0.0, 0.5]);
        assert_eq!(mesh.points[8], [1.0, 1.0]);
        assert_eq!(
            mesh.triangles[..4],
            [[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]]
        );
        assert_eq!(mesh.regions, vec![0; 8]);
        check(&mesh).unwrap();
    }

    #[test]
    fn cell_counts_survive_round_off() {
        let cells = |size: f64| {
            let mesh = rectangle([-1.0, 0.0], [1.0, 1e-3], size).unwrap();
            mesh.triangles.len() / 2
        };
        assert_eq!(cells(0.25), 8);
        assert_eq!(cells(0.25000000001), 8);
        assert_eq!(cells(0.24999999999), 8);
        assert_eq!(cells(0.2499999), 9);
        assert_eq!(cells(0.1), 20);
        assert_eq!(cells(2.0 / 3.0), 3);
        assert_eq!(cells(5.0), 1);
        // 0.3 / 0.1 is 2.9999999999999996, and 0.6 / 0.2 likewise is no fourth cell.
        let mesh = rectangle([0.0, 0.0], [0.3, 0.6], 0.1).unwrap();
        assert_eq!(mesh.triangles.len(), 2 * 3 * 6);
    }

    #[test]
    fn rectangles_scale_bitwise_and_end_exactly() {
        let base = rectangle([-0.1, 0.3], [1.7, 2.9], 0.11).unwrap();
        check(&base).unwrap();
        assert_eq!(*base.points.last().unwrap(), [1.7, 2.9]);
        assert!((area(&base) - 1.8 * 2.6).abs() < 1e-12);
        for e in [-400, -20, 1, 400] {
            let s = 2f64.powi(e);
            let scaled = rectangle([-0.1 * s, 0.3 * s], [1.7 * s, 2.9 * s], 0.11 * s).unwrap();
            assert_eq!(scaled.triangles, base.triangles);
            for (p, q) in base.points.iter().zip(&scaled.points) {
                assert_eq!([p[0] * s, p[1] * s], *q);
            }
        }
    }

    #[test]
    fn bad_rectangles_are_refused() {
        let unit = |size| rectangle([0.0, 0.0], [1.0, 1.0], size).unwrap_err();
        for size in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(matches!(unit(size), DomainError::Size { .. }), "{size}");
        }
        assert!(
            matches!(unit(1e-5), DomainError::TooManyTriangles { triangles, .. } if (triangles - 2e10).abs() < 1e7)
        );
        assert!(matches!(unit(1e-300), DomainError::TooManyTriangles { .. }));
        let bad = |lower, upper| rectangle(lower, upper, 0.1).unwrap_err();
        assert!(matches!(
            bad([f64::NAN, 0.0], [1.0, 1.0]),
            DomainError::NotFinite { name: "lower", .. }
        ));
        assert!(matches!(
            bad([0.0, 0.0], [1.0, f64::INFINITY]),
            DomainError::NotFinite { name: "upper", .. }
        ));
        assert!(matches!(
            bad([0.0, 1.0], [1.0, 1.0]),
            DomainError::EmptyRectangle { .. }
        ));
        assert!(matches!(
            bad([2.0, 0.0], [1.0, 1.0]),
            DomainError::EmptyRectangle { .. }
        ));
        assert!(matches!(
            bad([0.0, 0.0], [1e-180, 1.0]),
            DomainError::Extent { .. }
        ));
        assert!(matches!(
            bad([-1e308, 0.0], [1e308, 1.0]),
            DomainError::Extent { .. }
        ));
        let far = rectangle([1e16, 0.0], [1e16 + 10.0, 1.0], 1.0).unwrap_err();
        assert!(matches!(far, DomainError::TooFine { .. }));
        assert_eq!(
            unit(-1.0).to_string(),
            "mesh size `-1` is not a positive number"
        );
        assert!(unit(-1.0).hint().is_some());
    }

    #[test]
    fn fan_is_exactly_symmetric() {
        let disk = disk([0.0, 0.0], 1.5, 0.5).unwrap();
        check(&disk.fan).unwrap();
        let points = &disk.fan.points;
        assert_eq!(points[0], [0.0, 0.0]);
        assert_eq!(points[1], [1.5, 0.0]);
        assert_eq!(points[2][0], points[2][1]);
        for p in points {
            for q in [[-p[0], p[1]], [p[0], -p[1]], [p[1], p[0]]] {
                assert!(points.contains(&q), "{q:?}");
            }
        }
    }

    /// Red refinement with projection, to measure the longest edge that the count promises.
    fn longest_after(k: u32) -> f64 {
        let mut triangles = vec![[[0.0, 0.0], [1.0, 0.0], [FRAC_1_SQRT_2, FRAC_1_SQRT_2]]];
        let rim = |p: Point| (p[0].hypot(p[1]) - 1.0).abs() < 1e-12;
        for level in 0..k {
            let middle = |a: Point, b: Point, bent: bool| {
                let m = [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
                let n = m[0].hypot(m[1]);
                if bent { [m[0] / n, m[1] / n] } else { m }
            };
            let bent = |a: Point, b: Point| {
                rim(a) && rim(b) && crate::geometry::distance(a, b) < 0.8 / 2f64.powi(level as i32)
            };
            triangles = triangles
                .iter()
                .flat_map(|&[a, b, c]| {
                    let (ab, bc, ca) = (
                        middle(a, b, bent(a, b)),
                        middle(b, c, bent(b, c)),
                        middle(c, a, bent(c, a)),
                    );
                    [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
                })
                .collect();
        }
        let d = crate::geometry::distance;
        triangles
            .iter()
            .flat_map(|&[a, b, c]| [d(a, b), d(b, c), d(c, a)])
            .fold(0.0, f64::max)
    }

    #[test]
    fn refinements_reach_the_size() {
        for size in [2.0, 1.0, 0.81, 0.79, 0.5, 0.4, 0.25, 0.1, 0.03] {
            let k = disk([0.0, 0.0], 1.0, size).unwrap().refinements;
            assert!(
                longest_after(k) <= 1.25 * size,
                "size {size}, {k} refinements"
            );
            if k > 0 {
                // One less would miss it, up to the slack of the bound.
                assert!(
                    1.02 * longest_after(k - 1) > 1.25 * size,
                    "size {size}, {k} refinements"
                );
            }
        }
        assert_eq!(disk([0.0, 0.0], 1.0, 0.25).unwrap().refinements, 2);
        assert_eq!(disk([0.0, 0.0], 1.0, 0.8).unwrap().refinements, 0);
    }

    #[test]
    fn disks_scale_bitwise() {
        let base = disk([0.3, -0.2], 1.1, 0.3).unwrap();
        for e in [-400, 3, 400] {
            let s = 2f64.powi(e);
            let scaled = disk([0.3 * s, -0.2 * s], 1.1 * s, 0.3 * s).unwrap();
            assert_eq!(scaled.refinements, base.refinements);
            for (p, q) in base.fan.points.iter().zip(&scaled.fan.points) {
                assert_eq!([p[0] * s, p[1] * s], *q);
            }
        }
    }

    #[test]
    fn bad_disks_are_refused() {
        let bad = |center, radius, size| disk(center, radius, size).unwrap_err();
        let o = [0.0, 0.0];
        assert!(matches!(bad(o, 1.0, 0.0), DomainError::Size { .. }));
        assert!(matches!(bad(o, 0.0, 1.0), DomainError::Radius { .. }));
        assert!(matches!(bad(o, -2.0, 1.0), DomainError::Radius { .. }));
        assert!(matches!(
            bad(o, f64::NAN, 1.0),
            DomainError::NotFinite { name: "radius", .. }
        ));
        assert!(matches!(
            bad([f64::NAN, 0.0], 1.0, 1.0),
            DomainError::NotFinite { name: "center", .. }
        ));
        assert!(matches!(bad(o, 1e200, 1e200), DomainError::Extent { .. }));
        assert!(matches!(
            bad(o, 1.0, 1e-6),
            DomainError::TooManyTriangles { .. }
        ));
        assert!(matches!(
            bad(o, 1.0, 1e-320),
            DomainError::TooManyTriangles { .. }
        ));
        assert!(matches!(
            bad([1e17, 0.0], 1.0, 0.5),
            DomainError::TooFine { .. }
        ));
    }
}
