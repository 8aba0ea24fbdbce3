//! Polygons with holes and inner lines, meshed by constrained Delaunay refinement.
//!
//! Four steps: validate the outline ([`outline`]), cut outline and lines where they touch
//! ([`lines`]), triangulate and refine ([`mesher`]), and put the result back into the user's
//! coordinates, where the given vertices keep theirs to the bit.

mod lines;
mod mesher;
mod outline;

use crate::check::check;
use crate::geometry::Point;
use crate::quality::{Quality, quality};
use crate::shapes::check_size;
use crate::{DomainError, RawMesh};

/// Meshes the polygon `outer` without the `holes`, keeping `lines` as mesh edges.
///
/// Polygons may be given in either orientation; a closing point equal to the first is dropped.
/// `size` is the edge length of the equilateral triangle whose area no triangle exceeds. Angles
/// are refined towards 30 degrees; where the outline or a line has a smaller angle that cannot be
/// reached everywhere. [`Quality`] says what was, and such a mesh is no error.
///
/// Holes must lie inside, apart from each other and from the outer polygon. Lines may run anywhere
/// in the domain and along its outline, and may touch both and each other; they must not cross
/// except in common vertices. A vertex of a line within `1e-10` of the domain's extent from a vertex
/// or an edge is taken to lie on it.
///
/// With lines in a domain that is not convex or has holes, the outside and the holes are refined as
/// well before they are dropped: a narrow notch or hole then makes the mesh finer around it than it
/// need be.
pub fn polygon(
    outer: &[Point],
    holes: &[Vec<Point>],
    lines: &[Vec<Point>],
    size: f64,
) -> Result<(RawMesh, Quality), DomainError> {
    check_size(size)?;
    let outline = outline::Outline::new(outer, holes, lines)?;
    let graph = lines::Graph::new(&outline)?;
    let triangulation = mesher::triangulate(&outline, &graph, size)?;

    let place = |(index, &p): (usize, &Point)| match graph.given.get(index) {
        Some(&given) => given,
        None => outline.frame.leave(p),
    };
    let points: Vec<Point> = triangulation.points.iter().enumerate().map(place).collect();
    let mesh = drop_unused(points, triangulation.triangles);
    check(&mesh)?;
    let quality = quality(&mesh);
    Ok((mesh, quality))
}

fn drop_unused(points: Vec<Point>, mut triangles: Vec<[u32; 3]>) -> RawMesh {
    let mut number = vec![u32::MAX; points.len()];
    for &v in triangles.iter().flatten() {
        number[v as usize] = 0;
    }
    let mut kept = Vec::with_capacity(points.len());
    for (point, number) in points.into_iter().zip(&mut number) {
        if *number == 0 {
            *number = kept.len() as u32;
            kept.push(point);
        }
    }
    for v in triangles.iter_mut().flatten() {
        *v = number[*v as usize];
    }
    RawMesh {
        regions: vec![0; triangles.len()],
        points: kept,
        triangles,
    }
}
