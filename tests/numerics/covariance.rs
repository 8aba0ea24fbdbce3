//! Scaling lengths by 2^a, tensions by 4^k and loads by 2^l changes exponents and not a single digit.

use adapt::settings::{Fields, Stop};
use adapt::{Level, LevelRecord};
use fem_core::Scale;
use fem_core::scale::times_power_of_two;

use crate::cases::{configs, levels, scene};

/// Replaces the coordinates in an expression by coordinates over L.
fn over_length(expression: &str) -> String {
    let bytes = expression.as_bytes();
    let word = |b: u8| b.is_ascii_alphanumeric() || b == b'_';
    let mut result = String::new();
    for (i, c) in expression.char_indices() {
        let inside = |at: Option<usize>| at.and_then(|at| bytes.get(at)).is_some_and(|&b| word(b));
        let alone = !inside(i.checked_sub(1)) && !inside(Some(i + 1));
        match c {
            'x' | 'y' if alone => result.push_str(&format!("({c}/L)")),
            _ => result.push(c),
        }
    }
    result
}

/// The scene of a config in other units: every expression wrapped, every coordinate multiplied.
fn rescaled(name: &str, domain: &str, a: i32, k: i32, l: i32) -> scene::Scene {
    let text = std::fs::read_to_string(configs().join(format!("{name}.toml"))).expect("a scene");
    let power = |e: i32| format!("{:e}", times_power_of_two(1.0, e));
    let mut result = String::new();
    let parameters = [
        ("L", a),
        ("M", 2 * k),
        ("F", l),
        ("U", l + 2 * a - 2 * k),
        ("G", l + 2 * a),
    ];
    let mut section = "";
    for line in text.lines() {
        if line.starts_with('[') {
            section = line.trim();
            match section {
                "[parameters]" => continue,
                "[upper]" => {
                    let own = if name == "disk" { "g = 0.05\n" } else { "" };
                    result.push_str(&format!("[parameters]\n{own}"));
                    parameters
                        .iter()
                        .for_each(|(p, e)| result.push_str(&format!("{p} = {}\n", power(*e))));
                }
                s if s.starts_with("[domain") => {
                    result.push_str(domain);
                    continue;
                }
                _ => {}
            }
        }
        if section.starts_with("[domain") || section == "[parameters]" {
            continue;
        }
        let unit = |key: &str| match (section, key) {
            (_, "tension") => Some("M"),
            (_, "load") | ("[exact]", "action") => Some("F"),
            (_, "boundary") | ("[exact]", "upper") | ("[exact]", "lower") => Some("U"),
            ("[exact]", "sigma") => Some("G"),
            ("[exact]", "contact") => Some("1"),
            _ => None,
        };
        match line
            .split_once(" = ")
            .map(|(key, value)| (key, value, unit(key)))
        {
            Some((key, value, Some(unit))) => {
                let value = over_length(value.trim_matches('"'));
                result.push_str(&format!("{key} = \"{unit}*({value})\"\n"));
            }
            _ => result.push_str(&format!("{line}\n")),
        }
    }
    scene(&result)
}

fn run(scene: &scene::Scene) -> Vec<Level> {
    let mut settings = scene.settings.clone();
    settings.stop = Stop {
        vertices: Some(1500),
        ..Stop::default()
    };
    settings.output.fields = Fields::None;
    levels(&scene.problem, &settings)
}

fn same_bits(what: &str, a: &[f64], b: &[f64]) {
    assert_eq!(a.len(), b.len(), "{what}");
    if let Some(i) = (0..a.len()).find(|&i| a[i].to_bits() != b[i].to_bits()) {
        panic!("{what} {i}: {:e} against {:e}", a[i], b[i]);
    }
}

fn same_level(what: &str, a: &Level, b: &Level) {
    for i in 0..2 {
        same_bits(
            &format!("{what} u{}", i + 1),
            &a.solution.displacement[i],
            &b.solution.displacement[i],
        );
    }
    same_bits(&format!("{what} z"), &a.solution.force, &b.solution.force);
    same_bits(
        &format!("{what} sigma"),
        &a.solution.sigma,
        &b.solution.sigma,
    );
    assert_eq!(a.solution.contact, b.solution.contact, "{what}");
    let (p, q) = (
        a.estimates.paper.as_ref().expect("paper"),
        b.estimates.paper.as_ref().expect("paper"),
    );
    same_bits(&format!("{what} eta_K"), &p.eta_k, &q.eta_k);
    same_bits(&format!("{what} eta_e"), &p.eta_e, &q.eta_e);
    assert_eq!(a.estimates.global_bound, b.estimates.global_bound, "{what}");
    assert_eq!(a.estimates.contact_set, b.estimates.contact_set, "{what}");
    let (p, q) = (
        a.estimates.residual.as_ref().expect("residual"),
        b.estimates.residual.as_ref().expect("residual"),
    );
    same_bits(&format!("{what} residual"), p.squares(), q.squares());
    let (p, q) = (
        a.estimates.errors.as_ref().expect("exact"),
        b.estimates.errors.as_ref().expect("exact"),
    );
    same_bits(
        &format!("{what} error"),
        &p.energy_squared,
        &q.energy_squared,
    );
    for i in 0..2 {
        same_bits(
            &format!("{what} H1 error"),
            &p.displacement_squared[i],
            &q.displacement_squared[i],
        );
    }
}

