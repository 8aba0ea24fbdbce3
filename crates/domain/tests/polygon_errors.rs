//! Polygons that are refused, each with the place of what is wrong.

use domain::{DomainError, Part, polygon};

type P = [f64; 2];

fn refused(outer: &[P], holes: &[Vec<P>], lines: &[Vec<P>]) -> DomainError {
    let error = polygon(outer, holes, lines, 0.5).unwrap_err();
    let text = error.to_string();
    assert!(!text.ends_with('.') && !text.contains('\n'), "{text}");
    assert!(text.starts_with(|c: char| c.is_lowercase()), "{text}");
    assert!(error.hint().is_some(), "{text}");
    error
}

fn square(x: f64, y: f64, side: f64) -> Vec<P> {
    vec![[x, y], [x + side, y], [x + side, y + side], [x, y + side]]
}

fn unit() -> Vec<P> {
    square(0.0, 0.0, 1.0)
}

#[test]
fn sizes() {
    for size in [0.0, -0.1, f64::NAN, f64::INFINITY] {
        let error = polygon(&unit(), &[], &[], size).unwrap_err();
        assert!(matches!(error, DomainError::Size { .. }));
    }
    let error = polygon(&unit(), &[], &[], 1e-5).unwrap_err();
    let DomainError::TooManyTriangles { triangles, .. } = error else {
        panic!("{error}")
    };
    assert!((triangles - 4.0 / 3f64.sqrt() * 1e10).abs() < 1e4);
    assert!(matches!(
        polygon(&unit(), &[], &[], 1e-310),
        Err(DomainError::TooManyTriangles { .. })
    ));
    assert!(polygon(&unit(), &[], &[], 1e300).is_ok());
}

#[test]
fn too_few_points() {
    for outer in [
        vec![],
        vec![[0.0, 0.0]],
        vec![[0.0, 0.0], [1.0, 0.0]],
        vec![[0.0, 0.0], [1.0, 0.0], [0.0, 0.0]],
    ] {
        let error = refused(&outer, &[], &[]);
        assert!(
            matches!(
                error,
                DomainError::TooFewPoints {
                    part: Part::Outer,
                    needed: 3,
                    ..
                }
            ),
            "{error}"
        );
    }
    let error = refused(
        &unit(),
        &[square(0.2, 0.2, 0.1), vec![[0.5, 0.5], [0.6, 0.6]]],
        &[],
    );
    assert_eq!(
        error.to_string(),
        "hole 2 has `2` points, it needs at least `3`"
    );
    let error = refused(&unit(), &[], &[vec![[0.5, 0.5]]]);
    assert_eq!(
        error.to_string(),
        "line 1 has `1` points, it needs at least `2`"
    );
}

#[test]
fn numbers_that_are_none() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let error = refused(&[[0.0, 0.0], [1.0, 0.0], [0.5, bad]], &[], &[]);
        assert!(matches!(
            error,
            DomainError::VertexNotFinite {
                part: Part::Outer,
                vertex: 3,
                ..
            }
        ));
        let error = refused(&unit(), &[vec![[bad, 0.5], [0.6, 0.5], [0.5, 0.6]]], &[]);
        assert!(matches!(
            error,
            DomainError::VertexNotFinite {
                part: Part::Hole(1),
                vertex: 1,
                ..
            }
        ));
        let error = refused(&unit(), &[], &[vec![[0.5, 0.5], [0.6, bad]]]);
        assert!(matches!(
            error,
            DomainError::VertexNotFinite {
                part: Part::Line(1),
                vertex: 2,
                ..
            }
        ));
    }
}

#[test]
fn numbers_out_of_range() {
    for scale in [1e-160, 1e160] {
        let outer: Vec<P> = unit().iter().map(|p| p.map(|x| x * scale)).collect();
        assert!(matches!(
            refused(&outer, &[], &[]),
            DomainError::Extent { .. }
        ));
    }
    let error = refused(&[[0.0, 0.0], [1.0, 1e-40], [0.0, 1.0]], &[], &[]);
    assert!(
        matches!(error, DomainError::VertexTiny { vertex: 2, .. }),
        "{error}"
    );
    // What trigonometry leaves behind is no such case.
    polygon(&[[0.0, 0.0], [1.0, 6e-17], [0.0, 1.0]], &[], &[], 0.5).unwrap();
}

