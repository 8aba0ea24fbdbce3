//! `membranes check`.

use adapt::output::OutputError;
use adapt::output::columns::reduction_name;
use adapt::settings::{Estimator, Final, Stop, Strategy};
use adapt::{Level, LevelError, Observer, Reason};
use contact::{Reduction, Tensions};
use scene::Scene;
use serde_json::{Value, json};

use crate::args::CheckArgs;
use crate::failure::{Failure, NUMERICAL, say};
use crate::names;
use crate::number::short;

/// Initial meshes up to this many vertices are solved, to say which model they lead to.
const SOLVED: usize = 50_000;

/// Reads a scene and says what will be modelled.
///
/// # Errors
/// Whatever is wrong with the scene.
pub fn check(arguments: &CheckArgs) -> Result<u8, Failure> {
    let scene = scene::load(&arguments.scene, &arguments.set)?;
    let first = match scene.overview.vertices <= SOLVED {
        true => Some(first_level(&scene)?),
        false => None,
    };
    say(&if arguments.json {
        object(&scene, first.as_ref()).to_string()
    } else {
        text(&scene, first.as_ref())
    })?;
    Ok(0)
}

/// Solves the initial mesh.
fn first_level(scene: &Scene) -> Result<Level, Failure> {
    struct Blind;
    impl Observer for Blind {
        fn level(&mut self, _: &Level, _: Option<Reason>) -> Result<(), OutputError> {
            Ok(())
        }
    }
    let mut settings = scene.settings.clone();
    settings.stop = Stop {
        levels: Some(1),
        ..Stop::default()
    };
    match adapt::run(&scene.problem, &settings, &mut Blind) {
        Ok(outcome) => Ok(outcome.level),
        Err(error) => Err(match error.cause {
            LevelError::Data(data) => scene.data_error(&data).into(),
            cause => Failure::new(NUMERICAL, format!("on the initial mesh: {cause}"), None),
        }),
    }
}

/// The model that the tensions alone allow: as the initial mesh saw them if it was solved, else by their samples.
fn model(scene: &Scene, first: Option<&Level>) -> Reduction {
    let overview = &scene.overview;
    let (constant, ratio) = match first.map(|first| first.discrete.tensions) {
        Some(Tensions::Constant(..)) => (true, true),
        Some(Tensions::Ratio(_)) => (false, true),
        Some(Tensions::General) => (false, false),
        None => (overview.constant_tensions, overview.constant_ratio),
    };
    match scene.settings.solve.reduce {
        true if constant => Reduction::ConstantTensions,
        true if ratio => Reduction::ConstantRatio,
        _ => Reduction::TwoField,
    }
}

fn text(scene: &Scene, first: Option<&Level>) -> String {
    let overview = &scene.overview;
    let settings = &scene.settings;
    let mut lines = Vec::new();
    let mut line = |name: &str, value: String| lines.push(format!("{name:<13} {value}"));
    if let Some(title) = &scene.title {
        line("title", title.clone());
    }
    line("domain", overview.domain.clone());
    line(
        "initial mesh",
        format!(
            "{} vertices, {} triangles, smallest angle {:.1} degrees",
            overview.vertices, overview.triangles, overview.smallest_angle
        ),
    );
    let range = |[least, largest]: [f64; 2]| match least == largest {
        true => short(least),
        false => format!("{} to {}", short(least), short(largest)),
    };
    let [upper, lower] = overview.tension.map(range);
    line("tensions", format!("upper {upper}, lower {lower}"));
    let model = model(scene, first);
    let explained = match model {
        Reduction::ConstantTensions => "one linear and one scalar obstacle problem",
        Reduction::ConstantRatio => {
            "the tensions are in a constant ratio: one linear and one scalar obstacle problem"
        }
        _ => "both membranes at once",
    };
    line("model", format!("{} ({explained})", reduction_name(model)));
    line(
        "solver",
        format!(
            "{}, tolerance {}",
            names::solver(settings.solve.solver),
            names::tolerance(settings.solve.tolerance)
        ),
    );
    if let Some(first) = first.map(|level| &level.record) {
        line(
            "",
            format!(
                "on the initial mesh: {} by {}, {} of {} vertices in contact",
                reduction_name(first.reduction),
                first.solver,
                first.contact_vertices,
                first.vertices
            ),
        );
    }
    line("estimator", estimators(scene));
    let mark = &settings.mark;
    line(
        "marking",
        match mark.strategy {
            Strategy::Uniform => "uniform".into(),
            strategy => format!(
                "{}, theta {}, children {}",
                names::strategy(strategy),
                mark.theta,
                names::children(mark.children)
            ),
        },
    );
    let rules: Vec<String> = names::rules(&settings.stop)
        .into_iter()
        .map(|(name, value)| format!("{name} {value}"))
        .collect();
    line("stop", rules.join(", "));
    line(
        "output",
        format!(
            "fields {}{}",
            names::fields(settings.output.fields),
            if settings.output.edges { ", edges" } else { "" }
        ),
    );
    lines.join("\n")
}

fn estimators(scene: &Scene) -> String {
    let estimate = &scene.settings.estimate;
    let also: Vec<&str> = estimate
        .also
        .iter()
        .filter(|also| **also != estimate.estimator)
        .map(|also| names::estimator(*also))
        .collect();
    let mut text = names::estimator(estimate.estimator).to_owned();
    if !also.is_empty() {
        text.push_str(&format!(", also {}", also.join(", ")));
    }
    if estimate.wants(Estimator::Certified) {
        text.push_str(match estimate.last {
            Final::Sharp => "; the last certificate sharp",
            Final::Fast => "; the last certificate fast",
        });
    }
    if scene.overview.exact {
        text.push_str("; true errors");
    }
    text
}

fn object(scene: &Scene, first: Option<&Level>) -> Value {
    let overview = &scene.overview;
    let settings = &scene.settings;
    let also: Vec<&str> = settings
        .estimate
        .also
        .iter()
        .map(|also| names::estimator(*also))
        .collect();
    let stop: serde_json::Map<String, Value> = names::rules(&settings.stop)
        .into_iter()
        .map(|(name, value)| (name.to_owned(), value))
        .collect();
    json!({
        "title": scene.title,
        "domain": overview.domain,
        "vertices": overview.vertices,
        "triangles": overview.triangles,
        "smallest_angle": overview.smallest_angle,
        "tension": { "upper": overview.tension[0], "lower": overview.tension[1] },
        "model": reduction_name(model(scene, first)),
        "solver": names::solver(settings.solve.solver),
        "tolerance": names::tolerance(settings.solve.tolerance),
        "initial_mesh": first.map(|level| &level.record).map(|first| json!({
            "reduction": reduction_name(first.reduction),
            "solver": first.solver,
            "contact_vertices": first.contact_vertices,
        })),
        "estimator": names::estimator(settings.estimate.estimator),
        "also": also,
        "final": names::last(settings.estimate.last),
        "exact": overview.exact,
        "marking": {
            "strategy": names::strategy(settings.mark.strategy),
            "theta": settings.mark.theta,
            "children": names::children(settings.mark.children),
        },
        "stop": stop,
        "output": {
            "fields": names::fields(settings.output.fields),
            "edges": settings.output.edges,
        },
    })
}
