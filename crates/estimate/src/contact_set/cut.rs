//! Divides the elements of a mesh into parts that lie in a set and parts that do not; the set is where a field is not zero.
//!
//! An element is looked at in its three corners, its edge midpoints and its barycentre. Where they disagree it is divided
//! into the six sub-triangles with these points as corners (so that no part crosses the border of a dual cell), and these
//! are quartered while their own seven points disagree. The smallest pieces are cut by a straight line between the points
//! where the border of the set crosses their edges, found by bisection. With the diameter d of the smallest pieces, at most
//! h/3, the line is off a border of curvature k by at most k d^2/8.
//!
//! Points are moved by 2^-20 of their way towards the barycentre of their element before the field is evaluated: strictly
//! inside, on the element's own side of a border that runs along an edge.

use fem_core::{Field, FieldError, Mesh, Samples, Shape, TriangleId};

/// Barycentric coordinates in an element.
pub(super) type Place = [f64; 3];

/// A convex polygon with three or four corners.
#[derive(Clone, Copy)]
pub(super) struct Polygon {
    places: [Place; 4],
    count: usize,
}

impl Polygon {
    fn triangle([a, b, c]: [Place; 3]) -> Polygon {
        Polygon {
            places: [a, b, c, c],
            count: 3,
        }
    }

    fn quadrangle(places: [Place; 4]) -> Polygon {
        Polygon { places, count: 4 }
    }

    /// The corners.
    pub fn places(&self) -> &[Place] {
        &self.places[..self.count]
    }

    /// The share of the polygon in the area of its element.
    pub fn share(&self) -> f64 {
        let [a, b, c, d] = self.places;
        let share = |p: Place, q: Place| {
            let (p, q) = ([p[1] - a[1], p[2] - a[2]], [q[1] - a[1], q[2] - a[2]]);
            p[0] * q[1] - p[1] * q[0]
        };
        // The fourth corner of a triangle repeats the third.
        share(b, c) + share(c, d)
    }
}

/// A convex part of an element that lies on one side of the border.
pub(super) struct Part {
    /// The element.
    pub triangle: TriangleId,
    /// The local vertex in whose dual cell the part lies; none for a whole element.
    pub cell: Option<usize>,
    /// Three or four corners, counter-clockwise.
    pub corners: Polygon,
    /// Whether the part belongs to the set.
    pub inside: bool,
}

/// Corners of the whole element.
pub(super) const WHOLE: [Place; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// The barycentre.
pub(super) const CENTRE: Place = [1.0 / 3.0; 3];

/// Elements and sub-triangles larger than this share of the domain are divided in any case, so that coarse meshes miss
/// nothing that is not small.
const LARGEST_SHARE: f64 = 1.0 / 2000.0;

/// A cut sub-triangle is quartered at least and at most so often; between these until it is no longer than the given share
/// of the domain's extent.
const DEPTH: std::ops::Range<u32> = 1..7;
const FINE: f64 = 1.0 / 256.0;

/// Steps of bisection along an edge of a smallest piece.
const BISECTIONS: u32 = 20;

/// A piece cut off with less than this share of the smallest piece is dropped: borders that merely touch the piece.
const NEGLIGIBLE: f64 = 1.0 / 65536.0;

/// Share of the way to the barycentre that points are moved by.
const INWARD: f64 = 1.0 / 1048576.0;

/// Elements that are looked at together.
const BLOCK: usize = 512;

struct Piece {
    triangle: TriangleId,
    cell: usize,
    corners: [Place; 3],
    depth: u32,
}

/// Shows every part to `visit`; the parts of an element follow each other.
pub(super) fn divide(
    mesh: &Mesh,
    field: &dyn Field,
    visit: &mut dyn FnMut(Part),
) -> Result<(), FieldError> {
    let cutter = Cutter {
        mesh,
        field,
        largest: LARGEST_SHARE * fem_core::norms::area(mesh),
        fine: FINE * extent(mesh),
    };
    let count = mesh.triangle_count() as u32;
    for first in (0..count).step_by(BLOCK) {
        let block = (first..count.min(first + BLOCK as u32)).map(TriangleId);
        cutter.block(block, visit)?;
    }
    Ok(())
}

/// The longer side of the box around a mesh.
fn extent(mesh: &Mesh) -> f64 {
    let side = |k: usize| {
        let range = |(l, h): (f64, f64), p: &[f64; 2]| (l.min(p[k]), h.max(p[k]));
        let start = (f64::INFINITY, f64::NEG_INFINITY);
        let (low, high) = mesh.points().iter().fold(start, range);
        high - low
    };
    side(0).max(side(1))
}

struct Cutter<'a> {
    mesh: &'a Mesh,
    field: &'a dyn Field,
    largest: f64,
    fine: f64,
}

