//! Mesh files that are refused, each with the line where possible.

mod common;

use std::path::Path;

use common::{FORMATS, Format, PLAIN, Style, write22, write41};
use domain::{GmshError, GmshFault, MeshDefect, Place, RawMesh, gmsh, rectangle};

fn refused(bytes: &[u8]) -> GmshError {
    let error = match gmsh::parse(bytes, Path::new("plate.msh")) {
        Ok(mesh) => panic!("accepted: {mesh:?}"),
        Err(error) => error,
    };
    let text = error.to_string();
    assert!(text.starts_with("mesh file `plate.msh`"), "{text}");
    assert!(!text.ends_with('.') && !text.contains('\n'), "{text}");
    error
}

/// Both versions of a mesh with the given nodes and triangles, in ASCII: nodes are rows after the
/// tag, in 2.2 from line 6 on; elements are node tags.
fn both(nodes: &[(u64, &str)], triangles: &[&str]) -> [String; 2] {
    let (n, m) = (nodes.len(), triangles.len());
    let mut old = format!("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{n}\n");
    let mut new = format!("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 {n} 1 {n}\n2 1 0 {n}\n");
    for (tag, row) in nodes {
        old += &format!("{tag} {row}\n");
        new += &format!("{tag}\n");
    }
    for (_, row) in nodes {
        new += &format!("{row}\n");
    }
    old += &format!("$EndNodes\n$Elements\n{m}\n");
    new += &format!("$EndNodes\n$Elements\n1 {m} 1 {m}\n2 1 2 {m}\n");
    for (k, row) in triangles.iter().enumerate() {
        old += &format!("{} 2 2 1 1 {row}\n", k + 1);
        new += &format!("{} {row}\n", k + 1);
    }
    [old + "$EndElements\n", new + "$EndElements\n"]
}

const SQUARE: [(u64, &str); 4] = [(1, "0 0 0"), (2, "1 0 0"), (3, "1 1 0"), (4, "0 1 0")];

/// Both versions are refused for the same reason, at the given lines.
fn both_refused(
    nodes: &[(u64, &str)],
    triangles: &[&str],
    lines: [Option<usize>; 2],
    is: impl Fn(&GmshFault) -> bool,
) {
    for (text, line) in both(nodes, triangles).iter().zip(lines) {
        let error = refused(text.as_bytes());
        assert!(is(error.fault()), "{error:?}");
        assert_eq!(error.line(), line, "{error}\n{text}");
    }
}

fn defect(fault: &GmshFault) -> Option<&MeshDefect> {
    match fault {
        GmshFault::Defect { defect, .. } => Some(defect),
        _ => None,
    }
}

#[test]
fn the_good_case_is_good() {
    for text in both(&SQUARE, &["1 2 3", "1 3 4"]) {
        let mesh = gmsh::parse(text.as_bytes(), Path::new("p")).unwrap();
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    }
}

#[test]
fn files_that_cannot_be_read() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("nowhere.msh");
    let error = gmsh::read(&path).unwrap_err();
    assert!(error.is_io());
    assert!(error.to_string().contains("nowhere.msh"));
    assert!(error.hint().unwrap().contains("relative path"));
    assert!(gmsh::read(dir.path()).unwrap_err().is_io());
}

#[test]
fn files_that_are_something_else() {
    for bytes in [&b""[..], b"\n \n"] {
        let error = refused(bytes);
        assert!(matches!(error.fault(), GmshFault::Empty));
        assert_eq!(error.to_string(), "mesh file `plate.msh`: file is empty");
    }
    for bytes in [
        &b"solid cube\n"[..],
        b"$Nodes\n",
        b"\x00\x01\x02",
        b"$MeshFormatted\n4.1 0 8\n",
    ] {
        let error = refused(bytes);
        assert!(matches!(error.fault(), GmshFault::NotGmsh), "{error}");
        assert!(error.hint().is_some());
    }
}

