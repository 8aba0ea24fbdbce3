//! Meshes, loads and problems of the tests.
#![allow(dead_code)]

use contact::{DiscreteProblem, Solution};
use fem_core::integrate::Loads;
use fem_core::{Mesh, TriangleId};

/// A function of the plane.
pub type Function<'a> = &'a dyn Fn(f64, f64) -> f64;

/// Pseudo-random numbers in [0, 1), the same on every machine.
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^= z >> 31;
        (z >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }
}

/// Continuous action in the disk of radius 1/2; tensions 1 and 2, heights zero. With P = (1 - x^2)(1 - y^2) and
/// q = max(0, x^2 + y^2 - 1/4) the displacements are P/3 + 2/3 P q^2 and P/3 - 1/3 P q^2, the action 5 - 20 (x^2 + y^2) in the disk.
pub fn smooth_action(membrane: usize, x: f64, y: f64) -> f64 {
    let r2 = x * x + y * y;
    let q = (r2 - 0.25).max(0.0);
    let (a, b) = (1.0 - x * x, 1.0 - y * y);
    // laplace P, and laplace (P q^2) = q^2 laplace P + 2 grad P . grad q^2 + P laplace q^2, zero in the disk.
    let lp = -2.0 * (a + b);
    let lpq = if q > 0.0 {
        q * q * lp - 16.0 * q * (x * x * b + y * y * a) + a * b * (8.0 * r2 + 8.0 * q)
    } else {
        0.0
    };
    let action = (5.0 - 20.0 * r2).max(0.0);
    if membrane == 0 {
        -(lp / 3.0 + 2.0 / 3.0 * lpq) - action
    } else {
        -2.0 * (lp / 3.0 - lpq / 3.0) + action
    }
}

/// Action 5 in a disk off the centre, 0 outside; tensions 1, heights zero, gap P q^2 and mean P/2.
pub fn jumping_action(membrane: usize, x: f64, y: f64) -> f64 {
    let (cx, cy) = (x - 0.23, y + 0.17);
    let rho = cx * cx + cy * cy;
    let q = (rho - 0.1681).max(0.0);
    let (a, b) = (1.0 - x * x, 1.0 - y * y);
    let lp = -2.0 * (a + b);
    let lpq = if q > 0.0 {
        q * q * lp - 16.0 * q * (x * b * cx + y * a * cy) + a * b * (8.0 * rho + 8.0 * q)
    } else {
        0.0
    };
    let action = if rho < 0.1681 { 5.0 } else { 0.0 };
    let sign = if membrane == 0 { 1.0 } else { -1.0 };
    -(0.5 * lp + sign * 0.5 * lpq) - sign * action
}

/// The square (-1, 1)^2 in n by n cells, every cell cut along the same diagonal; `map` moves the points.
pub fn square_mapped(n: usize, map: impl FnMut(usize, usize, [f64; 2]) -> [f64; 2]) -> Mesh {
    square_cut(n, map, |_, _| false)
}

fn square_cut(
    n: usize,
    mut map: impl FnMut(usize, usize, [f64; 2]) -> [f64; 2],
    mut other: impl FnMut(usize, usize) -> bool,
) -> Mesh {
    let at = |k: usize| 2.0 * k as f64 / n as f64 - 1.0;
    let mut points = Vec::new();
    for r in 0..=n {
        for c in 0..=n {
            points.push(map(r, c, [at(c), at(r)]));
        }
    }
    let id = |r: usize, c: usize| (r * (n + 1) + c) as u32;
    let mut triangles = Vec::new();
    for r in 0..n {
        for c in 0..n {
            let [a, b, d, e] = [id(r, c), id(r, c + 1), id(r + 1, c), id(r + 1, c + 1)];
            if other(r, c) {
                triangles.extend([[a, b, d], [b, e, d]]);
            } else {
                triangles.extend([[a, b, e], [a, e, d]]);
            }
        }
    }
    Mesh::new(points, &triangles, &[], None).expect("a valid mesh")
}

/// The square (-1, 1)^2 in n by n cells of two right triangles.
pub fn square(n: usize) -> Mesh {
    square_mapped(n, |_, _, p| p)
}

