//! `level_NNNN.vtu`: the fields of one level on its triangles.

use std::borrow::Cow;
use std::io::{self, Write};

use fem_core::VertexId;
use vtkio::model::{Attributes, CellType, Cells, DataSet, UnstructuredGridPiece, VertexNumbers};

use super::vtk::{self, Arrays, FieldValue};

/// Everything that the file of a level holds, in the user's units. `Cow` lets a caller hand over what it has computed for
/// the file and lend what it keeps; `.into()` makes one from a slice or a vector.
///
/// An estimator that was not computed is `None` and has no array.
#[derive(Clone, Debug)]
pub struct LevelFields<'a> {
    /// Number of the level; field data `level`.
    pub level: usize,
    /// The number that the run is judged by; field data `error_bound`.
    pub error_bound: f64,
    /// Coordinates of the vertices.
    pub points: Cow<'a, [[f64; 2]]>,
    /// Vertices of the triangles.
    pub triangles: Cow<'a, [[VertexId; 3]]>,

    /// Displacement of the upper membrane, one value a vertex.
    pub u1: Cow<'a, [f64]>,
    /// Displacement of the lower membrane, one value a vertex.
    pub u2: Cow<'a, [f64]>,
    /// u1 - u2, one value a vertex.
    pub gap: Cow<'a, [f64]>,
    /// Riesz representative of the action, one value a vertex.
    pub sigma: Cow<'a, [f64]>,
    /// Nodal multiplier z_i, a force, one value a vertex.
    pub action_force: Cow<'a, [f64]>,
    /// z_i over the area of the dual cell, a pressure, one value a vertex.
    pub action: Cow<'a, [f64]>,
    /// The contact set, one value a vertex; written as 0 and 1.
    pub contact: Cow<'a, [bool]>,

    /// Indicator (7.1), one value a triangle; written as `eta_K`.
    pub eta_k: Option<Cow<'a, [f64]>>,
    /// Indicator (7.2) summed over the triangle's interior edges, each counted half, one value a triangle.
    pub eta_e: Option<Cow<'a, [f64]>>,
    /// Local contribution of the residual estimator, one value a triangle.
    pub residual: Option<Cow<'a, [f64]>>,
    /// Local contribution of the certificate, one value a triangle.
    pub certified: Option<Cow<'a, [f64]>>,
    /// Data oscillation, one value a triangle.
    pub oscillation: Option<Cow<'a, [f64]>>,
    /// Mean of the upper load, one value a triangle.
    pub f1_h: Cow<'a, [f64]>,
    /// Mean of the lower load, one value a triangle.
    pub f2_h: Cow<'a, [f64]>,
    /// Bisections since the initial mesh, one value a triangle.
    pub generation: Cow<'a, [u16]>,
    /// Physical tag, one value a triangle.
    pub region: Cow<'a, [i32]>,
}

/// Writes a level; little endian, base64, every bit of every number kept.
///
/// Point arrays, in this order: `u1`, `u2`, `gap`, `sigma`, `action_force`, `action` (Float64), `contact` (UInt8). Cell
/// arrays: `eta_K`, `eta_e`, `residual`, `certified`, `oscillation`, `f1_h`, `f2_h` (Float64), `generation`, `region`
/// (Int32). Field data: `level` (Int64), `error_bound` (Float64).
///
/// # Errors
/// Those of `writer`; `InvalidInput` when an array does not have one value a vertex or triangle, or there is no triangle
/// (VTK refuses what vtkio writes for an empty mesh).
pub fn write_level(writer: &mut impl Write, fields: LevelFields<'_>) -> io::Result<()> {
    if fields.triangles.is_empty() {
        return Err(io::Error::new(
            io::ErrorKind::InvalidInput,
            "a level without triangles has no file",
        ));
    }
    let mut point = Arrays::new("points", fields.points.len());
    point.push("u1", fields.u1.into_owned())?;
    point.push("u2", fields.u2.into_owned())?;
    point.push("gap", fields.gap.into_owned())?;
    point.push("sigma", fields.sigma.into_owned())?;
    point.push("action_force", fields.action_force.into_owned())?;
    point.push("action", fields.action.into_owned())?;
    let contact: Vec<u8> = fields.contact.iter().map(|&c| u8::from(c)).collect();
    point.push("contact", contact)?;

    let mut cell = Arrays::new("cells", fields.triangles.len());
    cell.push_some("eta_K", fields.eta_k)?;
    cell.push_some("eta_e", fields.eta_e)?;
    cell.push_some("residual", fields.residual)?;
    cell.push_some("certified", fields.certified)?;
    cell.push_some("oscillation", fields.oscillation)?;
    cell.push("f1_h", fields.f1_h.into_owned())?;
    cell.push("f2_h", fields.f2_h.into_owned())?;
    let generation: Vec<i32> = fields.generation.iter().map(|&g| i32::from(g)).collect();
    cell.push("generation", generation)?;
    cell.push("region", fields.region.into_owned())?;

    let connectivity = fields
        .triangles
        .iter()
        .flatten()
        .map(|v| u64::from(v.0))
        .collect();
    let count = fields.triangles.len();
    let piece = UnstructuredGridPiece {
        points: vtk::points(&fields.points),
        cells: Cells {
            cell_verts: VertexNumbers::XML {
                connectivity,
                offsets: (1..=count as u64).map(|t| 3 * t).collect(),
            },
            types: vec![CellType::Triangle; count],
        },
        data: Attributes {
            point: point.into_list(),
            cell: cell.into_list(),
        },
    };
    vtk::write_xml(
        writer,
        DataSet::inline(piece),
        &[
            ("level", FieldValue::Integer(fields.level as i64)),
            ("error_bound", FieldValue::Real(fields.error_bound)),
        ],
    )
}
