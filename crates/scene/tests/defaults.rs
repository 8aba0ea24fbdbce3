//! What a scene means where it says nothing, and how values may be written.

use std::path::Path;

use adapt::settings::{Children, Estimator, Fields, Final, Stop, Strategy};
use contact::{Solver, Tolerance};
use scene::{Scene, from_text};

fn built(text: &str) -> Scene {
    with(text, &[])
}

fn with(text: &str, overrides: &[&str]) -> Scene {
    let overrides: Vec<String> = overrides.iter().map(|set| set.to_string()).collect();
    from_text(text, "scene.toml", Path::new(""), &overrides).unwrap_or_else(|e| panic!("{e}"))
}

const DISK: &str = "[domain.disk]\n";

#[test]
fn a_scene_with_nothing_but_a_domain() {
    let scene = built(DISK);
    assert_eq!(scene.title, None);
    let settings = &scene.settings;
    assert_eq!(settings.solve.solver, Solver::Auto);
    assert_eq!(settings.solve.tolerance, Tolerance::Balanced);
    assert!(settings.solve.reduce);
    assert_eq!(settings.estimate.estimator, Estimator::Certified);
    assert_eq!(settings.estimate.last, Final::Sharp);
    assert_eq!(
        settings.estimate.also,
        [Estimator::Paper, Estimator::Residual]
    );
    assert_eq!(settings.mark.strategy, Strategy::Doerfler);
    assert_eq!(
        (settings.mark.theta, settings.mark.children),
        (0.5, Children::Four)
    );
    let stop = Stop {
        relative_error: Some(0.01),
        vertices: Some(1_000_000),
        ..Stop::default()
    };
    assert_eq!(settings.stop, stop);
    assert_eq!(
        (settings.output.fields, settings.output.edges),
        (Fields::Last, false)
    );
    let problem = &scene.problem;
    assert!(problem.exact.is_none());
    assert_eq!(problem.tension[0].constant(), Some(1.0));
    assert_eq!(problem.load[1].constant(), Some(0.0));
    assert_eq!(problem.height[0].constant(), Some(0.0));
    // Radius 1 about the origin, size a fifth of the diameter: 8 * 4^2 triangles, held in units of 2.
    assert_eq!(scene.overview.triangles, 128);
    assert_eq!(problem.scale.length, 1);
    let circle = problem.mesh.curve().expect("a circle");
    assert_eq!((circle.center, circle.radius), ([0.0, 0.0], 0.5));
    assert!((20.0..46.0).contains(&scene.overview.smallest_angle));
}

#[test]
fn the_default_rectangle() {
    let scene = built("[domain.rectangle]\n");
    // Diameter 2 sqrt(2), size 0.566: 4 x 4 cells.
    assert_eq!(scene.overview.triangles, 32);
    assert_eq!(scene.overview.domain, "rectangle from (-1, -1) to (1, 1)");
    assert!((scene.overview.smallest_angle - 45.0).abs() < 1e-9);
}

#[test]
fn the_default_size_of_a_polygon() {
    let default = built("[domain.polygon]\nouter = [[0, 0], [3, 0], [3, 4], [0, 4]]\n");
    let fifth = built("[domain.polygon]\nouter = [[0, 0], [3, 0], [3, 4], [0, 4]]\nsize = 1.0\n");
    assert_eq!(default.overview, fifth.overview);
}

#[test]
fn one_stop_rule_is_the_only_one() {
    let stop = built("[domain.disk]\n[stop]\nlevels = 3\n").settings.stop;
    let only = Stop {
        levels: Some(3),
        ..Stop::default()
    };
    assert_eq!(stop, only);
    let empty = built("[domain.disk]\n[stop]\n").settings.stop;
    assert_eq!(empty.relative_error, Some(0.01));
}

