//! From the tree of values to [`SceneFile`]: known keys, types and names; nothing is evaluated.

use adapt::settings::{Estimator, Fields as NamedFields, Final, Strategy};
use contact::Solver;

use crate::reader::{Section, boolean, choice, list, not_in_this_version, number, point, text};
use crate::source::{At, Fault, Place};
use crate::tree::{Entry, Node, Value};
use crate::types::{
    Estimate, Exact, Fields, Mark, Membrane, Number, Output, Parameter, Point, SceneFile, Shape,
    Solve, Stop,
};

/// Keys and sections at the top of a file.
const TOP: [&str; 11] = [
    "title",
    "parameters",
    "domain",
    "upper",
    "lower",
    "exact",
    "solve",
    "estimate",
    "mark",
    "stop",
    "output",
];
/// Kinds of domain.
const SHAPES: [&str; 4] = ["rectangle", "disk", "polygon", "mesh"];

/// Names of the estimators; those without a value come later.
const ESTIMATORS: [(&str, Option<Estimator>); 3] = [
    ("certified", Some(Estimator::Certified)),
    ("residual", Some(Estimator::Residual)),
    ("paper", Some(Estimator::Paper)),
];

/// Decodes a scene.
pub(crate) fn scene(entries: &[Entry]) -> Result<SceneFile, Fault> {
    let top = Section::new("", entries, &TOP)?;
    let title = top.get("title", text)?.map(|title| title.value);
    Ok(SceneFile {
        title,
        parameters: parameters(&top)?,
        domain: domain(&top)?,
        membranes: [membrane(&top, "upper")?, membrane(&top, "lower")?],
        exact: exact(&top)?,
        solve: solve(&top)?,
        estimate: estimate(&top)?,
        mark: mark(&top)?,
        stop: stop(&top)?,
        output: output(&top)?,
    })
}

fn parameters(top: &Section<'_>) -> Result<Vec<Parameter>, Fault> {
    let entries = top.below("parameters")?.unwrap_or_default();
    entries
        .iter()
        .map(|entry| {
            let name = At {
                value: entry.key.clone(),
                place: entry.key_place.clone(),
            };
            let path = format!("parameters.{}", entry.key);
            let value = At {
                value: number(&entry.node, &path)?,
                place: entry.node.place.clone(),
            };
            Ok(Parameter { name, value })
        })
        .collect()
}

fn domain(top: &Section<'_>) -> Result<At<Shape>, Fault> {
    const HINT: &str =
        "add one of [domain.rectangle], [domain.disk], [domain.polygon], [domain.mesh]";
    let (Some(header), Some(entries)) = (top.entry("domain"), top.below("domain")?) else {
        return Err(Fault::nowhere("the scene has no domain").hint(HINT));
    };
    Section::new("domain", entries, &SHAPES)?;
    let entry = match entries {
        [] => return Err(Fault::at(&header.key_place, "the scene has no domain").hint(HINT)),
        [entry] => entry,
        [first, second, ..] => {
            let message = format!(
                "the scene has two domains, [domain.{}] and [domain.{}]",
                first.key, second.key
            );
            return Err(Fault::at(&second.key_place, message).hint("keep one of them"));
        }
    };
    let Some(keys) = Section::new("domain", entries, &SHAPES)?.below(&entry.key)? else {
        return Err(Fault::at(&header.key_place, "the scene has no domain").hint(HINT));
    };
    let place = &entry.key_place;
    let shape = match entry.key.as_str() {
        "rectangle" => {
            let section = Section::new("domain.rectangle", keys, &["lower", "upper", "size"])?;
            Shape::Rectangle {
                lower: section.get("lower", point)?,
                upper: section.get("upper", point)?,
                size: section.get("size", number)?,
            }
        }
        "disk" => {
            let section = Section::new("domain.disk", keys, &["center", "radius", "size"])?;
            Shape::Disk {
                center: section.get("center", point)?,
                radius: section.get("radius", number)?,
                size: section.get("size", number)?,
            }
        }
        "polygon" => polygon(keys, place)?,
        _ => {
            let section = Section::new("domain.mesh", keys, &["file"])?;
            let hint = "name a Gmsh file: `file = \"plate.msh\"`";
            Shape::Mesh {
                file: section.require("file", place, hint, text)?,
            }
        }
    };
    Ok(At {
        value: shape,
        place: place.clone(),
    })
}

fn polygon(keys: &[Entry], place: &Place) -> Result<Shape, Fault> {
    let section = Section::new("domain.polygon", keys, &["outer", "holes", "lines", "size"])?;
    let points = |node: &Node, path: &str| -> Result<Vec<At<Point>>, Fault> {
        list(node, path, "points `[x, y]`", point)
    };
    let many = |key: &str| -> Result<Vec<At<Vec<At<Point>>>>, Fault> {
        let read = |node: &Node, path: &str| list(node, path, "point lists", points);
        Ok(section
            .get(key, read)?
            .map(|at| at.value)
            .unwrap_or_default())
    };
    let hint = "list its vertices: `outer = [[0, 0], [1, 0], [0, 1]]`";
    Ok(Shape::Polygon {
        outer: section.require("outer", place, hint, points)?,
        holes: many("holes")?,
        lines: many("lines")?,
        size: section.get("size", number)?,
    })
}

