//! Refinement against a slow one that follows the definition: edges in sets, bisection by recursion, neighbours by search. Every array must agree to the bit.

use std::collections::{BTreeMap, BTreeSet};

use fem_core::{Birth, Children, Circle, Mesh, MeshError, Neighbour, TriangleId, VertexId};

type Edge = (VertexId, VertexId);

fn edge(a: VertexId, b: VertexId) -> Edge {
    (a.min(b), a.max(b))
}

fn face(v: [VertexId; 3], face: usize) -> Edge {
    edge(v[(face + 1) % 3], v[(face + 2) % 3])
}

/// All that a mesh is made of.
#[derive(Debug, Default, PartialEq)]
struct Arrays {
    points: Vec<[f64; 2]>,
    triangles: Vec<[VertexId; 3]>,
    neighbours: Vec<[Neighbour; 3]>,
    generation: Vec<u16>,
    region: Vec<i32>,
    boundary: Vec<bool>,
    genealogy: Vec<Birth>,
    parent: Vec<TriangleId>,
    split: Vec<u8>,
}

/// Bisects a triangle and its halves as long as their refinement edges are split; leaves in the order of the curve.
fn divide(
    v: [VertexId; 3],
    generation: u16,
    born: &BTreeMap<Edge, VertexId>,
    leaves: &mut Vec<([VertexId; 3], u16)>,
) {
    let Some(&p) = born.get(&edge(v[0], v[1])) else {
        leaves.push((v, generation));
        return;
    };
    let halves = [[v[2], v[0], p], [v[1], v[2], p]];
    let first = (generation % 2) as usize;
    divide(halves[first], generation + 1, born, leaves);
    divide(halves[1 - first], generation + 1, born, leaves);
}

fn level(p: VertexId, genealogy: &[Birth]) -> u16 {
    let birth = &genealogy[p.index()];
    if !birth.parents[0].is_some() || birth.level > 0 {
        return birth.level;
    }
    let around = birth.parents.iter().chain(&birth.opposite);
    let levels = around.filter(|q| q.is_some()).map(|&q| level(q, genealogy));
    1 + levels.max().expect("parents")
}

fn reference(mesh: &Mesh, marked: &[TriangleId], children: Children) -> Arrays {
    let old = mesh.triangles();
    // Edges to be split: those of marked triangles, then refinement edges where any other is split, until nothing changes.
    let mut split: BTreeSet<Edge> = BTreeSet::new();
    for t in marked {
        let faces = if children == Children::Two {
            2..3
        } else {
            0..3
        };
        split.extend(faces.map(|f| face(old[t.index()], f)));
    }
    loop {
        let before = split.len();
        for &v in old {
            if (0..3).any(|f| split.contains(&face(v, f))) {
                split.insert(face(v, 2));
            }
        }
        if split.len() == before {
            break;
        }
    }
    let mut new = Arrays {
        points: mesh.points().to_vec(),
        boundary: mesh.boundary().to_vec(),
        genealogy: mesh.genealogy().to_vec(),
        ..Arrays::default()
    };
    // Vertices in the order of the triangles, the refinement edge first.
    let mut born: BTreeMap<Edge, VertexId> = BTreeMap::new();
    let mut sides: BTreeMap<Edge, Vec<(usize, usize)>> = BTreeMap::new();
    for (t, &v) in old.iter().enumerate() {
        for f in [2, 1, 0] {
            let e = face(v, f);
            sides.entry(e).or_default().push((t, f));
            if !split.contains(&e) || born.contains_key(&e) {
                continue;
            }
            born.insert(e, VertexId(new.points.len() as u32));
            let parents = [v[(f + 1) % 3], v[(f + 2) % 3]];
            let [p, q] = parents.map(|i| mesh.points()[i.index()]);
            let middle = [0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1])];
            let rim = mesh.neighbours()[t][f] == Neighbour::BOUNDARY;
            let curve = mesh.curve().filter(|_| rim);
            new.points.push(curve.map_or(middle, |c| c.project(middle)));
            new.boundary.push(rim);
            new.genealogy.push(Birth {
                parents,
                ..Birth::INITIAL
            });
        }
    }
    for (e, p) in &born {
        for (side, &(t, f)) in sides[e].iter().enumerate() {
            let v = old[t];
            new.genealogy[p.index()].opposite[side] = if f == 2 { v[2] } else { born[&face(v, 2)] };
        }
    }
    for p in mesh.vertex_count()..new.points.len() {
        new.genealogy[p].level = level(VertexId(p as u32), &new.genealogy);
    }
    for (t, &v) in old.iter().enumerate() {
        let mut leaves = Vec::new();
        divide(v, mesh.generation()[t], &born, &mut leaves);
        for (v, generation) in leaves {
            new.triangles.push(v);
            new.generation.push(generation);
            new.region.push(mesh.region()[t]);
            new.parent.push(TriangleId(t as u32));
        }
        let bits = (0..3).map(|f| (born.contains_key(&face(v, f)) as u8) << f);
        new.split.push(bits.sum());
    }
    let mut behind = BTreeMap::new();
    for (t, v) in new.triangles.iter().enumerate() {
        for f in 0..3 {
            let directed = (v[(f + 1) % 3], v[(f + 2) % 3]);
            behind.insert(directed, Neighbour::new(TriangleId(t as u32), f));
        }
    }
    for v in &new.triangles {
        let next = |f: usize| behind.get(&(v[(f + 2) % 3], v[(f + 1) % 3]));
        new.neighbours
            .push([0, 1, 2].map(|f| next(f).copied().unwrap_or(Neighbour::BOUNDARY)));
    }
    new
}

