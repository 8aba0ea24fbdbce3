//! Meshes with every triangle divided into four similar ones.

use std::collections::HashMap;

use fem_core::Mesh;

/// Barycentric coordinates in a triangle of the coarse mesh.
pub(super) type Place = [f64; 3];

/// A mesh whose triangles come from those of another: 4^times for each, in the order of the coarse ones and always in the same order inside.
pub(super) struct Quartered {
    /// The fine mesh; it covers the same polygon.
    pub mesh: Mesh,
    /// Vertices of its triangles, in the order of `places`.
    pub triangles: Vec<[u32; 3]>,
    /// The ends of the edge that each vertex beyond the coarse ones halves; ends come before their vertex.
    pub parents: Vec<[u32; 2]>,
    /// Corners of the fine triangles of one coarse triangle.
    pub places: Vec<[Place; 3]>,
}

impl Quartered {
    pub fn of(mesh: &Mesh, times: u32) -> Quartered {
        let mut points = mesh.points().to_vec();
        let mut triangles: Vec<[u32; 3]> =
            mesh.triangles().iter().map(|v| v.map(|j| j.0)).collect();
        let mut parents = Vec::new();
        let mut places = vec![[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]];
        for _ in 0..times {
            let mut born = HashMap::with_capacity(2 * triangles.len());
            let mut middle = |a: u32, b: u32| {
                *born.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    let [p, q] = [a, b].map(|j| points[j as usize]);
                    parents.push([a, b]);
                    points.push([0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1])]);
                    points.len() as u32 - 1
                })
            };
            triangles = triangles
                .iter()
                .flat_map(|&[a, b, c]| {
                    let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                    [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
                })
                .collect();
            let half = |p: Place, q: Place| [0, 1, 2].map(|k| 0.5 * (p[k] + q[k]));
            places = places
                .iter()
                .flat_map(|&[a, b, c]| {
                    let (ab, bc, ca) = (half(a, b), half(b, c), half(c, a));
                    [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
                })
                .collect();
        }
        let region: Vec<i32> = mesh
            .region()
            .iter()
            .flat_map(|&tag| std::iter::repeat_n(tag, places.len()))
            .collect();
        let mesh = Mesh::new(points, &triangles, &region, None)
            // Four similar parts of the triangles of a mesh are those of a mesh again.
            .expect("quarters of a mesh are a mesh");
        Quartered {
            mesh,
            triangles,
            parents,
            places,
        }
    }
}
