//! What can be wrong with a mesh file, and where.

use std::fmt;
use std::path::{Path, PathBuf};

use crate::MeshDefect;

/// Where in a file something is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// The file as a whole.
    File,
    /// A line, counted from 1.
    Line(usize),
    /// A byte offset in a binary file, counted from 0.
    Byte(usize),
}

/// Why a mesh file gives no mesh.
#[derive(Debug)]
pub struct GmshError {
    file: PathBuf,
    place: Place,
    fault: Box<GmshFault>,
}

impl GmshError {
    pub(crate) fn new(file: &Path, flaw: Flaw) -> Self {
        Self {
            file: file.to_path_buf(),
            place: flaw.place,
            fault: Box::new(flaw.fault),
        }
    }

    /// The file, as it was asked for.
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// Where in it.
    pub fn place(&self) -> Place {
        self.place
    }

    /// What is wrong.
    pub fn fault(&self) -> &GmshFault {
        &self.fault
    }

    /// The line, counted from 1, where there is one.
    pub fn line(&self) -> Option<usize> {
        match self.place {
            Place::Line(line) => Some(line),
            Place::File | Place::Byte(_) => None,
        }
    }

    /// Whether the file could not be read at all, so that nothing is known about its content.
    pub fn is_io(&self) -> bool {
        matches!(*self.fault, GmshFault::Io { .. })
    }

    /// What to do instead.
    pub fn hint(&self) -> Option<String> {
        self.fault.hint()
    }
}

impl fmt::Display for GmshError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "mesh file `{}`", self.file.display())?;
        match self.place {
            Place::File => {}
            Place::Line(line) => write!(f, ", line {line}")?,
            Place::Byte(byte) => write!(f, ", byte {byte}")?,
        }
        write!(f, ": {}", self.fault)
    }
}

impl std::error::Error for GmshError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match &*self.fault {
            GmshFault::Io { error } => Some(error),
            GmshFault::Defect { defect, .. } => Some(defect),
            _ => None,
        }
    }
}

