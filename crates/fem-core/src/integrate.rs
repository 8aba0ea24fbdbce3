//! Integrals of data over elements, by rules that follow jumps inside elements.

/// Integrals of one load over a mesh.
#[derive(Clone, Debug, Default)]
pub struct Loads {
    /// (f, phi_j) for every vertex, boundary included.
    pub nodal: Vec<f64>,
    /// Mean f_h of f over every triangle.
    pub mean: Vec<f64>,
    /// ||f - f_h||^2 over every triangle.
    pub deviation_squared: Vec<f64>,
}
