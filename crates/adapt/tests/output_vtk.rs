//! The VTK files, read back by vtkio and by their text.

mod output_sample;

use adapt::output::vtp::write_edges;
use adapt::output::vtu::write_level;
use adapt::output::{LevelFields, RunFolder};
use fem_core::{Children, Mesh};
use output_sample::{awkward, edge_fields, level_fields, squares, triangle};
use vtkio::IOBuffer;
use vtkio::model::{
    Attribute, CellType, DataSet, Piece, PolyDataPiece, UnstructuredGridPiece, VertexNumbers, Vtk,
};

const POINT_ARRAYS: [&str; 7] = [
    "u1",
    "u2",
    "gap",
    "sigma",
    "action_force",
    "action",
    "contact",
];
const CELL_ARRAYS: [&str; 9] = [
    "eta_K",
    "eta_e",
    "residual",
    "certified",
    "oscillation",
    "f1_h",
    "f2_h",
    "generation",
    "region",
];

fn vtu(fields: LevelFields<'_>) -> Vec<u8> {
    let mut bytes = Vec::new();
    write_level(&mut bytes, fields).unwrap();
    bytes
}

fn vtp(mesh: &Mesh) -> Vec<u8> {
    let mut bytes = Vec::new();
    write_edges(&mut bytes, edge_fields(mesh, 3)).unwrap();
    bytes
}

/// The same file with its arrays inline in base64, since vtkio reads no raw bytes. Every array must begin where the one before
/// it ended, and nothing but the end of the file may follow the last.
fn inline(bytes: &[u8]) -> String {
    let start = b"<AppendedData encoding=\"raw\">\n_";
    let at = bytes.windows(start.len()).position(|w| w == start);
    let (head, block) = bytes.split_at(at.expect("a block"));
    let block = &block[start.len()..];
    let head = std::str::from_utf8(head).expect("text");
    let (mut text, mut read) = (String::new(), 0);
    for part in head.split_inclusive("/>") {
        let Some((tag, offset)) = part.split_once(" format=\"appended\" offset=\"") else {
            text += part;
            continue;
        };
        assert_eq!(offset, format!("{read}\"/>"));
        let length: [u8; 8] = block[read..read + 8].try_into().expect("eight bytes");
        let end = read + 8 + u64::from_le_bytes(length) as usize;
        text += &format!(
            "{tag} format=\"binary\">{}</DataArray>",
            base64(&block[read..end])
        );
        read = end;
    }
    assert_eq!(&block[read..], b"\n</AppendedData>\n</VTKFile>\n");
    text + "</VTKFile>\n"
}

fn base64(bytes: &[u8]) -> String {
    let digits = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for group in bytes.chunks(3) {
        let mut word = [0; 4];
        word[1..=group.len()].copy_from_slice(group);
        let word = u32::from_be_bytes(word);
        for k in 0..4 {
            let digit = digits[(word >> (18 - 6 * k)) as usize & 63];
            text.push(if k > group.len() { '=' } else { digit as char });
        }
    }
    text
}

fn read_vtu(bytes: &[u8]) -> UnstructuredGridPiece {
    let data = Vtk::parse_xml(inline(bytes).as_bytes()).unwrap().data;
    match data {
        DataSet::UnstructuredGrid { mut pieces, .. } if pieces.len() == 1 => {
            match pieces.remove(0) {
                Piece::Inline(piece) => *piece,
                other => panic!("{other:?}"),
            }
        }
        other => panic!("{other:?}"),
    }
}

fn read_vtp(bytes: &[u8]) -> PolyDataPiece {
    let data = Vtk::parse_xml(bytes).unwrap().data;
    match data {
        DataSet::PolyData { mut pieces, .. } if pieces.len() == 1 => match pieces.remove(0) {
            Piece::Inline(piece) => *piece,
            other => panic!("{other:?}"),
        },
        other => panic!("{other:?}"),
    }
}

fn names(list: &[Attribute]) -> Vec<&str> {
    list.iter()
        .map(|a| match a {
            Attribute::DataArray(array) => array.name.as_str(),
            Attribute::Field { name, .. } => name.as_str(),
        })
        .collect()
}

fn buffer<'a>(list: &'a [Attribute], name: &str) -> &'a IOBuffer {
    list.iter()
        .find_map(|a| match a {
            Attribute::DataArray(array) if array.name == name => Some(&array.data),
            _ => None,
        })
        .unwrap_or_else(|| panic!("no array `{name}`"))
}

fn bits(buffer: &IOBuffer) -> Vec<u64> {
    match buffer {
        IOBuffer::F64(values) => values.iter().map(|v| v.to_bits()).collect(),
        other => panic!("not doubles: {:?}", other.scalar_type()),
    }
}

fn bits_of(values: &[f64]) -> Vec<u64> {
    values.iter().map(|v| v.to_bits()).collect()
}

