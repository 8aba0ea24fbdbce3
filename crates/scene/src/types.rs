//! A scene as it was written: every key that was given, with its place, nothing evaluated and no default filled in.

use adapt::settings::{Estimator, Final, Strategy};
use contact::Solver;

use crate::source::{At, Place};

/// A number as it was written.
#[derive(Clone, Debug, PartialEq)]
pub enum Number {
    /// A TOML number, finite.
    Value(f64),
    /// An expression in quotes.
    Formula(String),
}

/// A point as it was written.
pub type Point = [At<Number>; 2];

/// A name under `[parameters]` with its value.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// The name.
    pub name: At<String>,
    /// The value.
    pub value: At<Number>,
}

/// A scene file, decoded. Every field is a key of the file; `None` where it is not given.
#[derive(Clone, Debug)]
pub struct SceneFile {
    /// `title`.
    pub title: Option<String>,
    /// `[parameters]` in the order of the file.
    pub parameters: Vec<Parameter>,
    /// The domain.
    pub domain: At<Shape>,
    /// `[upper]` and `[lower]`.
    pub membranes: [Membrane; 2],
    /// `[exact]`.
    pub exact: Option<Exact>,
    /// `[solve]`.
    pub solve: Solve,
    /// `[estimate]`.
    pub estimate: Estimate,
    /// `[mark]`.
    pub mark: Mark,
    /// `[stop]`.
    pub stop: Stop,
    /// `[output]`.
    pub output: Output,
}

/// One of the four kinds of domain.
#[derive(Clone, Debug)]
pub enum Shape {
    /// `[domain.rectangle]`.
    Rectangle {
        /// `lower`.
        lower: Option<At<Point>>,
        /// `upper`.
        upper: Option<At<Point>>,
        /// `size`.
        size: Option<At<Number>>,
    },
    /// `[domain.disk]`.
    Disk {
        /// `center`.
        center: Option<At<Point>>,
        /// `radius`.
        radius: Option<At<Number>>,
        /// `size`.
        size: Option<At<Number>>,
    },
    /// `[domain.polygon]`.
    Polygon {
        /// `outer`.
        outer: At<Vec<At<Point>>>,
        /// `holes`.
        holes: Vec<At<Vec<At<Point>>>>,
        /// `lines`.
        lines: Vec<At<Vec<At<Point>>>>,
        /// `size`.
        size: Option<At<Number>>,
    },
    /// `[domain.mesh]`.
    Mesh {
        /// `file`.
        file: At<String>,
    },
}

/// `[upper]` or `[lower]`.
#[derive(Clone, Debug)]
pub struct Membrane {
    /// Where the section stands, if it is there.
    pub place: Option<Place>,
    /// `tension`.
    pub tension: Option<At<Number>>,
    /// `load`.
    pub load: Option<At<Number>>,
    /// `boundary`.
    pub boundary: Option<At<Number>>,
}

/// `[exact]`.
#[derive(Clone, Debug)]
pub struct Exact {
    /// `upper` and `lower`.
    pub displacement: [At<Number>; 2],
    /// `action`.
    pub action: Option<At<Number>>,
    /// `sigma`.
    pub sigma: Option<At<Number>>,
    /// `contact`.
    pub contact: Option<At<Number>>,
}

/// `[solve]`.
#[derive(Clone, Debug, Default)]
pub struct Solve {
    /// `solver`.
    pub solver: Option<Solver>,
    /// `tolerance`: none for `"balanced"`.
    pub tolerance: Option<At<Number>>,
    /// `reduction`: whether it is `"auto"`.
    pub reduction: Option<bool>,
}

/// `[estimate]`.
#[derive(Clone, Debug, Default)]
pub struct Estimate {
    /// `estimator`.
    pub estimator: Option<Estimator>,
    /// `also`.
    pub also: Option<Vec<Estimator>>,
    /// `final`.
    pub last: Option<Final>,
}

/// `[mark]`.
#[derive(Clone, Debug, Default)]
pub struct Mark {
    /// `strategy`.
    pub strategy: Option<Strategy>,
    /// `theta`.
    pub theta: Option<At<Number>>,
    /// `children`.
    pub children: Option<At<Number>>,
}

/// `[stop]`.
#[derive(Clone, Debug, Default)]
pub struct Stop {
    /// `relative_error`.
    pub relative_error: Option<At<Number>>,
    /// `error`.
    pub error: Option<At<Number>>,
    /// `vertices`.
    pub vertices: Option<At<Number>>,
    /// `levels`.
    pub levels: Option<At<Number>>,
    /// `seconds`.
    pub seconds: Option<At<Number>>,
}

/// `[output]`.
#[derive(Clone, Debug, Default)]
pub struct Output {
    /// `fields`.
    pub fields: Option<At<Fields>>,
    /// `edges`.
    pub edges: Option<At<bool>>,
}

/// `output.fields`.
#[derive(Clone, Debug, PartialEq)]
pub enum Fields {
    /// `"all"`, `"last"` or `"none"`.
    Named(adapt::settings::Fields),
    /// Every nth level.
    Every(Number),
}
