//! A known solution, for true errors.

use std::sync::Arc;

use fem_core::Field;

/// First derivatives of a function, scaled.
pub type Gradient = [Arc<dyn Field>; 2];

/// The exact solution of a scene, in scaled units.
#[derive(Clone)]
pub struct Exact {
    /// Gradients of u1 and u2.
    pub displacement: [Gradient; 2],
    /// Gradient of the Riesz representative sigma, if known.
    pub sigma: Option<Gradient>,
    /// The action lambda, if known.
    pub action: Option<Arc<dyn Field>>,
    /// Not zero inside the contact set, if known.
    pub contact: Option<Arc<dyn Field>>,
}
