//! From a domain in numbers to the initial mesh, in a unit of length that makes it of order one.

use std::path::Path;

use domain::geometry::{bounds, exponent};
use domain::{DomainError, GmshFault, MAX_TRIANGLES, Part, RawMesh};
use fem_core::scale::times_power_of_two;
use fem_core::{Children, Circle, Mesh, MeshError};

use crate::error::{Excerpt, Kind, Report, SceneError};
use crate::geometry::diameter;
use crate::source::{At, Fault, Place, Sources};
use crate::validate::Shape;

/// The initial mesh, scaled.
pub(crate) struct Initial {
    pub mesh: Mesh,
    /// Exponent of the unit of length.
    pub length: i32,
    /// The domain in words.
    pub description: String,
}

/// Target edge length as a part of the domain's diameter where none is given.
const DEFAULT_SIZE: f64 = 0.2;

/// Meshes the domain. Mesh files are relative to `folder`.
pub(crate) fn build(
    shape: &At<Shape>,
    sources: &Sources<'_>,
    folder: &Path,
) -> Result<Initial, SceneError> {
    let (length, mesh, description) = match &shape.value {
        Shape::Mesh { file } => {
            let raw = read(file, sources, folder)?;
            let extent = extent(&raw.points);
            let length = exponent(extent).unwrap_or(0);
            let description = format!("mesh file {}", folder.join(&file.value).display());
            let mesh = plain(scale_points(raw, -length));
            (length, mesh.map_err(Flaw::Mesh), description)
        }
        shape => {
            let extent = shape.extent();
            // Out of range, the domain is meshed as it is, and that says what is wrong with it.
            let length = exponent(extent).unwrap_or(0);
            let size = shape.size(exponent(extent).is_some());
            let mesh = shape.mesh(size, -length).map_err(|flaw| match flaw {
                // The same in the user's units, for the message; scaling changes nothing but the numbers.
                Flaw::Domain(_) if length != 0 => shape.mesh(size, 0).err().unwrap_or(flaw),
                flaw => flaw,
            });
            (length, mesh, shape.description())
        }
    };
    let mesh = mesh.map_err(|flaw| {
        sources.report(match flaw {
            Flaw::Domain(error) => {
                let place = place_of(&error, shape);
                Fault::at(&place, error.to_string()).maybe_hint(error.hint())
            }
            Flaw::Mesh(error) => Fault::at(&shape.place, error.to_string()),
        })
    })?;
    Ok(Initial {
        mesh,
        length,
        description,
    })
}

/// What can go wrong with a domain that is no file.
enum Flaw {
    Domain(DomainError),
    Mesh(MeshError),
}

impl Shape {
    /// The larger side of the bounding box.
    fn extent(&self) -> f64 {
        match self {
            Shape::Rectangle { lower, upper, .. } => extent(&[*lower, *upper]),
            Shape::Disk { radius, .. } => 2.0 * radius,
            Shape::Polygon { outer, .. } => extent(&values(&outer.value)),
            Shape::Mesh { .. } => 0.0,
        }
    }

    /// The target edge length; without a usable extent any will do.
    fn size(&self, usable: bool) -> f64 {
        let (given, diameter) = match self {
            Shape::Rectangle { lower, upper, size } => {
                (size, (upper[0] - lower[0]).hypot(upper[1] - lower[1]))
            }
            Shape::Disk { radius, size, .. } => (size, 2.0 * radius),
            Shape::Polygon { outer, size, .. } => (size, diameter(&values(&outer.value))),
            Shape::Mesh { .. } => (&None, 1.0),
        };
        match given {
            Some(at) => at.value,
            None if usable => DEFAULT_SIZE * diameter,
            None => 1.0,
        }
    }

    /// Meshes the shape with all lengths times 2^e.
    fn mesh(&self, size: f64, e: i32) -> Result<Mesh, Flaw> {
        let number = |v: f64| times_power_of_two(v, e);
        let point = |p: [f64; 2]| p.map(number);
        let points = |list: &At<Vec<At<[f64; 2]>>>| -> Vec<[f64; 2]> {
            values(&list.value).into_iter().map(point).collect()
        };
        let size = number(size);
        match self {
            Shape::Rectangle { lower, upper, .. } => {
                let raw = domain::rectangle(point(*lower), point(*upper), size);
                plain(raw.map_err(Flaw::Domain)?).map_err(Flaw::Mesh)
            }
            Shape::Polygon {
                outer,
                holes,
                lines,
                ..
            } => {
                let holes: Vec<_> = holes.iter().map(points).collect();
                let lines: Vec<_> = lines.iter().map(points).collect();
                let raw = domain::polygon(&points(outer), &holes, &lines, size);
                let (raw, _) = raw.map_err(Flaw::Domain)?;
                plain(raw).map_err(Flaw::Mesh)
            }
            Shape::Disk { center, radius, .. } => {
                let circle = Circle {
                    center: point(*center),
                    radius: number(*radius),
                };
                let disk =
                    domain::disk(circle.center, circle.radius, size).map_err(Flaw::Domain)?;
                let fan = disk.fan;
                let mut mesh = Mesh::new(fan.points, &fan.triangles, &fan.regions, Some(circle))
                    .map_err(Flaw::Mesh)?;
                for _ in 0..disk.refinements {
                    mesh.refine_uniformly(Children::Four).map_err(Flaw::Mesh)?;
                }
                Ok(mesh)
            }
            Shape::Mesh { .. } => Err(Flaw::Mesh(MeshError::Empty)),
        }
    }

