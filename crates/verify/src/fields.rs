//! The fields of a level as its file gives them.

use crate::error::LevelError;
use crate::number::largest;
use crate::vtk::VtkFile;

/// What `level_NNNN.vtu` holds, in the user's units.
#[derive(Clone, Debug)]
pub(crate) struct LevelFields {
    /// Field data `level`.
    pub level: i64,
    /// Field data `error_bound`.
    pub error_bound: f64,
    /// Coordinates.
    pub points: Vec<[f64; 2]>,
    /// Vertices of the triangles, as they stand in the file.
    pub triangles: Vec<[u32; 3]>,
    /// Displacements.
    pub displacement: [Vec<f64>; 2],
    /// u1 - u2.
    pub gap: Vec<f64>,
    /// Riesz representative.
    pub sigma: Vec<f64>,
    /// Action forces z_j.
    pub force: Vec<f64>,
    /// Pressures z_j / |D_j|.
    pub action: Vec<f64>,
    /// The contact set as 0 and 1.
    pub contact: Vec<i64>,
    /// Cell arrays of doubles that need not be there, by name.
    pub cells: Vec<(&'static str, Option<Vec<f64>>)>,
    /// Bisections.
    pub generation: Vec<i64>,
    /// Physical tags.
    pub region: Vec<i64>,
}

/// Point arrays that every level has.
const POINT: [&str; 7] = [
    "u1",
    "u2",
    "gap",
    "sigma",
    "action_force",
    "action",
    "contact",
];
/// Cell arrays of doubles; which of them must be there depends on the scene.
const CELL: [&str; 7] = [
    "eta_K",
    "eta_e",
    "residual",
    "certified",
    "oscillation",
    "f1_h",
    "f2_h",
];
/// Values of the whole file.
const FIELD: [&str; 2] = ["level", "error_bound"];
/// The rest of the cell arrays.
const INTEGER: [&str; 2] = ["generation", "region"];

impl LevelFields {
    /// Takes the arrays out of a file.
    ///
    /// # Errors
    /// An array that is missing, unknown, of the wrong length, not finite, or no triangulation at all.
    pub fn of(file: &VtkFile) -> Result<LevelFields, LevelError> {
        LevelFields::read(file).map_err(LevelError::File)
    }

    fn read(file: &VtkFile) -> Result<LevelFields, String> {
        let vertices = file.count("NumberOfPoints")?;
        let count = file.count("NumberOfCells")?;
        known(file, "PointData", &POINT)?;
        known(file, "CellData", &[&CELL[..], &INTEGER[..]].concat())?;
        known(file, "Cells", &["connectivity", "offsets", "types"])?;
        known(file, "FieldData", &FIELD)?;
        let need = |name: &str| format!("the array `{name}` is missing");
        let point = |name: &str| {
            file.real("PointData", name, vertices)?
                .ok_or_else(|| need(name))
        };
        let integer = |place: &str, name: &str, length: usize| {
            file.integer(place, name, length)?.ok_or_else(|| need(name))
        };
        let connectivity = integer("Cells", "connectivity", times(count, 3)?)?;
        let offsets = integer("Cells", "offsets", count)?;
        let types = integer("Cells", "types", count)?;
        // 5 is the triangle of VTK.
        let triangles = types.iter().all(|&t| t == 5);
        if !triangles || offsets.iter().zip(1..).any(|(&o, t)| o != 3 * t) {
            return Err("the cells are not all triangles".into());
        }
        let cell = |name| Ok((name, file.real("CellData", name, count)?));
        Ok(LevelFields {
            level: integer("FieldData", "level", 1)?[0],
            error_bound: file
                .real("FieldData", "error_bound", 1)?
                .ok_or_else(|| need("error_bound"))?[0],
            points: points(file, vertices)?,
            triangles: vertex_numbers(&connectivity)?.as_chunks::<3>().0.to_vec(),
            displacement: [point("u1")?, point("u2")?],
            gap: point("gap")?,
            sigma: point("sigma")?,
            force: point("action_force")?,
            action: point("action")?,
            contact: integer("PointData", "contact", vertices)?,
            cells: CELL.into_iter().map(cell).collect::<Result<_, String>>()?,
            generation: integer("CellData", "generation", count)?,
            region: integer("CellData", "region", count)?,
        })
    }

