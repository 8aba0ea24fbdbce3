//! The discrete two-membrane problem on one mesh: matrices, loads, boundary heights.

use std::sync::{Arc, OnceLock};

use fem_core::assemble::{dual_areas, stiffness};
use fem_core::integrate::Loads;
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
///
/// Multigrid works on the mesh itself; the matrices in rows are assembled when somebody asks for them first.
#[derive(Clone, Debug)]
pub struct DiscreteProblem {
    /// The mesh.
    pub mesh: Arc<Mesh>,
    /// Element means of the tensions.
    pub tension_mean: [ElementValues; 2],
    /// What the tensions have in common.
    pub tensions: Tensions,
    /// Load vectors and element means.
    pub loads: [Loads; 2],
    /// Heights at boundary vertices; 0 inside.
    pub heights: [Vec<f64>; 2],
    /// Area |D_j| of every vertex's dual cell.
    pub dual_area: Vec<f64>,
    matrices: OnceLock<Matrices>,
}

/// The matrices of a problem in rows.
#[derive(Clone, Debug)]
struct Matrices {
    pattern: Arc<Pattern>,
    stiffness: [SymmetricMatrix; 2],
    laplacian: SymmetricMatrix,
}

impl DiscreteProblem {
    /// The discrete problem on a mesh; O(N).
    ///
    /// `tension_mean` holds positive values for each membrane, `heights` one a vertex with `heights[0] >= heights[1]`.
    pub fn new(
        mesh: impl Into<Arc<Mesh>>,
        tension_mean: [impl Into<ElementValues>; 2],
        loads: [Loads; 2],
        heights: [Vec<f64>; 2],
    ) -> DiscreteProblem {
        let mesh = mesh.into();
        let tension_mean = tension_mean.map(Into::into);
        DiscreteProblem {
            tensions: Tensions::of(&tension_mean),
            tension_mean,
            loads,
            heights,
            dual_area: dual_areas(&mesh),
            mesh,
            matrices: OnceLock::new(),
        }
    }

    fn matrices(&self) -> &Matrices {
        self.matrices.get_or_init(|| {
            let mesh = &*self.mesh;
            let pattern = Arc::new(Pattern::of(mesh));
            let matrix = |i: usize| stiffness(mesh, &pattern, |t| self.tension_mean[i][t]);
            Matrices {
                stiffness: [matrix(0), matrix(1)],
                laplacian: stiffness(mesh, &pattern, |_| 1.0),
                pattern,
            }
        })
    }

    /// Sparsity pattern shared by all matrices.
    pub fn pattern(&self) -> &Arc<Pattern> {
        &self.matrices().pattern
    }

    /// A_1 or A_2: stiffness with the element means of a tension.
    pub fn stiffness(&self, membrane: usize) -> &SymmetricMatrix {
        &self.matrices().stiffness[membrane]
    }

    /// K: stiffness with coefficient 1.
    pub fn laplacian(&self) -> &SymmetricMatrix {
        &self.matrices().laplacian
    }

    /// Whether a vertex lies on the boundary, where the displacements are given.
    pub fn boundary(&self) -> &[bool] {
        self.mesh.boundary()
    }

    /// Number of vertices, boundary included.
    pub fn order(&self) -> usize {
        self.mesh.vertex_count()
    }

    /// d_ij = (A_i)_jj.
    #[inline]
    pub fn diagonal(&self, membrane: usize, vertex: usize) -> f64 {
        self.stiffness(membrane).diagonal(vertex)
    }

    /// d_j = d_1j d_2j / (d_1j + d_2j), written so that it cannot overflow.
    #[inline]
    pub fn harmonic_diagonal(&self, vertex: usize) -> f64 {
        let (d1, d2) = (self.diagonal(0, vertex), self.diagonal(1, vertex));
        d1 / (1.0 + d1 / d2)
    }
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
