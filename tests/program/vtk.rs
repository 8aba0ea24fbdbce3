//! Every file of a run is read back by the real VTK, to the last bit.
//!
//! The test makes its own Python environment under the target folder (`python3 -m venv`, `pip install vtk`). Where that cannot be
//! done it says so and leaves the comparison out, unless `MEMBRANES_REQUIRE_VTK` is set.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use adapt::output::Values;
use adapt::{Level, Reason};
use serde_json::Value;

use crate::run::{config, run};

/// The Python of an environment with VTK, made on first use; `None` where it could not be made.
fn python() -> Option<&'static Path> {
    static PYTHON: OnceLock<Option<PathBuf>> = OnceLock::new();
    PYTHON
        .get_or_init(|| match environment() {
            Ok(python) => Some(python),
            Err(why) => {
                assert!(
                    std::env::var_os("MEMBRANES_REQUIRE_VTK").is_none(),
                    "VTK is required, but {why}"
                );
                // Past the capture of the test runner: this must be seen.
                let message =
                    format!("LEFT OUT: files are not read back by the real VTK, since {why}\n");
                std::io::stderr()
                    .write_all(message.as_bytes())
                    .expect("standard error");
                None
            }
        })
        .as_deref()
}

fn environment() -> Result<PathBuf, String> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("vtk-environment");
    let python = folder.join("bin/python");
    let works = || {
        let probe = Command::new(&python)
            .args(["-c", "import vtkmodules.vtkIOXML"])
            .output();
        probe.is_ok_and(|o| o.status.success())
    };
    if works() {
        return Ok(python);
    }
    let step = |command: &mut Command| -> Result<(), String> {
        let output = command
            .output()
            .map_err(|e| format!("{command:?} did not start: {e}"))?;
        let said = String::from_utf8_lossy(&output.stderr);
        let last = said.lines().last().unwrap_or("nothing said").to_owned();
        if output.status.success() {
            Ok(())
        } else {
            Err(format!("{command:?} failed: {last}"))
        }
    };
    step(
        Command::new("python3")
            .args(["-m", "venv", "--clear"])
            .arg(&folder),
    )?;
    step(Command::new(&python).args([
        "-m",
        "pip",
        "install",
        "--quiet",
        "--disable-pip-version-check",
        "vtk>=9.3,<10",
    ]))?;
    if works() {
        Ok(python)
    } else {
        Err("the environment was made, but VTK does not load in it".into())
    }
}

fn script() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/vtk/readback.py")
}