#[test]
fn other_versions() {
    for version in ["4.0", "4", "3", "3.0", "2.1", "2", "1", "5.0", "4.2"] {
        let error = refused(format!("$MeshFormat\n{version} 0 8\n$EndMeshFormat\n").as_bytes());
        assert_eq!(
            error.to_string(),
            format!(
                "mesh file `plate.msh`, line 2: MSH version `{version}` is not supported, only 2.2 and 4.1 are"
            )
        );
        assert!(error.hint().unwrap().contains("4.1"));
    }
    let error = refused(b"$NOD\n1\n1 0 0 0\n$ENDNOD\n");
    assert!(
        matches!(error.fault(), GmshFault::Version { found } if found == "1"),
        "{error}"
    );
    for line in [
        "4.1",
        "4.1 0",
        "4.1 0 8 8",
        "4.1 2 8",
        "4.1 0 3",
        "4.1 0 99999999999",
        "2.2 0 4",
        "x 0 8",
        "4.1 -1 8",
    ] {
        let error = refused(format!("$MeshFormat\n{line}\n$EndMeshFormat\n").as_bytes());
        assert!(
            matches!(error.fault(), GmshFault::Format { .. }),
            "{line}: {error}"
        );
        assert_eq!(error.line(), Some(2));
    }
    let error = refused(b"$MeshFormat\n4.1 1 8\n\x02\0\0\0\n$EndMeshFormat\n");
    assert!(matches!(error.fault(), GmshFault::ByteOrder), "{error}");
    let error = refused(b"$MeshFormat\n4.1 0 8\n$Nodes\n");
    assert!(
        matches!(
            error.fault(),
            GmshFault::SectionEnd {
                section: "MeshFormat",
                ..
            }
        ),
        "{error}"
    );
}

fn sample() -> RawMesh {
    rectangle([0.0, 0.0], [2.0, 1.0], 0.5).unwrap()
}

#[test]
fn every_truncation_is_noticed() {
    for format in FORMATS {
        for bytes in [
            write22(&sample(), format, PLAIN),
            write41(&sample(), format, PLAIN),
        ] {
            // Up to the end of the last tag every file is incomplete.
            for n in 0..bytes.len() - 1 {
                let error = refused(&bytes[..n]);
                assert!(!error.is_io());
            }
        }
    }
    let text = write22(&sample(), Format::Ascii, PLAIN);
    let error = refused(&text[..text.len() / 2]);
    assert!(error.line().is_some(), "{error}");
}

#[test]
fn sections_that_miss_or_repeat() {
    let section = |text: &str, name: &str| {
        let from = text.find(&format!("${name}\n")).unwrap();
        let end = format!("$End{name}\n");
        from..text.find(&end).unwrap() + end.len()
    };
    for text in both(&SQUARE, &["1 2 3", "1 3 4"]) {
        for name in ["Nodes", "Elements"] {
            let range = section(&text, name);
            let mut without = text.clone();
            without.replace_range(range.clone(), "");
            let error = refused(without.as_bytes());
            assert!(
                matches!(error.fault(), GmshFault::MissingSection { section } if *section == name),
                "{error}"
            );
            let twice = text.clone() + &text[range];
            let error = refused(twice.as_bytes());
            assert!(
                matches!(error.fault(), GmshFault::RepeatedSection { section } if *section == name),
                "{error}"
            );
        }
        let error = refused((text.clone() + "hello\n").as_bytes());
        assert!(
            matches!(error.fault(), GmshFault::NoSection { .. }),
            "{error}"
        );
    }
    let [old, new] = both(&SQUARE, &["1 2 3", "1 3 4"]);
    let error = refused((new + "$PartitionedEntities\n0\n$EndPartitionedEntities\n").as_bytes());
    assert!(matches!(error.fault(), GmshFault::Partitioned), "{error}");
    let error = refused((old + "$ParametricNodes\n0\n$EndParametricNodes\n").as_bytes());
    assert!(matches!(error.fault(), GmshFault::Parametric), "{error}");
}