/// A mesh with several generations.
fn refined() -> Mesh {
    let mut mesh = squares(3);
    let marked = [fem_core::TriangleId(0), fem_core::TriangleId(7)];
    mesh.refine(&marked, Children::Four).unwrap();
    mesh
}

#[test]
fn a_level_reads_back_to_the_bit() {
    for mesh in [triangle(), squares(1), refined()] {
        let fields = level_fields(&mesh, 3);
        let piece = read_vtu(&vtu(fields.clone()));
        let (n, m) = (mesh.vertex_count(), mesh.triangle_count());

        let expected: Vec<f64> = mesh
            .points()
            .iter()
            .flat_map(|&[x, y]| [x, y, 0.0])
            .collect();
        assert_eq!(bits(&piece.points), bits_of(&expected));
        assert_eq!(piece.cells.types, vec![CellType::Triangle; m]);
        let VertexNumbers::XML {
            connectivity,
            offsets,
        } = &piece.cells.cell_verts
        else {
            panic!("not from XML");
        };
        let vertices = mesh.triangles().iter().flatten();
        assert!(
            vertices
                .map(|v| u64::from(v.0))
                .eq(connectivity.iter().copied())
        );
        assert!((1..=m as u64).map(|t| 3 * t).eq(offsets.iter().copied()));

        assert_eq!(names(&piece.data.point), POINT_ARRAYS);
        for (salt, name) in (1..).zip(&POINT_ARRAYS[..6]) {
            let read = bits(buffer(&piece.data.point, name));
            assert_eq!(read, bits_of(&awkward(n, salt)), "{name}");
        }
        let contact = fields.contact.to_vec().into_iter().map(u8::from).collect();
        assert_eq!(buffer(&piece.data.point, "contact"), &IOBuffer::U8(contact));

        assert_eq!(names(&piece.data.cell), CELL_ARRAYS);
        for (salt, name) in (7..).zip(&CELL_ARRAYS[..7]) {
            let read = bits(buffer(&piece.data.cell, name));
            assert_eq!(read, bits_of(&awkward(m, salt)), "{name}");
        }
        let generation = mesh.generation().iter().map(|&g| g.into()).collect();
        assert_eq!(
            buffer(&piece.data.cell, "generation"),
            &IOBuffer::I32(generation)
        );
        assert_eq!(
            buffer(&piece.data.cell, "region"),
            &IOBuffer::I32(mesh.region().to_vec())
        );
    }
}

#[test]
fn the_head_of_a_level_says_what_the_reader_needs() {
    let mesh = triangle();
    let bytes = vtu(level_fields(&mesh, 3));
    let head = "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" \
                header_type=\"UInt64\">\n<UnstructuredGrid>\n<FieldData>\n\
                <DataArray type=\"Int64\" Name=\"level\" NumberOfTuples=\"1\" format=\"appended\" offset=\"0\"/>\n\
                <DataArray type=\"Float64\" Name=\"error_bound\" NumberOfTuples=\"1\" format=\"appended\" offset=\"16\"/>\n\
                </FieldData>\n<Piece NumberOfPoints=\"3\" NumberOfCells=\"1\">\n<PointData>\n\
                <DataArray type=\"Float64\" Name=\"u1\" format=\"appended\" offset=\"32\"/>\n";
    assert!(bytes.starts_with(head.as_bytes()));
    for element in [
        "type=\"UInt8\" Name=\"contact\" ",
        "type=\"Int32\" Name=\"generation\" ",
        "type=\"Float64\" Name=\"Points\" NumberOfComponents=\"3\" ",
        "type=\"Int32\" Name=\"connectivity\" ",
        "type=\"Int32\" Name=\"offsets\" ",
        "type=\"UInt8\" Name=\"types\" ",
    ] {
        assert!(inline(&bytes).contains(element), "{element}");
    }
    // 3 as Int64 and 0.30000000000000004 as Float64, each after its length 8 as UInt64, little endian.
    let block = b"<AppendedData encoding=\"raw\">\n_\x08\0\0\0\0\0\0\0\x03\0\0\0\0\0\0\0\
                  \x08\0\0\0\0\0\0\0\x34\x33\x33\x33\x33\x33\xd3\x3f";
    assert!(bytes.windows(block.len()).any(|w| w == block));
}

#[test]
fn an_estimator_that_was_not_computed_has_no_array() {
    let mesh = squares(2);
    let fields = LevelFields {
        eta_k: None,
        eta_e: None,
        residual: None,
        certified: None,
        oscillation: None,
        ..level_fields(&mesh, 0)
    };
    let piece = read_vtu(&vtu(fields));
    assert_eq!(
        names(&piece.data.cell),
        ["f1_h", "f2_h", "generation", "region"]
    );
    assert_eq!(names(&piece.data.point), POINT_ARRAYS);
}