/// What `readback.py` prints, one line an entry.
fn readback(python: &Path, arguments: &[&str]) -> Vec<String> {
    let output = Command::new(python)
        .arg(script())
        .args(arguments)
        .output()
        .expect("python starts");
    assert!(
        output.status.success(),
        "{arguments:?}: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8(output.stdout)
        .expect("text")
        .lines()
        .map(str::to_owned)
        .collect()
}

/// The same scene run in this process.
fn levels(path: &Path) -> (scene::Scene, Vec<Level>) {
    let scene = scene::load(path, &[]).unwrap_or_else(|e| panic!("{e}"));
    let mut kept = Vec::new();
    let mut keep = |level: &Level, _: Option<Reason>| {
        kept.push(level.clone());
        Ok(())
    };
    adapt::run(&scene.problem, &scene.settings, &mut keep).unwrap_or_else(|e| panic!("{e}"));
    (scene, kept)
}

/// Every value of an array against the bits that VTK read.
fn same_bits(python: &Path, file: &str, array: &str, values: &[f64]) {
    let lines = readback(python, &["--dump", file, array, "--bits"]);
    assert_eq!(lines.len(), values.len(), "{file} {array}");
    for (i, (line, value)) in lines.iter().zip(values).enumerate() {
        assert_eq!(
            *line,
            format!("{:016x}", value.to_bits()),
            "{file} {array} {i}: {value:e}"
        );
    }
}

fn same_numbers(python: &Path, file: &str, array: &str, values: impl Iterator<Item = i64>) {
    let lines = readback(python, &["--dump", file, array]);
    assert_eq!(
        lines,
        values.map(|v| v.to_string()).collect::<Vec<_>>(),
        "{file} {array}"
    );
}

/// A run with every level and every edge file, as VTK reads it.
fn reads_back(name: &str, extra: &[&str]) {
    let Some(python) = python() else { return };
    let mut arguments = vec![
        "--set",
        "output.fields=\"all\"",
        "--set",
        "output.edges=true",
    ];
    arguments.extend(extra);
    let run = run(&config(name), &arguments);
    assert!(matches!(run.code, 0 | 5), "{name}: {}", run.stderr);
    let (scene, levels) = levels(&run.out.join("scene.toml"));
    let scale = scene.problem.scale;

    let series = run.out.join("series.pvd");
    let told: Vec<Value> = readback(python, &[series.to_str().expect("a path")])
        .iter()
        .map(|l| serde_json::from_str(l).expect("JSON"))
        .collect();
    assert_eq!(told.len(), levels.len() + 1, "an index and every level");
    assert_eq!(
        told[0]["series"].as_array().map(Vec::len),
        Some(levels.len())
    );
    for (told, level) in told[1..].iter().zip(&levels) {
        assert_eq!(told["points"], level.mesh.vertex_count());
        assert_eq!(told["cells"], level.mesh.triangle_count());
        assert_eq!(
            told["cell_types"]["5"],
            level.mesh.triangle_count(),
            "all triangles"
        );
        let names = |place: &str| -> Vec<String> {
            let list = told[place].as_array().expect("arrays");
            list.iter()
                .map(|a| a["name"].as_str().expect("a name").to_owned())
                .collect()
        };
        assert_eq!(
            names("point_data"),
            [
                "u1",
                "u2",
                "gap",
                "sigma",
                "action_force",
                "action",
                "contact"
            ]
        );
        assert_eq!(
            names("cell_data"),
            [
                "eta_K",
                "eta_e",
                "residual",
                "certified",
                "oscillation",
                "f1_h",
                "f2_h",
                "generation",
                "region"
            ]
        );
        assert_eq!(names("field_data"), ["level", "error_bound"]);
    }
    for level in [&levels[0], &levels[levels.len() - 1]] {
        let file = run.out.join(format!("level_{:04}.vtu", level.number));
        let file = file.to_str().expect("a path");
        let fields = adapt::recorder::fields(level, scale);
        let points = fields.points.to_vec();
        let points: Vec<f64> = points.iter().flat_map(|p| [p[0], p[1], 0.0]).collect();
        same_bits(python, file, "Points", &points);
        let corners = level
            .mesh
            .triangles()
            .iter()
            .flatten()
            .map(|v| i64::from(v.0));
        same_numbers(python, file, "connectivity", corners);
        let empty = Values::from(Vec::new());
        for (array, values) in [
            ("point:u1", &fields.u1),
            ("point:u2", &fields.u2),
            ("point:gap", &fields.gap),
            ("point:sigma", &fields.sigma),
            ("point:action_force", &fields.action_force),
            ("point:action", &fields.action),
            ("cell:eta_K", fields.eta_k.as_ref().unwrap_or(&empty)),
            ("cell:eta_e", fields.eta_e.as_ref().unwrap_or(&empty)),
            ("cell:residual", fields.residual.as_ref().unwrap_or(&empty)),
            (
                "cell:certified",
                fields.certified.as_ref().unwrap_or(&empty),
            ),
            (
                "cell:oscillation",
                fields.oscillation.as_ref().unwrap_or(&empty),
            ),
            ("cell:f1_h", &fields.f1_h),
            ("cell:f2_h", &fields.f2_h),
        ] {
            same_bits(python, file, array, &values.to_vec());
        }
        same_numbers(
            python,
            file,
            "point:contact",
            fields.contact.to_vec().into_iter().map(i64::from),
        );
        same_numbers(
            python,
            file,
            "cell:generation",
            fields.generation.to_vec().into_iter().map(i64::from),
        );
        same_numbers(
            python,
            file,
            "cell:region",
            fields.region.to_vec().into_iter().map(i64::from),
        );
        same_bits(python, file, "field:error_bound", &[fields.error_bound]);
        same_numbers(
            python,
            file,
            "field:level",
            std::iter::once(level.number as i64),
        );

        let edges = run.out.join(format!("edges_{:04}.vtp", level.number));
        let edges = edges.to_str().expect("a path");
        let paper = level.estimates.paper.as_ref().expect("computed by default");
        let physical: Vec<f64> = paper
            .eta_e
            .iter()
            .map(|&e| fem_core::scale::times_power_of_two(e, scale.force()))
            .collect();
        same_bits(python, edges, "cell:eta_e", &physical);
    }
}

#[test]
fn disk_reads_back() {
    reads_back("disk", &["--set", "stop.vertices=2000"]);
}

#[test]
fn two_diaphragms_read_back() {
    reads_back("two-diaphragms", &["--set", "stop.vertices=2000"]);
}