/// The numbers a user sees: the same but for the power of two, wherever both are in the range of a double.
fn same_record(what: &str, plain: &LevelRecord, other: &LevelRecord, by: Scale) {
    let pairs = |r: &LevelRecord| {
        [
            (Some(r.contact_area), by.area()),
            (Some(r.energy), by.energy()),
            (Some(r.energy_norm), by.energy_norm()),
            (r.eta_k, by.force()),
            (r.eta_e_sum, by.force()),
            (r.residual, by.energy_norm()),
            (r.certified, by.energy_norm()),
            (r.eta_alg, by.energy_norm()),
            (Some(r.oscillation), by.force()),
            (r.relative_bound, 0),
            (r.true_error, by.energy_norm()),
            (r.effectivity, 0),
            (r.sigma_error, by.force()),
            (r.h1_error, by.displacement()),
            (r.contact_area_error, by.area()),
            (r.contact_jaccard, 0),
            (r.contact_hausdorff, by.length),
            (Some(r.contact_force), by.force()),
            (Some(r.max_action), by.load),
            (Some(r.smallest_gap), by.displacement()),
        ]
    };
    for (n, ((a, exponent), (b, _))) in pairs(plain).into_iter().zip(pairs(other)).enumerate() {
        let expected = a.map(|a| times_power_of_two(a, exponent));
        let representable = expected.is_none_or(|e| e == 0.0 || e.is_normal());
        assert!(
            !representable || expected == b,
            "{what} number {n}: {a:?} {exponent} {b:?}"
        );
    }
    assert_eq!(plain.kkt_residual, other.kkt_residual, "{what}");
}

fn covariant(name: &str, domain: impl Fn(f64) -> String) {
    let plain = rescaled(name, &domain(1.0), 0, 0, 0);
    let reference = run(&plain);
    assert!(reference.len() >= 3);
    let (mut tried, s) = (0, plain.problem.scale);
    for a in [-200, -3, 5, 200] {
        for k in [-100, 2, 100] {
            for l in [-300, 7, 300] {
                let what = format!("{name} 2^{a} 4^{k} 2^{l}");
                let other = rescaled(name, &domain(times_power_of_two(1.0, a)), a, k, l);
                let by = Scale {
                    length: a,
                    tension: 2 * k,
                    load: l,
                };
                let t = other.problem.scale;
                assert_eq!(
                    (t.length, t.tension, t.load),
                    (s.length + a, s.tension + 2 * k, s.load + l),
                    "{what}"
                );
                let found = run(&other);
                assert_eq!(found.len(), reference.len(), "{what}");
                for (x, y) in reference.iter().zip(&found) {
                    same_level(&format!("{what} level {}", x.number), x, y);
                    same_record(
                        &format!("{what} level {}", x.number),
                        &x.record,
                        &y.record,
                        by,
                    );
                }
                tried += 1;
            }
        }
    }
    assert_eq!(tried, 36);
}

#[test]
fn disk() {
    covariant("disk", |l| {
        format!(
            "[domain.disk]\ncenter = [0.0, 0.0]\nradius = {l:e}\nsize = {:e}\n",
            0.25 * l
        )
    });
}

#[test]
fn square() {
    covariant("square", |l| {
        format!(
            "[domain.rectangle]\nlower = [-{l:e}, -{l:e}]\nupper = [{l:e}, {l:e}]\nsize = {:e}\n",
            0.25 * l
        )
    });
}

#[test]
fn tension_jump() {
    covariant("tension-jump", |l| {
        format!(
            "[domain.polygon]\nouter = [[-{l:e}, -{l:e}], [{l:e}, -{l:e}], [{l:e}, {l:e}], [-{l:e}, {l:e}]]\n\
             lines = [[[0, -{l:e}], [0, {l:e}]]]\nsize = {:e}\n",
            0.25 * l
        )
    });
}