/// The square with interior points moved by up to `strength` of a cell and diagonals thrown by lot: from 0.3 on far from Delaunay,
/// and beyond 0.5 points may not be moved so far that a triangle turns over, so they are moved less until none does.
pub fn distorted(n: usize, strength: f64, seed: u64) -> Mesh {
    let mut random = Random(seed);
    let cell = 2.0 / n as f64;
    let mut points: Vec<Vec<[f64; 2]>> = (0..=n)
        .map(|r| {
            (0..=n)
                .map(|c| [c as f64 * cell - 1.0, r as f64 * cell - 1.0])
                .collect()
        })
        .collect();
    let cut: Vec<Vec<bool>> = (0..n)
        .map(|_| (0..n).map(|_| random.next() < 0.5).collect())
        .collect();
    let area = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| {
        0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
    };
    for r in 1..n {
        for c in 1..n {
            let old = points[r][c];
            let mut reach = strength * cell;
            let angle = random.between(0.0, std::f64::consts::TAU);
            loop {
                points[r][c] = [old[0] + reach * angle.cos(), old[1] + reach * angle.sin()];
                let fine =
                    [(r - 1, c - 1), (r - 1, c), (r, c - 1), (r, c)]
                        .iter()
                        .all(|&(y, x)| {
                            let [a, b, d, e] = [
                                points[y][x],
                                points[y][x + 1],
                                points[y + 1][x],
                                points[y + 1][x + 1],
                            ];
                            let parts = if cut[y][x] {
                                [area(a, b, d), area(b, e, d)]
                            } else {
                                [area(a, b, e), area(a, e, d)]
                            };
                            parts.iter().all(|&s| s > 1e-3 * cell * cell)
                        });
                if fine {
                    break;
                }
                reach *= 0.7;
                if reach < 1e-3 * cell {
                    points[r][c] = old;
                    break;
                }
            }
        }
    }
    square_cut(n, |r, c, _| points[r][c], |r, c| cut[r][c])
}

/// Loads by the vertex rule: (f, phi_j) is f at the vertex times the area of the dual cell.
pub fn loads(mesh: &Mesh, f: Function) -> Loads {
    let mut nodal = vec![0.0; mesh.vertex_count()];
    let mut means = Vec::new();
    for t in mesh.triangle_ids() {
        let shape = mesh.shape(t);
        let middle = [0, 1].map(|i| shape.corners.iter().map(|p| p[i]).sum::<f64>() / 3.0);
        means.push(f(middle[0], middle[1]));
        for v in mesh.triangles()[t.index()] {
            let p = mesh.points()[v.index()];
            // Inwards a little, so that data that jump along mesh edges are read on the triangle's side.
            let q = [0, 1].map(|i| p[i] + 1e-9 * (middle[i] - p[i]));
            nodal[v.index()] += shape.area / 3.0 * f(q[0], q[1]);
        }
    }
    Loads::from_parts(nodal, &means, &vec![0.0; means.len()])
}

/// Data of a problem on any mesh.
pub struct Data<'a> {
    pub tensions: [Function<'a>; 2],
    pub loads: [Function<'a>; 2],
    pub heights: [Function<'a>; 2],
}

impl Data<'_> {
    pub fn on(&self, mesh: &Mesh) -> DiscreteProblem {
        let mean = |f: Function| -> Vec<f64> {
            mesh.triangle_ids()
                .map(|t: TriangleId| {
                    let c = mesh.corners(t);
                    let m = [0, 1].map(|i| c.iter().map(|p| p[i]).sum::<f64>() / 3.0);
                    f(m[0], m[1])
                })
                .collect()
        };
        let height = |g: Function| -> Vec<f64> {
            mesh.points()
                .iter()
                .zip(mesh.boundary())
                .map(|(p, &b)| if b { g(p[0], p[1]) } else { 0.0 })
                .collect()
        };
        DiscreteProblem::new(
            mesh.clone(),
            self.tensions.map(mean),
            self.loads.map(|f| loads(mesh, f)),
            self.heights.map(height),
        )
    }
}

/// The largest displacement.
pub fn unit(solution: &Solution) -> f64 {
    solution
        .displacement
        .iter()
        .flatten()
        .fold(0.0, |m: f64, v| m.max(v.abs()))
}

/// The largest difference of the displacements, relative to the largest displacement.
pub fn difference(a: &Solution, b: &Solution) -> f64 {
    let mut worst = 0.0f64;
    for i in 0..2 {
        for (x, y) in a.displacement[i].iter().zip(&b.displacement[i]) {
            worst = worst.max((x - y).abs());
        }
    }
    worst / unit(a).max(f64::MIN_POSITIVE)
}

/// What every solution of the active set method must satisfy exactly.
pub fn assert_exact(problem: &DiscreteProblem, s: &Solution) {
    for j in 0..problem.order() {
        let gap = s.gap(j);
        assert!(gap >= 0.0, "gap {gap:e} at {j}");
        assert!(s.force[j] >= 0.0, "force {:e} at {j}", s.force[j]);
        if s.contact[j] {
            assert!(!problem.boundary()[j], "contact on the boundary at {j}");
            assert!(gap == 0.0, "gap {gap:e} in contact at {j}");
        } else {
            assert!(
                s.force[j] == 0.0,
                "force {:e} without contact at {j}",
                s.force[j]
            );
        }
        if problem.boundary()[j] {
            assert_eq!(s.displacement[0][j], problem.heights[0][j]);
            assert_eq!(s.displacement[1][j], problem.heights[1][j]);
            assert_eq!(s.sigma[j], 0.0);
        }
    }
}
