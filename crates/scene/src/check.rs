//! Samples the data of a scene on the initial mesh: are they finite, positive, in order, and how large are they.

use expression::{Expression, Variable};
use fem_core::{Circle, Field, FieldError, Mesh, Samples, TriangleId};

use crate::fields::{ExpressionField, LowerHeight};
use crate::source::Fault;
use crate::validate::{Exact, Formula, blame};

/// Barycentric coordinates of the sample points of a triangle: its centre, three towards the corners, three towards the
/// middles of the edges; all inside.
const INTERIOR: [[f64; 3]; 7] = [
    [1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0],
    [0.75, 0.125, 0.125],
    [0.125, 0.75, 0.125],
    [0.125, 0.125, 0.75],
    [0.0625, 0.46875, 0.46875],
    [0.46875, 0.0625, 0.46875],
    [0.46875, 0.46875, 0.0625],
];

/// Triangles sampled at once.
const CHUNK: usize = 36;

/// Smallest and largest value met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Range {
    pub least: f64,
    pub largest: f64,
}

impl Range {
    const NONE: Range = Range {
        least: f64::INFINITY,
        largest: f64::NEG_INFINITY,
    };

    fn with(self, value: f64) -> Self {
        Range {
            least: self.least.min(value),
            largest: self.largest.max(value),
        }
    }

    /// The largest absolute value.
    pub fn size(self) -> f64 {
        self.least.abs().max(self.largest.abs())
    }
}

/// A mesh with the exponent of its unit of length.
pub(crate) struct Survey<'a> {
    pub mesh: &'a Mesh,
    pub length: i32,
}

impl Survey<'_> {
    /// Values of a load.
    pub fn load(&self, formula: &Formula) -> Result<Range, Fault> {
        self.interior(formula, self.field(formula))
    }

    /// Values of a tension, all positive.
    pub fn tension(&self, formula: &Formula) -> Result<Range, Fault> {
        self.interior(formula, self.field(formula).positive())
    }

    /// Whether mu_2 / mu_1 is the same at all points, to rounding.
    pub fn same_ratio(&self, tension: &[Formula; 2]) -> Result<bool, Fault> {
        let fields = [self.field(&tension[0]), self.field(&tension[1])];
        let mut second = Vec::new();
        let mut range = Range::NONE;
        self.batches(|at, out| {
            fields[0].sample(at, out)?;
            second.resize(out.len(), 0.0);
            fields[1].sample(at, &mut second)?;
            for (a, b) in out.iter().zip(&second) {
                range = range.with(b / a);
            }
            Ok(())
        })
        .map_err(|error| refuse(&tension[0], error))?;
        Ok(range.largest - range.least <= 1e-13 * range.largest)
    }

    /// Values of both heights on the boundary, the lower never above the upper.
    pub fn heights(&self, boundary: &[Formula; 2]) -> Result<[Range; 2], Fault> {
        let [upper, lower] = [self.field(&boundary[0]), self.field(&boundary[1])];
        let checked = LowerHeight {
            lower: lower.clone(),
            upper: upper.clone(),
        };
        let fields: [&dyn Field; 3] = [&upper, &lower, &checked];
        let mut ranges = [Range::NONE; 3];
        if let [Some(a), Some(b), Some(_)] = fields.map(|f| f.constant()) {
            return Ok([a, b].map(|v| Range::NONE.with(v)));
        }
        for (t, face) in self.mesh.boundary_edges() {
            let [p, q] = self
                .mesh
                .face(t, face)
                .map(|v| self.mesh.points()[v.index()]);
            let points = on_edge(p, q, self.mesh.curve());
            let region = [f64::from(self.mesh.region()[t.index()]); 5];
            let (x, y) = (points.map(|p| p[0]), points.map(|p| p[1]));
            let at = Samples {
                x: &x,
                y: &y,
                region: &region,
            };
            for (k, field) in fields.iter().enumerate() {
                let mut out = [0.0; 5];
                field.sample(at, &mut out).map_err(|error| match k {
                    0 | 1 => refuse(&boundary[k], error),
                    _ => self.disorder(boundary, &error),
                })?;
                ranges[k] = out.iter().fold(ranges[k], |range, &v| range.with(v));
            }
        }
        Ok([ranges[0], ranges[1]])
    }

    fn disorder(&self, boundary: &[Formula; 2], error: &FieldError) -> Fault {
        let place = boundary[1].place.clone().or(boundary[0].place.clone());
        let height = |formula: &Formula| short(formula.expression.eval_at(error.x, error.y, 0.0));
        let [upper, lower] = [height(&boundary[0]), height(&boundary[1])];
        let at = format!("({}, {})", short(error.x), short(error.y));
        let region = boundary
            .iter()
            .any(|formula| formula.expression.uses_region());
        let message = if region || upper == lower {
            let excess = short(error.value);
            format!("`lower.boundary` exceeds `upper.boundary` by {excess} at {at}")
        } else {
            format!("`lower.boundary` = {lower} exceeds `upper.boundary` = {upper} at {at}")
        };
        blame(&place, message)
            .hint("the lower membrane must not be fixed above the upper one anywhere")
    }

    /// Whether everything that is evaluated of an exact solution is finite inside the triangles.
    pub fn exact(&self, exact: &Exact) -> Result<(), Fault> {
        let plain = [&exact.action, &exact.contact].into_iter().flatten();
        let differentiated = exact.displacement.iter().chain(&exact.sigma);
        for formula in plain.chain(differentiated.clone()) {
            self.interior(formula, self.field(formula))?;
        }
        for formula in differentiated {
            for variable in [Variable::X, Variable::Y] {
                let slope = gradient(formula, variable);
                let (name, expression) = (&slope.name, &slope.expression);
                self.interior(
                    formula,
                    ExpressionField::new(name, expression, self.length, 0),
                )?;
            }
        }
        Ok(())
    }

    /// The smallest angle of all triangles, in degrees.
    pub fn smallest_angle(&self) -> f64 {
        let mut smallest = 60.0f64;
        for t in self.mesh.triangle_ids() {
            let shape = self.mesh.shape(t);
            let mut l = shape.lengths;
            l.sort_by(f64::total_cmp);
            // Twice the area is b c sin, half of b^2 + c^2 - a^2 is b c cos of the angle opposite to the shortest edge.
            let cosine = 0.5 * ((l[1] - l[0]) * (l[1] + l[0]) + l[2] * l[2]);
            smallest = smallest.min((2.0 * shape.area).atan2(cosine).to_degrees());
        }
        smallest
    }

    fn field(&self, formula: &Formula) -> ExpressionField {
        ExpressionField::new(&formula.name, &formula.expression, self.length, 0)
    }

    fn interior(&self, formula: &Formula, field: ExpressionField) -> Result<Range, Fault> {
        if let Some(value) = field.constant() {
            return Ok(Range::NONE.with(value));
        }
        let mut range = Range::NONE;
        self.batches(|at, out| {
            field.sample(at, out)?;
            range = out.iter().fold(range, |range, &v| range.with(v));
            Ok(())
        })
        .map_err(|error| refuse(formula, error))?;
        Ok(range)
    }

    /// Shows the sample points of all triangles to `visit`, with room for as many values.
    fn batches(
        &self,
        mut visit: impl FnMut(Samples<'_>, &mut [f64]) -> Result<(), FieldError>,
    ) -> Result<(), FieldError> {
        let (mut x, mut y) = (Vec::new(), Vec::new());
        let (mut region, mut out) = (Vec::new(), Vec::new());
        let count = self.mesh.triangle_count();
        for start in (0..count).step_by(CHUNK) {
            for list in [&mut x, &mut y, &mut region] {
                list.clear();
            }
            for t in start..count.min(start + CHUNK) {
                let [a, b, c] = self.mesh.corners(TriangleId(t as u32));
                for [l, m, n] in INTERIOR {
                    x.push(l * a[0] + m * b[0] + n * c[0]);
                    y.push(l * a[1] + m * b[1] + n * c[1]);
                    region.push(f64::from(self.mesh.region()[t]));
                }
            }
            out.resize(x.len(), 0.0);
            let at = Samples {
                x: &x,
                y: &y,
                region: &region,
            };
            visit(at, &mut out)?;
        }
        Ok(())
    }
}

