//! `edges_NNNN.vtp`: the edge indicators on the interior edges.

use std::borrow::Cow;
use std::io::{self, Write};

use fem_core::VertexId;
use vtkio::model::{Attributes, DataSet, PolyDataPiece, VertexNumbers};

use super::vtk::{self, Arrays, FieldValue};

/// Everything that the edge file of a level holds, in the user's units.
#[derive(Clone, Debug)]
pub struct EdgeFields<'a> {
    /// Number of the level; field data `level`.
    pub level: usize,
    /// The number that the run is judged by; field data `error_bound`.
    pub error_bound: f64,
    /// Coordinates of the vertices: all of the mesh, so that numbers are those of the level's .vtu.
    pub points: Cow<'a, [[f64; 2]]>,
    /// Ends of the interior edges.
    pub edges: Cow<'a, [[VertexId; 2]]>,
    /// Indicator (7.2), one value an edge.
    pub eta_e: Cow<'a, [f64]>,
}

/// Writes the edges as lines with the cell array `eta_e` (Float64); field data as in the level's .vtu.
///
/// A mesh of one triangle has no interior edge: the file then holds points and no lines.
///
/// # Errors
/// Those of `writer`; `InvalidInput` when there is not one value an edge.
pub fn write_edges(writer: &mut impl Write, fields: EdgeFields<'_>) -> io::Result<()> {
    let mut cell = Arrays::new("edges", fields.edges.len());
    cell.push("eta_e", fields.eta_e.into_owned())?;
    let connectivity = fields
        .edges
        .iter()
        .flatten()
        .map(|v| u64::from(v.0))
        .collect();
    let piece = PolyDataPiece {
        points: vtk::points(&fields.points),
        lines: Some(VertexNumbers::XML {
            connectivity,
            offsets: (1..=fields.edges.len() as u64).map(|e| 2 * e).collect(),
        }),
        data: Attributes {
            point: Vec::new(),
            cell: cell.into_list(),
        },
        ..PolyDataPiece::default()
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
