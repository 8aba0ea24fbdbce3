//! Polygons that are meshed: area, quality, kept vertices and lines, scaling.

use domain::{DomainError, Quality, RawMesh, check::check, geometry, polygon, quality};
use proptest::prelude::*;

type P = [f64; 2];

fn mesh(outer: &[P], holes: &[Vec<P>], lines: &[Vec<P>], size: f64) -> (RawMesh, Quality) {
    let (mesh, report) = polygon(outer, holes, lines, size).unwrap_or_else(|e| panic!("{e}"));
    check(&mesh).unwrap();
    assert_eq!(report, quality(&mesh));
    (mesh, report)
}

fn area(mesh: &RawMesh) -> f64 {
    let mut sum = geometry::Sum::default();
    for t in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.corners(t);
        sum.add(0.5 * geometry::cross(a, b, c));
    }
    sum.value()
}

fn largest(mesh: &RawMesh) -> f64 {
    (0..mesh.triangles.len())
        .map(|t| {
            let [a, b, c] = mesh.corners(t);
            0.5 * geometry::cross(a, b, c)
        })
        .fold(0.0, f64::max)
}

fn assert_area(mesh: &RawMesh, wanted: f64) {
    let found = area(mesh);
    assert!(
        (found - wanted).abs() <= 1e-12 * wanted,
        "{found} for {wanted}"
    );
}

/// Total length of the mesh edges that lie on the segment from `a` to `b`.
fn covered(mesh: &RawMesh, a: P, b: P) -> f64 {
    let length = geometry::distance(a, b);
    let on = |p: P| {
        geometry::cross(a, b, p).abs() <= 1e-9 * length * length
            && geometry::in_box(
                [a[0].min(b[0]) - 1e-9, a[1].min(b[1]) - 1e-9],
                [a[0].max(b[0]) + 1e-9, a[1].max(b[1]) + 1e-9],
                p,
            )
    };
    let mut edges = std::collections::BTreeSet::new();
    for corners in &mesh.triangles {
        for k in 0..3 {
            let (u, v) = (corners[k], corners[(k + 1) % 3]);
            if on(mesh.points[u as usize]) && on(mesh.points[v as usize]) {
                edges.insert((u.min(v), u.max(v)));
            }
        }
    }
    edges
        .iter()
        .map(|&(u, v)| geometry::distance(mesh.points[u as usize], mesh.points[v as usize]))
        .sum()
}

fn square(x: f64, y: f64, side: f64) -> Vec<P> {
    vec![[x, y], [x + side, y], [x + side, y + side], [x, y + side]]
}

const ELL: [P; 6] = [
    [-1., -1.],
    [0., -1.],
    [0., 0.],
    [1., 0.],
    [1., 1.],
    [-1., 1.],
];

#[test]
fn unit_square() {
    for size in [10.0, 0.5, 0.1, 0.03] {
        let (m, q) = mesh(&square(0.0, 0.0, 1.0), &[], &[], size);
        assert_area(&m, 1.0);
        assert!(q.meets_angle_limit(), "{q:?}");
        assert!(largest(&m) <= 3f64.sqrt() / 4.0 * size * size * (1.0 + 1e-12));
        assert_eq!(m.points[..4], square(0.0, 0.0, 1.0));
        assert_eq!(m.regions, vec![0; m.triangles.len()]);
    }
}

#[test]
fn orientation_and_closing_point_do_not_matter() {
    let (base, _) = mesh(&ELL, &[], &[], 0.3);
    assert_area(&base, 3.0);
    let mut closed = ELL.to_vec();
    closed.push(ELL[0]);
    assert_eq!(mesh(&closed, &[], &[], 0.3).0, base);
    let reversed: Vec<P> = ELL.iter().rev().copied().collect();
    assert_area(&mesh(&reversed, &[], &[], 0.3).0, 3.0);
}

