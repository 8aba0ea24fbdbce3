//! The parts of multigrid against dense matrices: every shortcut beside what it stands for.

use fem_core::{Children, Mesh};

use super::descent::{Descent, Vectors};
use super::finest::Finest;
use super::galerkin::Levels;
use super::hierarchy::Hierarchy;
use super::unknowns::{Pair, Scalar, Unknowns};
use crate::common::{Data, Random, distorted};
use crate::problem::DiscreteProblem;

/// A graded mesh of a distorted initial one, with variable tensions.
fn problem(levels: usize) -> DiscreteProblem {
    problem_on(3, levels)
}

/// As [`problem`], the initial mesh of n by n cells.
fn problem_on(n: usize, levels: usize) -> DiscreteProblem {
    problem_from(distorted(n, 0.3, 7), levels)
}

/// A mesh all of whose triangles meet in one vertex, refined.
fn fan(triangles: u32, levels: usize) -> DiscreteProblem {
    let mut points = vec![[0.0, 0.0]];
    points.extend((0..triangles).map(|k| {
        let angle = std::f64::consts::TAU * f64::from(k) / f64::from(triangles);
        [angle.cos(), angle.sin()]
    }));
    let corners: Vec<[u32; 3]> = (0..triangles)
        .map(|k| [0, 1 + k, 1 + (k + 1) % triangles])
        .collect();
    problem_from(Mesh::new(points, &corners, &[], None).unwrap(), levels)
}

fn problem_from(mut mesh: Mesh, levels: usize) -> DiscreteProblem {
    let mut random = Random(11);
    for _ in 0..levels {
        let marked: Vec<_> = mesh
            .triangle_ids()
            .filter(|_| random.next() < 0.25)
            .collect();
        mesh.refine(&marked, Children::Two).unwrap();
    }
    let data = Data {
        tensions: [&|x, y| 1.0 + 0.5 * x * y, &|x, _| {
            if x > 0.2 { 30.0 } else { 2.0 }
        }],
        loads: [&|_, _| -1.0, &|_, _| 0.0],
        heights: [&|_, _| 0.1, &|_, _| 0.0],
    };
    data.on(&mesh)
}

/// Random contact, about half of the inner vertices.
fn contact(hierarchy: &Hierarchy, random: &mut Random) -> Vec<bool> {
    contact_of(0.5, hierarchy, random)
}

/// Random contact, about this part of the inner vertices.
fn contact_of(part: f64, hierarchy: &Hierarchy, random: &mut Random) -> Vec<bool> {
    (0..hierarchy.len())
        .map(|p| !hierarchy.fixed[p] && random.next() < part)
        .collect()
}

fn values<U: Unknowns>(hierarchy: &Hierarchy, random: &mut Random) -> Vec<U::Value> {
    (0..hierarchy.len())
        .map(|p| {
            let v = [random.between(-1.0, 1.0), random.between(-1.0, 1.0)];
            U::value(|i| if hierarchy.fixed[p] { 0.0 } else { v[i] })
        })
        .collect()
}

fn dot<U: Unknowns>(x: &[U::Value], y: &[U::Value]) -> f64 {
    x.iter().zip(y).map(|(&a, &b)| U::dot(a, b)).sum()
}

/// The truncation T of values of the finest mesh.
fn truncate<U: Unknowns>(finest: &Finest<U>, contact: &[bool], x: &mut [U::Value]) {
    for p in 0..x.len() {
        if contact[p] {
            x[p] = U::spread(x[p], finest.share(p));
        }
    }
}

fn hierarchy(problem: &DiscreteProblem) -> Hierarchy {
    let mut hierarchy = Hierarchy::default();
    hierarchy.read(&problem.mesh, None, false);
    hierarchy
}

fn levels<U: Unknowns>(hierarchy: &Hierarchy) -> Levels<U> {
    let mut levels = Levels::default();
    levels.fit(hierarchy);
    levels
}

fn finest<U: Unknowns>(problem: &DiscreteProblem, hierarchy: &Hierarchy) -> Finest<U> {
    let mut finest = Finest::default();
    finest.assemble(hierarchy, &problem.mesh, |i, t| problem.tension_mean[i][t]);
    finest
}

