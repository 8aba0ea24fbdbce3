//! What [`check`](super::check) can find.

use std::fmt;

use crate::error::Shown;
use crate::geometry::Point;

/// Why triangles and points are not a mesh. Indices are 0-based as in [`RawMesh`](crate::RawMesh).
#[derive(Clone, Debug, PartialEq)]
pub enum MeshDefect {
    /// There is no triangle.
    NoTriangles,
    /// More vertices or triangles than 32-bit indices carry.
    TooLarge {
        /// Vertices or triangles, whichever is too many.
        count: usize,
    },
    /// The list of regions is not as long as that of triangles.
    Regions {
        /// Number of regions.
        regions: usize,
        /// Number of triangles.
        triangles: usize,
    },
    /// A vertex index beyond the points.
    UnknownVertex {
        /// In which triangle.
        triangle: usize,
        /// The index.
        vertex: u32,
    },
    /// A coordinate that is NaN or infinite.
    NotFinite {
        /// The vertex.
        vertex: usize,
        /// Its coordinates.
        value: Point,
    },
    /// The mesh is larger or smaller than double precision carries through a computation.
    Extent {
        /// Largest side of the bounding box.
        extent: f64,
    },
    /// A vertex that no triangle uses.
    Unused {
        /// The vertex.
        vertex: usize,
        /// Its coordinates.
        value: Point,
    },
    /// A triangle with zero area.
    ZeroArea {
        /// The triangle.
        triangle: usize,
        /// Its corners.
        corners: [Point; 3],
    },
    /// A clockwise triangle.
    Clockwise {
        /// The triangle.
        triangle: usize,
        /// Its corners.
        corners: [Point; 3],
    },
    /// Two triangles with the same corners.
    Duplicate {
        /// The two triangles.
        triangles: [usize; 2],
        /// Their corners.
        corners: [Point; 3],
    },
    /// An edge of three or more triangles.
    SharedEdge {
        /// The first three triangles.
        triangles: [usize; 3],
        /// Its end points.
        edge: [Point; 2],
    },
    /// Two triangles on the same side of a common edge.
    Fold {
        /// The two triangles.
        triangles: [usize; 2],
        /// The edge.
        edge: [Point; 2],
    },
    /// The triangles around a vertex wind around it more than once.
    Overlap {
        /// One of the triangles.
        triangle: usize,
        /// The vertex.
        at: Point,
    },
    /// A vertex in the interior of an edge of another triangle.
    HangingNode {
        /// The triangle whose edge it is.
        triangle: usize,
        /// The edge.
        edge: [Point; 2],
        /// The vertex in it.
        at: Point,
    },
    /// Two boundary edges with different vertices at the same place.
    CoincidentEdges {
        /// The triangles at the two edges.
        triangles: [usize; 2],
        /// The edge.
        edge: [Point; 2],
    },
}

impl fmt::Display for MeshDefect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.describe(&|triangle| format!("triangle {triangle}")))
    }
}

impl std::error::Error for MeshDefect {}