#[test]
fn ell_is_of_good_shape() {
    let (m, q) = mesh(&ELL, &[], &[], 0.2);
    assert_area(&m, 3.0);
    assert!(q.meets_angle_limit(), "{q:?}");
    assert!(q.max_aspect_ratio < 2.5, "{q:?}");
    for (k, &a) in ELL.iter().enumerate() {
        let b = ELL[(k + 1) % 6];
        assert!((covered(&m, a, b) - geometry::distance(a, b)).abs() < 1e-12);
    }
}

#[test]
fn holes_are_left_out() {
    let mut reversed = square(2.0, 2.0, 1.0);
    reversed.reverse();
    let octagon: Vec<P> = (0..8)
        .map(|k| {
            let (s, c) = (std::f64::consts::TAU * f64::from(k) / 8.0).sin_cos();
            [3.0 + 0.4 * c, 0.8 + 0.4 * s]
        })
        .collect();
    let holes = [square(0.5, 0.5, 1.0), reversed, octagon.clone()];
    let (m, q) = mesh(&square(0.0, 0.0, 4.0), &holes, &[], 0.3);
    let octagon_area = 0.5 * geometry::twice_area(&octagon);
    assert_area(&m, 16.0 - 2.0 - octagon_area);
    assert!(q.meets_angle_limit(), "{q:?}");
    // No triangle has its centroid in a hole.
    for t in 0..m.triangles.len() {
        let [a, b, c] = m.corners(t);
        let center = [(a[0] + b[0] + c[0]) / 3.0, (a[1] + b[1] + c[1]) / 3.0];
        assert!(!holes.iter().any(|h| geometry::inside(h, center)));
    }
}

#[test]
fn lines_are_kept_as_edges() {
    // Across the whole domain, ending in the outline; one dangling; one that ends on another.
    let lines = vec![
        vec![[0.0, 0.3], [0.5, 0.55], [1.0, 0.4]],
        vec![[0.2, 0.8], [0.7, 0.9]],
        vec![[0.25, 0.425], [0.25, 0.1]],
    ];
    let (m, q) = mesh(&square(0.0, 0.0, 1.0), &[], &lines, 0.2);
    assert_area(&m, 1.0);
    for line in &lines {
        for pair in line.windows(2) {
            let wanted = geometry::distance(pair[0], pair[1]);
            let found = covered(&m, pair[0], pair[1]);
            assert!(
                (found - wanted).abs() < 1e-9,
                "{pair:?}: {found} for {wanted}"
            );
        }
    }
    assert!(q.meets_angle_limit(), "{q:?}");
    // Without them, the first is no union of edges.
    let (plain, _) = mesh(&square(0.0, 0.0, 1.0), &[], &[], 0.2);
    assert!(covered(&plain, [0.0, 0.3], [0.5, 0.55]) < 0.5);
}

#[test]
fn lines_do_not_confuse_inside_and_outside() {
    // Lines around holes, closed lines, lines inside lines: layers that do not count.
    let holes = [square(1.0, 1.0, 1.0), square(6.0, 6.0, 1.0)];
    let closed = |x: f64, side: f64| {
        let mut ring = square(x, x, side);
        ring.push(ring[0]);
        ring
    };
    let lines = [
        closed(0.5, 2.0),
        closed(0.25, 3.0),
        vec![[0.0, 5.0], [8.0, 5.0]],
        vec![[4.0, 0.0], [4.0, 5.0]],
        vec![[6.0, 5.0], [6.0, 6.0]],
    ];
    let (m, _) = mesh(&square(0.0, 0.0, 8.0), &holes, &lines, 1.0);
    assert_area(&m, 62.0);
    // In a domain that is not convex, too.
    let lines = [
        vec![[-1.0, 0.0], [0.0, 0.0]],
        vec![[0.0, 0.0], [0.0, 1.0]],
        vec![[-0.5, -0.5], [-0.5, 0.5]],
    ];
    // The third crosses the first.
    assert!(matches!(
        polygon(&ELL, &[], &lines, 0.2),
        Err(DomainError::LineCrosses { .. })
    ));
    let (m, q) = mesh(&ELL, &[], &lines[..2], 0.2);
    assert_area(&m, 3.0);
    assert!(q.meets_angle_limit(), "{q:?}");
    assert!((covered(&m, [-1.0, 0.0], [0.0, 0.0]) - 1.0).abs() < 1e-12);
}

