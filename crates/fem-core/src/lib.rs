//! Meshes, newest-vertex bisection and first-order finite elements.
//!
//! The crate knows nothing of contact, scenes or files. It provides, from the bottom up:
//!
//! - [`index`]: typed indices of vertices and triangles;
//! - [`topology`]: which triangle has which vertices and neighbours, and which edge bore which vertex;
//! - [`mesh`]: topology with coordinates, regions and the boundary curve, and its construction;
//! - [`bisect`]: newest-vertex bisection with conforming closure;
//! - [`invariants`]: the one checker that every mesh test ends with;
//! - [`sparse`], [`assemble`]: sparsity pattern, symmetric matrices, stiffness;
//! - [`field`], [`quadrature`], [`integrate`]: data given at points, and integrals of data that jump;
//! - [`values`]: one value for every triangle, or the same for all;
//! - [`norms`]: seminorms and areas;
//! - [`parallel`]: loops on several threads whose results do not depend on their number.
//!
//! Every length, tension and load in here is a pure number of order one: the caller has taken
//! powers of two out of the data (see [`scale`]) and puts them back where numbers leave the program.

pub mod assemble;
pub mod bisect;
pub mod error;
pub mod field;
pub mod index;
pub mod integrate;
pub mod invariants;
pub mod mesh;
pub mod norms;
pub mod parallel;
mod parts;
pub mod quadrature;
pub mod scale;
pub mod sparse;
pub mod topology;
pub mod values;

pub use bisect::{Children, Refinement};
pub use error::MeshError;
pub use field::{Constant, Field, FieldError, FieldPair, JointFields, Samples};
pub use index::{TriangleId, VertexId};
pub use mesh::{Circle, Mesh, Shape};
pub use scale::Scale;
pub use sparse::{Pattern, SymmetricMatrix};
pub use topology::{Birth, InteriorEdge, Neighbour, Topology};
pub use values::ElementValues;
