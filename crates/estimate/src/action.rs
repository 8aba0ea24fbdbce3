//! The action as a function: l_j = z_j / |D_j| at interior vertices, carried on to the boundary.
//!
//! The discrete problem has no multiplier at boundary vertices, but the contact set may reach the boundary, and the dual cells there need a value.
//! Zero would cost a strip of width h. The rule: 0 where the gap is positive; else the mean over all interior neighbours; a
//! vertex without interior neighbours (a corner) takes the mean over the neighbours that have a value already, round by round.

use contact::{DiscreteProblem, Solution};
use fem_core::{Mesh, Neighbour, TriangleId};

/// The nodal action l_j on all vertices, boundary included; a pressure (force per area).
///
/// This is the action to show; minus the Laplacian of sigma_h is a measure on edges with negative parts.
pub fn nodal_action(mesh: &Mesh, problem: &DiscreteProblem, solution: &Solution) -> Vec<f64> {
    debug_assert_eq!(mesh.vertex_count(), problem.order());
    let mut action: Vec<f64> = solution
        .force
        .iter()
        .zip(&problem.dual_area)
        .map(|(z, area)| z / area)
        .collect();
    extend_to_boundary(mesh, |j| solution.gap(j), &mut action);
    action
}

/// Overwrites the entries of boundary vertices by the rule of the [module](self).
///
/// `values` has one entry a vertex; `gap` tells u1 - u2 at a vertex. Vertices that no interior vertex can be reached from along boundary
/// vertices get 0.
pub fn extend_to_boundary(mesh: &Mesh, gap: impl Fn(usize) -> f64, values: &mut [f64]) {
    let around = Around::of(mesh);
    let mean = |j: usize, done: &[bool], values: &[f64]| {
        let (mut sum, mut count) = (0.0, 0usize);
        for &k in around.neighbours(j).iter().filter(|&&k| done[k as usize]) {
            sum += values[k as usize];
            count += 1;
        }
        (count > 0).then(|| sum / count as f64)
    };
    let interior: Vec<bool> = mesh.boundary().iter().map(|&b| !b).collect();
    let mut done = interior.clone();
    let mut front = Vec::new();
    for &j in &around.vertices {
        let j = j as usize;
        values[j] = 0.0;
        let value = if gap(j) > 0.0 {
            Some(0.0)
        } else {
            mean(j, &interior, values)
        };
        if let Some(value) = value {
            values[j] = value;
            done[j] = true;
            front.push(j);
        }
    }
    // Every vertex is reached once; a round looks only at rounds before it, so the order within a round does not matter.
    while !front.is_empty() {
        let mut next: Vec<usize> = front
            .iter()
            .flat_map(|&j| around.neighbours(j))
            .map(|&k| k as usize)
            .filter(|&k| !done[k])
            .collect();
        next.sort_unstable();
        next.dedup();
        let reached: Vec<Option<f64>> = next.iter().map(|&j| mean(j, &done, values)).collect();
        for (&j, value) in next.iter().zip(reached) {
            values[j] = value.unwrap_or(0.0);
            done[j] = true;
        }
        front = next;
    }
}

/// The vertices that share an edge with each boundary vertex.
struct Around {
    /// The boundary vertices, increasing.
    vertices: Vec<u32>,
    /// Their neighbours one after the other.
    other: Vec<u32>,
    /// Where those of each begin, and the end.
    start: Vec<u32>,
}

impl Around {
    /// Finds the edges on the boundary in O(N) and sorts what touches them.
    fn of(mesh: &Mesh) -> Around {
        let mut vertices = Vec::new();
        let mut pairs = Vec::new();
        for (t, around) in mesh.neighbours().iter().enumerate() {
            for (face, _) in (0..3).zip(around).filter(|a| *a.1 == Neighbour::BOUNDARY) {
                let [vertex, end] = mesh.face(TriangleId(t as u32), face);
                vertices.push(vertex.0);
                pairs.push((vertex.0, end.0));
                fan(mesh, t, (face + 1) % 3, |k| pairs.push((vertex.0, k)));
            }
        }
        vertices.sort_unstable();
        vertices.dedup();
        pairs.sort_unstable();
        pairs.dedup();
        let other = pairs.iter().map(|p| p.1).collect();
        let mut start: Vec<u32> = vertices
            .iter()
            .map(|&j| pairs.partition_point(|p| p.0 < j) as u32)
            .collect();
        start.push(pairs.len() as u32);
        Around {
            vertices,
            other,
            start,
        }
    }

