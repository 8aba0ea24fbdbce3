//! `series.pvd`: ParaView's index of the levels, the level number as time.

use std::io::{self, Write};

/// Writes the index of files named by level.
///
/// The names are relative to the folder of the index, so that a run can be moved. vtkio has nothing for this format.
///
/// # Errors
/// Those of `writer`.
pub fn write_series<'a>(
    writer: &mut impl Write,
    files: impl IntoIterator<Item = (usize, &'a str)>,
) -> io::Result<()> {
    writeln!(writer, "<?xml version=\"1.0\"?>")?;
    writeln!(
        writer,
        "<VTKFile type=\"Collection\" version=\"0.1\" byte_order=\"LittleEndian\">"
    )?;
    writeln!(writer, "  <Collection>")?;
    for (level, file) in files {
        writeln!(
            writer,
            "    <DataSet timestep=\"{level}\" group=\"\" part=\"0\" file=\"{file}\"/>"
        )?;
    }
    writeln!(writer, "  </Collection>")?;
    writeln!(writer, "</VTKFile>")
}