#[test]
fn lines_along_the_outline_and_ends_off_it_by_rounding() {
    let triangle = [[0.0, 0.0], [3.0, 1.0], [0.5, 2.0]];
    // A third of the way along two sides: not exactly on them.
    let ends = |t: f64| {
        let at = |a: P, b: P| [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])];
        vec![at(triangle[0], triangle[1]), at(triangle[2], triangle[1])]
    };
    let lines = [
        ends(1.0 / 3.0),
        ends(0.7),
        vec![triangle[0], triangle[2]],
        vec![triangle[0], triangle[2]],
    ];
    let (m, _) = mesh(&triangle, &[], &lines, 0.3);
    assert_area(&m, 0.5 * geometry::twice_area(&triangle));
    for line in &lines[..2] {
        let wanted = geometry::distance(line[0], line[1]);
        assert!((covered(&m, line[0], line[1]) - wanted).abs() < 1e-9);
    }
    // A line through a reflex corner, and one through the vertex of another line.
    let (m, _) = mesh(
        &ELL,
        &[],
        &[
            vec![[-0.5, -0.5], [0.5, 0.5]],
            vec![[-0.8, 0.5], [-0.2, 0.5]],
            vec![[-0.5, 0.5], [-0.5, 0.8]],
        ],
        0.3,
    );
    assert_area(&m, 3.0);
}

#[test]
fn small_input_angles_are_reported_not_refused() {
    let degrees = 5f64.to_radians();
    let spike = [
        [0.0, 0.0],
        [2.0, 0.0],
        [2.0 * degrees.cos(), 2.0 * degrees.sin()],
    ];
    let (m, q) = mesh(&spike, &[], &[], 0.2);
    assert_area(&m, 0.5 * geometry::twice_area(&spike));
    assert!(!q.meets_angle_limit());
    assert!((q.min_angle - 5.0).abs() < 1e-6, "{q:?}");
    // Twenty degrees are no reason for less.
    let degrees = 20f64.to_radians();
    let wedge = [
        [0.0, 0.0],
        [2.0, 0.0],
        [2.0 * degrees.cos(), 2.0 * degrees.sin()],
    ];
    let (_, q) = mesh(&wedge, &[], &[], 0.2);
    assert!(q.min_angle > 19.99, "{q:?}");
}

#[test]
fn narrow_notch() {
    let notch = [
        [0., 0.],
        [2., 0.],
        [2., 2.],
        [1.001, 2.],
        [1.0005, 0.5],
        [1., 2.],
        [0., 2.],
    ];
    let (m, q) = mesh(&notch, &[], &[], 0.3);
    assert_area(&m, 0.5 * geometry::twice_area(&notch));
    assert!(q.meets_angle_limit(), "{q:?}");
    assert!(m.triangles.len() < 5_000, "{}", m.triangles.len());
}

#[test]
fn far_from_the_origin() {
    let moved: Vec<P> = ELL.iter().map(|p| [p[0] + 1e7, p[1] - 1e7]).collect();
    let (m, q) = mesh(&moved, &[square(1e7 - 0.75, -1e7 + 0.25, 0.5)], &[], 0.2);
    // Corners of the mesh are rounded to 2e-9.
    assert!((area(&m) - 2.75).abs() < 1e-7);
    assert!(q.min_angle > 29.999, "{q:?}");
    assert_eq!(m.points[..6], moved);
    let huge: Vec<P> = ELL.iter().map(|p| [p[0] + 1e15, p[1]]).collect();
    assert!(polygon(&huge, &[], &[], 0.05).is_err());
}