#[test]
fn levels_are_prefixes_and_every_edge_has_its_slot() {
    // In the fan more edges meet than a byte can count.
    for problem in [problem(0), problem(1), problem(9), fan(600, 4)] {
        let h = hierarchy(&problem);
        assert_eq!(h.around.len(), h.quad.len());
        assert_eq!(h.level.last(), Some(&(h.len() as u32)));
        for p in 0..h.len() {
            let j = h.vertex[p] as usize;
            assert_eq!(h.rank[j] as usize, p);
            let level = problem.mesh.genealogy()[j].level as usize;
            assert!(h.ranks(level).contains(&p));
            let mut seen = 0;
            for &k in problem.pattern().columns(j) {
                let q = h.rank[k as usize] as usize;
                if q < p {
                    let slot = h.slot(q as u32, p as u32);
                    assert!(slot < h.slots() - 1 && h.edges(p).any(|e| e == (q, slot)));
                    seen += 1;
                }
            }
            assert!(p < h.initial() || seen <= 4);
            let others = h.edges(p).map(|(q, _)| h.vertex[q]);
            let mut row: Vec<u32> = others.chain([j as u32]).collect();
            row.sort_unstable();
            assert_eq!(row, problem.pattern().columns(j));
        }
        // Old rows: the inner parents of the level, once each.
        for level in 1..=h.depth() {
            let mut parents: Vec<u32> = h
                .ranks(level)
                .flat_map(|p| h.quad[p - h.initial()][..2].to_vec())
                .filter(|&q| !h.fixed[q as usize])
                .collect();
            parents.sort_unstable();
            parents.dedup();
            let mut rows = h.old_vertex[h.old_rows(level)].to_vec();
            rows.sort_unstable();
            assert_eq!(rows, parents);
        }
    }
}

#[test]
fn the_product_is_that_of_the_matrix() {
    let problem = problem(7);
    let h = hierarchy(&problem);
    let finest = finest::<Pair>(&problem, &h);
    let x = values::<Pair>(&h, &mut Random(3));
    let mut y = vec![[0.0; 2]; h.len()];
    finest.multiply(&h, &x, &mut y);
    for i in 0..2 {
        let plain: Vec<f64> = h.rank.iter().map(|&p| x[p as usize][i]).collect();
        for p in (0..h.len()).filter(|&p| !h.fixed[p]) {
            let j = h.vertex[p] as usize;
            let exact = problem.stiffness(i).row_dot(j, &plain);
            let scale = problem.stiffness(i).row_dot_abs(j, &plain);
            assert!((y[p][i] - exact).abs() <= 1e-15 * scale.max(1.0));
        }
    }
}

/// Prolongs a value at one rank of a level to the finest mesh.
fn hat<U: Unknowns>(h: &Hierarchy, level: usize, rank: usize, i: usize) -> Vec<U::Value> {
    let zero = U::value(|_| 0.0);
    let mut x = vec![zero; h.len()];
    x[rank] = U::value(|k| f64::from(k == i));
    for p in h.level[level + 1] as usize..h.len() {
        let [a, b, ..] = h.quad[p - h.initial()].map(|q| q as usize);
        let mean = |q: usize| if h.fixed[q] { zero } else { x[q] };
        if !h.fixed[p] {
            x[p] = U::plus(U::plus(zero, 0.5, mean(a)), 0.5, mean(b));
        }
    }
    x
}

