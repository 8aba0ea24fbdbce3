//! Every scene in `configs/` runs to its goal and gives the numbers that are known of it.

use std::f64::consts::PI;

use crate::run::{Run, config, run};

struct Known {
    name: &'static str,
    reduction: &'static str,
    /// Exact contact area and total contact force, with the relative distance allowed at the scene's accuracy.
    area: Option<(f64, f64)>,
    force: Option<(f64, f64)>,
    /// Bound over true error.
    effectivity: Option<(f64, f64)>,
    /// Whether the bound is proved: heights affine along the edges, a domain with straight sides.
    guaranteed: bool,
}

const KNOWN: [Known; 6] = [
    Known {
        name: "disk",
        reduction: "constant-tensions",
        area: Some((0.5 * PI, 0.05)),
        force: Some((0.05 * PI, 0.01)),
        effectivity: Some((1.0, 1.1)),
        guaranteed: false,
    },
    Known {
        name: "square",
        reduction: "constant-tensions",
        area: Some((0.25 * PI, 0.08)),
        force: Some((0.625 * PI, 0.01)),
        effectivity: Some((1.0, 1.1)),
        guaranteed: true,
    },
    Known {
        name: "lshape",
        reduction: "constant-tensions",
        area: Some((PI / 16.0, 0.15)),
        force: Some((0.078125 * PI, 0.02)),
        effectivity: Some((1.0, 1.1)),
        guaranteed: true,
    },
    Known {
        name: "full-contact",
        reduction: "full-contact",
        area: Some((4.0, 0.1)),
        force: Some((32.0 / 3.0, 0.02)),
        effectivity: Some((1.0, 1.1)),
        guaranteed: true,
    },
    Known {
        name: "no-contact",
        reduction: "no-contact",
        area: Some((0.0, 0.0)),
        force: Some((0.0, 0.0)),
        effectivity: Some((1.0, 1.1)),
        guaranteed: true,
    },
    Known {
        name: "tension-jump",
        reduction: "constant-ratio",
        // The contact force is a 1e-4 part of the load: the contact set is found late.
        area: Some((0.16 * PI, 0.6)),
        force: None,
        effectivity: Some((1.0, 1.1)),
        guaranteed: true,
    },
];

fn number(run: &Run, key: &str) -> f64 {
    run.summary()[key]
        .as_f64()
        .unwrap_or_else(|| panic!("no number `{key}`"))
}

fn near(what: &str, found: f64, (exact, relative): (f64, f64)) {
    println!("{what}: {found} against {exact}");
    assert!(
        (found - exact).abs() <= relative * exact.abs(),
        "{what}: {found} against {exact}"
    );
}

#[test]
fn scenes_with_known_solutions() {
    for known in KNOWN {
        let name = known.name;
        let run = run(&config(name), &[]);
        assert_eq!(run.code, 0, "{name}: {}", run.stderr);
        let summary = run.summary();
        assert_eq!(summary["outcome"], "goal", "{name}");
        assert_eq!(summary["stopped_by"], "relative_error", "{name}");
        assert_eq!(summary["reduction"], known.reduction, "{name}");
        if let Some(area) = known.area {
            near(&format!("{name} area"), number(&run, "contact_area"), area);
        }
        if let Some(force) = known.force {
            near(
                &format!("{name} force"),
                number(&run, "contact_force"),
                force,
            );
        }
        if let Some((low, high)) = known.effectivity {
            let effectivity = number(&run, "effectivity");
            println!("{name} effectivity: {effectivity}");
            assert!((low..high).contains(&effectivity), "{name}: {effectivity}");
        }
        assert_eq!(summary["bound_kind"], "rt1", "{name}");
        let relative = number(&run, "relative_bound");
        assert!(relative <= 0.03, "{name}: {relative}");
        let certificate = &summary["certificate"];
        assert_eq!(certificate["bound"], summary["error_bound"], "{name}");
        assert_eq!(
            certificate["guaranteed"], known.guaranteed,
            "{name}: {certificate}"
        );
        // A direct method goes to rounding, multigrid as far as the bound needs.
        let algebraic = number(&run, "eta_alg") / number(&run, "error_bound");
        if summary["solver"] == "multigrid" {
            assert!(algebraic <= 0.01, "{name}: {algebraic}");
        } else {
            assert!(number(&run, "kkt_residual") <= 1e-12, "{name}");
            assert!(algebraic <= 1e-8, "{name}: {algebraic}");
        }
        assert!(number(&run, "smallest_gap") >= 0.0, "{name}");
    }
}

#[test]
fn two_diaphragms_under_pressure() {
    let run = run(&config("two-diaphragms"), &[]);
    assert_eq!(run.code, 0, "{}", run.stderr);
    let summary = run.summary();
    assert_eq!(summary["outcome"], "goal");
    assert_eq!(summary["reduction"], "two-field");
    // No closed solution: the numbers are those of the same scene at a goal of 3 % (`--set stop.relative_error=0.03 --set stop.vertices=1000000`).
    near(
        "contact area",
        number(&run, "contact_area"),
        (FINE_AREA, 0.05),
    );
    near(
        "contact force",
        number(&run, "contact_force"),
        (FINE_FORCE, 0.02),
    );
    assert!(number(&run, "smallest_gap") >= 0.0);
    // Balance: the diaphragms cannot push each other harder than the pressure pushes the upper one.
    assert!(number(&run, "max_action") > 0.0);
}

const FINE_AREA: f64 = 1.361e-3;
const FINE_FORCE: f64 = 0.5417;