#[test]
fn other_units() {
    for scale in [1e-6, 1e6] {
        let scaled: Vec<P> = ELL.iter().map(|p| p.map(|x| x * scale)).collect();
        let (m, q) = mesh(&scaled, &[], &[], 0.2 * scale);
        assert_area(&m, 3.0 * scale * scale);
        assert!(q.meets_angle_limit(), "{q:?}");
    }
}

#[test]
fn powers_of_two_scale_bitwise() {
    let outer = [[0.1, 0.2], [3.3, -0.4], [2.9, 2.7], [1.1, 1.3], [-0.3, 2.2]];
    let hole = vec![[1.0, 0.5], [1.6, 0.45], [1.4, 0.9]];
    let line = vec![[0.1, 0.2], [0.7, 0.9]];
    let scaled = |s: f64| {
        let times = |points: &[P]| {
            points
                .iter()
                .map(|p| [p[0] * s, p[1] * s])
                .collect::<Vec<P>>()
        };
        mesh(&times(&outer), &[times(&hole)], &[times(&line)], 0.3 * s)
    };
    let (base, base_quality) = scaled(1.0);
    for exponent in [-400, -52, -1, 1, 3, 400] {
        let s = 2f64.powi(exponent);
        let (m, q) = scaled(s);
        assert_eq!(m.triangles, base.triangles);
        for (p, b) in m.points.iter().zip(&base.points) {
            assert_eq!(*p, [b[0] * s, b[1] * s], "exponent {exponent}");
        }
        assert!((q.min_angle - base_quality.min_angle).abs() < 1e-12);
    }
}

#[test]
fn the_same_input_gives_the_same_mesh() {
    let holes = [square(-0.8, -0.8, 0.3), square(0.3, 0.3, 0.4)];
    let lines = [vec![[-1.0, 0.5], [0.0, 0.2]]];
    let first = mesh(&ELL, &holes, &lines, 0.1).0;
    for _ in 0..3 {
        assert_eq!(mesh(&ELL, &holes, &lines, 0.1).0, first);
    }
}

#[test]
fn thousands_of_vertices() {
    let n = 20_000;
    let outer: Vec<P> = (0..n)
        .map(|k| {
            let t = std::f64::consts::TAU * f64::from(k) / f64::from(n);
            let r = 1.0 + 0.2 * (7.0 * t).sin() + 0.001 * (900.0 * t).sin();
            [r * t.cos(), r * t.sin()]
        })
        .collect();
    let (m, _) = mesh(&outer, &[], &[], 0.1);
    assert_area(&m, 0.5 * geometry::twice_area(&outer));
}