#[test]
fn numbers_may_be_expressions_or_whole_floats() {
    let scene = built(
        "[parameters]\nr = 3\nhalf = \"1/2\"\nboth = \"r*half\"\n\
         [domain.disk]\ncenter = [\"half\", -1]\nradius = \"2*both\"\nsize = \"r\"\n\
         [mark]\ntheta = \"half\"\nchildren = \"4/2\"\n\
         [solve]\ntolerance = \"10^-9\"\n\
         [stop]\nvertices = 1e6\nlevels = \"2^4\"\nseconds = 60\n\
         [output]\nfields = \"1 + 1\"\n",
    );
    assert_eq!(scene.overview.domain, "disk of radius 3 about (0.5, -1)");
    assert_eq!(
        (scene.settings.mark.theta, scene.settings.mark.children),
        (0.5, Children::Two)
    );
    assert_eq!(scene.settings.solve.tolerance, Tolerance::Relative(1e-9));
    assert_eq!(scene.settings.stop.vertices, Some(1_000_000));
    assert_eq!(scene.settings.stop.levels, Some(16));
    assert_eq!(scene.settings.output.fields, Fields::Every(2));
}

#[test]
fn every_name_of_a_setting() {
    let scene = built(
        "title = \"all\"\n[domain.disk]\n[solve]\nsolver = \"active-set\"\ntolerance = \"balanced\"\nreduction = \"off\"\n\
         [estimate]\nestimator = \"paper\"\nalso = []\nfinal = \"fast\"\n\
         [mark]\nstrategy = \"maximum\"\n[output]\nfields = \"none\"\ncompression = false\nedges = true\n",
    );
    let settings = &scene.settings;
    assert_eq!(scene.title.as_deref(), Some("all"));
    assert_eq!(settings.solve.solver, Solver::ActiveSet);
    assert!(!settings.solve.reduce);
    assert_eq!(settings.estimate.estimator, Estimator::Paper);
    assert!(settings.estimate.also.is_empty());
    assert_eq!(settings.mark.strategy, Strategy::Maximum);
    assert!(settings.output.edges);
    assert_eq!(settings.output.fields, Fields::None);
}

#[test]
fn overrides_win_and_stand_in_the_text() {
    let text = "# head\n[domain.disk]\nradius = 2 # metres\n\n[parameters]\na = 1\nb = \"2*a\"\n\n[mark]\ntheta = \"b/8\"\n";
    let sets = [
        "domain.disk.radius=1",
        "parameters.a=2",
        "stop.levels=7",
        "output.fields=all",
        "parameters.c=b",
    ];
    let scene = with(text, &sets);
    assert_eq!(scene.overview.domain, "disk of radius 1 about (0, 0)");
    assert_eq!(scene.settings.mark.theta, 0.5);
    assert_eq!(scene.settings.stop.levels, Some(7));
    assert_eq!(scene.settings.output.fields, Fields::All);
    assert!(
        scene
            .text
            .starts_with("# head\n[domain.disk]\nradius = 1 # metres\n"),
        "{}",
        scene.text
    );
    // The text is a scene that means the same.
    let again = built(&scene.text);
    assert_eq!(again.settings, scene.settings);
    assert_eq!(again.overview, scene.overview);
    assert_eq!(again.text, scene.text);
    // The last of two wins.
    assert_eq!(
        with(DISK, &["stop.levels=1", "stop.levels=2"])
            .settings
            .stop
            .levels,
        Some(2)
    );
    // Without overrides not a byte changes.
    assert_eq!(built(text).text, text);
}

#[test]
fn models_are_told_apart() {
    let overview = |upper: &str, lower: &str| {
        let text = format!(
            "[domain.disk]\n[upper]\ntension = \"{upper}\"\n[lower]\ntension = \"{lower}\"\n"
        );
        let overview = built(&text).overview;
        (overview.constant_tensions, overview.constant_ratio)
    };
    assert_eq!(overview("1", "2"), (true, true));
    assert_eq!(overview("2 + x", "3*(2 + x)"), (false, true));
    assert_eq!(overview("2 + x", "2 + y"), (false, false));
}
