//! What is kept from one solve to the next.

use std::sync::{Arc, Weak};

use fem_core::{Mesh, VertexId};

use super::coarse;
use super::finest::Finest;
use super::galerkin::Levels;
use super::hierarchy::Hierarchy;
use super::unknowns::{Pair, Scalar, Unknowns};
use crate::interior::Role;
use crate::settings::Settings;

/// A triangle is a needle if its longest side is more than this many times its height.
const NEEDLE: f64 = 5.0;

/// On large initial meshes with more than this share of needles the bisections are left aside, and all is left to aggregates.
const NEEDLES: f64 = 0.25;

/// What a solver keeps from one solve to the next: memory above all, and what was read off a mesh while it stays the same.
///
/// One workspace serves the levels of one run, whose meshes descend from one another.
#[derive(Default)]
pub struct Workspace {
    /// The mesh that `hierarchy` was read off.
    mesh: Weak<Mesh>,
    /// The order of the vertices of the initial mesh.
    initial: Vec<u32>,
    pub(super) hierarchy: Hierarchy,
    pub(super) scalar: Store<Scalar>,
    pub(super) pair: Store<Pair>,
}

/// Matrices of a mesh and of its levels.
#[derive(Default)]
pub(super) struct Store<U: Unknowns> {
    /// The matrix that `finest` holds for the mesh of the workspace, if it is one.
    pub(super) held: Option<Role>,
    pub(super) finest: Finest<U>,
    pub(super) levels: Levels<U>,
    /// Matrices of the levels for a second field beside the first.
    pub(super) beside: Levels<U>,
}

impl Workspace {
    /// Reads the hierarchy of a mesh ahead of a solve on it, if that will be by multigrid: something to do beside the assembly.
    pub fn read(&mut self, mesh: &Arc<Mesh>, settings: &Settings) {
        if settings.iterates(mesh.vertex_count()) {
            self.take(mesh);
        }
    }

    /// Takes in a mesh; false if it has no hierarchy and is not large enough for one of aggregates.
    pub(super) fn take(&mut self, mesh: &Arc<Mesh>) -> bool {
        if self.mesh.as_ptr() == Arc::as_ptr(mesh) {
            return true;
        }
        let births = mesh.genealogy().iter().zip(mesh.boundary());
        let inner = births.clone().filter(|(b, fixed)| b.level == 0 && !**fixed);
        let large = inner.count() > coarse::LARGE;
        if births.clone().all(|(birth, _)| birth.level == 0) {
            self.initial = along_leaves(mesh);
            if !large {
                return false;
            }
        }
        let flat = large && stretched(mesh);
        self.hierarchy.read(mesh, Some(&self.initial), flat);
        self.initial.clear();
        self.initial
            .extend_from_slice(self.hierarchy.initial_order());
        self.mesh = Arc::downgrade(mesh);
        self.scalar.held = None;
        self.pair.held = None;
        true
    }
}

/// Whether the triangles of a mesh are needles: the relaxation of single vertices level by level does little there, since couplings along the short
/// sides dominate. Aggregates follow the strong couplings.
fn stretched(mesh: &Mesh) -> bool {
    let points = mesh.points();
    let needle = |v: &&[VertexId; 3]| {
        let corner = v.map(|v| points[v.index()]);
        let edge =
            [(0, 1), (1, 2), (2, 0)].map(|(k, l)| [0, 1].map(|i| corner[l][i] - corner[k][i]));
        let longest = edge.iter().map(|e| e[0] * e[0] + e[1] * e[1]);
        let twice = (edge[0][0] * edge[1][1] - edge[0][1] * edge[1][0]).abs();
        longest.fold(0.0, f64::max) > NEEDLE * twice
    };
    let needles = mesh.triangles().iter().filter(needle).count();
    needles as f64 > NEEDLES * mesh.triangle_count() as f64
}

/// The vertices of a mesh in the order in which its triangles touch them first.
fn along_leaves(mesh: &Mesh) -> Vec<u32> {
    let mut seen = vec![false; mesh.vertex_count()];
    let all = mesh.triangles().iter().flatten();
    all.filter(|v| !std::mem::replace(&mut seen[v.index()], true))
        .map(|v| v.0)
        .collect()
}

impl<U: Unknowns> Store<U> {
    /// Gives up what every solve writes anew: the estimators want the memory next.
    pub(super) fn rest(&mut self) {
        self.levels.forget();
        self.levels.spare.clear();
        self.beside.forget();
        self.beside.spare.clear();
    }

    /// Assembles a matrix, unless it is there.
    pub(super) fn hold(
        &mut self,
        role: Role,
        hierarchy: &Hierarchy,
        mesh: &Mesh,
        coefficient: impl Fn(usize, usize) -> f64,
    ) {
        let other = self.held != Some(role);
        if other {
            self.finest.assemble(hierarchy, mesh, coefficient);
            self.held = Some(role);
        }
        if other || self.levels.pivot.is_empty() {
            self.levels.fit(hierarchy);
        }
    }
}
