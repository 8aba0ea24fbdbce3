//! From [`SceneFile`] to [`Checked`]: expressions parsed, numbers evaluated, every rule that needs no mesh applied.

use adapt::Settings;
use adapt::settings::{Children, Estimator, Fields as Wanted, Stop as Rules};
use contact::Tolerance;
use expression::{Expression, ParseError, Scope, ScopeError};

use crate::source::{At, Fault, Place, Sources};
use crate::types::{self, Fields, Number, SceneFile};

/// A scene that is right as far as can be said without a mesh. In the user's units.
#[derive(Clone, Debug)]
pub(crate) struct Checked {
    pub title: Option<String>,
    pub shape: At<Shape>,
    /// Tension, load and boundary height of the upper and the lower membrane.
    pub tension: [Formula; 2],
    pub load: [Formula; 2],
    pub boundary: [Formula; 2],
    pub exact: Option<Exact>,
    pub settings: Settings,
}

/// A function of the place, with the key that it was given by.
#[derive(Clone, Debug)]
pub(crate) struct Formula {
    /// Dotted name of the key.
    pub name: String,
    pub expression: Expression,
    /// None where the key is not given.
    pub place: Option<Place>,
}

/// The exact solution.
#[derive(Clone, Debug)]
pub(crate) struct Exact {
    pub displacement: [Formula; 2],
    pub action: Option<Formula>,
    pub sigma: Option<Formula>,
    pub contact: Option<Formula>,
}

/// A domain in numbers.
#[derive(Clone, Debug)]
pub(crate) enum Shape {
    Rectangle {
        lower: [f64; 2],
        upper: [f64; 2],
        size: Option<At<f64>>,
    },
    Disk {
        center: [f64; 2],
        radius: f64,
        size: Option<At<f64>>,
    },
    Polygon {
        outer: At<Vec<At<[f64; 2]>>>,
        holes: Vec<At<Vec<At<[f64; 2]>>>>,
        lines: Vec<At<Vec<At<[f64; 2]>>>>,
        size: Option<At<f64>>,
    },
    Mesh {
        file: At<String>,
    },
}

/// Goal and limit of a scene that names no rule at all.
const DEFAULT_RELATIVE_ERROR: f64 = 0.01;
const DEFAULT_VERTICES: usize = 1_000_000;

/// The largest whole number that every smaller one can be told from.
const LARGEST_COUNT: f64 = 9_007_199_254_740_992.0;

/// Applies every rule that needs no mesh.
pub(crate) fn check(file: &SceneFile, sources: &Sources<'_>) -> Result<Checked, Fault> {
    let scope = parameters(file, sources)?;
    let reader = Reader {
        scope,
        sources,
        later: Vec::new(),
    };
    let [upper, lower] = &file.membranes;
    let tension = |m: &types::Membrane, name: &str| {
        let formula = reader.formula(&m.tension, m, name, 1.0)?;
        match formula.expression.constant() {
            Some(value) if value <= 0.0 => {
                let message = format!("`{name}` must be greater than 0, not {value}");
                Err(blame(&formula.place, message))
            }
            _ => Ok(formula),
        }
    };
    let checked = Checked {
        title: file.title.clone(),
        shape: At {
            value: reader.shape(&file.domain.value)?,
            place: file.domain.place.clone(),
        },
        tension: [
            tension(upper, "upper.tension")?,
            tension(lower, "lower.tension")?,
        ],
        load: [
            reader.formula(&upper.load, upper, "upper.load", 0.0)?,
            reader.formula(&lower.load, lower, "lower.load", 0.0)?,
        ],
        boundary: [
            reader.formula(&upper.boundary, upper, "upper.boundary", 0.0)?,
            reader.formula(&lower.boundary, lower, "lower.boundary", 0.0)?,
        ],
        exact: file
            .exact
            .as_ref()
            .map(|exact| reader.exact(exact))
            .transpose()?,
        settings: reader.settings(file)?,
    };
    Ok(checked)
}

/// The fault at a place that may not exist.
pub(crate) fn blame(place: &Option<Place>, message: String) -> Fault {
    match place {
        Some(place) => Fault::at(place, message),
        None => Fault::nowhere(message),
    }
}