fn membrane(top: &Section<'_>, name: &str) -> Result<Membrane, Fault> {
    let entries = top.below(name)?.unwrap_or_default();
    let section = Section::new(name, entries, &["tension", "load", "boundary"])?;
    Ok(Membrane {
        place: top.entry(name).map(|entry| entry.key_place.clone()),
        tension: section.get("tension", number)?,
        load: section.get("load", number)?,
        boundary: section.get("boundary", number)?,
    })
}

fn exact(top: &Section<'_>) -> Result<Option<Exact>, Fault> {
    let (Some(header), Some(entries)) = (top.entry("exact"), top.below("exact")?) else {
        return Ok(None);
    };
    let known = ["upper", "lower", "action", "sigma", "contact"];
    let section = Section::new("exact", entries, &known)?;
    let hint = "an exact solution needs both `upper` and `lower`";
    let both = |key: &str| section.require(key, &header.key_place, hint, number);
    Ok(Some(Exact {
        displacement: [both("upper")?, both("lower")?],
        action: section.get("action", number)?,
        sigma: section.get("sigma", number)?,
        contact: section.get("contact", number)?,
    }))
}

fn solve(top: &Section<'_>) -> Result<Solve, Fault> {
    let Some(entries) = top.below("solve")? else {
        return Ok(Solve::default());
    };
    let section = Section::new("solve", entries, &["solver", "tolerance", "reduction"])?;
    let solvers = [
        ("auto", Some(Solver::Auto)),
        ("clarabel", Some(Solver::Clarabel)),
        ("active-set", Some(Solver::ActiveSet)),
        ("multigrid", Some(Solver::Multigrid)),
    ];
    let reductions = [("auto", Some(true)), ("off", Some(false))];
    let tolerance = section
        .get("tolerance", number)?
        .filter(|at| at.value != Number::Formula("balanced".into()));
    Ok(Solve {
        solver: section
            .get("solver", |node, path| choice(node, path, &solvers))?
            .map(|at| at.value),
        tolerance,
        reduction: section
            .get("reduction", |node, path| choice(node, path, &reductions))?
            .map(|at| at.value),
    })
}

fn estimate(top: &Section<'_>) -> Result<Estimate, Fault> {
    let Some(entries) = top.below("estimate")? else {
        return Ok(Estimate::default());
    };
    let section = Section::new("estimate", entries, &["estimator", "also", "final"])?;
    let name = |node: &Node, path: &str| choice(node, path, &ESTIMATORS);
    let names = |node: &Node, path: &str| list(node, path, "estimator names", name);
    let certificates = [("sharp", Some(Final::Sharp)), ("fast", Some(Final::Fast))];
    let last = section.get("final", |node, path| choice(node, path, &certificates))?;
    Ok(Estimate {
        last: last.map(|at| at.value),
        estimator: section.get("estimator", name)?.map(|at| at.value),
        also: section
            .get("also", names)?
            .map(|at| at.value.into_iter().map(|name| name.value).collect()),
    })
}

fn mark(top: &Section<'_>) -> Result<Mark, Fault> {
    let Some(entries) = top.below("mark")? else {
        return Ok(Mark::default());
    };
    let section = Section::new("mark", entries, &["strategy", "theta", "children"])?;
    let strategies = [
        ("doerfler", Some(Strategy::Doerfler)),
        ("maximum", Some(Strategy::Maximum)),
        ("uniform", Some(Strategy::Uniform)),
    ];
    Ok(Mark {
        strategy: section
            .get("strategy", |node, path| choice(node, path, &strategies))?
            .map(|at| at.value),
        theta: section.get("theta", number)?,
        children: section.get("children", number)?,
    })
}

fn stop(top: &Section<'_>) -> Result<Stop, Fault> {
    let Some(entries) = top.below("stop")? else {
        return Ok(Stop::default());
    };
    let known = ["relative_error", "error", "vertices", "levels", "seconds"];
    let section = Section::new("stop", entries, &known)?;
    Ok(Stop {
        relative_error: section.get("relative_error", number)?,
        error: section.get("error", number)?,
        vertices: section.get("vertices", number)?,
        levels: section.get("levels", number)?,
        seconds: section.get("seconds", number)?,
    })
}

fn output(top: &Section<'_>) -> Result<Output, Fault> {
    let Some(entries) = top.below("output")? else {
        return Ok(Output::default());
    };
    let section = Section::new("output", entries, &["fields", "compression", "edges"])?;
    if let Some(at) = section.get("compression", boolean)?
        && at.value
    {
        return Err(not_in_this_version(&at.place, "output.compression", "true"));
    }
    Ok(Output {
        fields: section.get("fields", fields)?,
        edges: section.get("edges", boolean)?,
    })
}

fn fields(node: &Node, path: &str) -> Result<Fields, Fault> {
    let named = match &node.value {
        Value::Text(text) => match text.as_str() {
            "all" => Some(NamedFields::All),
            "last" => Some(NamedFields::Last),
            "none" => Some(NamedFields::None),
            _ => None,
        },
        _ => None,
    };
    Ok(match named {
        Some(named) => Fields::Named(named),
        None => Fields::Every(number(node, path)?),
    })
}
