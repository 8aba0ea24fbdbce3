//! The way to vtkio, which writes the .vtp: arrays as it wants them, and a stream that mends what it leaves open.

use std::io::{self, Write};

use vtkio::IOBuffer;
use vtkio::model::{Attribute, ByteOrder, DataSet, Version, Vtk};
use vtkio::xml::{Compressor, Data, DataArray, EncodingInfo, ScalarType};

/// A value that belongs to the whole file.
#[derive(Clone, Copy, Debug)]
pub(super) enum FieldValue {
    /// An integer.
    Integer(i64),
    /// A real number.
    Real(f64),
}

/// The points with a third coordinate 0.
pub(super) fn points(points: &[[f64; 2]]) -> IOBuffer {
    IOBuffer::F64(points.iter().flat_map(|&[x, y]| [x, y, 0.0]).collect())
}

/// A list of arrays under construction, in the order of the file.
pub(super) struct Arrays {
    /// What the arrays have one entry for.
    place: &'static str,
    /// How many of those there are.
    count: usize,
    list: Vec<Attribute>,
}

impl Arrays {
    /// No arrays yet, for `count` points, cells, ...
    pub(super) fn new(place: &'static str, count: usize) -> Self {
        Arrays {
            place,
            count,
            list: Vec::new(),
        }
    }

    /// Appends an array of one component.
    ///
    /// # Errors
    /// `InvalidInput` when its length is not the number of points or cells: such a file must not come to be.
    pub(super) fn push(&mut self, name: &str, data: impl Into<IOBuffer>) -> io::Result<()> {
        let data = data.into();
        if data.len() != self.count {
            return Err(io::Error::new(
                io::ErrorKind::InvalidInput,
                format!(
                    "array `{name}` has {} values for {} {}",
                    data.len(),
                    self.count,
                    self.place
                ),
            ));
        }
        self.list.push(Attribute::scalars(name, 1).with_data(data));
        Ok(())
    }

    /// The list for vtkio.
    pub(super) fn into_list(self) -> Vec<Attribute> {
        self.list
    }
}

/// Writes a data set as VTK XML: little endian on every machine, arrays inline in base64, 64-bit headers, not compressed.
///
/// # Errors
/// Those of `writer`, and what vtkio refuses.
pub(super) fn write_xml(
    writer: &mut impl Write,
    data: DataSet,
    field: &[(&str, FieldValue)],
) -> io::Result<()> {
    let file = Vtk {
        version: Version::new_xml(1, 0),
        title: String::new(),
        byte_order: ByteOrder::LittleEndian,
        data,
        file_path: None,
    }
    .try_into_xml_format(Compressor::None, 0)
    .map_err(refused)?;
    let mut stream = Splice::new(writer, field_data(field)?);
    let result = file.write(&mut stream).map_err(refused);
    // The stream knows the true cause; vtkio reports it as a formatting error, or not at all (see `Splice`).
    stream.finish()?;
    result?;
    writer.write_all(b"\n")
}

fn refused(error: vtkio::xml::Error) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, error.to_string())
}

/// The `FieldData` element: arrays of one value each, encoded by vtkio.
fn field_data(field: &[(&str, FieldValue)]) -> io::Result<String> {
    let encoding = EncodingInfo {
        byte_order: ByteOrder::LittleEndian,
        header_type: ScalarType::UInt64,
        compressor: Compressor::None,
        compression_level: 0,
    };
    let mut element = String::from("<FieldData>");
    for &(name, value) in field {
        let (kind, data) = match value {
            FieldValue::Integer(value) => ("Int64", IOBuffer::I64(vec![value])),
            FieldValue::Real(value) => ("Float64", IOBuffer::F64(vec![value])),
        };
        let array = DataArray::from_io_buffer(data, encoding).map_err(refused)?;
        element += &format!(
            "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfTuples=\"1\" format=\"binary\">"
        );
        for data in &array.data {
            if let Data::Data(text) = data {
                element += text;
            }
        }
        element += "</DataArray>";
    }
    Ok(element + "</FieldData>")
}

/// Where the field data belongs: before the first piece of the data set.
const PIECE: &[u8] = b"<Piece";