#[test]
fn wrong_counts() {
    for format in FORMATS {
        let old = write22(&sample(), format, PLAIN);
        // 15 nodes, 16 elements.
        for (from, to) in [
            ("\n15\n", "\n14\n"),
            ("\n15\n", "\n16\n"),
            ("\n16\n", "\n15\n"),
            ("\n16\n", "\n17\n"),
        ] {
            let at = old.windows(4).position(|w| w == from.as_bytes()).unwrap();
            let mut changed = old.clone();
            changed[at..at + 4].copy_from_slice(to.as_bytes());
            refused(&changed);
        }
    }
    let [old, new] = both(&SQUARE, &["1 2 3", "1 3 4"]);
    for (text, from, to) in [
        (&old, "$Nodes\n4", "$Nodes\n4000000000000000000"),
        (&old, "$Elements\n2", "$Elements\n18446744073709551615"),
        (&new, "1 4 1 4", "1 4000000000000 1 4"),
        (&new, "1 4 1 4", "4000000000000 4 1 4"),
        (&new, "2 1 0 4", "2 1 0 4000000000000"),
        (&new, "2 1 2 2", "2 1 2 2000000000000"),
        (&new, "1 2 1 2", "1 18446744073709551615 1 2"),
    ] {
        let error = refused(text.replacen(from, to, 1).as_bytes());
        assert!(matches!(error.fault(), GmshFault::Count { .. }), "{error}");
        assert!(error.line().is_some());
    }
    // The same in binary, where the numbers are bytes.
    for format in [Format::Little, Format::Big] {
        let bytes = write41(&sample(), format, PLAIN);
        let find =
            |tag: &[u8]| bytes.windows(tag.len()).position(|w| w == tag).unwrap() + tag.len();
        for (at, width) in [
            (find(b"$Nodes\n"), 8),
            (find(b"$Nodes\n") + 8, 8),
            (find(b"$Elements\n"), 8),
        ] {
            let mut changed = bytes.clone();
            changed[at..at + width].fill(0x3f);
            let error = refused(&changed);
            assert!(matches!(error.fault(), GmshFault::Count { .. }), "{error}");
            assert!(matches!(error.place(), Place::Byte(_)));
        }
    }
}

#[test]
fn lines_that_are_wrong() {
    let [old, new] = both(&SQUARE, &["1 2 3", "1 3 4"]);
    let number = |f: &GmshFault| matches!(f, GmshFault::Number { .. });
    let short = |f: &GmshFault| matches!(f, GmshFault::TooShort { .. });
    let long = |f: &GmshFault| matches!(f, GmshFault::TooLong { .. });
    type Is<'a> = &'a dyn Fn(&GmshFault) -> bool;
    for (text, from, to, line, is) in [
        (&old, "2 1 0 0", "2 1 zero 0", 7, &number as Is),
        (&old, "2 1 0 0", "2 1 0", 7, &short),
        (&old, "2 1 0 0", "2 1 0 0 0", 7, &long),
        (&old, "2 1 0 0", "-2 1 0 0", 7, &number),
        (&old, "2 1 0 0", "0 1 0 0", 7, &number),
        (&old, "2 2 2 1 1 1 3 4", "2 2 2 1 1 1 3", 14, &short),
        (&old, "2 2 2 1 1 1 3 4", "2 2 3 1 1 1 3 4", 14, &short),
        (&old, "2 2 2 1 1 1 3 4", "2 2 1 1 1 1 3 4", 14, &long),
        (&old, "2 2 2 1 1 1 3 4", "2 2 -1 1 1 1 3 4", 14, &number),
        (&old, "$Nodes\n4", "$Nodes\nfour", 5, &number),
        (&new, "1 4 1 4", "1 4 1", 5, &short),
        (&new, "1 0 0", "1 0", 12, &short),
        (&new, "1 0 0", "1 0 0 0", 12, &long),
        (&new, "1 0 0", "1 o 0", 12, &number),
        (&new, "2 1 3 4", "2 1 3", 20, &short),
        (&new, "2 1 3 4", "2 1 3 4 5", 20, &long),
        (&new, "2 1 3 4", "2 1 -3 4", 20, &number),
    ] {
        assert!(text.contains(from), "{text}");
        let error = refused(text.replacen(from, to, 1).as_bytes());
        assert!(is(error.fault()), "{from} -> {to}: {error:?}");
        assert_eq!(error.line(), Some(line), "{from} -> {to}: {error}");
    }
    // Something that only the parser of 4.1 sees: a smallest tag of 0.
    let error = refused(new.replacen("1 4 1 4", "1 4 0 4", 1).as_bytes());
    assert!(matches!(error.fault(), GmshFault::Parser { .. }), "{error}");
    assert_eq!(error.line(), Some(5), "{error}");
    let error = refused(new.replacen("2 1 0 4", "2 1 1 4", 1).as_bytes());
    assert!(matches!(error.fault(), GmshFault::Parametric), "{error}");
    assert_eq!(error.line(), Some(6), "{error}");
}

