use super::*;
use crate::rectangle;

fn mesh(points: &[Point], triangles: &[[u32; 3]]) -> RawMesh {
    RawMesh {
        points: points.to_vec(),
        triangles: triangles.to_vec(),
        regions: vec![0; triangles.len()],
    }
}

fn defect(points: &[Point], triangles: &[[u32; 3]]) -> MeshDefect {
    check(&mesh(points, triangles)).unwrap_err()
}

const SQUARE: [Point; 4] = [[0., 0.], [1., 0.], [1., 1.], [0., 1.]];

#[test]
fn good_meshes_pass() {
    check(&mesh(&SQUARE, &[[0, 1, 2], [0, 2, 3]])).unwrap();
    check(&rectangle([-1.0, -1.0], [1.0, 2.0], 0.1).unwrap()).unwrap();
    // Two components, and a second one that touches in a point with a vertex of its own.
    let apart = [[0., 0.], [1., 0.], [0., 1.], [5., 0.], [6., 0.], [5., 1.]];
    check(&mesh(&apart, &[[0, 1, 2], [3, 4, 5]])).unwrap();
    let touching = [[0., 0.], [1., 0.], [0., 1.], [1., 0.], [2., 0.], [1., 1.]];
    check(&mesh(&touching, &[[0, 1, 2], [3, 4, 5]])).unwrap();
}

#[test]
fn extreme_scales_pass_and_fail_alike() {
    for e in [-480, 480] {
        let s = 2f64.powi(e);
        let scaled = SQUARE.map(|p| [p[0] * s, p[1] * s]);
        check(&mesh(&scaled, &[[0, 1, 2], [0, 2, 3]])).unwrap();
        let thin = [[0.0, 0.0], [s, s], [0.5 * s, 0.5 * s], [0.0, s]];
        let found = defect(&thin, &[[0, 1, 2], [0, 1, 3]]);
        assert!(
            matches!(found, MeshDefect::ZeroArea { triangle: 0, .. }),
            "{found:?}"
        );
    }
    let huge = SQUARE.map(|p| [p[0] * 1e200, p[1]]);
    assert!(matches!(
        defect(&huge, &[[0, 1, 2], [0, 2, 3]]),
        MeshDefect::Extent { .. }
    ));
}

#[test]
fn broken_lists() {
    assert_eq!(defect(&[], &[]), MeshDefect::NoTriangles);
    assert!(matches!(
        defect(&SQUARE, &[[0, 1, 9]]),
        MeshDefect::UnknownVertex {
            triangle: 0,
            vertex: 9
        }
    ));
    assert!(matches!(
        defect(&SQUARE, &[[0, 1, 2]]),
        MeshDefect::Unused { vertex: 3, .. }
    ));
    let nan = [[0., 0.], [1., f64::NAN], [1., 1.]];
    assert!(matches!(
        defect(&nan, &[[0, 1, 2]]),
        MeshDefect::NotFinite { vertex: 1, .. }
    ));
    let mut short = mesh(&SQUARE, &[[0, 1, 2], [0, 2, 3]]);
    short.regions.pop();
    assert!(matches!(
        check(&short),
        Err(MeshDefect::Regions {
            regions: 1,
            triangles: 2
        })
    ));
}

#[test]
fn bad_triangles() {
    let line = [[0., 0.], [1., 1.], [3., 3.]];
    assert!(matches!(
        defect(&line, &[[0, 1, 2]]),
        MeshDefect::ZeroArea { triangle: 0, .. }
    ));
    assert!(matches!(
        defect(&[[2., 2.]], &[[0, 0, 0]]),
        MeshDefect::ZeroArea { .. }
    ));
    let found = defect(&SQUARE, &[[0, 1, 2], [0, 3, 2]]);
    assert!(matches!(found, MeshDefect::Clockwise { triangle: 1, .. }));
    let found = defect(&SQUARE, &[[0, 1, 2], [0, 2, 3], [2, 0, 1]]);
    assert!(matches!(
        found,
        MeshDefect::Duplicate {
            triangles: [0, 2],
            ..
        }
    ));
    assert_eq!(
        found.to_string(),
        "triangle 0 and triangle 2 are the same triangle: `(1, 1)`, `(0, 0)`, `(1, 0)`"
    );
    assert!(found.hint().is_some());
}

#[test]
fn bad_edges() {
    let points = [[0., 0.], [1., 0.], [1., 1.], [0., 1.], [0.5, 2.]];
    let found = defect(&points, &[[0, 1, 2], [0, 2, 3], [0, 2, 4]]);
    assert!(
        matches!(
            found,
            MeshDefect::SharedEdge {
                triangles: [0, 1, 2],
                ..
            }
        ),
        "{found:?}"
    );
    let points = [[0., 0.], [1., 0.], [0.5, 1.], [0.6, 2.]];
    let found = defect(&points, &[[0, 1, 2], [0, 1, 3]]);
    assert!(
        matches!(
            found,
            MeshDefect::Fold {
                triangles: [0, 1],
                ..
            }
        ),
        "{found:?}"
    );
}

