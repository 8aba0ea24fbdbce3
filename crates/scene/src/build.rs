//! From [`Checked`] to a problem in scaled units.

use std::path::Path;
use std::sync::Arc;

use adapt::{DataError, Problem, Settings};
use estimate::Gradient;
use expression::Variable;
use fem_core::scale::exponent_of;
use fem_core::{Field, Scale};

use crate::check::{Survey, gradient, refusal};
use crate::domain_mesh;
use crate::error::SceneError;
use crate::fields::{ExpressionField, LowerHeight};
use crate::source::{Fault, Sources};
use crate::validate::{Checked, Exact, Formula, blame};

/// A scene that is ready to run.
#[derive(Clone)]
pub struct Scene {
    /// Its title.
    pub title: Option<String>,
    /// Initial mesh and data, in scaled units.
    pub problem: Problem,
    /// How it is to be run.
    pub settings: Settings,
    /// The text of the scene as it is run: overrides put in, comments kept; after [`load`](crate::load) with an absolute
    /// path of the mesh file.
    pub text: String,
    /// What `membranes check` tells of it.
    pub overview: Overview,
    /// The error without message at every key that gives a function.
    places: Places,
}

impl Scene {
    /// What the loop found wrong with the data of the scene, at the key that gives them.
    pub fn data_error(&self, error: &DataError) -> SceneError {
        match error {
            DataError::Field(field) => self.places.at(&field.name, refusal(field)),
            DataError::Tension { membrane, .. } => self.places.at(
                &format!("{membrane}.tension"),
                Fault::nowhere(error.to_string()),
            ),
            DataError::Heights { .. } => self
                .places
                .at("lower.boundary", Fault::nowhere(error.to_string())),
        }
    }
}

/// Errors at keys, by the name of the key; without message.
#[derive(Clone)]
struct Places {
    keys: Vec<(String, SceneError)>,
    file: SceneError,
}

impl Places {
    fn new(checked: &Checked, sources: &Sources<'_>) -> Self {
        let mut formulas: Vec<&Formula> = checked.tension.iter().collect();
        formulas.extend(checked.load.iter().chain(&checked.boundary));
        if let Some(exact) = &checked.exact {
            formulas.extend(&exact.displacement);
            formulas.extend(
                [&exact.action, &exact.sigma, &exact.contact]
                    .into_iter()
                    .flatten(),
            );
        }
        let error = |formula: &Formula| {
            let fault = blame(&formula.place, String::new());
            (formula.name.clone(), sources.report(fault))
        };
        Places {
            keys: formulas.into_iter().map(error).collect(),
            file: sources.report(Fault::nowhere("")),
        }
    }

    /// The key that `name` begins with or is made from.
    fn at(&self, name: &str, fault: Fault) -> SceneError {
        let name = name.trim_start_matches("d(");
        let found = self
            .keys
            .iter()
            .find(|(key, _)| name.starts_with(key.as_str()));
        let mut report = found
            .map_or(&self.file, |(_, error)| error)
            .report()
            .clone();
        report.message = fault.message;
        report.hint = fault.hint;
        SceneError::new(report)
    }
}

/// Facts about a scene, in the user's units.
#[derive(Clone, Debug, PartialEq)]
pub struct Overview {
    /// The domain in words.
    pub domain: String,
    /// Vertices of the initial mesh.
    pub vertices: usize,
    /// Triangles of the initial mesh.
    pub triangles: usize,
    /// Its smallest angle, in degrees.
    pub smallest_angle: f64,
    /// Smallest and largest tension met, of the upper and the lower membrane.
    pub tension: [[f64; 2]; 2],
    /// Whether the tensions are constants.
    pub constant_tensions: bool,
    /// Whether their quotient is the same at all points sampled.
    pub constant_ratio: bool,
    /// Whether an exact solution is given.
    pub exact: bool,
}