/// What is wrong with a mesh file.
#[derive(Debug, thiserror::Error)]
pub enum GmshFault {
    /// The operating system did not give its content.
    #[error("cannot be read: {error}")]
    Io {
        /// What it said.
        error: std::io::Error,
    },
    /// No content.
    #[error("file is empty")]
    Empty,
    /// Something else than a Gmsh mesh.
    #[error("not a Gmsh mesh file: it does not start with `$MeshFormat`")]
    NotGmsh,
    /// A version of the format other than 2.2 and 4.1.
    #[error("MSH version `{found}` is not supported, only 2.2 and 4.1 are")]
    Version {
        /// Version in the file.
        found: String,
    },
    /// The line after `$MeshFormat` is wrong.
    #[error("format line `{found}` is not a version, a file type (0 or 1) and a data size (8)")]
    Format {
        /// The line.
        found: String,
    },
    /// The integer one after the format line of a binary file is a one in no byte order.
    #[error("byte order of the binary file is unknown: the number after the format line is not 1")]
    ByteOrder,
    /// The file ends too early.
    #[error("file ends inside section `${section}`")]
    Truncated {
        /// The section.
        section: String,
    },
    /// A section that must be there is not.
    #[error("section `${section}` is missing")]
    MissingSection {
        /// The section.
        section: &'static str,
    },
    /// A section that may be there once is there again.
    #[error("section `${section}` appears twice")]
    RepeatedSection {
        /// The section.
        section: &'static str,
    },
    /// Text between sections.
    #[error("expected a section, found `{found}`")]
    NoSection {
        /// The text.
        found: String,
    },
    /// A section does not end after as many items as it announces.
    #[error("expected `$End{section}`, found `{found}`")]
    SectionEnd {
        /// The section.
        section: &'static str,
        /// What is there instead.
        found: String,
    },
    /// A partitioned mesh.
    #[error("partitioned meshes are not supported")]
    Partitioned,
    /// Nodes with parametric coordinates.
    #[error("nodes with parametric coordinates are not supported")]
    Parametric,
    /// A number that is none, or out of range.
    #[error("expected {what}, found `{found}`")]
    Number {
        /// What the number means.
        what: &'static str,
        /// The text, or the value in a binary file.
        found: String,
    },
    /// A line that ends too early.
    #[error("line ends where {what} should be")]
    TooShort {
        /// What is missing.
        what: &'static str,
    },
    /// A line that goes on.
    #[error("line goes on with `{found}`")]
    TooLong {
        /// The rest, or its beginning.
        found: String,
    },
    /// A count larger than the rest of the file can hold.
    #[error("`{count}` {what} are announced, more than the file can hold")]
    Count {
        /// What is counted.
        what: &'static str,
        /// How many.
        count: u64,
    },
    /// Elements that are not 3-node triangles and cannot be left out either.
    #[error("{name} (type {kind}) are not supported")]
    Element {
        /// Name of the elements, plural.
        name: &'static str,
        /// Gmsh's number of the type.
        kind: i64,
    },
    /// A triangle refers to a node that is not in the file.
    #[error("element `{element}` refers to node `{node}`, which is not in the file")]
    UnknownNode {
        /// Tag of the triangle.
        element: u64,
        /// Tag of the node.
        node: u64,
    },
    /// Two nodes with the same tag.
    #[error("node tag `{node}` is used twice")]
    DuplicateNode {
        /// The tag.
        node: u64,
    },
    /// A coordinate that is NaN or infinite.
    #[error("node `{node}` has a coordinate that is not finite: `({}, {}, {})`", value[0], value[1], value[2])]
    NodeNotFinite {
        /// Tag of the node.
        node: u64,
        /// Its coordinates.
        value: [f64; 3],
    },
    /// The nodes do not lie in a plane z = const.
    #[error("mesh is not planar: node `{node}` has z = `{z}`, node `{other}` has z = `{other_z}`")]
    NotPlanar {
        /// Tag of a node.
        node: u64,
        /// Its height.
        z: f64,
        /// Tag of another node.
        other: u64,
        /// Its height.
        other_z: f64,
    },
    /// The parser of MSH 4.1 gives up.
    #[error("not valid MSH 4.1: {what}")]
    Parser {
        /// What it says.
        what: String,
    },
    /// The triangles are not a mesh.
    #[error("{message}")]
    Defect {
        /// What is wrong, in indices of the points and triangles that are used.
        defect: MeshDefect,
        /// The same in words, with the element tags of the file.
        message: String,
    },
}

impl GmshFault {
    /// What to do instead.
    pub fn hint(&self) -> Option<String> {
        let text = match self {
            Self::Io { error } if error.kind() == std::io::ErrorKind::NotFound => {
                "a relative path is taken from the directory of the scene file"
            }
            Self::Io { .. } => "check the path and its permissions",
            Self::Version { .. } => {
                "save again with `Mesh.MshFileVersion = 4.1` or `gmsh -format msh41`"
            }
            Self::Empty | Self::NotGmsh => "save the mesh from Gmsh as `.msh`, version 4.1 or 2.2",
            Self::Partitioned => {
                "save again without partitions (`Mesh.PartitionCreateTopology = 0`, `Unpartition`)"
            }
            Self::Parametric => "save again with `Mesh.SaveParametric = 0`",
            Self::Element { .. } => {
                "mesh with first-order triangles: `Mesh.ElementOrder = 1`, `Mesh.RecombineAll = 0`, dimension 2"
            }
            Self::NotPlanar { .. } => "the domain must lie in a plane z = const",
            Self::Truncated { .. } | Self::Count { .. } | Self::ByteOrder => {
                "the file is damaged or incomplete; save it again"
            }
            Self::Defect { defect, .. } => return defect.hint(),
            Self::MissingSection { .. } | Self::SectionEnd { .. } | Self::Parser { .. } => {
                "save the mesh again from Gmsh"
            }
            _ => return None,
        };
        Some(text.to_string())
    }
}

/// A fault and its place, before the file's name is known.
#[derive(Debug)]
pub(crate) struct Flaw {
    pub place: Place,
    pub fault: GmshFault,
}

impl From<GmshFault> for Flaw {
    fn from(fault: GmshFault) -> Self {
        Self {
            place: Place::File,
            fault,
        }
    }
}