#[test]
fn triangles_that_wind_twice() {
    // Ten sectors of 72 degrees around one vertex.
    let mut points = vec![[0.0, 0.0]];
    for k in 0..10 {
        let (sin, cos) = (TAU * f64::from(k) / 5.0 + 0.1).sin_cos();
        let r = 1.0 + 0.05 * f64::from(k);
        points.push([r * cos, r * sin]);
    }
    let triangles: Vec<_> = (0..10).map(|k| [0, 1 + k, 1 + (k + 1) % 10]).collect();
    assert!(matches!(
        defect(&points, &triangles),
        MeshDefect::Overlap { at: [0.0, 0.0], .. }
    ));
    // Open at the boundary: six of them overlap as well, four do not.
    let four: Vec<_> = (0..4).map(|k| [0, 1 + k, 2 + k]).collect();
    check(&mesh(&points[..6], &four)).unwrap();
    let six: Vec<_> = (0..6).map(|k| [0, 1 + k, 2 + k]).collect();
    assert!(matches!(
        defect(&points[..8], &six),
        MeshDefect::Overlap { .. }
    ));
}

#[test]
fn hanging_nodes_are_found() {
    // The right half has a vertex in the middle of the common edge.
    let points = [[0., 0.], [1., 0.], [1., 1.], [0., 1.], [2., 0.5], [1., 0.5]];
    let triangles = [[0, 1, 2], [0, 2, 3], [1, 4, 5], [5, 4, 2]];
    let found = defect(&points, &triangles);
    let MeshDefect::HangingNode { triangle, at, edge } = &found else {
        panic!("{found:?}")
    };
    assert_eq!(
        (*triangle, *at, *edge),
        (0, [1.0, 0.5], [[1.0, 0.0], [1.0, 1.0]])
    );
    assert_eq!(
        found.to_string(),
        "mesh is not conforming: vertex `(1, 0.5)` hangs in the edge `(1, 0)` to `(1, 1)` of triangle 0"
    );
}

#[test]
fn hanging_nodes_off_by_rounding_are_found() {
    // On a slope, the midpoint rounds off the edge; far from the origin by more.
    for offset in [0.0, 1e7] {
        let (a, b) = ([offset + 0.1, 0.2], [offset + 1.0 / 3.0, 1.7]);
        let m = [a[0] + (b[0] - a[0]) * 0.3, a[1] + (b[1] - a[1]) * 0.3];
        let points = [a, b, [offset - 1.0, 1.0], [offset + 2.0, 1.0], m];
        let found = defect(&points, &[[0, 1, 2], [0, 3, 4], [4, 3, 1]]);
        assert!(
            matches!(found, MeshDefect::HangingNode { triangle: 0, .. }),
            "{found:?}"
        );
    }
}

#[test]
fn a_fine_gap_is_no_hanging_node() {
    // A thin own triangle, and a vertex 1e-6 away from the edge of another component.
    let points = [
        [0., 0.],
        [1., 0.],
        [0.5, -1e-9],
        [0.5, 1e-6],
        [0.4, 1.],
        [0.3, 1.],
    ];
    check(&mesh(&points, &[[0, 2, 1], [3, 4, 5]])).unwrap();
}

#[test]
fn one_hanging_node_among_many_boundary_edges() {
    // A comb of components so that the tree has depth; one tooth has a vertex in its long edge.
    let mut points = Vec::new();
    let mut triangles = Vec::new();
    for k in 0..2000u32 {
        let x = f64::from(k) * 0.01;
        let base = points.len() as u32;
        points.extend([[x, 0.1 * x], [x + 0.005, 0.1 * x], [x + 0.0041, 7.0]]);
        triangles.push([base, base + 1, base + 2]);
    }
    check(&mesh(&points, &triangles)).unwrap();
    let base = points.len() as u32;
    let (a, b) = (points[3 * 1234], points[3 * 1234 + 2]);
    let m = [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
    points.extend([m, [m[0] - 1e-3, m[1]], [m[0] - 1e-3, m[1] - 1e-3]]);
    triangles.push([base, base + 1, base + 2]);
    let found = defect(&points, &triangles);
    assert!(
        matches!(found, MeshDefect::HangingNode { triangle: 1234, .. }),
        "{found:?}"
    );
}

#[test]
fn unmerged_nodes_are_found() {
    let points = [[0., 0.], [1., 0.], [1., 1.], [0., 0.], [1., 1.], [-0., 1.]];
    let found = defect(&points, &[[0, 1, 2], [3, 4, 5]]);
    assert!(
        matches!(
            found,
            MeshDefect::CoincidentEdges {
                triangles: [0, 1],
                ..
            }
        ),
        "{found:?}"
    );
}
