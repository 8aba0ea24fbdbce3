//! Whether the triangulation of a level covers the scene's domain, as a refinement of the scene's initial mesh.

use std::f64::consts::TAU;

use fem_core::{Circle, Mesh};

use crate::element::{Element, elements};
use crate::grid::Grid;
use crate::number::sum;
use crate::report::{Report, show};

/// Largest deviation of areas and lengths, relative to those of the domain.
const COVER: f64 = 1e-12;

/// Spacings of the coordinates that a point may be beside a line.
const SPACINGS: f64 = 64.0;

/// Compares the mesh of a level with the initial mesh; both scaled.
///
/// Every triangle of a conforming mesh lies on the left of its edges; if all boundary edges lie on the boundary of the domain and run
/// around it once (equal lengths, on a circle the angle 2 pi), every point of the domain is covered once.
pub(crate) fn check(
    mesh: &Mesh,
    initial: &Mesh,
    generation: &[i64],
    file: &str,
    report: &mut Report,
) {
    let cover = Cover::new(mesh, initial);
    let first = initial.vertex_count().min(mesh.vertex_count());
    let moved = |j: usize| {
        let [p, q] = [mesh.points()[j], initial.points()[j]];
        let shown = |[x, y]: [f64; 2]| format!("({}, {}), scaled", show(x), show(y));
        (distance(p, q) > cover.slack).then(|| (shown(p), Some(shown(q))))
    };
    report.everywhere(file, "vertices of the initial mesh", "vertex", first, moved);
    let fewer = mesh.vertex_count() < initial.vertex_count();
    let fewer = fewer.then(|| "there are fewer vertices than in the initial mesh".into());
    report.property(file, "vertices", fewer);
    let wrong = match mesh.curve() {
        Some(circle) => cover.around(circle),
        None => cover.same_boundary(),
    };
    report.property(file, "cover of the domain", wrong);
    cover.descent(generation, file, report);
}

struct Cover<'a> {
    mesh: &'a Mesh,
    initial: &'a Mesh,
    /// Distance that stands for none.
    slack: f64,
}

impl<'a> Cover<'a> {
    fn new(mesh: &'a Mesh, initial: &'a Mesh) -> Self {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for p in initial.points() {
            for k in 0..2 {
                low[k] = low[k].min(p[k]);
                high[k] = high[k].max(p[k]);
            }
        }
        let far = low.iter().chain(&high).fold(0.0f64, |m, x| m.max(x.abs()));
        let extent = (high[0] - low[0]).max(high[1] - low[1]);
        Cover {
            mesh,
            initial,
            slack: COVER * extent + SPACINGS * f64::EPSILON * far,
        }
    }

    /// On a disk: boundary vertices lie on the circle, and the boundary goes around it once.
    fn around(&self, circle: Circle) -> Option<String> {
        let from_centre = |p: [f64; 2]| [p[0] - circle.center[0], p[1] - circle.center[1]];
        let points = self.mesh.points();
        let off = |j: usize| {
            let [x, y] = from_centre(points[j]);
            self.mesh.boundary()[j] && (x.hypot(y) - circle.radius).abs() > self.slack
        };
        if let Some(j) = (0..points.len()).find(|&j| off(j)) {
            return Some(format!(
                "vertex {j} is on the boundary and not on the circle"
            ));
        }
        let angles = boundary(self.mesh).map(|[p, q]| {
            let ([a, b], [c, d]) = (from_centre(p), from_centre(q));
            (a * d - b * c).atan2(a * c + b * d)
        });
        let angle = sum(angles);
        let off = (angle - TAU).abs() > COVER * TAU * 1e3;
        off.then(|| format!("the boundary goes through an angle of {angle} instead of 2 pi"))
    }

