//! Where errors point to, and where files are looked for.

use std::fs;
use std::path::Path;

use fem_core::Samples;
use scene::{Report, from_text, load};

fn report(text: &str, overrides: &[&str]) -> Report {
    let overrides: Vec<String> = overrides.iter().map(|set| set.to_string()).collect();
    match from_text(text, "scene.toml", Path::new(""), &overrides) {
        Ok(_) => panic!("no error in\n{text}"),
        Err(error) => error.report().clone(),
    }
}

/// Line, column and the characters above the carets.
fn place(text: &str) -> (usize, usize, String) {
    let report = report(text, &[]);
    let excerpt = report.excerpt.expect("an excerpt");
    let shown = excerpt
        .line
        .chars()
        .skip(excerpt.start)
        .take(excerpt.length)
        .collect();
    (
        report.line.expect("a line"),
        report.column.expect("a column"),
        shown,
    )
}

#[test]
fn columns_count_characters_not_bytes() {
    let text = "title = \"Größe für µ\"\n[domain.disk]\n[upper]\nload = 'x' # déjà vu\nboundary = \"x*√2\"\n";
    assert_eq!(place(text), (5, 15, "√".into()));
    let inline = "parameters = { grün = 1 }\n[domain.disk]\n";
    assert_eq!(report(inline, &[]).line, Some(1));
    let after = "domain = { disk = { } } # ééé\nmark = { strategy = \"düfler\", thetta = 1 }\n";
    assert_eq!(place(after), (2, 31, "thetta".into()));
}

#[test]
fn windows_line_ends_and_a_byte_order_mark() {
    assert_eq!(
        place("[domain.disk]\r\n[mark]\r\ntheta = 3\r\n"),
        (3, 9, "3".into())
    );
    let marked = "\u{feff}[domain.disk]\n[mark]\ntheta = 3\n";
    assert_eq!(report(marked, &[]).line, Some(3));
}

#[test]
fn places_inside_strings() {
    let text = |load: &str| format!("[domain.disk]\n[upper]\nload = {load}\n");
    assert_eq!(place(&text("'2*qq'")), (3, 11, "qq".into()));
    assert_eq!(place(&text("\"\"\"\n x +\n qq\"\"\"")), (5, 2, "qq".into()));
    assert_eq!(place(&text("\"x \\u002B qq\"")), (3, 18, "qq".into()));
    assert_eq!(place(&text("\"(x\"")), (3, 9, "(".into()));
}

#[test]
fn the_first_mistake_is_the_one_shown() {
    let text = "[domain.disk]\n[upper]\ntenson = 1\nlaod = 2\n[lower]\ntension = -1\n";
    assert_eq!(place(text), (3, 1, "tenson".into()));
}

#[test]
fn an_override_is_shown_as_it_was_typed() {
    let report = report("[domain.disk]\n", &["stop.levels=3", " mark.theta = 1.5 "]);
    assert_eq!((report.file.as_str(), report.line), ("--set", None));
    let excerpt = report.excerpt.expect("an excerpt");
    assert_eq!(
        (excerpt.line.as_str(), excerpt.start, excerpt.length),
        (" mark.theta = 1.5 ", 14, 3)
    );
}

/// Two triangles with the tags 7 and 8.
const MESH: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n$EndNodes\n\
$Elements\n2\n1 2 2 7 1 1 2 3\n2 2 2 8 1 1 3 4\n$EndElements\n";

#[test]
fn a_mesh_file_is_found_beside_the_scene_and_its_regions_are_seen() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::create_dir(folder.path().join("meshes")).expect("a folder");
    fs::write(folder.path().join("meshes/plate.msh"), MESH).expect("written");
    let path = folder.path().join("scene.toml");
    let text = "[domain.mesh]\nfile = \"meshes/plate.msh\"\n[upper]\ntension = \"if(region == 7, 2, 8)\"\nload = \"region\"\n";
    fs::write(&path, text).expect("written");
    let scene = load(&path, &[]).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(scene.problem.mesh.region(), [7, 8]);
    assert_eq!(scene.overview.tension[0], [2.0, 8.0]);
    assert_eq!(scene.problem.scale.tension, 2);
    let mut out = [0.0; 2];
    let at = Samples {
        x: &[0.5; 2],
        y: &[0.5; 2],
        region: &[7.0, 8.0],
    };
    scene.problem.tension[0]
        .sample(at, &mut out)
        .expect("positive");
    assert_eq!(out, [0.5, 2.0]);
    scene.problem.load[0].sample(at, &mut out).expect("finite");
    assert_eq!(out, [7.0 / 8.0, 1.0]);

    fs::remove_file(folder.path().join("meshes/plate.msh")).expect("removed");
    let error = load(&path, &[]).err().expect("no mesh any more");
    assert_eq!((error.report().line, error.is_reading()), (Some(2), false));
}