/// Every stored row of every level is the Galerkin product of truncated hat functions.
fn galerkin<U: Unknowns>(contact: Option<(u64, f64)>) {
    let problem = problem(6);
    let h = hierarchy(&problem);
    let finest = finest::<U>(&problem, &h);
    let contact = match contact {
        Some((seed, part)) => contact_of(part, &h, &mut Random(seed)),
        None => vec![false; h.len()],
    };
    let mut levels = levels::<U>(&h);
    levels.sweep(&h, &finest, &contact).unwrap();
    let function = |level: usize, rank: usize, i: usize| {
        let mut x = hat::<U>(&h, level, rank, i);
        truncate(&finest, &contact, &mut x);
        x
    };
    let entry = |x: &[U::Value], y: &[U::Value]| {
        let mut image = vec![U::value(|_| 0.0); h.len()];
        finest.multiply(&h, y, &mut image);
        h.clear_fixed(&mut image);
        dot::<U>(x, &image)
    };
    let n0 = h.initial();
    let mut compared = 0;
    for level in 1..=h.depth() {
        for p in h.ranks(level).filter(|&p| !h.fixed[p]) {
            for (k, &q) in h.quad[p - n0].iter().enumerate() {
                for (i, j) in [(0, 0), (0, U::WIDTH - 1), (U::WIDTH - 1, 0)] {
                    if !h.fixed[q as usize] {
                        let exact = entry(&function(level, p, i), &function(level, q as usize, j));
                        let found = U::coupling_at(levels.coupling[4 * (p - n0) + k], i, j);
                        assert!((found - exact).abs() < 1e-12, "{found} {exact}");
                        compared += 1;
                    }
                }
            }
        }
        for row in h.old_rows(level) {
            let q = h.old_vertex[row] as usize;
            for e in h.old_start[row] as usize..h.old_start[row + 1] as usize {
                for (i, j) in [(0, 0), (0, U::WIDTH - 1), (U::WIDTH - 1, 0)] {
                    let other = h.old_entry[e].other();
                    let exact = entry(&function(level, q, i), &function(level, other, j));
                    let found = U::coupling_at(U::full(levels.old_coupling[e]), i, j);
                    let rounding = f64::from(f32::EPSILON) * exact.abs();
                    assert!((found - exact).abs() < 1e-12 + rounding, "{found} {exact}");
                    compared += 1;
                }
            }
        }
    }
    assert!(compared > 500, "{compared}");
}

#[test]
fn rows_of_all_levels_are_galerkin_products() {
    // Few vertices in contact are truncated one by one.
    for contact in [None, Some((1, 0.5)), Some((2, 0.5)), Some((3, 0.1))] {
        galerkin::<Scalar>(contact);
        galerkin::<Pair>(contact);
    }
}

/// The preconditioner is symmetric and positive, and close to the inverse where nothing is truncated.
fn preconditioner<U: Unknowns>(problem: &DiscreteProblem, seed: Option<u64>) {
    let h = hierarchy(problem);
    let finest = finest::<U>(problem, &h);
    let mut random = Random(5);
    let contact = match seed {
        Some(seed) => contact(&h, &mut Random(seed)),
        None => vec![false; h.len()],
    };
    let mut levels = levels::<U>(&h);
    levels.sweep(&h, &finest, &contact).unwrap();
    let gathered = |x: &[U::Value]| -> Vec<U::Value> {
        (0..x.len())
            .map(|p| {
                if contact[p] {
                    U::gather(x[p], finest.share(p))
                } else {
                    x[p]
                }
            })
            .collect()
    };
    let mut apply = |r: &[U::Value]| -> Vec<U::Value> {
        let mut r = gathered(r);
        let mut c = vec![U::value(|_| 0.0); r.len()];
        levels.cycle(&h, &mut r, &mut c);
        truncate(&finest, &contact, &mut c);
        c
    };
    for _ in 0..5 {
        let x = values::<U>(&h, &mut random);
        let y = values::<U>(&h, &mut random);
        let (bx, by) = (apply(&x), apply(&y));
        let (one, other) = (dot::<U>(&bx, &y), dot::<U>(&x, &by));
        let scale = (dot::<U>(&bx, &x) * dot::<U>(&by, &y)).sqrt();
        // Nearly empty hats multiply rounding: up to 1.4e-11 is seen over these sets.
        assert!((one - other).abs() <= 1e-10 * scale, "{one} {other}");
        assert!(dot::<U>(&bx, &x) > 0.0);
        // Energies of B A lie in (0, 1]: a symmetric cycle never overshoots.
        let mut v = y.clone();
        truncate(&finest, &contact, &mut v);
        let mut av = vec![U::value(|_| 0.0); v.len()];
        finest.multiply(&h, &v, &mut av);
        h.clear_fixed(&mut av);
        let bav = apply(&av);
        let ratio = dot::<U>(&av, &bav) / dot::<U>(&v, &av);
        assert!(ratio > 0.0 && ratio <= 1.0 + 1e-10, "{ratio}");
    }
}