    /// On a polygon: the boundary is that of the initial mesh, and so is the area.
    fn same_boundary(&self) -> Option<String> {
        let edges: Vec<[[f64; 2]; 2]> = boundary(self.initial).collect();
        let boxes: Vec<[[f64; 2]; 2]> = edges
            .iter()
            .map(|[p, q]| {
                let low = [p[0].min(q[0]), p[1].min(q[1])];
                [low, [p[0].max(q[0]), p[1].max(q[1])]]
            })
            .collect();
        let grid = Grid::new(&boxes, self.slack);
        let on = |p: [f64; 2]| grid.near(p).any(|e| to_segment(p, edges[e]) <= self.slack);
        for [p, q] in boundary(self.mesh) {
            let middle = [0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1])];
            if let Some([x, y]) = [p, middle].into_iter().find(|&p| !on(p)) {
                return Some(format!(
                    "the boundary point ({x:e}, {y:e}), scaled, is not on that of the domain"
                ));
            }
        }
        let length = |mesh: &Mesh| sum(boundary(mesh).map(|[p, q]| distance(p, q)));
        let area = |mesh: &Mesh| sum(elements(mesh).iter().map(|e| e.area));
        let (found, expected) = (length(self.mesh), length(self.initial));
        // Every vertex may be off by the slack.
        let edges = boundary(self.mesh).count() as f64;
        if (found - expected).abs() > COVER * expected + edges * self.slack * COVER.sqrt() {
            return Some(format!(
                "its boundary is {found} long instead of {expected}, scaled"
            ));
        }
        let (found, whole) = (area(self.mesh), area(self.initial));
        if (found - whole).abs() > COVER * whole + self.slack * expected {
            return Some(format!("its area is {found} instead of {whole}, scaled"));
        }
        None
    }

    /// Every triangle has the region of the initial triangle that it lies in, and the area that its generation leaves of it.
    fn descent(&self, generation: &[i64], file: &str, report: &mut Report) {
        let roots = elements(self.initial);
        let corner = |e: &Element| e.vertices.map(|j| self.initial.points()[j]);
        let boxes: Vec<[[f64; 2]; 2]> = roots
            .iter()
            .map(|e| {
                let [a, b, c] = corner(e);
                let low = [0, 1].map(|k| a[k].min(b[k]).min(c[k]));
                [low, [0, 1].map(|k| a[k].max(b[k]).max(c[k]))]
            })
            .collect();
        let grid = Grid::new(&boxes, self.slack);
        // The root in which a point lies deepest: the largest of the smallest barycentric coordinates.
        let depth = |t: usize, p: [f64; 2]| {
            let e = &roots[t];
            let at = corner(e);
            (0..3)
                .map(|i| {
                    let j = (i + 1) % 3;
                    let d = [p[0] - at[j][0], p[1] - at[j][1]];
                    d[0] * e.hat[i][0] + d[1] * e.hat[i][1]
                })
                .fold(f64::INFINITY, f64::min)
        };
        let root = |p: [f64; 2]| {
            grid.near(p)
                .map(|t| (depth(t, p), t))
                .max_by(|a, b| a.0.total_cmp(&b.0))
                .filter(|(depth, _)| *depth > -1e-6)
                .map(|(_, t)| t)
        };
        let leaves = elements(self.mesh);
        let home: Vec<Option<usize>> = leaves
            .iter()
            .map(|e| root(self.inside(e.vertices.map(|j| self.mesh.points()[j]))))
            .collect();
        let far = self
            .mesh
            .points()
            .iter()
            .flatten()
            .fold(0.0f64, |m, x| m.max(x.abs()));
        report.everywhere(file, "region", "triangle", leaves.len(), |t| {
            let root = home[t].map(|r| self.initial.region()[r]);
            let found = self.mesh.region()[t];
            (root != Some(found)).then(|| (found.to_string(), Some(text(root))))
        });
        // Areas halve but for the rounding of coordinates, and next to a circle.
        let off = |t: usize| {
            let Some(r) = home[t] else {
                return Some((generation[t].to_string(), Some(text(None::<i64>))));
            };
            let since = generation[t].saturating_sub(i64::from(self.initial.generation()[r]));
            let halvings = (roots[r].area / leaves[t].area).log2();
            let rounding = SPACINGS * f64::EPSILON * far * leaves[t].diameter / leaves[t].area;
            let [low, high] = match self.mesh.curve() {
                Some(_) => CURVED,
                None => [-HALVED - rounding, HALVED + rounding],
            };
            let surplus = since as f64 - halvings;
            (since < 0 || !(low..=high).contains(&surplus)).then(|| {
                let expected = f64::from(self.initial.generation()[r]) + halvings;
                (generation[t].to_string(), Some(show(expected)))
            })
        };
        report.everywhere(file, "generation", "triangle", leaves.len(), off);
    }

    /// The barycentre of a triangle; on a disk moved into the polygon of the initial mesh if need be.
    fn inside(&self, [a, b, c]: [[f64; 2]; 3]) -> [f64; 2] {
        let p = [0, 1].map(|k| (a[k] + b[k] + c[k]) / 3.0);
        let Some(Circle { center, radius }) = self.mesh.curve() else {
            return p;
        };
        let d = [p[0] - center[0], p[1] - center[1]];
        // The edges of the coarsest fan of eight triangles come as near as this to the centre.
        let near = radius * (TAU / 16.0).cos();
        let shrink = (near / d[0].hypot(d[1])).min(1.0);
        [center[0] + shrink * d[0], center[1] + shrink * d[1]]
    }
}

/// A number of the initial triangle, if there is one.
fn text(number: Option<impl ToString>) -> String {
    number.map_or("none, since it is outside the domain".into(), |n| {
        n.to_string()
    })
}

