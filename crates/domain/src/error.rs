//! Everything that can be wrong with a shape, an outline or a mesh file.
//!
//! `Display` is one line without a final stop; `hint()` says what to do instead.

use std::fmt;

use crate::MAX_TRIANGLES;
use crate::geometry::Point;

/// A point as a message shows it.
pub(crate) struct Shown(pub Point);

impl fmt::Display for Shown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let number = |x: f64| {
            if x == 0.0 || (1e-4..1e9).contains(&x.abs()) || !x.is_finite() {
                format!("{x}")
            } else {
                format!("{x:e}")
            }
        };
        write!(f, "({}, {})", number(self.0[0]), number(self.0[1]))
    }
}

/// One of the point lists of a polygonal domain, counted from 1 as a user does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The outer polygon.
    Outer,
    /// A hole.
    Hole(usize),
    /// An inner line.
    Line(usize),
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Outer => write!(f, "the outer polygon"),
            Self::Hole(k) => write!(f, "hole {k}"),
            Self::Line(k) => write!(f, "line {k}"),
        }
    }
}

/// An edge of a [`Part`], for messages.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PartEdge {
    /// The polygon or line.
    pub part: Part,
    /// Number of the edge, from 1; edge `k` goes from vertex `k` to the next one.
    pub number: usize,
    /// Where it starts.
    pub from: Point,
    /// Where it ends.
    pub to: Point,
}

impl fmt::Display for PartEdge {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { part, number, .. } = self;
        let (from, to) = (Shown(self.from), Shown(self.to));
        write!(f, "edge {number} of {part}, `{from}` to `{to}`")
    }
}

/// Why a shape gives no mesh. Vertices, edges, holes and lines are counted from 1.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DomainError {
    /// The target edge length is not a positive finite number.
    #[error("mesh size `{size}` is not a positive number")]
    Size {
        /// What was given.
        size: f64,
    },
    /// A number of a rectangle or disk is NaN or infinite.
    #[error("`{name}` is not finite: `{}`", Shown(*value))]
    NotFinite {
        /// Which one.
        name: &'static str,
        /// What was given (a radius twice).
        value: Point,
    },
    /// A rectangle without interior.
    #[error("rectangle is empty: `lower` `{}` is not below `upper` `{}`", Shown(*lower), Shown(*upper))]
    EmptyRectangle {
        /// Lower-left corner.
        lower: Point,
        /// Upper-right corner.
        upper: Point,
    },
    /// A radius that is not positive.
    #[error("disk radius `{radius}` is not positive")]
    Radius {
        /// What was given.
        radius: f64,
    },
    /// The domain is larger or smaller than double precision carries through a computation.
    #[error("domain extent `{extent:e}` is out of range")]
    Extent {
        /// Largest side of the bounding box.
        extent: f64,
    },
    /// The mesh would have more than [`MAX_TRIANGLES`] triangles.
    #[error(
        "mesh size `{size}` needs about `{triangles:.1e}` triangles, the limit is `{MAX_TRIANGLES:e}`"
    )]
    TooManyTriangles {
        /// Estimate.
        triangles: f64,
        /// Target edge length.
        size: f64,
    },
    /// Neighbouring vertices would round to the same coordinates.
    #[error("mesh size `{size}` is below the resolution of the coordinates near `{}`", Shown(*at))]
    TooFine {
        /// Target edge length.
        size: f64,
        /// Where.
        at: Point,
    },
    /// Too few different points for a polygon (3) or a line (2).
    #[error("{part} has `{found}` points, it needs at least `{needed}`")]
    TooFewPoints {
        /// Which.
        part: Part,
        /// Points given, a closing point not counted.
        found: usize,
        /// Points needed.
        needed: usize,
    },
    /// A vertex with NaN or infinity.
    #[error("vertex {vertex} of {part} is not finite: `{}`", Shown(*value))]
    VertexNotFinite {
        /// Which polygon or line.
        part: Part,
        /// Which vertex.
        vertex: usize,
        /// Its coordinates.
        value: Point,
    },
    /// A coordinate that is tiny beside the domain, but not zero.
    #[error("vertex {vertex} of {part} has a coordinate too small beside the domain: `{}`", Shown(*value))]
    VertexTiny {
        /// Which polygon or line.
        part: Part,
        /// Which vertex.
        vertex: usize,
        /// Its coordinates.
        value: Point,
    },
    /// Two vertices of one polygon or line coincide.
    #[error("vertices {first} and {second} of {part} are the same point `{}`", Shown(*value))]
    RepeatedVertex {
        /// Which polygon or line.
        part: Part,
        /// One of them.
        first: usize,
        /// The other.
        second: usize,
        /// Their coordinates.
        value: Point,
    },
    /// All vertices of a polygon lie on one straight line.
    #[error("{part} has zero area: all its vertices lie on one straight line")]
    ZeroArea {
        /// Which polygon.
        part: Part,
    },
    /// Two edges of the same polygon meet other than in a common vertex.
    #[error("{} intersects itself: edge {} (`{}` to `{}`) meets edge {} (`{}` to `{}`)",
        first.part, first.number, Shown(first.from), Shown(first.to),
        second.number, Shown(second.from), Shown(second.to))]
    SelfIntersection {
        /// One edge.
        first: PartEdge,
        /// The other.
        second: PartEdge,
    },
    /// Two different polygons meet.
    #[error("{} meets {}: {first} and {second}", first.part, second.part)]
    PolygonsMeet {
        /// An edge of one.
        first: PartEdge,
        /// An edge of the other.
        second: PartEdge,
    },
    /// A hole that lies outside the outer polygon.
    #[error("hole {hole} lies outside the outer polygon: vertex 1 is `{}`", Shown(*at))]
    HoleOutside {
        /// Which hole.
        hole: usize,
        /// Its first vertex.
        at: Point,
    },
    /// A hole inside another hole.
    #[error("hole {inner} lies inside hole {outer}: vertex 1 is `{}`", Shown(*at))]
    HoleInHole {
        /// The one inside.
        inner: usize,
        /// The one around it.
        outer: usize,
        /// First vertex of the one inside.
        at: Point,
    },
    /// A piece of a line lies outside the domain.
    #[error("line {line} leaves the domain: edge {edge} (`{}` to `{}`) is outside at `{}`",
        Shown(*from), Shown(*to), Shown(*at))]
    LineOutside {
        /// Which line.
        line: usize,
        /// Which of its edges.
        edge: usize,
        /// Where that edge starts.
        from: Point,
        /// Where it ends.
        to: Point,
        /// A point of it that is outside.
        at: Point,
    },
    /// A line crosses the outline or another line.
    #[error("{} crosses {}: {first} and {second}", first.part, second.part)]
    LineCrosses {
        /// An edge of one.
        first: PartEdge,
        /// An edge of the other.
        second: PartEdge,
    },
    /// The refinement did not reach its goal within the allowed number of vertices.
    #[error("polygon needs more than `{limit}` vertices for triangles of good shape")]
    VertexLimit {
        /// Vertices allowed.
        limit: usize,
    },
    /// The mesh generator returned something that is not a mesh of the polygon.
    #[error("mesh generator failed: {what}")]
    Generator {
        /// What was wrong with it.
        what: String,
    },
    /// The mesh is defective once its coordinates are rounded.
    #[error("mesh is defective: {0}")]
    Mesh(#[from] MeshDefect),
}

