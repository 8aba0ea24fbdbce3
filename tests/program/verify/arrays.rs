//! Changed fields and meshes, with checksums that fit: refused, and for the right reason.

use super::folder::Copy;
use super::{LAST, found, random, said, vertices};
use crate::run::{config, run};

#[test]
fn nodal_values() {
    for (array, factor) in [("u1", 1.0 + 1e-8), ("u2", 1.0 - 1e-8), ("u1", 1.001)] {
        let change = |c: &Copy| {
            let (open, _) = vertices(c);
            let mut moved = 0.0;
            c.reals(LAST, array, |u| {
                moved = u[open] * (factor - 1.0);
                u[open] *= factor;
            });
            let sign = if array == "u1" { 1.0 } else { -1.0 };
            c.reals(LAST, "gap", |w| w[open] += sign * moved);
        };
        found(array, change, &["`kkt_residual` is"]);
    }
    let largest = |v: &[f64]| {
        (0..v.len())
            .max_by(|&i, &j| v[i].total_cmp(&v[j]))
            .expect("one")
    };
    let change = |c: &Copy| {
        c.reals(LAST, "sigma", |s| {
            let j = largest(s);
            s[j] *= 1.0 + 1e-9;
        });
    };
    found(
        "sigma",
        change,
        &["`action_force = (grad sigma, grad phi_j)` at vertex"],
    );
    let change = |c: &Copy| {
        c.reals(LAST, "sigma", |s| {
            s.iter_mut().for_each(|s| *s *= 1.0 + 3e-9)
        });
    };
    found("all of sigma", change, &["`sigma`: it is wrong by"]);
    let change = |c: &Copy| {
        let (_, closed) = vertices(c);
        c.reals(LAST, "action_force", |z| z[closed] *= 1.0 + 1e-6);
        c.reals(LAST, "action", |l| l[closed] *= 1.0 + 1e-6);
    };
    found(
        "action_force",
        change,
        &["`kkt_residual` is", "`contact_force` is"],
    );
    let change = |c: &Copy| {
        let (_, closed) = vertices(c);
        c.reals(LAST, "action", |l| l[closed] *= 1.0 + 1e-6);
    };
    found("action", change, &["`action` at vertex"]);
    let change = |c: &Copy| {
        let (open, _) = vertices(c);
        c.reals(LAST, "gap", |w| w[open] *= 1.0 + 1e-12);
    };
    found("gap", change, &["`gap` at vertex"]);
}

#[test]
fn signs_zeros_and_boundary_values() {
    let change = |c: &Copy| {
        let (_, closed) = vertices(c);
        c.integer::<1>(LAST, "contact", closed, 0);
    };
    found(
        "out of contact",
        change,
        &[
            "`action_force = 0 without contact`",
            "`contact_vertices` is",
        ],
    );
    let change = |c: &Copy| {
        let (open, _) = vertices(c);
        c.integer::<1>(LAST, "contact", open, 1);
    };
    found(
        "into contact",
        change,
        &["`gap = 0 in contact`", "`contact_area` is"],
    );
    let change = |c: &Copy| {
        let (open, _) = vertices(c);
        c.integer::<1>(LAST, "contact", open, 2);
    };
    found("a third kind", change, &["`contact is 0 or 1`"]);
    let change = |c: &Copy| {
        let (_, closed) = vertices(c);
        c.reals(LAST, "u2", |u| u[closed] += 1e-14);
        c.reals(LAST, "gap", |w| w[closed] -= 1e-14);
    };
    found("penetration", change, &["`gap >= 0` at vertex"]);
    let change = |c: &Copy| {
        let (_, closed) = vertices(c);
        c.reals(LAST, "action_force", |z| z[closed] = -z[closed]);
    };
    found("pull", change, &["`action_force >= 0` at vertex"]);
    // The first vertex of the disk is its centre, the second lies on the circle.
    let change = |c: &Copy| {
        c.reals(LAST, "u1", |u| u[1] += 1e-10);
        c.reals(LAST, "gap", |w| w[1] += 1e-10);
    };
    found("height", change, &["`u1 on the boundary` at vertex 1 is"]);
    let change = |c: &Copy| c.reals(LAST, "sigma", |s| s[1] = 1e-10);
    found(
        "sigma at the rim",
        change,
        &["`sigma = 0 on the boundary` at vertex 1"],
    );
}

#[test]
fn local_indicators() {
    for array in ["eta_K", "eta_e", "residual", "oscillation", "f1_h", "f2_h"] {
        let change = |c: &Copy| {
            c.reals(LAST, array, |v| {
                let most = v.iter().fold(0.0f64, |m, v| m.max(v.abs()));
                let k = v.iter().position(|v| v.abs() == most).expect("one");
                v[k] *= 1.0 + 1e-8;
            });
        };
        found(array, change, &[&format!("`{array}` at triangle")]);
    }
    let change = |c: &Copy| c.reals("edges_0002.vtp", "eta_e", |v| v[5] += 1e-8);
    found("edges", change, &["`edges_0002.vtp`: `eta_e` at edge 5"]);
    let generation = |c: &Copy| c.bytes_of(LAST, "generation")[4 * 7];
    for (array, more) in [("generation", 1), ("generation", -1), ("region", 1)] {
        let change = |c: &Copy| {
            let old = if array == "region" {
                0
            } else {
                i64::from(generation(c))
            };
            c.integer::<4>(LAST, array, 7, (old + more) as u64);
        };
        found(array, change, &[&format!("`{array}` at triangle 7")]);
    }
    // An array of the level before, whole.
    let change = |c: &Copy| c.reals("level_0001.vtu", "residual", |v| v.rotate_left(1));
    found(
        "another level",
        change,
        &["`level_0001.vtu`: `residual` at triangle"],
    );
}