#[test]
fn edges_read_back_to_the_bit() {
    for mesh in [squares(1), refined()] {
        let piece = read_vtp(&vtp(&mesh));
        let fields = edge_fields(&mesh, 3);
        assert_eq!(piece.num_points(), mesh.vertex_count());
        let Some(VertexNumbers::XML {
            connectivity,
            offsets,
        }) = &piece.lines
        else {
            panic!("no lines");
        };
        let ends = fields.edges.iter().flatten();
        assert!(
            ends.map(|v| u64::from(v.0))
                .eq(connectivity.iter().copied())
        );
        assert_eq!(offsets.len(), fields.edges.len());
        assert_eq!(names(&piece.data.cell), ["eta_e"]);
        assert_eq!(
            bits(buffer(&piece.data.cell, "eta_e")),
            bits_of(&fields.eta_e)
        );
    }
}

#[test]
fn one_triangle_has_no_interior_edge_and_still_a_file() {
    let text = String::from_utf8(vtp(&triangle())).unwrap();
    assert!(text.contains("NumberOfPoints=\"3\""), "{text}");
    assert!(!text.contains("NumberOfLines=\"1\""), "{text}");
}

/// Larger than the blocks that are written at a time.
#[test]
fn a_level_of_many_blocks_reads_back_to_the_bit() {
    let mesh = squares(100);
    let piece = read_vtu(&vtu(level_fields(&mesh, 3)));
    let (n, m) = (mesh.vertex_count(), mesh.triangle_count());
    assert!(n > 10_000 && m == 20_000);
    assert_eq!(
        bits(buffer(&piece.data.point, "action")),
        bits_of(&awkward(n, 6))
    );
    assert_eq!(
        bits(buffer(&piece.data.cell, "f2_h")),
        bits_of(&awkward(m, 13))
    );
    let VertexNumbers::XML { connectivity, .. } = &piece.cells.cell_verts else {
        panic!("not from XML");
    };
    let vertices = mesh.triangles().iter().flatten();
    let vertices = vertices.map(|v| u64::from(v.0));
    assert!(vertices.eq(connectivity.iter().copied()));
}

/// The arrays at the types of the file, and a text of a few thousand bytes.
#[test]
fn a_file_is_hardly_larger_than_its_arrays() {
    let mesh = squares(100);
    let (n, m) = (mesh.vertex_count(), mesh.triangle_count());
    let point = 3 * 8 + 6 * 8 + 1;
    let cell = 7 * 8 + 2 * 4 + 3 * 4 + 4 + 1;
    let arrays = n * point + m * cell;
    let size = vtu(level_fields(&mesh, 3)).len();
    assert!((arrays..arrays + 4000).contains(&size), "{size}, {arrays}");
}

#[test]
fn the_same_level_gives_the_same_bytes() {
    let mesh = refined();
    assert_eq!(vtu(level_fields(&mesh, 3)), vtu(level_fields(&mesh, 3)));
    assert_eq!(vtp(&mesh), vtp(&mesh));
}

#[test]
fn lengths_that_do_not_fit_are_refused() {
    let mesh = squares(1);
    let mut out = Vec::new();
    let error = write_level(
        &mut out,
        LevelFields {
            u2: vec![1.0].into(),
            ..level_fields(&mesh, 0)
        },
    )
    .unwrap_err();
    assert_eq!(error.to_string(), "array `u2` has 1 values for 4 points");
    let error = write_level(
        &mut out,
        LevelFields {
            triangles: Vec::new().into(),
            ..level_fields(&mesh, 0)
        },
    )
    .unwrap_err();
    assert_eq!(error.kind(), std::io::ErrorKind::InvalidInput);
    assert!(out.is_empty());
}

#[test]
fn the_index_lists_every_level_once_in_order() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = RunFolder::prepare(folder.path(), false).unwrap();
    let mesh = triangle();
    let index = || std::fs::read_to_string(folder.path().join("series.pvd")).unwrap();
    run.write_level(level_fields(&mesh, 0)).unwrap();
    assert!(!index().contains("level_0003.vtu"));
    for level in [12, 3, 3] {
        run.write_level(level_fields(&mesh, level)).unwrap();
    }
    assert_eq!(
        index(),
        "<?xml version=\"1.0\"?>\n\
         <VTKFile type=\"Collection\" version=\"0.1\" byte_order=\"LittleEndian\">\n  <Collection>\n    \
         <DataSet timestep=\"0\" group=\"\" part=\"0\" file=\"level_0000.vtu\"/>\n    \
         <DataSet timestep=\"3\" group=\"\" part=\"0\" file=\"level_0003.vtu\"/>\n    \
         <DataSet timestep=\"12\" group=\"\" part=\"0\" file=\"level_0012.vtu\"/>\n  \
         </Collection>\n</VTKFile>\n"
    );
}