impl MeshDefect {
    /// The message, with triangles named by `name`.
    pub fn describe(&self, name: &dyn Fn(usize) -> String) -> String {
        let path = |edge: &[Point; 2]| format!("`{}` to `{}`", Shown(edge[0]), Shown(edge[1]));
        let corners =
            |c: &[Point; 3]| format!("`{}`, `{}`, `{}`", Shown(c[0]), Shown(c[1]), Shown(c[2]));
        match self {
            Self::NoTriangles => "mesh has no triangles".to_string(),
            Self::TooLarge { count } => {
                format!("mesh has `{count}` vertices or triangles, too many for 32-bit indices")
            }
            Self::Regions { regions, triangles } => {
                format!("mesh has `{regions}` regions for `{triangles}` triangles")
            }
            Self::UnknownVertex { triangle, vertex } => {
                format!(
                    "{} refers to vertex `{vertex}`, which does not exist",
                    name(*triangle)
                )
            }
            Self::NotFinite { vertex, value } => {
                format!(
                    "vertex {vertex} has a coordinate that is not finite: `{}`",
                    Shown(*value)
                )
            }
            Self::Extent { extent } => format!("mesh extent `{extent:e}` is out of range"),
            Self::Unused { vertex, value } => {
                format!(
                    "vertex {vertex} at `{}` belongs to no triangle",
                    Shown(*value)
                )
            }
            Self::ZeroArea {
                triangle,
                corners: c,
            } => {
                format!("{} has zero area: {}", name(*triangle), corners(c))
            }
            Self::Clockwise {
                triangle,
                corners: c,
            } => {
                format!("{} is clockwise: {}", name(*triangle), corners(c))
            }
            Self::Duplicate {
                triangles: [a, b],
                corners: c,
            } => {
                format!(
                    "{} and {} are the same triangle: {}",
                    name(*a),
                    name(*b),
                    corners(c)
                )
            }
            Self::SharedEdge {
                triangles: [a, b, c],
                edge,
            } => format!(
                "edge {} is shared by more than two triangles: {}, {} and {}",
                path(edge),
                name(*a),
                name(*b),
                name(*c)
            ),
            Self::Fold {
                triangles: [a, b],
                edge,
            } => format!(
                "{} and {} overlap: they lie on the same side of their common edge {}",
                name(*a),
                name(*b),
                path(edge)
            ),
            Self::Overlap { triangle, at } => format!(
                "triangles overlap: those around the vertex `{}`, {} among them, wind around it more than once",
                Shown(*at),
                name(*triangle)
            ),
            Self::HangingNode { triangle, edge, at } => format!(
                "mesh is not conforming: vertex `{}` hangs in the edge {} of {}",
                Shown(*at),
                path(edge),
                name(*triangle)
            ),
            Self::CoincidentEdges {
                triangles: [a, b],
                edge,
            } => format!(
                "{} and {} meet along {} but have separate vertices there",
                name(*a),
                name(*b),
                path(edge)
            ),
        }
    }

    /// The triangle that the message is about, to find its place in a file.
    pub fn triangle(&self) -> Option<usize> {
        match self {
            Self::UnknownVertex { triangle, .. }
            | Self::ZeroArea { triangle, .. }
            | Self::Clockwise { triangle, .. }
            | Self::Overlap { triangle, .. }
            | Self::HangingNode { triangle, .. } => Some(*triangle),
            Self::Duplicate { triangles, .. }
            | Self::Fold { triangles, .. }
            | Self::CoincidentEdges { triangles, .. } => Some(triangles[1]),
            Self::SharedEdge { triangles, .. } => Some(triangles[2]),
            Self::NoTriangles
            | Self::TooLarge { .. }
            | Self::Regions { .. }
            | Self::NotFinite { .. }
            | Self::Extent { .. }
            | Self::Unused { .. } => None,
        }
    }

    /// What to do instead.
    pub fn hint(&self) -> Option<String> {
        let text = match self {
            Self::NoTriangles => {
                "save the surface elements: in Gmsh put the surface into a physical group, or set `Mesh.SaveAll = 1`"
            }
            Self::Duplicate { .. } => {
                "a surface in two physical groups is saved twice; keep it in one"
            }
            Self::ZeroArea { .. } => {
                "mesh again; in Gmsh `Mesh.Optimize` or a smaller size removes degenerate triangles"
            }
            Self::SharedEdge { .. } | Self::Fold { .. } | Self::Overlap { .. } => {
                "surfaces overlap; in Gmsh cut them with `BooleanFragments` before meshing"
            }
            Self::HangingNode { .. } => {
                "neighbouring triangles must share whole edges; in Gmsh join the surfaces with `BooleanFragments` before meshing"
            }
            Self::CoincidentEdges { .. } => {
                "merge the double nodes: in Gmsh `Coherence Mesh`, or `BooleanFragments` before meshing"
            }
            Self::Extent { .. } => {
                "choose units in which the mesh is between 2^-500 and 2^500 across"
            }
            _ => return None,
        };
        Some(text.to_string())
    }
}
