//! What the loop works on: an initial mesh and the data, in scaled units.

use std::sync::Arc;

use estimate::Exact;
use fem_core::{Field, Mesh, Scale};

/// A checked problem: whoever builds one has made sure that tensions are positive and that `heights[0] >= heights[1]`.
#[derive(Clone)]
pub struct Problem {
    /// The initial mesh.
    pub mesh: Mesh,
    /// The powers of two taken out of lengths, tensions and loads.
    pub scale: Scale,
    /// Tensions mu_1, mu_2.
    pub tension: [Arc<dyn Field>; 2],
    /// Loads f_1, f_2.
    pub load: [Arc<dyn Field>; 2],
    /// Boundary heights g_1 >= g_2, sampled at boundary vertices.
    pub height: [Arc<dyn Field>; 2],
    /// The exact solution, if known.
    pub exact: Option<Exact>,
}

impl Problem {
    /// The loads f_1, f_2.
    pub fn loads(&self) -> [&dyn Field; 2] {
        self.load.each_ref().map(|f| &**f)
    }

    /// The tensions mu_1, mu_2.
    pub fn tensions(&self) -> [&dyn Field; 2] {
        self.tension.each_ref().map(|f| &**f)
    }
}
