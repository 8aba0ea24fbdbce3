//! VTK XML with the numbers behind the text: every array is named in the head, and its bytes stand in one block at the end of the file
//! (`<AppendedData encoding="raw">`), little endian, each array behind its length as UInt64.
//!
//! The places in the block follow from the lengths alone, so the head can be written first and the arrays after it through a buffer
//! of fixed size.

use std::io::{self, Write};

use super::values::Values;

/// Values that are taken at a time.
const BLOCK: usize = 4096;

/// An array of a file.
pub(super) struct Array<'a> {
    name: &'a str,
    /// Name of its type in VTK.
    kind: &'static str,
    /// Numbers a tuple, as the head says.
    components: usize,
    /// How many values were given.
    count: usize,
    /// Bytes a value.
    width: usize,
    write: Box<WriteAll<'a>>,
}

/// Writes every number of an array.
type WriteAll<'a> = dyn Fn(&mut dyn Write) -> io::Result<()> + 'a;

impl<'a> Array<'a> {
    /// An array of the bytes that `encode` makes of each of `values`; the head says that a tuple has `components` numbers.
    pub fn new<T: Copy + Send + Sync + 'a, const N: usize>(
        name: &'a str,
        kind: &'static str,
        components: usize,
        values: Values<'a, T>,
        encode: impl Fn(T) -> [u8; N] + 'a,
    ) -> Self {
        Array {
            name,
            kind,
            components,
            count: values.len(),
            width: N,
            write: Box::new(move |writer| stream(writer, &values, &encode)),
        }
    }

    /// Doubles, one a tuple.
    pub fn reals(name: &'a str, values: Values<'a, f64>) -> Self {
        Array::new(name, "Float64", 1, values, f64::to_le_bytes)
    }

    /// Whether there is a value for each of `count` points or cells.
    ///
    /// # Errors
    /// `InvalidInput`: a file with another number of them must not come to be.
    pub fn check(&self, place: &str, count: usize) -> io::Result<()> {
        if self.count == count {
            return Ok(());
        }
        Err(io::Error::new(
            io::ErrorKind::InvalidInput,
            format!(
                "array `{}` has {} values for {count} {place}",
                self.name, self.count
            ),
        ))
    }

    /// Bytes of its numbers.
    fn length(&self) -> u64 {
        self.count as u64 * self.width as u64
    }
}

/// Writes the numbers of an array, a block at a time.
fn stream<T: Copy + Send + Sync, const N: usize>(
    writer: &mut dyn Write,
    values: &Values<'_, T>,
    encode: &impl Fn(T) -> [u8; N],
) -> io::Result<()> {
    let block = BLOCK.min(values.len());
    let mut taken = Vec::with_capacity(block);
    let mut bytes = vec![0; N * block];
    for start in (0..values.len()).step_by(BLOCK) {
        taken.clear();
        values.append(start..values.len().min(start + BLOCK), &mut taken);
        let (rows, _) = bytes.as_chunks_mut::<N>();
        for (row, &value) in rows.iter_mut().zip(&taken) {
            *row = encode(value);
        }
        writer.write_all(&bytes[..N * taken.len()])?;
    }
    Ok(())
}

/// The bytes of several numbers, next to each other.
pub(super) fn joined<const W: usize, const N: usize>(
    numbers: impl IntoIterator<Item = [u8; W]>,
) -> [u8; N] {
    let mut row = [0; N];
    let (places, _) = row.as_chunks_mut::<W>();
    for (place, number) in places.iter_mut().zip(numbers) {
        *place = number;
    }
    row
}

/// A file of one piece.
pub(super) struct Document<'a> {
    /// The kind of its data set, for example `UnstructuredGrid`.
    pub kind: &'static str,
    /// Arrays that belong to the whole file.
    pub field: Vec<Array<'a>>,
    /// Attributes of the piece and their numbers.
    pub counts: Vec<(&'static str, usize)>,
    /// Elements of the piece with their arrays.
    pub sections: Vec<(&'static str, Vec<Array<'a>>)>,
}

impl Document<'_> {
    /// Writes the file.
    ///
    /// # Errors
    /// Those of `writer`.
    pub fn write(&self, writer: &mut dyn Write) -> io::Result<()> {
        writer.write_all(self.head().as_bytes())?;
        for array in self.arrays() {
            writer.write_all(&array.length().to_le_bytes())?;
            (array.write)(writer)?;
        }
        writer.write_all(b"\n</AppendedData>\n</VTKFile>\n")
    }

    /// Every array in the order of the block.
    fn arrays(&self) -> impl Iterator<Item = &Array<'_>> {
        let piece = self.sections.iter().flat_map(|(_, arrays)| arrays);
        self.field.iter().chain(piece)
    }

    /// Everything before the first byte of the block.
    fn head(&self) -> String {
        let kind = self.kind;
        let mut offset = 0;
        let mut text = format!(
            "<VTKFile type=\"{kind}\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n<{kind}>\n"
        );
        text += "<FieldData>\n";
        for array in &self.field {
            let tuples = format!(" NumberOfTuples=\"{}\"", array.count);
            text += &array.element(&tuples, &mut offset);
        }
        text += "</FieldData>\n<Piece";
        for (name, count) in &self.counts {
            text += &format!(" {name}=\"{count}\"");
        }
        text += ">\n";
        for (name, arrays) in &self.sections {
            text += &format!("<{name}>\n");
            for array in arrays {
                text += &array.element("", &mut offset);
            }
            text += &format!("</{name}>\n");
        }
        text + &format!("</Piece>\n</{kind}>\n<AppendedData encoding=\"raw\">\n_")
    }
}