#[test]
fn the_cycle_is_symmetric_and_does_not_overshoot() {
    let problem = problem(8);
    for seed in [None].into_iter().chain((1..30).map(Some)) {
        preconditioner::<Scalar>(&problem, seed);
        preconditioner::<Pair>(&problem, seed);
    }
    // And with aggregates below.
    for levels in [0, 2] {
        let problem = problem_on(LARGE_CELLS, levels);
        for seed in [None, Some(3)] {
            preconditioner::<Scalar>(&problem, seed);
            preconditioner::<Pair>(&problem, seed);
        }
    }
}

/// Cells that make an initial mesh large.
const LARGE_CELLS: usize = 76;

/// Truncation after truncation, the cycle is that of the last one alone.
#[test]
fn what_is_kept_of_aggregates_is_what_would_be_made_anew() {
    fn check<U: Unknowns>() {
        let problem = problem_on(LARGE_CELLS, 1);
        let h = hierarchy(&problem);
        let finest = finest::<U>(&problem, &h);
        let mut kept = levels::<U>(&h);
        let none = vec![false; h.len()];
        kept.sweep(&h, &finest, &none).unwrap();
        for seed in 0..3 {
            let mut random = Random(seed);
            // One quarter of the square, and a vertex here and there.
            let contact: Vec<bool> = (0..h.len())
                .map(|p| {
                    let [x, y] = problem.mesh.points()[h.vertex[p] as usize];
                    !h.fixed[p] && (random.next() < 0.01 || x > 0.1 * seed as f64 && y > 0.0)
                })
                .collect();
            kept.sweep(&h, &finest, &contact).unwrap();
            let mut fresh = levels::<U>(&h);
            fresh.sweep(&h, &finest, &contact).unwrap();
            let r = values::<U>(&h, &mut random);
            let [one, other] = [&mut kept, &mut fresh].map(|levels| {
                let mut r = r.clone();
                let mut c = vec![U::value(|_| 0.0); r.len()];
                levels.cycle(&h, &mut r, &mut c);
                c
            });
            for (a, b) in one.iter().zip(&other) {
                assert!((0..U::WIDTH).all(|i| U::at(*a, i) == U::at(*b, i)));
            }
        }
    }
    check::<Scalar>();
    check::<Pair>();
}

/// Monotone cycles keep the bounds and lower the energy, each time.
fn monotone<U: Unknowns>(problem: &DiscreteProblem, seeds: u64) {
    let h = hierarchy(problem);
    let finest = finest::<U>(problem, &h);
    let none = vec![false; h.len()];
    let mut levels = levels::<U>(&h);
    levels.sweep(&h, &finest, &none).unwrap();
    for seed in 0..seeds {
        // Pressed hard nearly everywhere: coarse corrections would go far beyond the bounds.
        let mut random = Random(seed);
        let mut load = values::<U>(&h, &mut random);
        for p in (0..h.len()).filter(|&p| !h.fixed[p]) {
            let pull = if p % 7 == 0 { 2.0 } else { -0.5 };
            load[p] = U::value(|i| if i == 0 { pull } else { -pull });
        }
        let x = values::<U>(&h, &mut random).into_iter().map(|v| {
            let size = U::size(v);
            U::value(|i| if i == 0 { size } else { -size })
        });
        descend(&h, &finest, &mut levels, &load, x.collect());
    }
}

fn descend<U: Unknowns>(
    h: &Hierarchy,
    finest: &Finest<U>,
    levels: &mut Levels<U>,
    load: &[U::Value],
    mut x: Vec<U::Value>,
) {
    let mut last = f64::INFINITY;
    for cycle in 0..6 {
        let mut image = x.clone();
        finest.multiply(h, &x, &mut image);
        h.clear_fixed(&mut image);
        let energy = 0.5 * dot::<U>(&x, &image) - dot::<U>(&x, load);
        assert!(energy < last, "cycle {cycle}: {energy} {last}");
        last = energy;
        let mut r: Vec<U::Value> = load
            .iter()
            .zip(&image)
            .map(|(&b, &y)| U::plus(b, -1.0, y))
            .collect();
        let mut bound: Vec<f64> = x.iter().map(|&x| -U::gap(x).max(0.0)).collect();
        let mut c = x.clone();
        levels.monotone_cycle(h, &mut r, &mut c, &mut bound, &mut Vec::new());
        let mut closed = 0;
        for p in 0..x.len() {
            x[p] = U::plus(x[p], 1.0, c[p]);
            assert!(U::gap(x[p]) >= -1e-14, "{}", U::gap(x[p]));
            closed += usize::from(!h.fixed[p] && U::gap(x[p]).abs() <= 1e-14);
        }
        assert!(closed > 0 && closed < h.len());
    }
}