    /// Of a boundary vertex, increasing; of an interior one nothing.
    fn neighbours(&self, j: usize) -> &[u32] {
        match self.vertices.binary_search(&(j as u32)) {
            Ok(at) => &self.other[self.start[at] as usize..self.start[at + 1] as usize],
            Err(_) => &[],
        }
    }
}

/// Shows the neighbours of a boundary vertex counter-clockwise, but for the first one: from triangle `t`, in which the vertex has the number `corner`
/// and the boundary runs from it to the next corner, to the triangle that ends at the boundary again.
fn fan(mesh: &Mesh, t: usize, corner: usize, mut show: impl FnMut(u32)) {
    let (mut t, mut corner) = (t, corner);
    loop {
        show(mesh.triangles()[t][(corner + 2) % 3].0);
        // The edge from the vertex to the corner just shown is opposite to the next corner.
        let Some((next, face)) = mesh.neighbours()[t][(corner + 1) % 3].get() else {
            return;
        };
        // The neighbour has the same edge the other way round: the vertex comes first in it.
        (t, corner) = (next.index(), (face + 1) % 3);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{close, four_triangles, problem, solution, two_triangles};

    #[test]
    fn boundary_takes_the_mean_of_interior_neighbours_unless_there_is_a_gap() {
        let mesh = four_triangles();
        let problem = problem(&mesh, [vec![1.0; 4], vec![1.0; 4]], [0.0, 0.0]);
        let upper = vec![0.0, 0.5, 0.0, 0.0, 0.0];
        let force = vec![0.0, 0.0, 0.0, 0.0, 2.0];
        let solution = solution([upper, vec![0.0; 5]], force, vec![0.0; 5]);
        // The dual cell of the centre has an area of 4/3.
        let action = nodal_action(&mesh, &problem, &solution);
        for j in [0, 2, 3, 4] {
            close(action[j], 1.5, 1e-15);
        }
        assert_eq!(action[1], 0.0);
    }

    #[test]
    fn a_corner_takes_the_mean_of_vertices_that_are_done() {
        // The four triangles and a fifth that hangs on the right side, its tip out of sight of the centre.
        let points = vec![
            [-1.0, -1.0],
            [1.0, -1.0],
            [1.0, 1.0],
            [-1.0, 1.0],
            [0.0, 0.0],
            [2.0, 0.0],
        ];
        let triangles = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [1, 5, 2]];
        let mesh = Mesh::new(points, &triangles, &[], None).unwrap();
        let mut values = vec![7.0, 7.0, 7.0, 7.0, 1.5, 7.0];
        let upper = vec![0.0, 0.5, 0.0, 0.0, 0.0, 0.0];
        let solution = solution([upper, vec![0.0; 6]], vec![0.0; 6], vec![0.0; 6]);
        extend_to_boundary(&mesh, |j| solution.gap(j), &mut values);
        assert_eq!(values, [1.5, 0.0, 1.5, 1.5, 1.5, 0.75]);
    }

    #[test]
    fn without_interior_vertices_there_is_no_action() {
        let mesh = two_triangles();
        let problem = problem(&mesh, [vec![1.0; 2], vec![1.0; 2]], [0.0, 0.0]);
        let solution = solution([vec![0.0; 4], vec![0.0; 4]], vec![0.0; 4], vec![0.0; 4]);
        assert_eq!(nodal_action(&mesh, &problem, &solution), [0.0; 4]);
    }
}