impl Array<'_> {
    /// Its element in the head; `offset`, its place in the block, moves on to the next.
    pub fn element(&self, tuples: &str, offset: &mut u64) -> String {
        let Array {
            name,
            kind,
            components,
            ..
        } = self;
        let components = match components {
            1 => String::new(),
            several => format!(" NumberOfComponents=\"{several}\""),
        };
        let place = *offset;
        *offset += size_of::<u64>() as u64 + self.length();
        format!(
            "<DataArray type=\"{kind}\" Name=\"{name}\"{components}{tuples} format=\"appended\" offset=\"{place}\"/>\n"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::super::vtk::tests::FullDisk;
    use super::*;

    fn document(count: usize) -> Document<'static> {
        let numbers = |salt: u32| Values::by(count, move |i| i as u32 * 3 + salt);
        Document {
            kind: "PolyData",
            field: vec![Array::reals("bound", vec![0.5].into())],
            counts: vec![("NumberOfPoints", count), ("NumberOfLines", 0)],
            sections: vec![
                (
                    "PointData",
                    vec![Array::new("a", "UInt8", 1, numbers(1), |v| [v as u8])],
                ),
                (
                    "Points",
                    vec![Array::new("Points", "UInt32", 2, numbers(2), |v| {
                        joined::<4, 8>([v, v + 1].map(u32::to_le_bytes))
                    })],
                ),
            ],
        }
    }

    #[test]
    fn the_head_tells_where_every_array_is() {
        let mut bytes = Vec::new();
        document(2).write(&mut bytes).unwrap();
        let head = "<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n<PolyData>\n\
            <FieldData>\n<DataArray type=\"Float64\" Name=\"bound\" NumberOfTuples=\"1\" format=\"appended\" offset=\"0\"/>\n</FieldData>\n\
            <Piece NumberOfPoints=\"2\" NumberOfLines=\"0\">\n\
            <PointData>\n<DataArray type=\"UInt8\" Name=\"a\" format=\"appended\" offset=\"16\"/>\n</PointData>\n\
            <Points>\n<DataArray type=\"UInt32\" Name=\"Points\" NumberOfComponents=\"2\" format=\"appended\" offset=\"26\"/>\n</Points>\n\
            </Piece>\n</PolyData>\n<AppendedData encoding=\"raw\">\n_";
        let block = [
            &[8, 0, 0, 0, 0, 0, 0, 0][..],
            &0.5f64.to_le_bytes(),
            &[2, 0, 0, 0, 0, 0, 0, 0],
            &[1, 4],
            &[16, 0, 0, 0, 0, 0, 0, 0],
            &[2, 0, 0, 0, 3, 0, 0, 0, 5, 0, 0, 0, 6, 0, 0, 0],
        ]
        .concat();
        let tail = b"\n</AppendedData>\n</VTKFile>\n";
        assert_eq!(bytes, [head.as_bytes(), &block, tail].concat());
    }

    #[test]
    fn more_than_a_block_is_written_to_the_end() {
        for count in [0, 1, BLOCK - 1, BLOCK, BLOCK + 1, 3 * BLOCK + 5] {
            let mut bytes = Vec::new();
            let values = Values::by(count, |i| i as u64 + 7);
            stream(&mut bytes, &values, &u64::to_le_bytes).unwrap();
            let expected: Vec<u8> = (7..count as u64 + 7).flat_map(u64::to_le_bytes).collect();
            assert!(bytes == expected, "{count}");
        }
    }

    #[test]
    fn a_full_disk_is_an_error_wherever_it_strikes() {
        let mut whole = Vec::new();
        document(3).write(&mut whole).unwrap();
        for room in 0..whole.len() {
            let error = document(3).write(&mut FullDisk(room)).unwrap_err();
            assert_eq!(error.kind(), io::ErrorKind::StorageFull, "room {room}");
        }
    }

    #[test]
    fn an_array_of_the_wrong_length_is_refused() {
        let array = Array::reals("eta_K", vec![1.0, 2.0].into());
        assert!(array.check("cells", 2).is_ok());
        let error = array.check("cells", 3).unwrap_err();
        assert_eq!(error.to_string(), "array `eta_K` has 2 values for 3 cells");
    }
}
