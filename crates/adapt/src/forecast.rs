//! What a run knows of a certificate before it is made.

use fem_core::Mesh;

use crate::level::{Level, SETTLED};

/// After several steps eta_alg is this part of what the quotient after a single one lets expect, or less: the rough parts of the error go first. A larger part than
/// the true one costs a step at most, a smaller one another solve with all that is read for it.
const LEAK: f64 = 0.4;

/// From so many vertices on a run that the certificate drives goes by cheap indicators as long as its goal is far. Below, the certificate
/// of all levels together takes a few milliseconds.
const CHEAP_FROM: usize = 10_000;

/// The quotient of the certificate and the cheap indicators is taken anew when the number of vertices has grown by this factor: all these
/// certificates together cost an eighth of the last one.
const RENEWED: usize = 8;

/// What is known of the certificate before it is made.
#[derive(Clone, Copy, Default)]
pub(crate) struct Forecast {
    /// Quotient of the bound and the cheap indicators where both were there last.
    quotient: Option<f64>,
    /// Vertices of that level.
    vertices: usize,
    /// Quotient of eta_alg and the algebraic error as estimated, over the root of the number of vertices: it grows like 1/h.
    leak: Option<f64>,
}

impl Forecast {
    /// Takes in a finished level.
    pub fn see(&mut self, level: &Level) {
        if let Some(quotient) = level.estimates.quotient() {
            self.quotient = Some(quotient);
            self.vertices = level.mesh.vertex_count();
            let certificate = level.estimates.certificate.as_ref();
            let algebraic = level.solution.info.algebraic_error.filter(|&e| e > 0.0);
            self.leak = certificate.zip(algebraic).map(|(certificate, algebraic)| {
                certificate.algebraic / algebraic / (self.vertices as f64).sqrt()
            });
        }
    }

    /// The algebraic error at which eta_alg is expected to be half of what it may be on a mesh where the error has this size.
    pub fn settled(self, size: f64, mesh: &Mesh) -> Option<f64> {
        let share = 0.5 * SETTLED * size;
        self.leak
            .map(|leak| share / (LEAK * leak * (mesh.vertex_count() as f64).sqrt()))
    }

    /// The quotient that a level is to be judged by before its certificate is made, if it is to be.
    pub fn on(self, mesh: &Mesh) -> Option<f64> {
        self.quotient.filter(|_| mesh.vertex_count() >= CHEAP_FROM)
    }

    /// Whether the quotient is to be taken anew.
    pub fn is_old(self, mesh: &Mesh) -> bool {
        mesh.vertex_count() >= RENEWED * self.vertices
    }
}