#[test]
fn the_text_of_a_scene_with_a_mesh_file_runs_from_another_folder() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::create_dir(folder.path().join("out")).expect("a folder");
    fs::write(folder.path().join("plate.msh"), MESH).expect("written");
    let path = folder.path().join("scene.toml");
    let text =
        |file: &str| format!("# plate\r\n[domain.mesh]\nfile =  {file} # here\n\n[upper]\nload=-1");
    let file = std::path::absolute(folder.path().join("plate.msh")).expect("a path");
    let overrides = ["domain.mesh.file=plate.msh".to_owned()];
    for (written, overrides) in [("'plate.msh'", &[][..]), ("'none.msh'", &overrides)] {
        fs::write(&path, text(written)).expect("written");
        let scene = load(&path, overrides).unwrap_or_else(|e| panic!("{e}"));
        if overrides.is_empty() {
            assert_eq!(scene.text, text(&format!("\"{}\"", file.display())));
        }
        let copy = folder.path().join("out/scene.toml");
        fs::write(&copy, &scene.text).expect("written");
        let again = load(&copy, &[]).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(again.problem.mesh.region(), [7, 8]);
        assert_eq!(again.text, scene.text);
    }
    // A text without a file of its own stays as it is.
    let scene = from_text(&text("'plate.msh'"), "scene.toml", folder.path(), &[]);
    assert_eq!(
        scene.unwrap_or_else(|e| panic!("{e}")).text,
        text("'plate.msh'")
    );
}

#[test]
fn files_that_are_no_scene() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let refused = |name: &str| {
        let error = load(&folder.path().join(name), &[])
            .err()
            .expect("an error");
        assert!(!error.is_reading());
        error.report().message.clone()
    };
    assert_eq!(refused(""), "the scene is a directory");
    assert_eq!(refused("missing.toml"), "the scene does not exist");
    fs::write(folder.path().join("binary.toml"), [0x80, 0xff, 0x00]).expect("written");
    assert_eq!(refused("binary.toml"), "the scene is not UTF-8 text");
}

#[test]
fn errors_found_by_the_loop_lead_back_to_their_key() {
    use adapt::DataError;
    use fem_core::FieldError;
    let text = "[domain.disk]\n[upper]\nload = \"1/x\"\n[exact]\nupper = 'x'\nlower = 'y'\n";
    let scene = from_text(text, "scene.toml", Path::new(""), &[]).unwrap_or_else(|e| panic!("{e}"));
    let line = |name: &str| {
        let field = FieldError {
            name: name.into(),
            value: f64::NAN,
            x: 0.0,
            y: 0.0,
        };
        let error = scene.data_error(&DataError::Field(field));
        assert!(error.report().message.contains(name));
        error.report().line
    };
    assert_eq!(line("upper.load"), Some(3));
    assert_eq!(line("d(exact.lower)/dy"), Some(6));
    assert_eq!(line("upper.tension"), Some(2));
    assert_eq!(line("lower.boundary - upper.boundary"), None);
}

#[test]
fn random_damage_to_a_scene_never_panics() {
    let text = "title = \"t\"\n[parameters]\ng = 0.05\n[domain.polygon]\nouter = [[0, 0], [1, 0], [1, 1], [0, 1]]\nsize = 5\n\
        [upper]\ntension = \"1 + x^2\"\nload = \"if(x^2 + y^2 < 0.5, -10*g, -8*g)\"\nboundary = \"g\"\n[lower]\nload = 1\n\
        [exact]\nupper = \"g*(2*x)\"\nlower = 'y'\n[solve]\ntolerance = 1e-8\n[mark]\ntheta = 0.5\n[stop]\nlevels = 3\n[output]\nfields = 2\n";
    let bytes = text.as_bytes();
    let mut state = 7u64;
    let mut random = |n: usize| {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (state >> 33) as usize % n
    };
    let pieces = [
        "", "\"", "[", "]", "=", "nan", "\n", "1e999", "-", "0", "é", "x", "\\", "{", ",",
    ];
    let mut refused = 0;
    for _ in 0..3000 {
        let mut damaged = bytes.to_vec();
        for _ in 0..1 + random(3) {
            let at = random(damaged.len());
            let until = (at + random(4)).min(damaged.len());
            damaged.splice(at..until, pieces[random(pieces.len())].bytes());
        }
        let damaged = String::from_utf8_lossy(&damaged);
        if let Err(error) = from_text(&damaged, "scene.toml", Path::new(""), &[]) {
            refused += 1;
            let shown = error.to_string();
            assert!(
                shown.starts_with("error: ") && shown.contains("\n  --> "),
                "{shown}"
            );
        }
    }
    assert!(refused > 1000, "{refused}");
}
