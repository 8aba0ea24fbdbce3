//! Files of a run: fields for ParaView, the history, the summary, and the folder that holds them.
//!
//! Every file appears whole or not at all ([`atomic`]). Numbers come in the user's units; nothing in here scales.
//!
//! - [`folder`]: [`RunFolder`], what may be replaced in a folder and when; the one entry a run needs;
//! - [`vtu`], [`vtp`], [`pvd`]: fields on the triangles, on the interior edges, and ParaView's index of the levels;
//! - [`values`]: arrays of a level that are lent or computed while they are written;
//! - [`history`], [`summary`]: one row a level, and the run in one JSON object; [`columns`] names what both hold;
//! - [`checksum`]: SHA-256 of what is written, for `membranes verify`;
//! - [`memory`], [`machine`]: what the system says of memory and processor.

mod appended;
pub mod atomic;
pub mod checksum;
pub mod columns;
pub mod error;
pub mod folder;
pub mod history;
pub mod machine;
pub mod memory;
pub mod pvd;
pub mod summary;
pub mod values;
mod vtk;
pub mod vtp;
pub mod vtu;

pub use error::OutputError;
pub use folder::RunFolder;
pub use memory::peak_memory_mb;
pub use summary::{Ending, Summary};
pub use values::Values;
pub use vtp::EdgeFields;
pub use vtu::LevelFields;