#[test]
fn repeated_vertices() {
    let error = refused(&[[0., 0.], [1., 0.], [1., 0.], [0., 1.]], &[], &[]);
    assert_eq!(
        error.to_string(),
        "vertices 2 and 3 of the outer polygon are the same point `(1, 0)`"
    );
    let error = refused(
        &[[0., 0.], [1., 0.], [0., 1.], [0., 0.], [0., 0.]],
        &[],
        &[],
    );
    assert!(
        matches!(
            error,
            DomainError::RepeatedVertex {
                first: 4,
                second: 1,
                ..
            }
        ),
        "{error}"
    );
    // A figure of eight that meets in a vertex.
    let error = refused(
        &[[0., 0.], [1., 1.], [2., 0.], [2., 2.], [1., 1.], [0., 2.]],
        &[],
        &[],
    );
    assert!(
        matches!(
            error,
            DomainError::RepeatedVertex {
                first: 2,
                second: 5,
                ..
            }
        ),
        "{error}"
    );
    let error = refused(&unit(), &[], &[vec![[0.5, 0.5], [0.5, 0.5]]]);
    assert!(matches!(
        error,
        DomainError::RepeatedVertex {
            part: Part::Line(1),
            first: 1,
            second: 2,
            ..
        }
    ));
}

#[test]
fn zero_area() {
    let error = refused(&[[0., 0.], [1., 1.], [3., 3.], [2., 2.]], &[], &[]);
    assert!(
        matches!(error, DomainError::ZeroArea { part: Part::Outer }),
        "{error}"
    );
    let error = refused(&unit(), &[vec![[0.2, 0.2], [0.4, 0.2], [0.3, 0.2]]], &[]);
    assert_eq!(
        error.to_string(),
        "hole 1 has zero area: all its vertices lie on one straight line"
    );
}

#[test]
fn self_intersections() {
    let error = refused(&[[0., 0.], [1., 1.], [1., 0.], [0., 1.]], &[], &[]);
    assert_eq!(
        error.to_string(),
        "the outer polygon intersects itself: edge 1 (`(0, 0)` to `(1, 1)`) meets edge 3 (`(1, 0)` to `(0, 1)`)"
    );
    // A vertex on an edge.
    let error = refused(
        &[[0., 0.], [2., 0.], [2., 1.], [1., 0.], [0., 1.]],
        &[],
        &[],
    );
    assert!(
        matches!(error, DomainError::SelfIntersection { .. }),
        "{error}"
    );
    // A fold back along the same line, and a spike.
    for outer in [
        vec![[0., 0.], [2., 0.], [1., 0.], [1., 1.]],
        vec![[0., 0.], [1., 0.], [1., 1.], [3., 1.], [0., 1.]],
    ] {
        let error = refused(&outer, &[], &[]);
        assert!(
            matches!(error, DomainError::SelfIntersection { .. }),
            "{error}"
        );
    }
    let bow = vec![[0.2, 0.2], [0.4, 0.4], [0.4, 0.2], [0.2, 0.4]];
    let error = refused(&unit(), &[square(0.6, 0.6, 0.1), bow], &[]);
    assert!(
        matches!(error, DomainError::SelfIntersection { first, .. } if first.part == Part::Hole(2)),
        "{error}"
    );
}