#[test]
fn meshes() {
    let change = |c: &Copy| {
        let (open, _) = vertices(c);
        c.reals(LAST, "Points", |p| p[3 * open] += 1e-6);
    };
    found(
        "an inner point",
        change,
        &["`kkt_residual` is", "`edges_0002.vtp`: `points`"],
    );
    // Vertex 1 is (1, 0).
    let change = |c: &Copy| c.reals(LAST, "Points", |p| p[3] += 1e-9);
    found(
        "a boundary point",
        change,
        &[
            "is on the boundary and not on the circle",
            "`vertices of the initial mesh`",
        ],
    );
    let change = |c: &Copy| c.reals(LAST, "Points", |p| p[2] = 1.0);
    found(
        "out of the plane",
        change,
        &["point 0 is not in the plane z = 0"],
    );
    let change = |c: &Copy| c.reals(LAST, "Points", |p| p[0] = f64::NAN);
    found("no number", change, &["value 0 of `Points` is NaN"]);
    let change = |c: &Copy| c.integer::<4>(LAST, "connectivity", 4, 3);
    found("a corner", change, &["`cover of the domain`"]);
    for wild in [1 << 20, 1 << 31, u64::MAX] {
        let change = |c: &Copy| c.integer::<4>(LAST, "connectivity", 4, wild);
        found("no such vertex", change, &["vertex"]);
    }
    let change = |c: &Copy| c.replace(LAST, "NumberOfPoints=\"", "NumberOfPoints=\"1");
    found("a count", change, &["instead of"]);
    let change = |c: &Copy| c.replace(LAST, "NumberOfCells=\"", "NumberOfCells=\"9999999999999999");
    found("a wild count", change, &["cells are too many"]);
    let change = |c: &Copy| c.replace(LAST, "Name=\"residual\"", "Name=\"residues\"");
    found("a name", change, &["`residues` is not known"]);
    let change = |c: &Copy| {
        c.replace(
            "edges_0002.vtp",
            "Name=\"eta_e\" format=\"binary\" RangeMin=\"",
            "Name=\"eta_e\" format=\"binary\" RangeMin=\"1",
        )
    };
    found("a range", change, &["the range beside the array `eta_e`"]);
}

#[test]
fn any_value_of_any_array() {
    // Two fields, variable tensions, a hole; adaptive, so that generations differ.
    let keys = ["stop.levels=3", "output.edges=true"];
    let arguments: Vec<&str> = keys.iter().flat_map(|key| ["--set", key]).collect();
    let run = run(&config("two-diaphragms"), &arguments);
    let honest = Copy::of(&run.out);
    assert_eq!(said(&honest), [""; 0]);
    let mut random = random();
    let refused = |what: String, change: &dyn Fn(&Copy)| {
        let copy = Copy::of(&run.out);
        change(&copy);
        copy.fit();
        let said = said(&copy);
        assert!(
            !said.is_empty() && !said[0].contains("SHA-256"),
            "{what}: {said:#?}"
        );
        println!("{what}: {}", said[0]);
    };
    for array in [
        "u1",
        "u2",
        "gap",
        "sigma",
        "action_force",
        "action",
        "eta_K",
        "eta_e",
        "residual",
        "oscillation",
        "f1_h",
        "f2_h",
        "Points",
    ] {
        let values = honest.read(LAST, array);
        let largest = values.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        // Constant loads have no oscillation at all.
        let step = if largest > 0.0 {
            2e-9 * largest
        } else {
            1e-300
        };
        for _ in 0..6 {
            let k = random(values.len());
            let change = |c: &Copy| c.reals(LAST, array, |v| v[k] += step);
            refused(format!("{array} {k}"), &change);
        }
    }
    let count = honest.read(LAST, "u1").len();
    let contact = honest.bytes_of(LAST, "contact");
    let triangles = honest.read(LAST, "f1_h").len();
    let generation = honest.bytes_of(LAST, "generation");
    for _ in 0..6 {
        let j = random(count);
        let other = u64::from(1 - contact[j]);
        refused(format!("contact {j}"), &|c| {
            c.integer::<1>(LAST, "contact", j, other)
        });
        let t = random(triangles);
        for other in [generation[4 * t] + 1, generation[4 * t] - 1] {
            let change = |c: &Copy| c.integer::<4>(LAST, "generation", t, u64::from(other));
            refused(format!("generation {t}"), &change);
        }
        let (at, other) = (random(3 * triangles), random(count) as u64);
        let before = honest.bytes_of(LAST, "connectivity");
        if before[4 * at..4 * at + 4] != other.to_le_bytes()[..4] {
            let change = |c: &Copy| c.integer::<4>(LAST, "connectivity", at, other);
            refused(format!("connectivity {at}"), &change);
        }
    }
}