/// Passes bytes on, puts an element before the first `<Piece`, and remembers the first error.
///
/// vtkio 0.7.0-rc2 leaves two things open. Its XML model has no place for field data (field attributes are "simply
/// ignored"), so the element is put into the stream. And its writer calls `write` where it means `write_all` and drops the
/// errors of its last flush, so that a full disk could pass for success: this stream takes every byte or fails, and
/// [`Splice::finish`] tells.
struct Splice<'a, W> {
    inner: &'a mut W,
    element: String,
    /// Bytes held back until the place is found; `None` from then on.
    head: Option<Vec<u8>>,
    error: Option<io::Error>,
}

impl<'a, W: Write> Splice<'a, W> {
    fn new(inner: &'a mut W, element: String) -> Self {
        Splice {
            inner,
            element,
            head: Some(Vec::new()),
            error: None,
        }
    }

    fn take(&mut self, bytes: &[u8]) -> io::Result<()> {
        let Some(head) = &mut self.head else {
            return self.inner.write_all(bytes);
        };
        head.extend_from_slice(bytes);
        if let Some(at) = head.windows(PIECE.len()).position(|w| w == PIECE) {
            self.inner.write_all(&head[..at])?;
            self.inner.write_all(self.element.as_bytes())?;
            self.inner.write_all(&head[at..])?;
            self.head = None;
        }
        Ok(())
    }

    /// The first error, or that the file had no piece.
    fn finish(self) -> io::Result<()> {
        match (self.error, self.head) {
            (Some(error), _) => Err(error),
            (None, Some(_)) => Err(io::Error::new(
                io::ErrorKind::InvalidData,
                "the VTK file has no piece",
            )),
            (None, None) => Ok(()),
        }
    }
}

impl<W: Write> Write for Splice<'_, W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if let Some(error) = &self.error {
            return Err(error.kind().into());
        }
        match self.take(bytes) {
            Ok(()) => Ok(bytes.len()),
            Err(error) => {
                let kind = error.kind();
                self.error = Some(error);
                Err(kind.into())
            }
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Takes a few bytes, then the disk is full.
    pub(in super::super) struct FullDisk(pub usize);

    impl Write for FullDisk {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            if self.0 == 0 {
                return Err(io::ErrorKind::StorageFull.into());
            }
            let taken = bytes.len().min(self.0);
            self.0 -= taken;
            Ok(taken)
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn the_element_goes_before_the_piece_however_the_bytes_are_cut() {
        let text = b"<VTKFile><PolyData><Piece a=\"1\"><Piece/></Piece></PolyData></VTKFile>";
        for cut in 1..text.len() {
            let mut out = Vec::new();
            let mut stream = Splice::new(&mut out, "<FieldData/>".into());
            for part in text.chunks(cut) {
                stream.write_all(part).unwrap();
            }
            stream.finish().unwrap();
            assert_eq!(
                String::from_utf8(out).unwrap(),
                "<VTKFile><PolyData><FieldData/><Piece a=\"1\"><Piece/></Piece></PolyData></VTKFile>"
            );
        }
    }

    #[test]
    fn a_full_disk_is_an_error_wherever_it_strikes() {
        use vtkio::model::{Attributes, DataSet, PolyDataPiece, VertexNumbers};
        let data = || {
            DataSet::inline(PolyDataPiece {
                points: points(&[[0.0, 0.0], [1.0, 0.0]]),
                lines: Some(VertexNumbers::XML {
                    connectivity: vec![0, 1],
                    offsets: vec![2],
                }),
                data: Attributes::new(),
                ..PolyDataPiece::default()
            })
        };
        let mut whole = Vec::new();
        write_xml(&mut whole, data(), &[("level", FieldValue::Integer(3))]).unwrap();
        for room in 0..whole.len() {
            let error = write_xml(
                &mut FullDisk(room),
                data(),
                &[("level", FieldValue::Integer(3))],
            )
            .unwrap_err();
            assert_eq!(error.kind(), io::ErrorKind::StorageFull, "room {room}");
        }
    }

    #[test]
    fn an_array_of_the_wrong_length_is_refused() {
        let mut arrays = Arrays::new("cells", 3);
        let error = arrays.push("eta_K", vec![1.0, 2.0]).unwrap_err();
        assert_eq!(error.to_string(), "array `eta_K` has 2 values for 3 cells");
    }
}
