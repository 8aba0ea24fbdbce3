//! Problems, meshes and the adaptive loop that the counts are taken on.

use contact::{DiscreteProblem, Settings, Solution, Solver, Start, Tolerance, solve};
use fem_core::{Children, Mesh, TriangleId, VertexId};

use crate::common::{Data, Function, Random, square};
pub use crate::common::{jumping_action, smooth_action};

pub const ZERO: Function = &|_, _| 0.0;
pub const ONE: Function = &|_, _| 1.0;

/// Many contact sets: a wave presses and pulls.
pub fn islands(x: f64, y: f64) -> f64 {
    let k = 4.0 * std::f64::consts::PI;
    60.0 * (k * x).sin() * (k * y).sin() - 15.0
}

/// A load that is constant on 64 by 64 cells and random: thousands of contact spots.
pub fn spots(x: f64, y: f64) -> f64 {
    let cell = |t: f64| ((t + 1.0) * 32.0).floor().clamp(0.0, 63.0) as u64;
    // The first numbers of a seed are close to those of its neighbours.
    let mut random = Random(cell(x) * 7919 + cell(y) * 104_729);
    random.next();
    100.0 * (random.next() - 0.6)
}

/// Low on the cells of an n by n checkerboard of one colour, high on the other.
pub fn checkerboard(n: usize, high: f64) -> impl Fn(f64, f64) -> f64 {
    move |x, y| {
        let cell = |t: f64| (((t + 1.0) * n as f64 / 2.0).floor() as i64).clamp(0, n as i64 - 1);
        if (cell(x) + cell(y)) % 2 == 0 {
            1.0
        } else {
            high
        }
    }
}

/// The L-shape (-1, 1)^2 without x > 0, y < 0, in n by n cells of the square.
pub fn lshape(n: usize) -> Mesh {
    let whole = square(n);
    let inside = |t: &TriangleId| {
        let c = whole.corners(*t);
        let m = [0, 1].map(|k| c.iter().map(|p| p[k]).sum::<f64>() / 3.0);
        m[0] < 0.0 || m[1] > 0.0
    };
    cut(&whole, inside)
}

/// The triangles of a mesh that are kept, as an initial mesh.
fn cut(mesh: &Mesh, keep: impl Fn(&TriangleId) -> bool) -> Mesh {
    let mut number = vec![u32::MAX; mesh.vertex_count()];
    let mut points = Vec::new();
    let mut triangles = Vec::new();
    for t in mesh.triangle_ids().filter(keep) {
        triangles.push(mesh.triangles()[t.index()].map(|v: VertexId| {
            let new = &mut number[v.index()];
            if *new == u32::MAX {
                *new = points.len() as u32;
                points.push(mesh.points()[v.index()]);
            }
            *new
        }));
    }
    Mesh::new(points, &triangles, &[], None).expect("a mesh")
}

/// Squares of the jump estimator of every triangle, in the energy norm.
pub fn indicators(mesh: &Mesh, problem: &DiscreteProblem, solution: &Solution) -> Vec<f64> {
    let mut squares = vec![0.0; mesh.triangle_count()];
    let gradient = |i: usize, t: TriangleId| {
        let values = mesh.triangles()[t.index()].map(|v| solution.displacement[i][v.index()]);
        let mu = problem.tension_mean[i][t.index()];
        (mesh.shape(t).gradient(values).map(|g| mu * g), mu)
    };
    for edge in mesh.interior_edges() {
        let [s, t] = edge.triangles;
        let shape = mesh.shape(s);
        let (normal, length) = (shape.normal(edge.faces[0]), shape.lengths[edge.faces[0]]);
        for i in 0..2 {
            let ((g, m1), (h, m2)) = (gradient(i, s), gradient(i, t));
            let jump = (g[0] - h[0]) * normal[0] + (g[1] - h[1]) * normal[1];
            let share = 0.25 * length * length * jump * jump / m1.max(m2);
            squares[s.index()] += share;
            squares[t.index()] += share;
        }
    }
    squares
}

/// The least set of triangles with a share `theta` of the sum.
pub fn bulk(squares: &[f64], theta: f64) -> Vec<TriangleId> {
    let mut order: Vec<u32> = (0..squares.len() as u32).collect();
    order.sort_by(|&s, &t| squares[t as usize].total_cmp(&squares[s as usize]));
    let mut missing = theta * squares.iter().sum::<f64>();
    let mut count = 0;
    while missing > 0.0 && count < order.len() {
        missing -= squares[order[count] as usize];
        count += 1;
    }
    order.truncate(count.max(1));
    order.into_iter().map(TriangleId).collect()
}

/// Settings of multigrid.
pub fn multigrid(tolerance: Tolerance, reduce: bool) -> Settings {
    Settings {
        solver: Solver::Multigrid,
        tolerance,
        reduce,
        energy_target: None,
        sigma: true,
        threads: 1,
    }
}

/// A level on its mesh: problem, start, and the estimate of the start's own solution.
pub struct Stage<'a> {
    pub mesh: &'a Mesh,
    pub problem: &'a DiscreteProblem,
    pub start: Option<&'a Start>,
    /// The estimator of the level before.
    pub eta: f64,
}

/// The adaptive loop until `vertices`, one step of bisection a level, each solved to a tenth of the estimate to be expected; `last`
/// sees the first mesh that has as many.
pub fn adaptively<T>(
    data: &Data,
    mut mesh: Mesh,
    vertices: usize,
    theta: f64,
    mut last: impl FnMut(Stage) -> T,
) -> T {
    let mut start: Option<Start> = None;
    let mut eta = f64::INFINITY;
    let mut settings = multigrid(Tolerance::Balanced, true);
    settings.sigma = false;
    loop {
        let problem = data.on(&mesh);
        if mesh.vertex_count() >= vertices {
            return last(Stage {
                mesh: &mesh,
                problem: &problem,
                start: start.as_ref(),
                eta,
            });
        }
        settings.energy_target = eta.is_finite().then_some(0.1 * eta);
        let s = solve(&problem, &settings, start.as_ref()).expect("a solution");
        let squares = indicators(&mesh, &problem, &s);
        eta = squares.iter().sum::<f64>().sqrt();
        let refined = mesh
            .refine(&bulk(&squares, theta), Children::Two)
            .expect("refines");
        start = Some(Start::prolong(&s, &mesh, refined.old_vertices));
    }
}

/// The energy norm of the difference of two solutions.
pub fn energy_difference(problem: &DiscreteProblem, a: &Solution, b: &Solution) -> f64 {
    let part = |i: usize| {
        let e: Vec<f64> = a.displacement[i]
            .iter()
            .zip(&b.displacement[i])
            .map(|(x, y)| x - y)
            .collect();
        problem.stiffness(i).quadratic(&e)
    };
    (part(0) + part(1)).max(0.0).sqrt()
}
