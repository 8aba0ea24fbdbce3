//! `level_NNNN.vtu`: the fields of one level on its triangles.

use std::io::{self, Write};

use fem_core::VertexId;

use super::appended::{Array, Document, joined};
use super::values::Values;

/// Everything that the file of a level holds, in the user's units. `.into()` makes [`Values`] from a slice or a vector;
/// [`Values::scaled`] and [`Values::by`] compute them while the file is written.
///
/// An estimator that was not computed is `None` and has no array.
#[derive(Clone, Debug)]
pub struct LevelFields<'a> {
    /// Number of the level; field data `level`.
    pub level: usize,
    /// The number that the run is judged by; field data `error_bound`.
    pub error_bound: f64,
    /// Coordinates of the vertices.
    pub points: Values<'a, [f64; 2]>,
    /// Vertices of the triangles.
    pub triangles: Values<'a, [VertexId; 3]>,

    /// Displacement of the upper membrane, one value a vertex.
    pub u1: Values<'a, f64>,
    /// Displacement of the lower membrane, one value a vertex.
    pub u2: Values<'a, f64>,
    /// u1 - u2, one value a vertex.
    pub gap: Values<'a, f64>,
    /// Riesz representative of the action, one value a vertex.
    pub sigma: Values<'a, f64>,
    /// Nodal multiplier z_i, a force, one value a vertex.
    pub action_force: Values<'a, f64>,
    /// z_i over the area of the dual cell, a pressure, one value a vertex.
    pub action: Values<'a, f64>,
    /// The contact set, one value a vertex; written as 0 and 1.
    pub contact: Values<'a, bool>,

    /// Indicator (7.1), one value a triangle; written as `eta_K`.
    pub eta_k: Option<Values<'a, f64>>,
    /// Indicator (7.2) summed over the triangle's interior edges, each counted half, one value a triangle.
    pub eta_e: Option<Values<'a, f64>>,
    /// Local contribution of the residual estimator, one value a triangle.
    pub residual: Option<Values<'a, f64>>,
    /// Local contribution of the certificate, one value a triangle.
    pub certified: Option<Values<'a, f64>>,
    /// Data oscillation, one value a triangle.
    pub oscillation: Option<Values<'a, f64>>,
    /// Mean of the upper load, one value a triangle.
    pub f1_h: Values<'a, f64>,
    /// Mean of the lower load, one value a triangle.
    pub f2_h: Values<'a, f64>,
    /// Bisections since the initial mesh, one value a triangle.
    pub generation: Values<'a, u16>,
    /// Physical tag, one value a triangle.
    pub region: Values<'a, i32>,
}

/// Number of the triangle among the cell types of VTK.
const TRIANGLE: u8 = 5;

/// Writes a level; little endian, every bit of every number kept, the numbers in one block of raw bytes behind the text.
///
/// Point arrays, in this order: `u1`, `u2`, `gap`, `sigma`, `action_force`, `action` (Float64), `contact` (UInt8). Cell
/// arrays: `eta_K`, `eta_e`, `residual`, `certified`, `oscillation`, `f1_h`, `f2_h` (Float64), `generation`, `region`
/// (Int32). Field data: `level` (Int64), `error_bound` (Float64). The vertices of the triangles are Int32 as long as all
/// numbers fit, else Int64.
///
/// Nothing is held but a buffer of some hundred kilobytes, whatever the size of the mesh.
///
/// # Errors
/// Those of `writer`; `InvalidInput` when an array does not have one value a vertex or triangle, or there is no triangle.
/// Then nothing is written.
pub fn write_level(writer: &mut dyn Write, fields: LevelFields<'_>) -> io::Result<()> {
    let (vertices, triangles) = (fields.points.len(), fields.triangles.len());
    if triangles == 0 {
        return Err(io::Error::new(
            io::ErrorKind::InvalidInput,
            "a level without triangles has no file",
        ));
    }
    let point = vec![
        Array::reals("u1", fields.u1),
        Array::reals("u2", fields.u2),
        Array::reals("gap", fields.gap),
        Array::reals("sigma", fields.sigma),
        Array::reals("action_force", fields.action_force),
        Array::reals("action", fields.action),
        Array::new("contact", "UInt8", 1, fields.contact, |c| [u8::from(c)]),
    ];
    let estimators = [
        ("eta_K", fields.eta_k),
        ("eta_e", fields.eta_e),
        ("residual", fields.residual),
        ("certified", fields.certified),
        ("oscillation", fields.oscillation),
    ];
    let computed = estimators
        .into_iter()
        .filter_map(|(name, values)| Some(Array::reals(name, values?)));
    let mut cell: Vec<_> = computed.collect();
    cell.extend([
        Array::reals("f1_h", fields.f1_h),
        Array::reals("f2_h", fields.f2_h),
        Array::new("generation", "Int32", 1, fields.generation, |g| {
            i32::from(g).to_le_bytes()
        }),
        Array::new("region", "Int32", 1, fields.region, i32::to_le_bytes),
    ]);
    for array in &point {
        array.check("points", vertices)?;
    }
    for array in &cell {
        array.check("cells", triangles)?;
    }
    Document {
        kind: "UnstructuredGrid",
        field: vec![
            Array::new(
                "level",
                "Int64",
                1,
                vec![fields.level as i64].into(),
                i64::to_le_bytes,
            ),
            Array::reals("error_bound", vec![fields.error_bound].into()),
        ],
        counts: vec![("NumberOfPoints", vertices), ("NumberOfCells", triangles)],
        sections: vec![
            ("PointData", point),
            ("CellData", cell),
            (
                "Points",
                vec![Array::new(
                    "Points",
                    "Float64",
                    3,
                    fields.points,
                    |[x, y]| joined::<8, 24>([x, y, 0.0].map(f64::to_le_bytes)),
                )],
            ),
            ("Cells", cells(fields.triangles, vertices)),
        ],
    }
    .write(writer)
}

/// The arrays that say what the cells are.
fn cells(corners: Values<'_, [VertexId; 3]>, vertices: usize) -> Vec<Array<'_>> {
    let count = corners.len();
    let ends = Values::by(count, |t| 3 * (t as u64 + 1));
    let largest = i32::MAX as usize;
    let [connectivity, offsets] = if vertices <= largest && 3 * count <= largest {
        [
            Array::new("connectivity", "Int32", 1, corners, |t| {
                joined::<4, 12>(t.map(|v| v.0.to_le_bytes()))
            }),
            Array::new("offsets", "Int32", 1, ends, |o| (o as i32).to_le_bytes()),
        ]
    } else {
        [
            Array::new("connectivity", "Int64", 1, corners, |t| {
                joined::<8, 24>(t.map(|v| u64::from(v.0).to_le_bytes()))
            }),
            Array::new("offsets", "Int64", 1, ends, u64::to_le_bytes),
        ]
    };
    let types = Values::by(count, |_| TRIANGLE);
    vec![
        connectivity,
        offsets,
        Array::new("types", "UInt8", 1, types, |t| [t]),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_beyond_32_bits_are_written_with_64() {
        let most = i32::MAX as usize;
        for (triangles, vertices, kind) in [
            (5, 7, "Int32"),
            (most / 3, most, "Int32"),
            (most / 3 + 1, 7, "Int64"),
            (5, most + 1, "Int64"),
        ] {
            let corners = Values::by(triangles, |_| [VertexId(0); 3]);
            for array in &cells(corners, vertices)[..2] {
                let element = array.element("", &mut 0);
                assert!(element.contains(kind), "{triangles} {vertices} {element}");
            }
        }
    }
}