/// The partial derivative of a formula, named after it.
pub(crate) fn gradient(formula: &Formula, variable: Variable) -> Formula {
    let by = match variable {
        Variable::X => "x",
        Variable::Y => "y",
    };
    let expression: Expression = formula.expression.derivative(variable);
    Formula {
        name: format!("d({})/d{by}", formula.name),
        expression,
        place: formula.place.clone(),
    }
}

/// The ends, the middle and the quarter points of a boundary edge, where refinement will put vertices.
fn on_edge(p: [f64; 2], q: [f64; 2], curve: Option<Circle>) -> [[f64; 2]; 5] {
    let middle = |p: [f64; 2], q: [f64; 2]| {
        let straight = [0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1])];
        curve.map_or(straight, |circle| circle.project(straight))
    };
    let m = middle(p, q);
    [p, middle(p, m), m, middle(m, q), q]
}

fn refuse(formula: &Formula, error: FieldError) -> Fault {
    Fault {
        place: formula.place.clone(),
        ..refusal(&error)
    }
}

/// What is wrong with a value, and what helps.
pub(crate) fn refusal(error: &FieldError) -> Fault {
    let name = &error.name;
    let value = short(error.value);
    let at = format!("({}, {})", short(error.x), short(error.y));
    if error.value.is_finite() && name.ends_with(".tension") {
        return Fault::nowhere(format!(
            "`{name}` must be greater than 0, but is {value} at {at}"
        ));
    }
    let fault = Fault::nowhere(format!("`{name}` is {value} at {at}"));
    if error.value.is_finite() {
        fault
    } else if name.starts_with("d(") {
        fault.hint("an exact field is differentiated as an expression; this derivative is not finite there")
    } else {
        fault.hint("`if(condition, then, else)` evaluates only the branch that is taken")
    }
}

/// A number with six significant digits, for messages.
pub(crate) fn short(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.abs().to_string();
    }
    let rounded: f64 = format!("{value:.5e}").parse().unwrap_or(value);
    if (1e-4..1e9).contains(&rounded.abs()) {
        rounded.to_string()
    } else {
        format!("{rounded:e}")
    }
}