/// Builds the problem: meshes the domain, samples the data, chooses the units.
pub(crate) fn scene(
    checked: Checked,
    sources: &Sources<'_>,
    folder: &Path,
    text: String,
) -> Result<Scene, SceneError> {
    let initial = domain_mesh::build(&checked.shape, sources, folder)?;
    let report = |fault| sources.report(fault);
    let places = Places::new(&checked, sources);
    let survey = Survey {
        mesh: &initial.mesh,
        length: initial.length,
    };
    let [t1, t2] = [&checked.tension[0], &checked.tension[1]].map(|f| survey.tension(f));
    let tension = [t1.map_err(report)?, t2.map_err(report)?];
    let [f1, f2] = [&checked.load[0], &checked.load[1]].map(|f| survey.load(f));
    let load = [f1.map_err(report)?, f2.map_err(report)?];
    let height = survey.heights(&checked.boundary).map_err(report)?;
    if let Some(exact) = &checked.exact {
        survey.exact(exact).map_err(report)?;
    }
    let constant = |formula: &Formula| formula.expression.constant().is_some();
    let constant_tensions = checked.tension.iter().all(constant);
    let overview = Overview {
        domain: initial.description,
        vertices: initial.mesh.vertex_count(),
        triangles: initial.mesh.triangle_count(),
        smallest_angle: survey.smallest_angle(),
        tension: tension.map(|range| [range.least, range.largest]),
        constant_tensions,
        constant_ratio: constant_tensions || survey.same_ratio(&checked.tension).map_err(report)?,
        exact: checked.exact.is_some(),
    };
    let scale = choose_scale(
        initial.length,
        tension[0].largest.max(tension[1].largest),
        load[0].size().max(load[1].size()),
        height[0].size().max(height[1].size()),
    );
    let field = |formula: &Formula, exponent: i32| {
        ExpressionField::new(&formula.name, &formula.expression, scale.length, exponent)
    };
    let [upper, lower] = [0, 1].map(|i| field(&checked.boundary[i], scale.displacement()));
    let problem = Problem {
        tension: [0, 1].map(|i| -> Arc<dyn Field> {
            Arc::new(field(&checked.tension[i], scale.tension).positive())
        }),
        load: ExpressionField::pair([0, 1].map(|i| field(&checked.load[i], scale.load)))
            .map(|field| -> Arc<dyn Field> { Arc::new(field) }),
        height: [
            Arc::new(upper.clone()),
            Arc::new(LowerHeight { lower, upper }),
        ],
        exact: checked
            .exact
            .as_ref()
            .map(|exact| exact_fields(exact, scale)),
        mesh: initial.mesh,
        scale,
    };
    Ok(Scene {
        title: checked.title,
        problem,
        settings: checked.settings,
        text,
        overview,
        places,
    })
}

/// Powers of two that bring a scene to order one; they follow when its data are scaled by powers of two (tensions by
/// powers of four).
fn choose_scale(length: i32, tension: f64, load: f64, height: f64) -> Scale {
    let tension = exponent_of(tension);
    let tension = tension - tension.rem_euclid(2);
    // A height h stands for the load tension h / length^2.
    let of_height = |h: f64| exponent_of(h) + tension - 2 * length;
    let load = match (load != 0.0, height != 0.0) {
        (true, true) => exponent_of(load).max(of_height(height)),
        (true, false) => exponent_of(load),
        (false, true) => of_height(height),
        // Nothing moves: displacements keep their unit.
        (false, false) => tension - 2 * length,
    };
    Scale {
        length,
        tension,
        load,
    }
}

fn exact_fields(exact: &Exact, scale: Scale) -> estimate::Exact {
    let slopes = |formula: &Formula, unit: i32| -> Gradient {
        [Variable::X, Variable::Y].map(|variable| -> Arc<dyn Field> {
            let slope = gradient(formula, variable);
            let unit = unit - scale.length;
            Arc::new(ExpressionField::new(
                &slope.name,
                &slope.expression,
                scale.length,
                unit,
            ))
        })
    };
    let plain = |formula: &Formula, unit: i32| -> Arc<dyn Field> {
        let (name, expression) = (&formula.name, &formula.expression);
        Arc::new(ExpressionField::new(name, expression, scale.length, unit))
    };
    estimate::Exact {
        displacement: [0, 1].map(|i| slopes(&exact.displacement[i], scale.displacement())),
        sigma: exact.sigma.as_ref().map(|f| slopes(f, scale.force())),
        action: exact.action.as_ref().map(|f| plain(f, scale.load)),
        contact: exact.contact.as_ref().map(|f| plain(f, 0)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_follow_their_data() {
        let base = choose_scale(1, 3.0, 0.4, 0.05);
        assert_eq!(
            base,
            Scale {
                length: 1,
                tension: 0,
                load: -2
            }
        );
        let moved = choose_scale(
            1 + 5,
            3.0 * 4f64.powi(7),
            0.4 * 8.0,
            0.05 * 2f64.powi(3 + 10 - 14),
        );
        let expected = Scale {
            length: 6,
            tension: 14,
            load: 1,
        };
        assert_eq!(moved, expected);
        assert_eq!(choose_scale(0, 2.5, 0.0, 0.0).displacement(), 0);
        assert_eq!(choose_scale(0, 0.3, 0.0, 0.7).displacement(), -1);
        assert_eq!(choose_scale(0, 0.3, 0.0, 0.7).tension, -2);
    }
}