#[test]
fn elements_that_are_not_supported() {
    let [old, new] = both(&SQUARE, &["1 2 3", "1 3 4"]);
    for (kind, name) in [
        (9, "second-order triangles"),
        (3, "quadrangles"),
        (4, "tetrahedra"),
        (5, "hexahedra"),
        (21, "third-order triangles"),
        (999, "unknown elements"),
    ] {
        for (text, line) in [
            (
                old.replace("2 2 2 1 1 1 3 4", &format!("2 {kind} 2 1 1 1 3 4")),
                14,
            ),
            (new.replace("2 1 2 2", &format!("2 1 {kind} 2")), 18),
        ] {
            let error = refused(text.as_bytes());
            assert_eq!(
                error.to_string(),
                format!(
                    "mesh file `plate.msh`, line {line}: {name} (type {kind}) are not supported"
                )
            );
            assert!(error.hint().unwrap().contains("ElementOrder"));
        }
    }
}

#[test]
fn no_triangles() {
    let lines_only = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n2\n1 0 0 0\n2 1 0 0\n$EndNodes\n$Elements\n1\n1 1 0 1 2\n$EndElements\n";
    let new_lines = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 2 1 2\n1 1 0 2\n1\n2\n0 0 0\n1 0 0\n$EndNodes\n$Elements\n1 1 1 1\n1 1 1 1\n1 1 2\n$EndElements\n";
    let empty = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n0 0 0 0\n$EndNodes\n$Elements\n0 0 0 0\n$EndElements\n";
    let none =
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n0\n$EndNodes\n$Elements\n0\n$EndElements\n";
    for text in [lines_only, new_lines, empty, none] {
        let error = refused(text.as_bytes());
        assert_eq!(
            error.to_string(),
            "mesh file `plate.msh`: mesh has no triangles"
        );
        assert!(error.hint().unwrap().contains("physical group"));
    }
}

#[test]
fn nodes_that_are_wrong() {
    both_refused(&SQUARE, &["1 2 3", "1 3 7"], [Some(14), Some(20)], |f| {
        matches!(
            f,
            GmshFault::UnknownNode {
                element: 2,
                node: 7
            }
        )
    });
    let twice = [(1, "0 0 0"), (2, "1 0 0"), (3, "1 1 0"), (2, "0 1 0")];
    both_refused(&twice, &["1 2 3"], [Some(9), Some(10)], |f| {
        matches!(f, GmshFault::DuplicateNode { node: 2 })
    });
    for bad in ["nan 1 0", "1 inf 0", "1 1 NaN", "1e999 0 0"] {
        let nodes = [(1, "0 0 0"), (2, "1 0 0"), (3, bad), (4, "0 1 0")];
        let [old, new] = both(&nodes, &["1 2 4"]);
        for (text, line) in [(old, 8), (new, 13)] {
            let error = refused(text.as_bytes());
            assert_eq!(error.line(), Some(line), "{bad}: {error}");
            assert!(
                matches!(error.fault(), GmshFault::NodeNotFinite { node: 3, .. }),
                "{bad}: {error}"
            );
        }
    }
    let tilted = [(1, "0 0 0"), (2, "1 0 0"), (3, "1 1 0.5"), (4, "0 1 0")];
    both_refused(&tilted, &["1 2 3", "1 3 4"], [Some(8), Some(13)], |f| {
        matches!(
            f,
            GmshFault::NotPlanar {
                node: 3,
                other: 1,
                ..
            }
        )
    });
    // The same in binary.
    let mut mesh = sample();
    mesh.points[4][1] = f64::NAN;
    for format in [Format::Little, Format::Big] {
        for bytes in [write22(&mesh, format, PLAIN), write41(&mesh, format, PLAIN)] {
            let error = refused(&bytes);
            assert!(
                matches!(error.fault(), GmshFault::NodeNotFinite { node: 5, .. }),
                "{error}"
            );
            assert!(matches!(error.place(), Place::Byte(at) if at > 60 && at < bytes.len()));
        }
    }
}