impl DomainError {
    /// What to do instead, where there is something better than the message itself.
    pub fn hint(&self) -> Option<String> {
        let text = match self {
            Self::Size { .. } => "give a target edge length, for example a fifth of the diameter",
            Self::NotFinite { .. } | Self::VertexNotFinite { .. } => "give finite numbers",
            Self::EmptyRectangle { .. } => {
                "both coordinates of `lower` must be less than those of `upper`"
            }
            Self::Radius { .. } => "give a radius greater than 0",
            Self::Extent { .. } => {
                "choose units in which the domain is between 2^-500 and 2^500 across"
            }
            Self::TooManyTriangles { .. } => {
                "start with a larger mesh size; adaptive refinement adds triangles where they pay"
            }
            Self::TooFine { .. } => {
                "use a larger mesh size, or move the domain closer to the origin"
            }
            Self::TooFewPoints { .. } => "a closing point equal to the first one does not count",
            Self::VertexTiny { .. } => "write 0 instead",
            Self::RepeatedVertex { .. } => "remove one of them; a polygon must not touch itself",
            Self::ZeroArea { .. } => {
                "move at least one vertex off that line, or remove the polygon"
            }
            Self::SelfIntersection { .. } => {
                "list the vertices in order along the outline, each once"
            }
            Self::PolygonsMeet { .. } => {
                "keep holes apart from each other and from the outer polygon; join those that meet into one polygon"
            }
            Self::HoleOutside { .. } => "remove the hole, or move it inside",
            Self::HoleInHole { .. } => {
                "islands inside holes are not supported; remove the inner polygon"
            }
            Self::LineOutside { .. } => {
                "end the line on the outline and continue it as another line beyond a hole"
            }
            Self::LineCrosses { .. } => "add the crossing point as a vertex to both",
            Self::VertexLimit { .. } => {
                "remove details, slits and thin parts that are far smaller than the mesh size"
            }
            Self::Generator { .. } => {
                "simplify the polygon near its finest details, or mesh it with Gmsh and read the file"
            }
            Self::Mesh(_) => "use a larger mesh size, or move the domain closer to the origin",
        };
        Some(text.to_string())
    }
}

pub use crate::check::MeshDefect;
pub use crate::gmsh::error::{GmshError, GmshFault, Place};