impl Cutter<'_> {
    fn block(
        &self,
        block: impl Iterator<Item = TriangleId> + Clone,
        visit: &mut dyn FnMut(Part),
    ) -> Result<(), FieldError> {
        let points = block
            .clone()
            .flat_map(|t| seven(WHOLE).map(|place| (t, place)));
        let flags = self.sample(points)?;
        let mut pieces = Vec::new();
        for (t, flags) in block.zip(flags.chunks_exact(7)) {
            if same(flags) && self.mesh.shape(t).area <= self.largest {
                visit(Part {
                    triangle: t,
                    cell: None,
                    corners: Polygon::triangle(WHOLE),
                    inside: flags[0],
                });
            } else {
                pieces.extend(sub_triangles().map(|(cell, corners)| Piece {
                    triangle: t,
                    cell,
                    corners,
                    depth: 0,
                }));
            }
        }
        let mut cut = Vec::new();
        while !pieces.is_empty() {
            let points = pieces
                .iter()
                .flat_map(|p| seven(p.corners).map(|place| (p.triangle, place)));
            let flags = self.sample(points)?;
            let mut next = Vec::new();
            for (piece, flags) in pieces.into_iter().zip(flags.chunks_exact(7)) {
                let corners = self.points(&piece);
                let shape = Shape::new(corners);
                let (agree, small) = (same(flags), shape.area <= self.largest);
                let smallest = piece.depth >= DEPTH.start && shape.diameter() <= self.fine
                    || piece.depth >= DEPTH.end;
                if agree && (small || smallest) {
                    visit(piece.part(Polygon::triangle(piece.corners), flags[0]));
                } else if smallest {
                    cut.push((piece, [flags[0], flags[1], flags[2]]));
                } else {
                    next.extend(piece.quarters());
                }
            }
            pieces = next;
        }
        self.cut(cut, visit)
    }

    /// Cuts the smallest pieces between their corners.
    fn cut(
        &self,
        cut: Vec<(Piece, [bool; 3])>,
        visit: &mut dyn FnMut(Part),
    ) -> Result<(), FieldError> {
        // The corner that differs from the two others, if any.
        let apex = |f: &[bool; 3]| {
            (0..3).find(|&k| f[(k + 1) % 3] == f[(k + 2) % 3] && f[k] != f[(k + 1) % 3])
        };
        let edges: Vec<(TriangleId, Place, Place, bool)> = cut
            .iter()
            .filter_map(|(piece, flags)| apex(flags).map(|k| (piece, k, flags[k])))
            .flat_map(|(piece, k, flag)| {
                [1, 2].map(|s| {
                    (
                        piece.triangle,
                        piece.corners[k],
                        piece.corners[(k + s) % 3],
                        flag,
                    )
                })
            })
            .collect();
        // Between `at` and `at + step` of the way from the apex the field changes.
        let mut at = vec![0.0; edges.len()];
        let mut step = 1.0;
        for _ in 0..BISECTIONS {
            step *= 0.5;
            let points = edges
                .iter()
                .zip(&at)
                .map(|((t, a, b, _), s)| (*t, between(*a, *b, s + step)));
            for ((flag, edge), s) in self.sample(points)?.into_iter().zip(&edges).zip(&mut at) {
                if flag == edge.3 {
                    *s += step;
                }
            }
        }
        let mut crossings = at.chunks_exact(2);
        for (piece, flags) in cut {
            let found = apex(&flags).and_then(|k| {
                crossings
                    .next()
                    .map(|c| (k, [c[0] + 0.5 * step, c[1] + 0.5 * step]))
            });
            let Some((k, [s, t])) = found else {
                visit(piece.part(Polygon::triangle(piece.corners), flags[0]));
                continue;
            };
            let share = s * t;
            if !(NEGLIGIBLE..=1.0 - NEGLIGIBLE).contains(&share) {
                let inside = flags[k] == (share > 0.5);
                visit(piece.part(Polygon::triangle(piece.corners), inside));
                continue;
            }
            let [a, b, c] = [0, 1, 2].map(|i| piece.corners[(k + i) % 3]);
            let (p, q) = (between(a, b, s), between(a, c, t));
            visit(piece.part(Polygon::triangle([a, p, q]), flags[k]));
            visit(piece.part(Polygon::quadrangle([p, b, c, q]), !flags[k]));
        }
        Ok(())
    }

    fn points(&self, piece: &Piece) -> [[f64; 2]; 3] {
        let corners = self.mesh.corners(piece.triangle);
        piece.corners.map(|place| point(&corners, place))
    }

    /// Whether the field is not zero at these places.
    fn sample(
        &self,
        places: impl Iterator<Item = (TriangleId, Place)>,
    ) -> Result<Vec<bool>, FieldError> {
        let (mut x, mut y, mut region) = (Vec::new(), Vec::new(), Vec::new());
        for (t, place) in places {
            let inner = place.map(|l| l + INWARD * (1.0 / 3.0 - l));
            let p = point(&self.mesh.corners(t), inner);
            x.push(p[0]);
            y.push(p[1]);
            region.push(f64::from(self.mesh.region()[t.index()]));
        }
        let mut values = vec![0.0; x.len()];
        let at = Samples {
            x: &x,
            y: &y,
            region: &region,
        };
        self.field.sample(at, &mut values)?;
        Ok(values.into_iter().map(|v| v != 0.0).collect())
    }
}

