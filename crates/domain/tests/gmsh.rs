//! Mesh files that are read: every format gives the same mesh.

mod common;

use std::path::{Path, PathBuf};

use common::{FORMATS, PLAIN, Style, write22, write41};
use domain::{RawMesh, gmsh, polygon, rectangle};
use proptest::prelude::*;

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/data")
        .join(name)
}

fn parse(bytes: &[u8]) -> RawMesh {
    gmsh::parse(bytes, Path::new("test.msh")).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn files_in_both_versions_agree() {
    let new = gmsh::read(&data("P2_right_16.msh")).unwrap();
    let old = gmsh::read(&data("P2_right_16.v22.msh")).unwrap();
    assert_eq!(new.points, old.points);
    assert_eq!(new.triangles, old.triangles);
    // The older file has a physical tag on its triangles, the newer one has no entities.
    assert_eq!(new.regions, vec![0; 512]);
    assert_eq!(old.regions, vec![1; 512]);
    // Numbers of the file, minus one, in its order.
    assert_eq!(new.points.len(), 289);
    assert_eq!(new.points[1], [-1.0, -0.875]);
    assert_eq!(new.points[17], [-0.875, -1.0]);
    assert_eq!(new.triangles[0], [18, 0, 17]);
    assert_eq!(new.triangles[511], [270, 288, 271]);
}

fn sample() -> RawMesh {
    let (mut mesh, _) = polygon(
        &[[0.1, 0.0], [2.0, 1e-3], [1.7, 1.3], [0.3, 0.9]],
        &[],
        &[],
        0.4,
    )
    .unwrap();
    for (t, region) in mesh.regions.iter_mut().enumerate() {
        *region = [7, 0, 12][t * 3 / mesh.triangles.len()];
    }
    mesh
}

#[test]
fn every_format_gives_back_the_mesh() {
    let styles = [
        PLAIN,
        Style {
            clutter: true,
            z: -2.5,
            ..PLAIN
        },
        Style {
            offset: 100,
            stride: 37,
            ..PLAIN
        },
        Style {
            reverse: true,
            ..PLAIN
        },
        Style {
            reverse: true,
            offset: 5,
            stride: 1000,
            clutter: true,
            z: 1e-3,
        },
    ];
    for mesh in [sample(), rectangle([0.0, 0.0], [1.0, 1.0], 1.0).unwrap()] {
        for style in styles {
            for format in FORMATS {
                assert_eq!(
                    parse(&write22(&mesh, format, style)),
                    mesh,
                    "2.2 {format:?} {style:?}"
                );
                assert_eq!(
                    parse(&write41(&mesh, format, style)),
                    mesh,
                    "4.1 {format:?} {style:?}"
                );
            }
        }
    }
}

#[test]
fn tags_beyond_32_bits_are_read() {
    let mesh = sample();
    let style = Style {
        offset: 1 << 40,
        stride: 1 << 33,
        ..PLAIN
    };
    for format in FORMATS {
        assert_eq!(parse(&write41(&mesh, format, style)), mesh);
    }
}

#[test]
fn windows_line_ends_and_a_missing_last_one() {
    let mesh = sample();
    for bytes in [
        write22(&mesh, FORMATS[0], PLAIN),
        write41(&mesh, FORMATS[0], PLAIN),
    ] {
        let text = String::from_utf8(bytes).unwrap();
        assert_eq!(parse(text.replace('\n', "\r\n").as_bytes()), mesh);
        assert_eq!(parse(text.trim_end().as_bytes()), mesh);
    }
}

#[test]
fn unknown_sections_are_passed_over() {
    let mesh = sample();
    let extra = "$NodeData\n1\n\"u\"\n$Nodes in a text\n$EndNodeData\n";
    for format in FORMATS {
        for mut bytes in [write22(&mesh, format, PLAIN), write41(&mesh, format, PLAIN)] {
            bytes.extend(extra.bytes());
            assert_eq!(parse(&bytes), mesh);
        }
    }
}

#[test]
fn clockwise_triangles_are_turned_and_others_left_alone() {
    let mut mesh = sample();
    mesh.triangles[0].rotate_left(1);
    let wanted = mesh.clone();
    let [a, b, c] = mesh.triangles[3];
    mesh.triangles[3] = [a, c, b];
    for format in FORMATS {
        assert_eq!(parse(&write22(&mesh, format, PLAIN)), wanted);
        assert_eq!(parse(&write41(&mesh, format, PLAIN)), wanted);
    }
}

#[test]
fn reversed_surfaces_keep_their_region() {
    let mut mesh = sample();
    let wanted = mesh.clone();
    mesh.regions.iter_mut().for_each(|r| *r = -*r);
    assert_eq!(parse(&write22(&mesh, FORMATS[0], PLAIN)), wanted);
    assert_eq!(parse(&write41(&mesh, FORMATS[0], PLAIN)), wanted);
}

#[test]
fn a_little_noise_in_z_is_planar() {
    let text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n3\n1 0 0 1e-17\n2 1 0 0\n3 0 1 -1e-16\n$EndNodes\n\
                $Elements\n1\n1 2 2 4 1 1 2 3\n$EndElements\n";
    let mesh = parse(text.as_bytes());
    assert_eq!(mesh.regions, [4]);
}

#[test]
fn files_without_a_path_problem_are_read_from_disk() {
    let mesh = sample();
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("plate with space.msh");
    std::fs::write(&path, write41(&mesh, FORMATS[1], PLAIN)).unwrap();
    assert_eq!(gmsh::read(&path).unwrap(), mesh);
}

#[test]
fn a_large_file_is_read_in_moderate_time() {
    let mesh = rectangle([0.0, 0.0], [1.0, 1.0], 1.0 / 300.0).unwrap();
    assert_eq!(mesh.triangles.len(), 180_000);
    let start = std::time::Instant::now();
    for format in FORMATS {
        assert_eq!(parse(&write41(&mesh, format, PLAIN)), mesh);
        assert_eq!(parse(&write22(&mesh, format, PLAIN)), mesh);
    }
    let seconds = start.elapsed().as_secs_f64();
    assert!(seconds < 60.0, "{seconds} s");
}

/// A triangle with the given coordinates, in both ASCII versions.
fn ascii_triangle(x: f64, y: f64) -> [String; 2] {
    let nodes = [[0.0, 0.0], [1.0, 0.0], [x, y]];
    let row = |k: usize| format!("{:?} {:?} 0", nodes[k][0], nodes[k][1]);
    [
        format!(
            "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n3\n1 {}\n2 {}\n3 {}\n$EndNodes\n\
             $Elements\n1\n1 2 0 1 2 3\n$EndElements\n",
            row(0),
            row(1),
            row(2)
        ),
        format!(
            "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 3 1 3\n2 1 0 3\n1\n2\n3\n{}\n{}\n{}\n$EndNodes\n\
             $Elements\n1 1 1 1\n2 1 2 1\n1 1 2 3\n$EndElements\n",
            row(0),
            row(1),
            row(2)
        ),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(2000) })]

    #[test]
    fn decimal_numbers_are_read_to_the_last_bit(x in -1e3..1e3f64, e in -12..3i32, y in 1e-3..1e3f64) {
        let x = x * 10f64.powi(e);
        for text in ascii_triangle(x, y) {
            let mesh = parse(text.as_bytes());
            prop_assert_eq!(mesh.points[2], [x, y]);
        }
    }
}