/// How far, in bisections, the area of a triangle may be from a power of two of its root's but for the rounding of coordinates.
const HALVED: f64 = 1e-10;

/// The same next to a circle. Less than 1 apart, so that no other generation fits.
///
/// All triangles of a disk descend from one fan of eight, so uniform refinement meets every shape there is: -0.21 to 0.53.
const CURVED: [f64; 2] = [-0.3, 0.65];

/// The edges of the boundary, counter-clockwise around their triangles.
fn boundary(mesh: &Mesh) -> impl Iterator<Item = [[f64; 2]; 2]> + '_ {
    mesh.boundary_edges()
        .map(|(t, face)| mesh.face(t, face).map(|v| mesh.points()[v.index()]))
}

fn distance(p: [f64; 2], q: [f64; 2]) -> f64 {
    (p[0] - q[0]).hypot(p[1] - q[1])
}

/// Distance of a point to a segment.
fn to_segment(p: [f64; 2], [a, b]: [[f64; 2]; 2]) -> f64 {
    let along = [b[0] - a[0], b[1] - a[1]];
    let from = [p[0] - a[0], p[1] - a[1]];
    let share = (from[0] * along[0] + from[1] * along[1]) / (along[0].powi(2) + along[1].powi(2));
    let share = share.clamp(0.0, 1.0);
    distance(p, [a[0] + share * along[0], a[1] + share * along[1]])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::square;
    use fem_core::{Children, TriangleId};

    fn said(mesh: &Mesh, initial: &Mesh, generation: &[i64]) -> Vec<String> {
        let mut report = Report::default();
        check(mesh, initial, generation, "f", &mut report);
        report.failures.iter().map(ToString::to_string).collect()
    }

    fn generations(mesh: &Mesh) -> Vec<i64> {
        mesh.generation().iter().map(|&g| i64::from(g)).collect()
    }

    fn rebuilt(mesh: &Mesh, move_point: impl Fn([f64; 2]) -> [f64; 2], skip: usize) -> Mesh {
        let triangles: Vec<[u32; 3]> = mesh
            .triangles()
            .iter()
            .enumerate()
            .filter(|(t, _)| *t != skip)
            .map(|(_, v)| v.map(|v| v.0))
            .collect();
        let points = mesh.points().iter().map(|&p| move_point(p)).collect();
        Mesh::with_refinement_edges(points, &triangles, &[], None).unwrap()
    }

    #[test]
    fn refinements_cover_and_others_do_not() {
        let initial = square(4);
        let mut mesh = initial.clone();
        for round in 0..6 {
            mesh.refine(&[TriangleId(round)], Children::Four).unwrap();
        }
        let generation = generations(&mesh);
        assert_eq!(said(&mesh, &initial, &generation), [""; 0]);
        let whole = usize::MAX;
        // A triangle in the middle is missing.
        let hole = rebuilt(&mesh, |p| p, 20);
        let said_of =
            |mesh: &Mesh| said(mesh, &initial, &generation[..mesh.triangle_count()]).join("; ");
        assert!(said_of(&hole).contains("is not on that of the domain"));
        // The whole is larger by a part in 1e10, or turned.
        let larger = rebuilt(&mesh, |p| p.map(|x| x * (1.0 + 1e-10)), whole);
        assert!(said_of(&larger).contains("`cover of the domain`"));
        let turned = rebuilt(&mesh, |[x, y]| [-y, x], whole);
        assert!(said_of(&turned).contains("`vertices of the initial mesh`"));
        // An inner vertex that is no midpoint any more, and a wrong generation.
        let last = mesh.vertex_count() - 1;
        let moved = mesh.points()[last];
        let bent = rebuilt(
            &mesh,
            |p| if p == moved { [p[0] + 1e-9, p[1]] } else { p },
            whole,
        );
        assert!(
            said_of(&bent).contains("`generation`"),
            "{}",
            said_of(&bent)
        );
        let mut wrong = generation.clone();
        wrong[3] += 1;
        assert_eq!(
            said(&mesh, &initial, &wrong),
            [format!(
                "`f`: `generation` at triangle 3 is `{}`, recomputed `{}`",
                wrong[3], generation[3]
            )]
        );
    }

    #[test]
    fn half_of_the_domain_is_not_all_of_it() {
        let initial = square(2);
        let points = vec![[-1.0, -1.0], [0.0, -1.0], [0.0, 0.0], [-1.0, 0.0]];
        let part = Mesh::with_refinement_edges(points, &[[2, 0, 1], [0, 2, 3]], &[], None).unwrap();
        let said = said(&part, &initial, &[0, 0]).join("; ");
        assert!(
            said.contains("fewer vertices") && said.contains("`cover of the domain`"),
            "{said}"
        );
    }
}