/// Evaluates the parameters in the order of the file; each may use those before it.
fn parameters(file: &SceneFile, sources: &Sources<'_>) -> Result<Scope, Fault> {
    let names: Vec<&str> = file
        .parameters
        .iter()
        .map(|parameter| parameter.name.value.as_str())
        .collect();
    let mut reader = Reader {
        scope: Scope::new(),
        sources,
        later: names,
    };
    for types::Parameter { name, value } in &file.parameters {
        // A name that cannot be used is reported before its value is looked at.
        let refused = |error: ScopeError| {
            let text = error.to_string();
            let (message, hint) = match text.split_once("\nhint: ") {
                Some((message, hint)) => (message.to_owned(), Some(hint.to_owned())),
                None => (text, None),
            };
            Fault::at(&name.place, message).maybe_hint(hint)
        };
        Scope::new().define(&name.value, 0.0).map_err(refused)?;
        let value = reader.number(value)?;
        reader.scope.define(&name.value, value).map_err(refused)?;
        reader.later.remove(0);
    }
    Ok(reader.scope)
}

/// Evaluates what was written.
struct Reader<'a> {
    scope: Scope,
    sources: &'a Sources<'a>,
    /// Parameters that are not defined yet, the one under way first.
    later: Vec<&'a str>,
}

