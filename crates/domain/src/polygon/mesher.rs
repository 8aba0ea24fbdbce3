//! Constrained Delaunay triangulation and refinement, by [`spade`].
//!
//! Which triangles belong to the domain is decided here, from the outline: spade's own notion of
//! inside counts the constraint edges crossed on the way in, and lines would count as well. For
//! the same reason its way to leave the outside unrefined serves only a domain without lines. With
//! lines the outside is refined too and then dropped; four vertices far around keep it free of the
//! flat triangles that an almost straight outline and its convex hull would enclose.

use spade::{
    AngleLimit, ConstrainedDelaunayTriangulation, Point2, RefinementParameters, Triangulation,
};

use super::lines::Graph;
use super::outline::Outline;
use crate::geometry::{Point, Sum, bounds, cross, distance};
use crate::quality::ANGLE_LIMIT;
use crate::{DomainError, MAX_TRIANGLES};

/// Vertices allowed for fine details, beyond those that the size accounts for.
const DETAIL_VERTICES: usize = 300_000;

/// The triangulation may have this many times the triangles of the ideal mesh.
const SURPLUS: f64 = 10.0;

/// Distance of the four outer vertices from the domain, whose extent is one to two.
const MARGIN: f64 = 0.5;

type Cdt = ConstrainedDelaunayTriangulation<Point2<f64>>;

/// A mesh of the domain at order one.
#[derive(Clone, Debug)]
pub(super) struct Domain {
    /// The vertices of the graph, then others; some may be unused.
    pub points: Vec<Point>,
    pub triangles: Vec<[u32; 3]>,
}

pub(super) fn triangulate(
    outline: &Outline,
    graph: &Graph,
    size: f64,
) -> Result<Domain, DomainError> {
    let scaled = size * outline.frame.scale;
    let ideal = 3f64.sqrt() / 4.0 * scaled * scaled;
    let expected = graph.area / ideal;
    if expected > MAX_TRIANGLES {
        return Err(DomainError::TooManyTriangles {
            triangles: expected,
            size,
        });
    }
    let frame = if graph.has_lines && !graph.convex {
        around(graph)
    } else {
        Vec::new()
    };
    let mut cdt = load(graph, &frame)?;
    let refined_area = match frame.as_slice() {
        [low, _, high, _] => (high[0] - low[0]) * (high[1] - low[1]),
        _ => graph.area,
    };
    // Without limit where the size is larger than the domain by far.
    let surplus = (SURPLUS * refined_area / ideal).min(SURPLUS * MAX_TRIANGLES) as usize;
    let limit = DETAIL_VERTICES + surplus;
    let result = cdt.refine(
        RefinementParameters::<f64>::new()
            .exclude_outer_faces(!graph.has_lines)
            .with_angle_limit(AngleLimit::from_deg(ANGLE_LIMIT))
            .with_max_allowed_area(ideal)
            .with_max_additional_vertices(limit),
    );
    if !result.refinement_complete {
        return Err(DomainError::VertexLimit { limit });
    }
    let points: Vec<Point> = cdt
        .vertices()
        .map(|v| v.position())
        .map(|p| [p.x, p.y])
        .collect();
    let triangles = domain_triangles(outline, &cdt);
    let domain = Domain { points, triangles };
    verify(graph, &cdt, &domain)?;
    Ok(domain)
}

fn failed(what: impl ToString) -> DomainError {
    let what = what.to_string();
    DomainError::Generator { what }
}

/// Four vertices around the domain.
fn around(graph: &Graph) -> Vec<Point> {
    let Some([low, high]) = bounds(graph.points.iter().copied()) else {
        return Vec::new();
    };
    let (low, high) = (low.map(|x| x - MARGIN), high.map(|x| x + MARGIN));
    vec![low, [high[0], low[1]], high, [low[0], high[1]]]
}

fn load(graph: &Graph, frame: &[Point]) -> Result<Cdt, DomainError> {
    let points = graph
        .points
        .iter()
        .chain(frame)
        .map(|p| Point2::new(p[0], p[1]));
    let mut conflicts = 0;
    let cdt = Cdt::try_bulk_load_cdt(points.collect(), graph.edges.clone(), |_| conflicts += 1)
        .map_err(failed)?;
    if conflicts > 0 {
        return Err(failed(format!("`{conflicts}` edges are in conflict")));
    }
    if cdt.num_vertices() != graph.points.len() + frame.len() {
        return Err(failed("vertices were merged"));
    }
    Ok(cdt)
}

/// The triangles in the domain, counter-clockwise.
///
/// Triangles that are connected without crossing a constraint edge lie on the same side of the
/// outline; the centroid of the largest of them, far from rounding, decides for all.
fn domain_triangles(outline: &Outline, cdt: &Cdt) -> Vec<[u32; 3]> {
    // Face 0 is the outer one.
    let mut inside: Vec<Option<bool>> = vec![None; cdt.num_all_faces()];
    for start in cdt.inner_faces() {
        if inside[start.fix().index()].is_some() {
            continue;
        }
        let mut patch = vec![start];
        inside[start.fix().index()] = Some(false);
        let mut next = 0;
        while let Some(&face) = patch.get(next) {
            next += 1;
            for edge in face.adjacent_edges() {
                if !edge.is_constraint_edge()
                    && let Some(neighbour) = edge.rev().face().as_inner()
                    && inside[neighbour.fix().index()].is_none()
                {
                    inside[neighbour.fix().index()] = Some(false);
                    patch.push(neighbour);
                }
            }
        }
        let largest = patch.iter().max_by(|f, g| f.area().total_cmp(&g.area()));
        let in_domain = largest.is_some_and(|face| {
            let center = face.center();
            outline.contains([center.x, center.y])
        });
        if in_domain {
            for face in patch {
                inside[face.fix().index()] = Some(true);
            }
        }
    }
    cdt.inner_faces()
        .filter(|face| inside[face.fix().index()] == Some(true))
        .map(|face| face.vertices().map(|v| v.fix().index() as u32))
        .collect()
}

/// Checks that the triangles fill the polygon and that every given edge is there.
fn verify(graph: &Graph, cdt: &Cdt, domain: &Domain) -> Result<(), DomainError> {
    let length = |a: Point, b: Point| distance(a, b);
    let mut given = Sum::default();
    for &[u, v] in &graph.edges {
        given.add(length(graph.points[u], graph.points[v]));
    }
    let mut found = Sum::default();
    for edge in cdt.undirected_edges().filter(|e| e.is_constraint_edge()) {
        let [a, b] = edge.positions().map(|p| [p.x, p.y]);
        found.add(length(a, b));
    }
    let (given, found) = (given.value(), found.value());
    if (given - found).abs() > 1e-12 * given {
        return Err(failed(format!(
            "edges of total length `{given}` became `{found}`"
        )));
    }
    let mut area = Sum::default();
    for triangle in &domain.triangles {
        let [a, b, c] = triangle.map(|v| domain.points[v as usize]);
        area.add(0.5 * cross(a, b, c));
    }
    // New vertices round off the outline: in a thin polygon that weighs more than its area does.
    let area = area.value();
    let tolerance = 1e-12 * graph.area + 1e-15 * given;
    if (area - graph.area).abs() > tolerance {
        let wanted = graph.area;
        return Err(failed(format!("an area of `{wanted}` became `{area}`")));
    }
    Ok(())
}
