//! The scene's data on the mesh of a level, and the discrete solution of its file, all scaled.

use adapt::Problem;
use estimate::{Moments, Near};
use fem_core::integrate::{Loads, Reference, load_pair_relative_to, means};
use fem_core::scale::times_power_of_two;
use fem_core::{ElementValues, Field, FieldError, Mesh, Samples, Scale};

use crate::element::{Element, elements};

/// Everything that a level's numbers follow from.
pub(crate) struct Discrete<'a> {
    /// The mesh of the file.
    pub mesh: &'a Mesh,
    /// The units.
    pub scale: Scale,
    /// Moments of the data, on a level with a certificate.
    pub moments: Option<Moments>,
    /// Its triangles.
    pub elements: Vec<Element>,
    /// Element means of the tensions.
    pub tension: [ElementValues; 2],
    /// Nodal loads, element means, deviations from them.
    pub loads: [Loads; 2],
    /// Heights at boundary vertices; 0 inside.
    pub heights: [Vec<f64>; 2],
    /// |D_j|, a third of the area around vertex j.
    pub dual_area: Vec<f64>,
    /// u1, u2 of the file.
    pub displacement: [Vec<f64>; 2],
    /// z of the file.
    pub force: Vec<f64>,
    /// sigma of the file.
    pub sigma: Vec<f64>,
    /// The contact set of the file.
    pub contact: Vec<bool>,
}

/// The nodal fields of a file, scaled.
pub(crate) struct Nodal {
    /// u1, u2.
    pub displacement: [Vec<f64>; 2],
    /// z.
    pub force: Vec<f64>,
    /// sigma.
    pub sigma: Vec<f64>,
    /// The contact set.
    pub contact: Vec<bool>,
}

impl<'a> Discrete<'a> {
    /// Integrates the data of the scene over the mesh of a file, on a level with a certificate or without.
    ///
    /// # Errors
    /// A value of the data that is not finite.
    pub fn new(
        mesh: &'a Mesh,
        problem: &Problem,
        nodal: Nodal,
        certified: bool,
    ) -> Result<Self, FieldError> {
        let elements = elements(mesh);
        let mut dual_area = vec![0.0; mesh.vertex_count()];
        for e in &elements {
            for j in e.vertices {
                dual_area[j] += e.area / 3.0;
            }
        }
        // The run judged its elements by the loads on the initial mesh.
        let load = problem.loads();
        let reference = Reference::of(&problem.mesh, load)?;
        let tension = problem.tensions();
        let loads = load_pair_relative_to(&reference, mesh, load, 1)?;
        let near = Near {
            force: &nodal.force,
            loads: &loads,
        };
        let moments = certified
            .then(|| Moments::near(&reference, mesh, load, tension, near))
            .transpose()?;
        let pair = |fields: &[std::sync::Arc<dyn Field>; 2]| {
            Ok::<_, FieldError>([means(mesh, &*fields[0])?, means(mesh, &*fields[1])?])
        };
        Ok(Discrete {
            tension: pair(&problem.tension)?,
            loads,
            heights: [
                heights(mesh, &*problem.height[0])?,
                heights(mesh, &*problem.height[1])?,
            ],
            mesh,
            scale: problem.scale,
            moments,
            elements,
            dual_area,
            displacement: nodal.displacement,
            force: nodal.force,
            sigma: nodal.sigma,
            contact: nodal.contact,
        })
    }

    /// Number of vertices.
    pub fn vertices(&self) -> usize {
        self.dual_area.len()
    }

    /// Whether a vertex is not on the boundary.
    pub fn is_interior(&self, j: usize) -> bool {
        !self.mesh.boundary()[j]
    }

    /// w_j = u1_j - u2_j.
    pub fn gap(&self, j: usize) -> f64 {
        self.displacement[0][j] - self.displacement[1][j]
    }

    /// Values in the user's units.
    pub fn physical(&self, values: &[f64], exponent: i32) -> Vec<f64> {
        values
            .iter()
            .map(|&v| times_power_of_two(v, exponent))
            .collect()
    }

    /// The vertices in contact.
    pub fn in_contact(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.vertices()).filter(|&j| self.contact[j])
    }
}

/// Heights at boundary vertices. `region` there is that of the last triangle with a boundary edge at the vertex.
fn heights(mesh: &Mesh, field: &dyn Field) -> Result<Vec<f64>, FieldError> {
    let mut region = vec![0.0; mesh.vertex_count()];
    for (t, face) in mesh.boundary_edges() {
        for v in mesh.face(t, face) {
            region[v.index()] = f64::from(mesh.region()[t.index()]);
        }
    }
    let mut result = vec![0.0; mesh.vertex_count()];
    for j in (0..mesh.vertex_count()).filter(|&j| mesh.boundary()[j]) {
        let [x, y] = mesh.points()[j];
        let at = Samples {
            x: &[x],
            y: &[y],
            region: &region[j..=j],
        };
        field.sample(at, &mut result[j..=j])?;
    }
    Ok(result)
}