    fn description(&self) -> String {
        match self {
            Shape::Rectangle { lower, upper, .. } => format!(
                "rectangle from ({}, {}) to ({}, {})",
                lower[0], lower[1], upper[0], upper[1]
            ),
            Shape::Disk { center, radius, .. } => {
                format!(
                    "disk of radius {radius} about ({}, {})",
                    center[0], center[1]
                )
            }
            Shape::Polygon {
                outer,
                holes,
                lines,
                ..
            } => {
                let mut text = format!("polygon with {} vertices", outer.value.len());
                for (count, one) in [(holes.len(), "hole"), (lines.len(), "line")] {
                    match count {
                        0 => {}
                        1 => text.push_str(&format!(", 1 {one}")),
                        n => text.push_str(&format!(", {n} {one}s")),
                    }
                }
                text
            }
            Shape::Mesh { file } => format!("mesh file {}", file.value),
        }
    }
}

fn plain(raw: RawMesh) -> Result<Mesh, MeshError> {
    Mesh::new(raw.points, &raw.triangles, &raw.regions, None)
}

fn values(points: &[At<[f64; 2]>]) -> Vec<[f64; 2]> {
    points.iter().map(|at| at.value).collect()
}

/// The larger side of the bounding box.
fn extent(points: &[[f64; 2]]) -> f64 {
    bounds(points.iter().copied())
        .map_or(0.0, |[low, high]| (high[0] - low[0]).max(high[1] - low[1]))
}

fn scale_points(mut raw: RawMesh, e: i32) -> RawMesh {
    for point in &mut raw.points {
        *point = point.map(|v| times_power_of_two(v, e));
    }
    raw
}

/// The place that an error is about, as near as it says.
fn place_of(error: &DomainError, shape: &At<Shape>) -> Place {
    let size = match &shape.value {
        Shape::Rectangle { size, .. } | Shape::Disk { size, .. } | Shape::Polygon { size, .. } => {
            size.as_ref().map(|at| at.place.clone())
        }
        Shape::Mesh { .. } => None,
    };
    let part = |part: Part, vertex: Option<usize>| {
        let Shape::Polygon {
            outer,
            holes,
            lines,
            ..
        } = &shape.value
        else {
            return None;
        };
        let list = match part {
            Part::Outer => Some(outer),
            Part::Hole(k) => holes.get(k - 1),
            Part::Line(k) => lines.get(k - 1),
        }?;
        let vertex = vertex.and_then(|k| list.value.get(k - 1));
        Some(vertex.map_or(list.place.clone(), |at| at.place.clone()))
    };
    let place = match error {
        DomainError::Size { .. }
        | DomainError::TooManyTriangles { .. }
        | DomainError::TooFine { .. } => size,
        DomainError::TooFewPoints { part: p, .. } | DomainError::ZeroArea { part: p } => {
            part(*p, None)
        }
        DomainError::VertexNotFinite {
            part: p, vertex, ..
        }
        | DomainError::VertexTiny {
            part: p, vertex, ..
        }
        | DomainError::RepeatedVertex {
            part: p,
            second: vertex,
            ..
        } => part(*p, Some(*vertex)),
        DomainError::SelfIntersection { second, .. } => part(second.part, Some(second.number)),
        DomainError::PolygonsMeet { first, .. } | DomainError::LineCrosses { first, .. } => {
            part(first.part, Some(first.number))
        }
        DomainError::HoleOutside { hole, .. } => part(Part::Hole(*hole), Some(1)),
        DomainError::HoleInHole { inner, .. } => part(Part::Hole(*inner), Some(1)),
        DomainError::LineOutside { line, edge, .. } => part(Part::Line(*line), Some(*edge)),
        _ => None,
    };
    place.unwrap_or_else(|| shape.place.clone())
}

/// Reads a mesh file.
fn read(file: &At<String>, sources: &Sources<'_>, folder: &Path) -> Result<RawMesh, SceneError> {
    let path = folder.join(&file.value);
    let shown = path.display();
    let refuse =
        |message: String, hint: &str| sources.report(Fault::at(&file.place, message).hint(hint));
    if path.is_dir() {
        let hint = "name a Gmsh file: `file = \"plate.msh\"`";
        return Err(refuse(
            format!("the mesh file `{shown}` is a directory"),
            hint,
        ));
    }
    let raw = domain::gmsh::read(&path).map_err(|error| match error.fault() {
        GmshFault::Io { error: io } if io.kind() == std::io::ErrorKind::NotFound => {
            let hint = "a relative path is taken from the folder of the scene file";
            refuse(format!("the mesh file `{shown}` does not exist"), hint)
        }
        fault => {
            let mut message = fault.to_string();
            if let domain::Place::Byte(byte) = error.place() {
                message = format!("{message} (at byte {byte})");
            }
            SceneError::new(Report {
                file: shown.to_string(),
                line: error.line(),
                excerpt: error.line().and_then(|line| line_of(&path, line)),
                message,
                hint: error.hint(),
                kind: if error.is_io() {
                    Kind::Reading
                } else {
                    Kind::Input
                },
                ..Report::default()
            })
        }
    })?;
    if raw.triangles.len() as f64 > MAX_TRIANGLES {
        let message = format!(
            "the mesh has {} triangles, the limit is {MAX_TRIANGLES:e}",
            raw.triangles.len()
        );
        return Err(refuse(message, "start with a coarser mesh"));
    }
    Ok(raw)
}

/// A line of a text file, all of it at fault.
fn line_of(path: &Path, line: usize) -> Option<Excerpt> {
    let bytes = std::fs::read(path).ok()?;
    let text = bytes.split(|&b| b == b'\n').nth(line - 1)?;
    let line = std::str::from_utf8(text).ok()?.trim_end().to_owned();
    let length = line.chars().count();
    (length > 0).then_some(Excerpt {
        line,
        start: 0,
        length,
    })
}