fn arrays(mesh: &Mesh) -> Arrays {
    Arrays {
        points: mesh.points().to_vec(),
        triangles: mesh.triangles().to_vec(),
        neighbours: mesh.neighbours().to_vec(),
        generation: mesh.generation().to_vec(),
        region: mesh.region().to_vec(),
        boundary: mesh.boundary().to_vec(),
        genealogy: mesh.genealogy().to_vec(),
        ..Arrays::default()
    }
}

/// Numbers that look random, the same every time.
struct Dice(u64);

impl Dice {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self
            .0
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        ((self.0 >> 33) as usize) % n
    }
}

fn compare(mut mesh: Mesh, seed: u64, rounds: usize) -> u16 {
    let mut dice = Dice(seed);
    for round in 0..rounds {
        let count = mesh.triangle_count();
        let marked: Vec<_> = (0..1 + count / [3, 9, 40][round % 3])
            .map(|_| TriangleId(dice.below(count) as u32))
            .collect();
        let children = [Children::Two, Children::Four][dice.below(2)];
        let expected = reference(&mesh, &marked, children);
        let old = arrays(&mesh);
        let (refined, info) = mesh.refined(&marked, children).expect("refines");
        assert_eq!(arrays(&mesh), old);
        let found = Arrays {
            parent: info.parent,
            split: info.split,
            ..arrays(&refined)
        };
        assert!(found == expected, "seed {seed}, round {round}");
        let bits = |a: &Arrays| {
            a.points
                .concat()
                .iter()
                .map(|x| x.to_bits())
                .collect::<Vec<_>>()
        };
        assert_eq!(bits(&found), bits(&expected));
        assert_eq!(info.old_vertices, mesh.vertex_count());
        let again = mesh.refine(&marked, children).expect("refines");
        assert_eq!(arrays(&mesh), arrays(&refined));
        assert_eq!(again.closure_steps, info.closure_steps);
    }
    mesh.genealogy()
        .iter()
        .map(|b| b.level)
        .max()
        .expect("some")
}

#[test]
fn distorted_squares_with_any_labels() {
    for seed in 0..12 {
        let mut dice = Dice(seed);
        let n = 4;
        let points: Vec<[f64; 2]> = (0..(n + 1) * (n + 1))
            .map(|i| {
                let mut shift = || 0.6 * dice.below(1000) as f64 / 1000.0;
                [
                    (i % (n + 1)) as f64 + shift(),
                    (i / (n + 1)) as f64 + shift(),
                ]
            })
            .collect();
        let mut triangles = Vec::new();
        for i in 0..n * n {
            let a = (i % n + i / n * (n + 1)) as u32;
            let (b, c, d) = (a + 1, a + n as u32 + 2, a + n as u32 + 1);
            triangles.extend([[a, b, c], [a, c, d]]);
        }
        let regions: Vec<i32> = (0..2 * n * n).map(|t| t % 5).collect();
        match Mesh::new(points, &triangles, &regions, None) {
            Ok(mesh) => assert!(compare(mesh, seed, 9) > 3),
            // A distortion may turn a triangle over.
            Err(MeshError::Overlap { .. }) => {}
            Err(error) => panic!("{error}"),
        }
    }
}

#[test]
fn a_fan_in_a_circle() {
    let circle = Circle {
        center: [0.25, -0.5],
        radius: 1.5,
    };
    for spokes in [3, 5, 8] {
        let mut points = vec![circle.center];
        points.extend((0..spokes).map(|i| {
            let angle = i as f64 / spokes as f64 * std::f64::consts::TAU;
            circle.project([0.25 + angle.cos(), -0.5 + angle.sin()])
        }));
        let triangles: Vec<_> = (0..spokes)
            .map(|i| [0, 1 + i, 1 + (i + 1) % spokes])
            .collect();
        let mesh = Mesh::new(points, &triangles, &[], Some(circle)).expect("a fan");
        assert!(compare(mesh, spokes as u64, 12) > 3);
    }
}

/// A strip of triangles, each of whose refinement edges is no refinement edge behind it: one mark splits them all, and each level follows from the next.
#[test]
fn a_chain_of_levels() {
    let points: Vec<[f64; 2]> = (0..12)
        .map(|i| {
            let x = 1.3f64.powi(i);
            [x, if i % 2 == 0 { 0.0 } else { x }]
        })
        .collect();
    let triangles: Vec<_> = (0..10).map(|i| [i, i + 1, i + 2]).collect();
    let mesh = Mesh::new(points, &triangles, &[], None).expect("a strip");
    let (refined, _) = mesh
        .refined(&[TriangleId(0)], Children::Two)
        .expect("refines");
    assert!(refined.genealogy().iter().any(|b| b.level >= 8));
    assert!(compare(mesh, 1, 9) >= 8);
}