impl Reader<'_> {
    fn number(&self, at: &At<Number>) -> Result<f64, Fault> {
        match &at.value {
            Number::Value(value) => Ok(*value),
            Number::Formula(text) => {
                Expression::parse_constant(text, &self.scope).map_err(|mut error| {
                    // Names of the place do not help where a single number is wanted.
                    error.hint = error
                        .hint
                        .map(|hint| hint.replace("`x`, `y`, `region`, ", ""));
                    self.parse_fault(&at.place, text, error)
                })
            }
        }
    }

    fn parse_fault(&self, place: &Place, text: &str, error: ParseError) -> Fault {
        let name = text.get(error.span.clone()).unwrap_or_default();
        let at = self.sources.inside(place, error.span);
        match self.later.iter().position(|later| *later == name) {
            Some(0) => Fault::at(&at, format!("parameter `{name}` is defined by itself")),
            Some(_) => Fault::at(
                &at,
                format!("parameter `{name}` is used before it is defined"),
            )
            .hint("a parameter may use those above it; change their order"),
            None => Fault::at(&at, error.message).maybe_hint(error.hint),
        }
    }

    fn formula(
        &self,
        at: &Option<At<Number>>,
        section: &types::Membrane,
        name: &str,
        default: f64,
    ) -> Result<Formula, Fault> {
        match at {
            Some(at) => self.given(at, name),
            None => Ok(Formula {
                name: name.to_owned(),
                expression: Expression::number(default),
                place: section.place.clone(),
            }),
        }
    }

    fn given(&self, at: &At<Number>, name: &str) -> Result<Formula, Fault> {
        let expression = match &at.value {
            Number::Value(value) => Expression::number(*value),
            Number::Formula(text) => Expression::parse(text, &self.scope)
                .map_err(|error| self.parse_fault(&at.place, text, error))?,
        };
        match expression.constant() {
            Some(value) if !value.is_finite() => {
                let message = format!("`{name}` is {value} everywhere, not a finite number");
                Err(Fault::at(&at.place, message))
            }
            _ => Ok(Formula {
                name: name.to_owned(),
                expression,
                place: Some(at.place.clone()),
            }),
        }
    }

    fn exact(&self, exact: &types::Exact) -> Result<Exact, Fault> {
        let maybe = |at: &Option<At<Number>>, name: &str| {
            at.as_ref().map(|at| self.given(at, name)).transpose()
        };
        Ok(Exact {
            displacement: [
                self.given(&exact.displacement[0], "exact.upper")?,
                self.given(&exact.displacement[1], "exact.lower")?,
            ],
            action: maybe(&exact.action, "exact.action")?,
            sigma: maybe(&exact.sigma, "exact.sigma")?,
            contact: maybe(&exact.contact, "exact.contact")?,
        })
    }

    fn shape(&self, shape: &types::Shape) -> Result<Shape, Fault> {
        Ok(match shape {
            types::Shape::Rectangle { lower, upper, size } => {
                let corner = |at: &Option<At<types::Point>>, default: [f64; 2]| match at {
                    Some(at) => self.point(&at.value),
                    None => Ok(default),
                };
                let (low, high) = (corner(lower, [-1.0; 2])?, corner(upper, [1.0; 2])?);
                if let Some(k) = (0..2).find(|&k| low[k] >= high[k]) {
                    let given = upper.as_ref().or(lower.as_ref()).map(|at| at.place.clone());
                    let message = format!(
                        "the rectangle is empty: `upper[{k}]` = {} is not greater than `lower[{k}]` = {}",
                        high[k], low[k]
                    );
                    let hint = "`lower` is the corner with the smaller coordinates";
                    return Err(blame(&given, message).hint(hint));
                }
                Shape::Rectangle {
                    lower: low,
                    upper: high,
                    size: self.positive(size, "domain.rectangle.size")?,
                }
            }
            types::Shape::Disk {
                center,
                radius,
                size,
            } => Shape::Disk {
                center: match center {
                    Some(at) => self.point(&at.value)?,
                    None => [0.0; 2],
                },
                radius: self
                    .positive(radius, "domain.disk.radius")?
                    .map_or(1.0, |at| at.value),
                size: self.positive(size, "domain.disk.size")?,
            },
            types::Shape::Polygon {
                outer,
                holes,
                lines,
                size,
            } => {
                let all = |lists: &[At<Vec<At<types::Point>>>]| {
                    lists
                        .iter()
                        .map(|list| self.points(list))
                        .collect::<Result<Vec<_>, Fault>>()
                };
                Shape::Polygon {
                    outer: self.points(outer)?,
                    holes: all(holes)?,
                    lines: all(lines)?,
                    size: self.positive(size, "domain.polygon.size")?,
                }
            }
            types::Shape::Mesh { file } => Shape::Mesh { file: file.clone() },
        })
    }

    fn point(&self, [x, y]: &types::Point) -> Result<[f64; 2], Fault> {
        Ok([self.number(x)?, self.number(y)?])
    }

    fn points(&self, list: &At<Vec<At<types::Point>>>) -> Result<At<Vec<At<[f64; 2]>>>, Fault> {
        let points = list.value.iter().map(|at| {
            Ok(At {
                value: self.point(&at.value)?,
                place: at.place.clone(),
            })
        });
        Ok(At {
            value: points.collect::<Result<_, Fault>>()?,
            place: list.place.clone(),
        })
    }

    fn positive(&self, at: &Option<At<Number>>, name: &str) -> Result<Option<At<f64>>, Fault> {
        self.within(at, name, "greater than 0", |value| value > 0.0)
    }

    fn within(
        &self,
        at: &Option<At<Number>>,
        name: &str,
        rule: &str,
        holds: impl Fn(f64) -> bool,
    ) -> Result<Option<At<f64>>, Fault> {
        let Some(at) = at else { return Ok(None) };
        let value = self.number(at)?;
        if holds(value) {
            Ok(Some(At {
                value,
                place: at.place.clone(),
            }))
        } else {
            let message = format!("`{name}` must be {rule}, not {value}");
            Err(Fault::at(&at.place, message))
        }
    }

    fn count(&self, at: &Option<At<Number>>, name: &str) -> Result<Option<usize>, Fault> {
        let rule = "a whole number of at least 1";
        Ok(self
            .within(at, name, rule, is_count)?
            .map(|at| at.value as usize))
    }

    fn settings(&self, file: &SceneFile) -> Result<Settings, Fault> {
        let mut settings = Settings::default();
        self.solve(file, &mut settings)?;
        self.mark(file, &mut settings)?;
        if let Some(last) = file.estimate.last {
            settings.estimate.last = last;
        }
        if let Some(estimator) = file.estimate.estimator {
            settings.estimate.estimator = estimator;
        }
        if let Some(also) = &file.estimate.also {
            settings.estimate.also = also.clone();
            settings.estimate.also.dedup();
        }
        settings.stop = self.stop(&file.stop)?;
        if let Some(edges) = &file.output.edges {
            settings.output.edges = edges.value;
        }
        if let Some(at) = file.output.edges.as_ref().filter(|at| at.value)
            && !settings.estimate.wants(Estimator::Paper)
        {
            let message =
                "`output.edges = true` needs the estimator \"paper\", which computes `eta_e`";
            return Err(Fault::at(&at.place, message).hint("add \"paper\" to `estimate.also`"));
        }
        if let Some(fields) = &file.output.fields {
            settings.output.fields = self.fields(fields)?;
        }
        Ok(settings)
    }

    fn solve(&self, file: &SceneFile, settings: &mut Settings) -> Result<(), Fault> {
        let solve = &file.solve;
        if let Some(solver) = solve.solver {
            settings.solve.solver = solver;
        }
        if let Some(reduce) = solve.reduction {
            settings.solve.reduce = reduce;
        }
        let rule = "\"balanced\" or a number between 0 and 1";
        let tolerance = self
            .within(&solve.tolerance, "solve.tolerance", rule, |v| {
                v > 0.0 && v < 1.0
            })
            .map_err(|fault| or_names(fault, &solve.tolerance, "solve.tolerance", rule))?;
        if let Some(at) = tolerance {
            settings.solve.tolerance = Tolerance::Relative(at.value);
        }
        Ok(())
    }

    fn mark(&self, file: &SceneFile, settings: &mut Settings) -> Result<(), Fault> {
        let mark = &file.mark;
        if let Some(strategy) = mark.strategy {
            settings.mark.strategy = strategy;
        }
        let rule = "greater than 0 and at most 1";
        if let Some(at) = self.within(&mark.theta, "mark.theta", rule, |v| v > 0.0 && v <= 1.0)? {
            settings.mark.theta = at.value;
        }
        let either = |v: f64| v == 2.0 || v == 4.0;
        if let Some(at) = self.within(&mark.children, "mark.children", "2 or 4", either)? {
            settings.mark.children = if at.value == 2.0 {
                Children::Two
            } else {
                Children::Four
            };
        }
        Ok(())
    }

    fn stop(&self, stop: &types::Stop) -> Result<Rules, Fault> {
        let value =
            |at: &Option<At<Number>>, name: &str| Ok(self.positive(at, name)?.map(|at| at.value));
        let rules = Rules {
            relative_error: value(&stop.relative_error, "stop.relative_error")?,
            error: value(&stop.error, "stop.error")?,
            vertices: self.count(&stop.vertices, "stop.vertices")?,
            levels: self.count(&stop.levels, "stop.levels")?,
            seconds: value(&stop.seconds, "stop.seconds")?,
        };
        if rules == Rules::default() {
            return Ok(Rules {
                relative_error: Some(DEFAULT_RELATIVE_ERROR),
                vertices: Some(DEFAULT_VERTICES),
                ..rules
            });
        }
        Ok(rules)
    }

    fn fields(&self, at: &At<Fields>) -> Result<Wanted, Fault> {
        match &at.value {
            Fields::Named(named) => Ok(*named),
            Fields::Every(number) => {
                let number = Some(At {
                    value: number.clone(),
                    place: at.place.clone(),
                });
                let name = "output.fields";
                let rule = "\"all\", \"last\", \"none\" or a whole number of at least 1";
                let every = self
                    .within(&number, name, rule, is_count)
                    .map_err(|fault| or_names(fault, &number, name, rule))?;
                Ok(Wanted::Every(every.map_or(1, |at| at.value as usize)))
            }
        }
    }
}

/// Whether a number counts something.
fn is_count(value: f64) -> bool {
    (1.0..=LARGEST_COUNT).contains(&value) && value.fract() == 0.0
}

/// Where names and numbers are allowed, text that is no number is taken for a wrong name.
fn or_names(fault: Fault, at: &Option<At<Number>>, name: &str, rule: &str) -> Fault {
    match at {
        Some(At {
            value: Number::Formula(text),
            place,
        }) if !fault.message.starts_with(&format!("`{name}`")) => {
            Fault::at(place, format!("unknown value \"{text}\" of `{name}`"))
                .hint(format!("it must be {rule}"))
        }
        _ => fault,
    }
}