impl Piece {
    fn part(&self, corners: Polygon, inside: bool) -> Part {
        Part {
            triangle: self.triangle,
            cell: Some(self.cell),
            corners,
            inside,
        }
    }

    fn quarters(&self) -> [Piece; 4] {
        let [a, b, c] = self.corners;
        let (ab, bc, ca) = (between(a, b, 0.5), between(b, c, 0.5), between(c, a, 0.5));
        [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]].map(|corners| Piece {
            triangle: self.triangle,
            cell: self.cell,
            corners,
            depth: self.depth + 1,
        })
    }
}

/// The sub-triangles of an element, each with the local vertex in whose dual cell it lies.
fn sub_triangles() -> impl Iterator<Item = (usize, [Place; 3])> {
    (0..3).flat_map(|k| {
        let [a, b, c] = [0, 1, 2].map(|i| WHOLE[(k + i) % 3]);
        [
            (k, [a, between(a, b, 0.5), CENTRE]),
            (k, [a, CENTRE, between(c, a, 0.5)]),
        ]
    })
}

/// The share of the dual cell of a local vertex in an element: vertex, edge midpoint, barycentre, edge midpoint.
pub(super) fn cell(k: usize) -> [Place; 4] {
    let [a, b, c] = [0, 1, 2].map(|i| WHOLE[(k + i) % 3]);
    [a, between(a, b, 0.5), CENTRE, between(c, a, 0.5)]
}

/// Corners, edge midpoints and barycentre of a piece.
fn seven([a, b, c]: [Place; 3]) -> [Place; 7] {
    let mut centre = [0.0; 3];
    for k in 0..3 {
        centre[k] = (a[k] + b[k] + c[k]) / 3.0;
    }
    [
        a,
        b,
        c,
        between(a, b, 0.5),
        between(b, c, 0.5),
        between(c, a, 0.5),
        centre,
    ]
}

fn same(flags: &[bool]) -> bool {
    flags.iter().all(|&f| f == flags[0])
}

fn between(a: Place, b: Place, t: f64) -> Place {
    [0, 1, 2].map(|k| a[k] + t * (b[k] - a[k]))
}

/// The point of an element with these barycentric coordinates.
pub(super) fn point(corners: &[[f64; 2]; 3], place: Place) -> [f64; 2] {
    let [a, b, c] = corners;
    [0, 1].map(|k| a[k] + place[1] * (b[k] - a[k]) + place[2] * (c[k] - a[k]))
}