#[test]
fn monotone_cycles_are_monotone() {
    for (problem, seeds) in [(problem(8), 10), (problem_on(LARGE_CELLS, 0), 2)] {
        monotone::<Scalar>(&problem, seeds);
        monotone::<Pair>(&problem, seeds);
    }
}

#[test]
fn inverses_of_pairs() {
    let plain = [3.0, 0.5];
    let times = |d: [f64; 3], y: [f64; 2]| Pair::times(d, y);
    // Regular, with one empty field, and empty.
    let full = Pair::inverse([2.0, 0.3, 0.4], plain);
    let back = times(full, times([2.0, 0.3, 0.4], [0.7, -1.1]));
    assert!((back[0] - 0.7).abs() < 1e-15 && (back[1] + 1.1).abs() < 1e-15);
    assert_eq!(Pair::inverse([2.0, 0.0, 1e-12], plain), [0.5, 0.0, 0.0]);
    assert_eq!(Pair::inverse([0.0; 3], plain), [0.0; 3]);
    // Glued: of rank one, also with tensions far apart.
    for ratio in [1.0, 1e6, 1e-6] {
        let plain = [4.0, 4.0 * ratio];
        let share = Pair::share(plain);
        let glued = Pair::truncated_pivot(plain, Some(share));
        let inverse = Pair::inverse(glued, plain);
        // On the range, D D+ D = D.
        for y in [[1.0, 0.0], [0.0, 1.0]] {
            let d = times(glued, y);
            let again = times(glued, times(inverse, d));
            for i in 0..2 {
                assert!((again[i] - d[i]).abs() <= 1e-9 * plain[i].max(d[i].abs()));
            }
        }
        // The kernel is left alone.
        let kernel = [1.0 - share, -share];
        let moved = times(inverse, times(glued, kernel));
        assert!(moved[0].abs() + moved[1].abs() < 1e-12);
    }
}

#[test]
fn gaps_that_a_monotone_cycle_closes_are_closed_exactly() {
    let mut mesh = distorted(4, 0.2, 3);
    for _ in 0..3 {
        mesh.refine_uniformly(Children::Four).unwrap();
    }
    let data = Data {
        tensions: [&|_, _| 1.0, &|x, _| if x > 0.0 { 1e4 } else { 3.0 }],
        loads: [
            &|x, y| 30.0 * (9.0 * x).sin() * (7.0 * y).cos() - 12.0,
            &|_, _| 1.0,
        ],
        heights: [&|_, _| 0.0, &|_, _| 0.0],
    };
    let problem = data.on(&mesh);
    let h = hierarchy(&problem);
    let finest = finest::<Pair>(&problem, &h);
    let mut levels = levels::<Pair>(&h);
    let load = |p: usize, i: usize| problem.loads[i].nodal[h.vertex[p] as usize];
    let values = Vectors {
        x: vec![[0.0; 2]; h.len()],
        b: (0..h.len())
            .map(|p| [0, 1].map(|i| if h.fixed[p] { 0.0 } else { load(p, i) }))
            .collect(),
        boundary_size: 0.0,
        plain: false,
    };
    let scale = |_: usize| 0.0;
    let mut descent = Descent::new(&h, &finest, &mut levels, true, &scale, values);
    descent.settle();
    descent.monotone_start().unwrap();
    let size = descent.x.iter().map(|&u| Pair::size(u)).fold(0.0, f64::max);
    let (mut closed, mut open) = (0, 0);
    for p in (0..h.len()).filter(|&p| !h.fixed[p]) {
        match Pair::gap(descent.x[p]) {
            0.0 => closed += 1,
            gap => {
                assert!(gap > 1e-13 * size, "{gap:e} of {size:e}");
                open += 1;
            }
        }
    }
    assert!(closed > 100 && open > 100, "{closed} {open}");
}