mod mutations {
    use super::*;

    /// Whatever the bytes, reading ends with a mesh or an error.
    fn survives(bytes: &[u8]) {
        match gmsh::parse(bytes, Path::new("m.msh")) {
            Ok(mesh) => domain::check::check(&mesh).unwrap(),
            Err(error) => assert!(!error.to_string().is_empty()),
        }
    }

    fn originals() -> Vec<Vec<u8>> {
        let mesh = rectangle([0.0, 0.0], [2.0, 1.0], 1.0).unwrap();
        let style = Style {
            clutter: true,
            ..PLAIN
        };
        FORMATS
            .iter()
            .flat_map(|&f| [write22(&mesh, f, style), write41(&mesh, f, style)])
            .collect()
    }

    #[test]
    fn every_prefix_and_every_single_byte_survives() {
        for bytes in originals() {
            for n in 0..bytes.len() {
                survives(&bytes[..n]);
                for value in [0, b'0', b'9', b'-', b' ', b'\n', b'$', 0xff] {
                    let mut changed = bytes.clone();
                    changed[n] = value;
                    survives(&changed);
                }
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(3000) })]

        #[test]
        fn random_changes_survive(
            which in 0..6usize,
            changes in prop::collection::vec((0.0..1.0f64, any::<u8>(), 0..4u8), 1..12),
        ) {
            let mut bytes = originals().swap_remove(which);
            for (at, value, what) in changes {
                let at = (at * bytes.len() as f64) as usize;
                match what {
                    0 => bytes.insert(at, value),
                    1 if !bytes.is_empty() => { bytes.remove(at); }
                    2 => bytes.truncate(bytes.len().max(40).min(at + 60)),
                    _ if !bytes.is_empty() => bytes[at] = value,
                    _ => {}
                }
            }
            survives(&bytes);
        }
    }
}