#[test]
fn triangles_that_are_no_mesh() {
    let flat = [(1, "0 0 0"), (2, "1 1 0"), (3, "2 2 0"), (4, "0 1 0")];
    both_refused(&flat, &["1 2 4", "1 2 3"], [Some(14), Some(20)], |f| {
        matches!(defect(f), Some(MeshDefect::ZeroArea { triangle: 1, .. }))
    });
    both_refused(
        &SQUARE,
        &["1 2 3", "1 3 4", "3 1 2"],
        [Some(15), Some(21)],
        |f| {
            matches!(
                defect(f),
                Some(MeshDefect::Duplicate {
                    triangles: [0, 2],
                    ..
                })
            )
        },
    );
    // The duplicate may run the other way round.
    both_refused(
        &SQUARE,
        &["1 2 3", "1 3 4", "3 2 1"],
        [Some(15), Some(21)],
        |f| matches!(defect(f), Some(MeshDefect::Duplicate { .. })),
    );
    let five = [
        (1, "0 0 0"),
        (2, "1 0 0"),
        (3, "1 1 0"),
        (4, "0 1 0"),
        (5, "0.5 2 0"),
    ];
    both_refused(
        &five,
        &["1 2 3", "1 3 4", "1 3 5"],
        [Some(16), Some(23)],
        |f| matches!(defect(f), Some(MeshDefect::SharedEdge { .. })),
    );
    let fold = [(1, "0 0 0"), (2, "1 0 0"), (3, "0.5 1 0"), (4, "0.6 2 0")];
    both_refused(&fold, &["1 2 3", "1 2 4"], [Some(14), Some(20)], |f| {
        matches!(defect(f), Some(MeshDefect::Fold { .. }))
    });
    let hanging = [
        (1, "0 0 0"),
        (2, "1 0 0"),
        (3, "1 1 0"),
        (4, "2 0.5 0"),
        (5, "1 0.5 0"),
    ];
    both_refused(
        &hanging,
        &["1 2 3", "2 4 5", "5 4 3"],
        [Some(14), Some(21)],
        |f| matches!(defect(f), Some(MeshDefect::HangingNode { triangle: 0, .. })),
    );
    let double = [
        (1, "0 0 0"),
        (2, "1 0 0"),
        (3, "1 1 0"),
        (4, "0 0 0"),
        (5, "1 1 0"),
        (6, "0 1 0"),
    ];
    both_refused(&double, &["1 2 3", "4 5 6"], [Some(16), Some(24)], |f| {
        matches!(defect(f), Some(MeshDefect::CoincidentEdges { .. }))
    });
    let [text, _] = both(&flat, &["1 2 4", "1 2 3"]);
    let text = text.replace("\n2 2 2 1 1 1 2 3", "\n77 2 2 1 1 1 2 3");
    assert_eq!(
        refused(text.as_bytes()).to_string(),
        "mesh file `plate.msh`, line 14: element 77 has zero area: `(0, 0)`, `(1, 1)`, `(2, 2)`"
    );
}

#[test]
fn tags_that_only_look_consecutive() {
    // Tags 2, 1, 4, 3 in this order: between them as many as nodes.
    let nodes = [(2, "0 0 0"), (1, "1 0 0"), (4, "1 1 0"), (3, "0 1 0")];
    for text in both(&nodes, &["2 1 4", "2 4 3"]) {
        let mesh = gmsh::parse(text.as_bytes(), Path::new("p")).unwrap();
        assert_eq!(
            mesh.points,
            [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
        );
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    }
    // Nodes that no triangle uses may lie anywhere, but must be numbers.
    let style = Style {
        clutter: true,
        ..PLAIN
    };
    gmsh::parse(&write41(&sample(), Format::Big, style), Path::new("p")).unwrap();
}
