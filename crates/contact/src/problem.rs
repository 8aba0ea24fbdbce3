//! The discrete two-membrane problem on one mesh: matrices, loads, boundary heights.

use std::sync::Arc;

use fem_core::assemble::{dual_areas, stiffness};
use fem_core::integrate::Loads;
use fem_core::topology::Birth;
use fem_core::{ElementValues, Mesh, Pattern, SymmetricMatrix};

/// What the two tensions have in common; decides how far the problem reduces.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Tensions {
    /// Both are constant: (mu_1, mu_2).
    Constant(f64, f64),
    /// mu_2 = c mu_1 in every triangle, mu_1 variable: c.
    Ratio(f64),
    /// Nothing in common.
    General,
}

/// Find nodal u1 >= u2 that minimise the energy, in the matrices of first-order elements.
///
/// With the interior rows of `A_i u_i = F_i +- z`: `A_1 u1 - z = F_1`, `A_2 u2 + z = F_2`, `u1 - u2 >= 0`, `z >= 0`, `z . (u1
/// - u2) = 0`. Every array that has one entry a vertex covers boundary vertices too; index 0 is the upper membrane.
#[derive(Clone, Debug)]
pub struct DiscreteProblem {
    /// Sparsity pattern shared by all matrices.
    pub pattern: Arc<Pattern>,
    /// A_1, A_2: stiffness with the element means of the tensions.
    pub stiffness: [SymmetricMatrix; 2],
    /// K: stiffness with coefficient 1.
    pub laplacian: SymmetricMatrix,
    /// Element means of the tensions.
    pub tension_mean: [ElementValues; 2],
    /// What the tensions have in common.
    pub tensions: Tensions,
    /// Load vectors and element means.
    pub loads: [Loads; 2],
    /// Whether a vertex lies on the boundary, where the displacements are given.
    pub boundary: Vec<bool>,
    /// Heights at boundary vertices; 0 inside.
    pub heights: [Vec<f64>; 2],
    /// Area |D_j| of every vertex's dual cell.
    pub dual_area: Vec<f64>,
    /// The birth of every vertex: the hierarchy of multigrid.
    pub genealogy: Arc<[Birth]>,
    /// The vertices in the order in which the leaves of the mesh touch them first: neighbours stand close.
    pub along_leaves: Arc<[u32]>,
}

impl DiscreteProblem {
    /// Assembles the matrices of a mesh; O(N).
    ///
    /// `tension_mean` holds positive values for each membrane, `heights` one a vertex with `heights[0] >= heights[1]`.
    pub fn new(
        mesh: &Mesh,
        tension_mean: [impl Into<ElementValues>; 2],
        loads: [Loads; 2],
        heights: [Vec<f64>; 2],
    ) -> DiscreteProblem {
        let tension_mean = tension_mean.map(Into::into);
        let pattern = Arc::new(Pattern::of(mesh));
        let matrix = |i: usize| stiffness(mesh, &pattern, |t| tension_mean[i][t]);
        DiscreteProblem {
            stiffness: [matrix(0), matrix(1)],
            laplacian: stiffness(mesh, &pattern, |_| 1.0),
            tensions: Tensions::of(&tension_mean),
            tension_mean,
            loads,
            boundary: mesh.boundary().to_vec(),
            heights,
            dual_area: dual_areas(mesh),
            genealogy: mesh.genealogy().into(),
            along_leaves: along_leaves(mesh),
            pattern,
        }
    }

    /// Number of vertices, boundary included.
    pub fn order(&self) -> usize {
        self.boundary.len()
    }

    /// d_ij = (A_i)_jj.
    #[inline]
    pub fn diagonal(&self, membrane: usize, vertex: usize) -> f64 {
        self.stiffness[membrane].diagonal(vertex)
    }

    /// d_j = d_1j d_2j / (d_1j + d_2j), written so that it cannot overflow.
    #[inline]
    pub fn harmonic_diagonal(&self, vertex: usize) -> f64 {
        let (d1, d2) = (self.diagonal(0, vertex), self.diagonal(1, vertex));
        d1 / (1.0 + d1 / d2)
    }
}

/// The vertices of a mesh in the order of its triangles.
fn along_leaves(mesh: &Mesh) -> Arc<[u32]> {
    let mut seen = vec![false; mesh.vertex_count()];
    let mut order = Vec::with_capacity(mesh.vertex_count());
    for v in mesh.triangles().iter().flatten() {
        if !std::mem::replace(&mut seen[v.index()], true) {
            order.push(v.0);
        }
    }
    order.into()
}

impl Tensions {
    /// Looks at the values that are stored: O(1) for constants.
    fn of(mean: &[ElementValues; 2]) -> Tensions {
        let [upper, lower] = mean.each_ref().map(ElementValues::stored);
        let (Some(&m1), Some(&m2)) = (upper.first(), lower.first()) else {
            return Tensions::General;
        };
        if upper.iter().all(|&m| m == m1) && lower.iter().all(|&m| m == m2) {
            return Tensions::Constant(m1, m2);
        }
        let ratio = m2 / m1;
        // Means of proportional expressions agree to rounding and to the tolerance of their quadrature, no better.
        let same = (0..upper.len().max(lower.len()))
            .all(|t| ((mean[1][t] / mean[0][t]) / ratio - 1.0).abs() <= RATIO_TOLERANCE);
        if same {
            Tensions::Ratio(ratio)
        } else {
            Tensions::General
        }
    }
}

/// How far the quotient of the element means may vary and still count as constant.
const RATIO_TOLERANCE: f64 = 1e-13;