/// A star-shaped polygon about `center`.
fn star(center: P, radii: &[f64], jitter: &[f64]) -> Vec<P> {
    let n = radii.len();
    (0..n)
        .map(|k| {
            let t = std::f64::consts::TAU * (k as f64 + 0.9 * jitter[k % jitter.len()]) / n as f64;
            [
                center[0] + radii[k] * t.cos(),
                center[1] + radii[k] * t.sin(),
            ]
        })
        .collect()
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(300) })]

    #[test]
    fn stars_are_meshed(
        radii in prop::collection::vec(0.3..1.0f64, 3..25),
        jitter in prop::collection::vec(0.0..1.0f64, 25),
        size in 0.1..1.0f64,
        center in [-10.0..10.0f64, -10.0..10.0f64],
    ) {
        let outer = star(center, &radii, &jitter);
        let hole = star(center, &[0.02, 0.03, 0.025, 0.02], &[0.0]);
        let line = vec![center.map(|x| x + 0.1), center.map(|x| x + 0.12)];
        for (holes, lines) in [(vec![], vec![]), (vec![hole.clone()], vec![]), (vec![], vec![line.clone()]), (vec![hole], vec![line])] {
            match polygon(&outer, &holes, &lines, size) {
                Ok((m, _)) => {
                    check(&m).unwrap();
                    let wanted = 0.5 * (geometry::twice_area(&outer) - holes.iter().map(|h| geometry::twice_area(h)).sum::<f64>());
                    prop_assert!((area(&m) - wanted).abs() < 1e-11 * wanted);
                }
                // With few vertices the centre, or the hole or line about it, may be outside.
                Err(e) => prop_assert!(matches!(e,
                    DomainError::HoleOutside { .. } | DomainError::PolygonsMeet { .. } | DomainError::LineOutside { .. } | DomainError::LineCrosses { .. }
                    | DomainError::SelfIntersection { .. }), "{}", e),
            }
        }
    }

    #[test]
    fn needles_are_meshed_or_refused(
        exponents in prop::collection::vec(-3.0..0.0f64, 3..12),
        jitter in prop::collection::vec(0.0..1.0f64, 12),
        with_line in any::<bool>(),
    ) {
        // Radii over three orders of magnitude: angles from almost 0 to almost 360 degrees.
        let radii: Vec<f64> = exponents.iter().map(|&e| 10f64.powf(e)).collect();
        let outer = star([0.3, -0.7], &radii, &jitter);
        let lines = if with_line { vec![vec![outer[0], [0.3, -0.7]]] } else { vec![] };
        match polygon(&outer, &[], &lines, 1.0) {
            Ok((m, _)) => {
                let wanted = 0.5 * geometry::twice_area(&outer).abs();
                prop_assert!((area(&m) - wanted).abs() < 1e-9 * wanted);
            }
            Err(DomainError::Generator { what }) => prop_assert!(false, "{}", what),
            Err(e) => prop_assert!(!e.to_string().is_empty()),
        }
    }

    #[test]
    fn anything_ends_with_a_mesh_or_an_error(
        outer in prop::collection::vec([0..7i32, 0..7i32], 0..9),
        hole in prop::collection::vec([0..7i32, 0..7i32], 0..5),
        line in prop::collection::vec([0..7i32, 0..7i32], 0..5),
        what in 0..4u8,
    ) {
        // A coarse grid: collinear points, touching edges and repeated vertices are frequent.
        let points = |list: &[[i32; 2]]| list.iter().map(|p| p.map(f64::from)).collect::<Vec<P>>();
        let holes = if what & 1 == 0 { vec![] } else { vec![points(&hole)] };
        let lines = if what & 2 == 0 { vec![] } else { vec![points(&line)] };
        match polygon(&points(&outer), &holes, &lines, 1.0) {
            Ok((m, _)) => {
                check(&m).unwrap();
                let wanted = 0.5 * (geometry::twice_area(&points(&outer)).abs() - holes.iter().map(|h| geometry::twice_area(h).abs()).sum::<f64>());
                prop_assert!((area(&m) - wanted).abs() < 1e-11 * wanted);
            }
            Err(DomainError::Generator { what }) => prop_assert!(false, "{}", what),
            Err(e) => prop_assert!(!e.to_string().is_empty() && !e.to_string().contains('\n')),
        }
    }

    #[test]
    fn lines_on_a_grid_are_meshed_or_refused(
        lines in prop::collection::vec(prop::collection::vec([0..7i32, 0..7i32], 2..5), 1..4),
        scale in prop::sample::select(vec![1.0, 0.1, 1.0 / 3.0]),
    ) {
        let to = |p: &[i32; 2]| p.map(|x| f64::from(x) * scale);
        let lines: Vec<Vec<P>> = lines.iter().map(|l| l.iter().map(to).collect()).collect();
        match polygon(&square(0.0, 0.0, 6.0 * scale), &[], &lines, scale) {
            Ok((m, _)) => {
                prop_assert!((area(&m) - 36.0 * scale * scale).abs() < 1e-11 * 36.0);
                for line in &lines {
                    for pair in line.windows(2) {
                        let wanted = geometry::distance(pair[0], pair[1]);
                        prop_assert!((covered(&m, pair[0], pair[1]) - wanted).abs() < 1e-7);
                    }
                }
            }
            Err(e) => prop_assert!(matches!(e, DomainError::LineCrosses { .. } | DomainError::RepeatedVertex { .. }), "{}", e),
        }
    }
}