    /// An array so small that doubles hold fewer digits of it, from which nothing can be recomputed.
    pub fn lost_digits(&self) -> Option<String> {
        let [u1, u2] = &self.displacement;
        let flat = self.points.as_flattened();
        let arrays: [(&str, &[f64]); 5] = [
            ("Points", flat),
            ("u1", u1),
            ("u2", u2),
            ("sigma", &self.sigma),
            ("action_force", &self.force),
        ];
        let tiny = |values: &[f64]| {
            let size = largest(values);
            size > 0.0 && size < f64::MIN_POSITIVE / f64::EPSILON
        };
        let found = arrays.iter().find(|(_, values)| tiny(values))?;
        Some(format!(
            "the values of `{}` are too small for doubles to hold all digits",
            found.0
        ))
    }

    /// A cell array of doubles, if it is there.
    pub fn cell(&self, name: &str) -> Option<&[f64]> {
        let found = self.cells.iter().find(|(n, _)| *n == name);
        found.and_then(|(_, values)| values.as_deref())
    }
}

/// What `edges_NNNN.vtp` holds, in the user's units.
#[derive(Clone, Debug)]
pub(crate) struct EdgeFields {
    /// Field data `level`.
    pub level: i64,
    /// Field data `error_bound`.
    pub error_bound: f64,
    /// Coordinates of all vertices.
    pub points: Vec<[f64; 2]>,
    /// Ends of the edges.
    pub edges: Vec<[u32; 2]>,
    /// Indicator (7.2).
    pub eta_e: Vec<f64>,
}

impl EdgeFields {
    /// Takes the arrays out of a file.
    ///
    /// # Errors
    /// As [`LevelFields::of`].
    pub fn of(file: &VtkFile) -> Result<EdgeFields, LevelError> {
        EdgeFields::read(file).map_err(LevelError::File)
    }

    fn read(file: &VtkFile) -> Result<EdgeFields, String> {
        let vertices = file.count("NumberOfPoints")?;
        let count = file.count("NumberOfLines")?;
        known(file, "PointData", &[])?;
        known(file, "CellData", &["eta_e"])?;
        known(file, "Lines", &["connectivity", "offsets"])?;
        known(file, "FieldData", &FIELD)?;
        let need = |name: &str| format!("the array `{name}` is missing");
        let integer = |place: &str, name: &str, length: usize| {
            file.integer(place, name, length)?.ok_or_else(|| need(name))
        };
        let real = |place: &str, name: &str, length: usize| {
            file.real(place, name, length)?.ok_or_else(|| need(name))
        };
        let connectivity = integer("Lines", "connectivity", times(count, 2)?)?;
        let offsets = integer("Lines", "offsets", count)?;
        if offsets.iter().zip(1..).any(|(&o, e)| o != 2 * e) {
            return Err("the lines are not all single edges".into());
        }
        Ok(EdgeFields {
            level: integer("FieldData", "level", 1)?[0],
            error_bound: real("FieldData", "error_bound", 1)?[0],
            points: points(file, vertices)?,
            edges: vertex_numbers(&connectivity)?.as_chunks::<2>().0.to_vec(),
            eta_e: real("CellData", "eta_e", count)?,
        })
    }
}

fn times(count: usize, by: usize) -> Result<usize, String> {
    let product = count.checked_mul(by);
    product.ok_or_else(|| format!("{count} cells are too many"))
}

/// The points without their third coordinate, which must be zero.
fn points(file: &VtkFile, count: usize) -> Result<Vec<[f64; 2]>, String> {
    known(file, "Points", &["Points"])?;
    let flat = file
        .real("Points", "Points", times(count, 3)?)?
        .ok_or("the array `Points` is missing")?;
    let (rows, _) = flat.as_chunks::<3>();
    if let Some(k) = rows.iter().position(|p| p[2] != 0.0) {
        return Err(format!("point {k} is not in the plane z = 0"));
    }
    Ok(rows.iter().map(|p| [p[0], p[1]]).collect())
}

/// Vertex numbers as the mesh wants them.
fn vertex_numbers(numbers: &[i64]) -> Result<Vec<u32>, String> {
    let number = |&v: &i64| u32::try_from(v).map_err(|_| format!("there is no vertex {v}"));
    numbers.iter().map(number).collect()
}

/// Refuses an array that this version does not know, since nobody would look at its numbers, and one beside which a wrong range stands.
fn known(file: &VtkFile, place: &str, names: &[&str]) -> Result<(), String> {
    for array in file.arrays() {
        if array.place == place && !names.contains(&array.name.as_str()) {
            return Err(format!(
                "the array `{}` is not known to this version",
                array.name
            ));
        }
        if !array.range_holds() {
            return Err(format!(
                "the range beside the array `{}` is not that of its values",
                array.name
            ));
        }
    }
    Ok(())
}
