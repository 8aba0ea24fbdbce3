//! Integrals of a load: what is kept of it for every vertex and every triangle.

use super::Reference;
use crate::assemble::dual_areas;
use crate::mesh::{Mesh, signed_area};

/// Integrals of one load over a mesh.
#[derive(Clone, Debug, Default)]
pub struct Loads {
    /// (f, phi_j) for every vertex, boundary included.
    pub nodal: Vec<f64>,
    pub(super) elements: Elements,
    pub(super) reference: Option<Reference>,
}

/// Integrals of one load over one triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ElementLoad {
    /// (f, phi_k) for the corners 0 and 1; that for corner 2 follows from the mean.
    pub corners: [f64; 2],
    /// Mean f_h of f.
    pub mean: f64,
    /// ||f - f_h||^2.
    pub deviation_squared: f64,
}

#[derive(Clone, Debug)]
pub(super) enum Elements {
    /// A load that is the same everywhere.
    Same(f64),
    /// Any other.
    Each(Vec<ElementLoad>),
}

impl Default for Elements {
    fn default() -> Self {
        Elements::Same(0.0)
    }
}

impl ElementLoad {
    /// What stands where nothing is known yet.
    pub(super) const NONE: ElementLoad = ElementLoad {
        corners: [0.0; 2],
        mean: 0.0,
        deviation_squared: 0.0,
    };

    /// (f, phi_k) for the three corners of a triangle with this area.
    #[inline]
    pub fn moments(&self, area: f64) -> [f64; 3] {
        let [first, second] = self.corners;
        [first, second, self.mean * area - first - second]
    }
}

impl Loads {
    /// The load vector of integrals over the triangles of a mesh, one entry each.
    pub fn new(mesh: &Mesh, elements: Vec<ElementLoad>) -> Loads {
        let mut nodal = vec![0.0; mesh.vertex_count()];
        for (id, element) in mesh.triangle_ids().zip(&elements) {
            let moments = element.moments(mesh.area(id));
            for (v, m) in mesh.triangles()[id.index()].iter().zip(moments) {
                nodal[v.index()] += m;
            }
        }
        Loads {
            nodal,
            elements: Elements::Each(elements),
            reference: None,
        }
    }

    /// [`Loads::new`] for two loads at once: areas and corners are read once, and both sums of a vertex are side by side.
    pub(super) fn pair(mesh: &Mesh, elements: [Vec<ElementLoad>; 2]) -> [Loads; 2] {
        let points = mesh.points();
        let mut nodal = vec![[0.0; 2]; points.len()];
        let [first, second] = &elements;
        for ((triangle, first), second) in mesh.triangles().iter().zip(first).zip(second) {
            let vertices = triangle.map(|v| v.index());
            let area = signed_area(vertices.map(|v| points[v]));
            let load = [first.mean * area, second.mean * area];
            let [one, two] = [0, 1].map(|k| [first.corners[k], second.corners[k]]);
            let three = [0, 1].map(|i| load[i] - one[i] - two[i]);
            for (v, moments) in vertices.into_iter().zip([one, two, three]) {
                let sums = &mut nodal[v];
                *sums = [sums[0] + moments[0], sums[1] + moments[1]];
            }
        }
        let [first, second] = elements;
        [(0, first), (1, second)].map(|(own, elements)| Loads {
            nodal: nodal.iter().map(|sums| sums[own]).collect(),
            elements: Elements::Each(elements),
            reference: None,
        })
    }

    /// The loads that are `values` everywhere; nothing is stored for the triangles.
    pub fn constant<const N: usize>(mesh: &Mesh, values: [f64; N]) -> [Loads; N] {
        let area = dual_areas(mesh);
        values.map(|value| Loads {
            nodal: area.iter().map(|a| value * a).collect(),
            elements: Elements::Same(value),
            reference: None,
        })
    }

    /// A load vector with element means and squared deviations that were found elsewhere, one of each a triangle. The moments of single triangles
    /// are not known then, so that such loads cannot be carried over to another mesh.
    pub fn from_parts(nodal: Vec<f64>, mean: &[f64], deviation_squared: &[f64]) -> Loads {
        let elements = mean
            .iter()
            .zip(deviation_squared)
            .map(|(&mean, &deviation_squared)| ElementLoad {
                corners: [f64::NAN; 2],
                mean,
                deviation_squared,
            })
            .collect();
        Loads {
            nodal,
            elements: Elements::Each(elements),
            reference: None,
        }
    }

    /// The same with another [`Reference`], which [`super::load_pair_carried`] goes on with.
    pub fn relative_to(self, reference: Reference) -> Loads {
        Loads {
            reference: Some(reference),
            ..self
        }
    }

    /// What the elements were judged by; none of loads that were found elsewhere.
    pub fn reference(&self) -> Option<Reference> {
        self.reference
    }

    /// The value of a load that is the same everywhere by the way it is stored; O(1).
    #[inline]
    pub fn same(&self) -> Option<f64> {
        match self.elements {
            Elements::Same(value) => Some(value),
            Elements::Each(_) => None,
        }
    }

    /// The integrals over all triangles, where they are stored.
    #[inline]
    pub(super) fn each(&self) -> Option<&[ElementLoad]> {
        match &self.elements {
            Elements::Same(_) => None,
            Elements::Each(each) => Some(each),
        }
    }

    /// The integrals over a triangle; those of a constant have no corners, since they go without.
    #[inline]
    pub(super) fn element(&self, triangle: usize) -> ElementLoad {
        match &self.elements {
            Elements::Same(value) => ElementLoad {
                mean: *value,
                ..ElementLoad::NONE
            },
            Elements::Each(each) => each[triangle],
        }
    }

    /// Mean f_h of f over a triangle.
    #[inline]
    pub fn mean(&self, triangle: usize) -> f64 {
        match &self.elements {
            Elements::Same(value) => *value,
            Elements::Each(each) => each[triangle].mean,
        }
    }

    /// ||f - f_h||^2 over a triangle.
    #[inline]
    pub fn deviation_squared(&self, triangle: usize) -> f64 {
        match &self.elements {
            Elements::Same(_) => 0.0,
            Elements::Each(each) => each[triangle].deviation_squared,
        }
    }

    /// (f, phi_k) for the corners of a triangle with this area.
    #[inline]
    pub fn moments(&self, triangle: usize, area: f64) -> [f64; 3] {
        match &self.elements {
            Elements::Same(value) => [value * area / 3.0; 3],
            Elements::Each(each) => each[triangle].moments(area),
        }
    }
}