#[test]
fn holes_out_of_place() {
    let outside = refused(&unit(), &[square(2.0, 2.0, 0.5)], &[]);
    assert_eq!(
        outside.to_string(),
        "hole 1 lies outside the outer polygon: vertex 1 is `(2, 2)`"
    );
    let around = refused(&unit(), &[square(-1.0, -1.0, 4.0)], &[]);
    assert!(
        matches!(around, DomainError::HoleOutside { hole: 1, .. }),
        "{around}"
    );
    let island = refused(
        &unit(),
        &[square(0.2, 0.2, 0.6), square(0.4, 0.4, 0.1)],
        &[],
    );
    assert!(
        matches!(
            island,
            DomainError::HoleInHole {
                inner: 2,
                outer: 1,
                ..
            }
        ),
        "{island}"
    );
    let meet = |holes: &[Vec<P>], one: Part, two: Part| {
        let error = refused(&unit(), holes, &[]);
        let DomainError::PolygonsMeet { first, second } = &error else {
            panic!("{error}")
        };
        assert_eq!((first.part, second.part), (one, two), "{error}");
    };
    let inner = square(0.25, 0.25, 0.25);
    // Across the outline, in a vertex on it, along it, and the outline itself.
    meet(&[square(0.75, 0.25, 0.5)], Part::Outer, Part::Hole(1));
    meet(
        &[vec![[0.5, 0.0], [0.75, 0.5], [0.25, 0.5]]],
        Part::Outer,
        Part::Hole(1),
    );
    meet(&[square(0.0, 0.25, 0.5)], Part::Outer, Part::Hole(1));
    meet(&[unit()], Part::Outer, Part::Hole(1));
    // Two holes that overlap, touch in a corner, along an edge, and are the same.
    meet(
        &[inner.clone(), square(0.4, 0.4, 0.25)],
        Part::Hole(1),
        Part::Hole(2),
    );
    meet(
        &[inner.clone(), square(0.5, 0.5, 0.25)],
        Part::Hole(1),
        Part::Hole(2),
    );
    meet(
        &[inner.clone(), square(0.5, 0.25, 0.25)],
        Part::Hole(1),
        Part::Hole(2),
    );
    meet(&[inner.clone(), inner], Part::Hole(1), Part::Hole(2));
}

#[test]
fn lines_out_of_place() {
    let hole = [square(0.25, 0.25, 0.5)];
    // Outside, inside a hole, through a corner into the open, along a diagonal of a hole.
    for (holes, line) in [
        (&[][..], vec![[2.0, 2.0], [3.0, 3.0]]),
        (&hole[..], vec![[0.3, 0.3], [0.6, 0.6]]),
        (&[][..], vec![[0.5, 0.5], [2.0, 2.0]]),
        (&hole[..], vec![[0.1, 0.1], [0.9, 0.9]]),
    ] {
        let error = refused(&unit(), holes, std::slice::from_ref(&line));
        assert!(
            matches!(
                error,
                DomainError::LineOutside {
                    line: 1,
                    edge: 1,
                    ..
                }
            ),
            "{line:?}: {error}"
        );
    }
    let error = refused(&unit(), &[], &[vec![[0.1, 0.5], [0.5, 0.5], [1.5, 0.6]]]);
    assert_eq!(
        error.to_string(),
        "line 1 crosses the outer polygon: edge 2 of line 1, `(0.5, 0.5)` to `(1.5, 0.6)` \
         and edge 2 of the outer polygon, `(1, 0)` to `(1, 1)`"
    );
    let error = refused(&unit(), &hole, &[vec![[0.1, 0.5], [0.9, 0.5]]]);
    assert!(
        matches!(&error, DomainError::LineCrosses { second, .. } if second.part == Part::Hole(1)),
        "{error}"
    );
    let cross = [vec![[0.1, 0.1], [0.9, 0.9]], vec![[0.1, 0.9], [0.9, 0.1]]];
    let error = refused(&unit(), &[], &cross);
    assert!(
        error.to_string().starts_with("line 2 crosses line 1: "),
        "{error}"
    );
    assert_eq!(
        error.hint().unwrap(),
        "add the crossing point as a vertex to both"
    );
    // As the hint says.
    let joined = [
        vec![[0.1, 0.1], [0.5, 0.5], [0.9, 0.9]],
        vec![[0.1, 0.9], [0.5, 0.5], [0.9, 0.1]],
    ];
    polygon(&unit(), &[], &joined, 0.5).unwrap();
    let bow = [vec![[0.1, 0.1], [0.9, 0.9], [0.9, 0.1], [0.1, 0.9]]];
    let error = refused(&unit(), &[], &bow);
    assert!(matches!(error, DomainError::LineCrosses { .. }), "{error}");
}

#[test]
fn details_beyond_reach() {
    // A strip so thin that good triangles would be too many.
    let strip = [[0.0, 0.0], [1.0, 0.0], [1.0, 1e-7], [0.0, 1e-7]];
    let error = refused(&strip, &[], &[]);
    assert!(matches!(error, DomainError::VertexLimit { .. }), "{error}");
}
