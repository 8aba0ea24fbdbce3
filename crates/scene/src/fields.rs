//! Expressions as fields: scaled points in, scaled values out.

use expression::{Expression, Joint};
use fem_core::scale::times_power_of_two;
use fem_core::{Field, FieldError, JointFields, Samples};
use std::sync::Arc;

/// An expression of the physical coordinates, read at scaled points.
#[derive(Clone, Debug)]
pub(crate) struct ExpressionField {
    name: String,
    /// As it was written.
    expression: Expression,
    /// The same for scaled points, with scaled values.
    scaled_expression: Expression,
    /// 2^a, a the exponent of length.
    length: f64,
    /// Two factors whose product is 2^-e, e the exponent of the values: 2^-e alone may not be a number.
    factors: [f64; 2],
    positive: bool,
    /// Both fields of a pair, and which of them this is.
    joint: Option<(Arc<ExpressionPair>, usize)>,
}

/// Two fields that are read at the same points.
#[derive(Debug)]
struct ExpressionPair {
    scaled: Joint<2>,
    fields: [ExpressionField; 2],
}

impl ExpressionField {
    /// The field `expression`, which errors call `name`, with points in units of 2^length and values in units of 2^value.
    pub fn new(name: &str, expression: &Expression, length: i32, value: i32) -> Self {
        let half = -value / 2;
        let factors = [half, -value - half].map(|e| times_power_of_two(1.0, e));
        let length = times_power_of_two(1.0, length);
        ExpressionField {
            name: name.to_owned(),
            expression: expression.clone(),
            scaled_expression: expression.in_units(length, factors),
            length,
            factors,
            positive: false,
            joint: None,
        }
    }

    /// The same fields, which are sampled together for less if neither is constant.
    pub fn pair(fields: [Self; 2]) -> [Self; 2] {
        if fields.iter().any(|field| field.constant().is_some()) {
            return fields;
        }
        let scaled = Joint::new(fields.each_ref().map(|field| &field.scaled_expression));
        let [first, second] = fields.clone();
        let pair = Arc::new(ExpressionPair { scaled, fields });
        [(first, 0), (second, 1)].map(|(field, own)| ExpressionField {
            joint: Some((pair.clone(), own)),
            ..field
        })
    }

    /// The same field, for which a value that is not positive is an error.
    pub fn positive(self) -> Self {
        ExpressionField {
            positive: true,
            ..self
        }
    }

    fn scaled(&self, value: f64) -> f64 {
        value * self.factors[0] * self.factors[1]
    }

    /// Whether a scaled value may be used. Without a branch, so that many are tested at a time.
    #[inline]
    fn is_good(&self, scaled: f64) -> bool {
        scaled.is_finite() & (!self.positive | (scaled > 0.0))
    }

    /// The value at one of the points, in the user's units.
    fn value_at(&self, at: Samples<'_>, k: usize) -> f64 {
        let region = at.region.get(k).copied().unwrap_or_default();
        let [x, y] = [at.x[k], at.y[k]].map(|c| c * self.length);
        self.expression.eval_at(x, y, region)
    }

    /// Refuses scaled values, which are those at the points, if one of them may not be used.
    fn judge(&self, at: Samples<'_>, values: &[f64]) -> Result<(), FieldError> {
        // Nearly always all are good: one test for all of them.
        if values
            .iter()
            .fold(true, |good, value| good & self.is_good(*value))
        {
            return Ok(());
        }
        match values.iter().position(|value| !self.is_good(*value)) {
            Some(k) => Err(self.refuse(self.value_at(at, k), at, k)),
            None => Ok(()),
        }
    }

    fn refuse(&self, value: f64, at: Samples<'_>, k: usize) -> FieldError {
        FieldError {
            name: self.name.clone(),
            value,
            x: at.x[k] * self.length,
            y: at.y[k] * self.length,
        }
    }
}

impl Field for ExpressionField {
    fn sample(&self, at: Samples<'_>, out: &mut [f64]) -> Result<(), FieldError> {
        if self.scaled_expression.eval(at.x, at.y, at.region, out) && !self.positive {
            return Ok(());
        }
        self.judge(at, out)
    }

    fn constant(&self) -> Option<f64> {
        let value = self.scaled(self.expression.constant()?);
        self.is_good(value).then_some(value)
    }

    fn joint(&self) -> Option<(&dyn JointFields, usize)> {
        let (pair, own) = self.joint.as_ref()?;
        Some((&**pair, *own))
    }
}

impl JointFields for ExpressionPair {
    fn sample(&self, at: Samples<'_>, [first, second]: [&mut [f64]; 2]) -> Result<(), FieldError> {
        let out = [&mut *first, &mut *second];
        let finite = self.scaled.eval(at.x, at.y, at.region, out);
        if finite && !self.fields.iter().any(|field| field.positive) {
            return Ok(());
        }
        self.fields[0].judge(at, first)?;
        self.fields[1].judge(at, second)
    }
}

/// How far, relative to the larger one, g2 may lie above g1 and be taken for equal: expressions that mean the same
/// differ by rounding.
const HEIGHT_SLACK: f64 = 1e-13;

/// The height of the lower membrane, which is never above that of the upper one.
#[derive(Clone, Debug)]
pub(crate) struct LowerHeight {
    pub lower: ExpressionField,
    pub upper: ExpressionField,
}

impl LowerHeight {
    /// The height to use, or how far the lower one is above the upper one.
    fn below(lower: f64, upper: f64) -> Result<f64, f64> {
        if lower <= upper {
            Ok(lower)
        } else if lower - upper <= HEIGHT_SLACK * lower.abs().max(upper.abs()) {
            Ok(upper)
        } else {
            Err(lower - upper)
        }
    }
}

impl Field for LowerHeight {
    fn sample(&self, at: Samples<'_>, out: &mut [f64]) -> Result<(), FieldError> {
        self.lower.sample(at, out)?;
        let mut upper = vec![0.0; at.len()];
        self.upper.sample(at, &mut upper)?;
        for (k, (lower, upper)) in out.iter_mut().zip(upper).enumerate() {
            *lower = Self::below(*lower, upper).map_err(|excess| FieldError {
                name: "lower.boundary - upper.boundary".into(),
                value: excess / self.lower.factors[0] / self.lower.factors[1],
                ..self.lower.refuse(0.0, at, k)
            })?;
        }
        Ok(())
    }

    fn constant(&self) -> Option<f64> {
        Self::below(self.lower.constant()?, self.upper.constant()?).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use expression::Scope;
    use fem_core::FieldPair;

    fn field(text: &str, length: i32, value: i32) -> ExpressionField {
        let expression = Expression::parse(text, &Scope::new()).unwrap();
        ExpressionField::new("f", &expression, length, value)
    }

    fn sample(field: &dyn Field, x: &[f64], y: &[f64]) -> Result<Vec<f64>, FieldError> {
        let region = vec![3.0; x.len()];
        let mut out = vec![0.0; x.len()];
        let at = Samples {
            x,
            y,
            region: &region,
        };
        field.sample(at, &mut out)?;
        Ok(out)
    }

    #[test]
    fn points_and_values_are_scaled() {
        let f = field("x + 10*y + 100*region", 2, 3);
        assert_eq!(
            sample(&f, &[1.0, 2.0], &[0.5, 0.25]).unwrap(),
            [40.5, 39.75]
        );
        assert_eq!(field("12", 5, 2).constant(), Some(3.0));
        assert_eq!(f.constant(), None);
    }

    #[test]
    fn exponents_beyond_the_range_of_a_double() {
        let f = field("1e-300", 0, -1900);
        let expected = times_power_of_two(1e-300, 1900);
        assert!(expected.is_finite() && expected > 0.0);
        assert_eq!(sample(&f, &[0.0], &[0.0]).unwrap(), [expected]);
        assert_eq!(
            field("1e300", 0, 1900).constant(),
            Some(times_power_of_two(1e300, -1900))
        );
        assert!(sample(&field("1e300", 0, -1900), &[0.0], &[0.0]).is_err());
        assert_eq!(field("1e300", 0, -1900).constant(), None);
    }

    #[test]
    fn many_points_give_what_single_ones_do() {
        let f = field("sin(x)*y + if(x > 0.5, x^2, -y)", -1, 1);
        let x: Vec<f64> = (0..1000).map(|k| k as f64 / 700.0).collect();
        let y: Vec<f64> = (0..1000).map(|k| 1.0 - k as f64 / 300.0).collect();
        let all = sample(&f, &x, &y).unwrap();
        for k in 0..1000 {
            assert_eq!(all[k], sample(&f, &x[k..=k], &y[k..=k]).unwrap()[0]);
        }
    }

    #[test]
    fn a_value_that_is_not_finite_is_named_with_its_place() {
        let x: Vec<f64> = (0..300).map(|k| (280 - k) as f64).collect();
        let error = sample(&field("1/x", 1, 0), &x, &vec![0.25; 300]).unwrap_err();
        assert_eq!((error.x, error.y), (0.0, 0.5));
        assert!(error.value.is_infinite() && error.name == "f");
        let error = sample(&field("x - 3", 1, 4).positive(), &[2.0, 1.0], &[0.0; 2]).unwrap_err();
        assert_eq!((error.x, error.value), (2.0, -1.0));
    }

    #[test]
    fn a_pair_gives_what_its_fields_give() {
        let [f, g] = ExpressionField::pair([
            field("if(x > 0.5, x^4*y/3 - x, 1/(x - 2))", -1, 3),
            field("y - x^4*y/3 + if(x > 0.5, 2, 1/(x - 3))", -1, 3),
        ]);
        assert_eq!(
            [&f, &g].map(|f| f.joint().map(|joint| joint.1)),
            [Some(0), Some(1)]
        );
        let x: Vec<f64> = (0..1000).map(|k| k as f64 / 300.0).collect();
        let y: Vec<f64> = (0..1000).map(|k| 1.0 - k as f64 / 300.0).collect();
        let at = Samples {
            x: &x,
            y: &y,
            region: &vec![0.0; 1000],
        };
        for fields in [[&f, &g], [&g, &f], [&f, &f]] {
            let mut out = [vec![0.0; 1000], vec![0.0; 1000]];
            let [first, second] = &mut out;
            let pair = FieldPair::new(fields.map(|f| -> &dyn Field { f }));
            pair.sample(at, [first, second]).unwrap();
            assert_eq!(out, fields.map(|f| sample(f, &x, &y).unwrap()));
        }
        // What is wrong with the first is told first.
        let [f, g] = ExpressionField::pair([field("1/x", 1, 0), field("1/y", 1, 0)]);
        let pair = FieldPair::new([&f, &g]);
        let sample = |x: [f64; 2], y: [f64; 2]| {
            let region = &[0.0; 2];
            let at = Samples {
                x: &x,
                y: &y,
                region,
            };
            pair.sample(at, [&mut [0.0; 2], &mut [0.0; 2]])
        };
        assert_eq!(sample([1.0, 0.0], [0.0, 1.0]).unwrap_err().y, 2.0);
        assert_eq!(sample([1.0, 3.0], [0.5, 0.0]).unwrap_err().x, 6.0);
        assert!(sample([1.0, 3.0], [0.5, 1.0]).is_ok());
        // Nothing is gained with a constant.
        let pair = ExpressionField::pair([field("1/x", 1, 0), field("2", 1, 0)]);
        assert!(pair.iter().all(|field| field.joint().is_none()));
    }

    #[test]
    fn heights_that_differ_by_rounding_are_equal() {
        let height = |lower: &str, upper: &str| LowerHeight {
            lower: field(lower, 0, 2),
            upper: field(upper, 0, 2),
        };
        let rounded = height("0.3*x", "0.1*x + 0.2*x");
        assert_eq!(sample(&rounded, &[1.0], &[0.0]).unwrap(), [0.3 / 4.0]);
        let rounded = height("0.1*x + 0.2*x", "0.3*x");
        assert_eq!(sample(&rounded, &[1.0], &[0.0]).unwrap(), [0.3 / 4.0]);
        let error = sample(&height("1", "1 - x"), &[0.0, 0.5], &[0.0; 2]).unwrap_err();
        assert_eq!((error.x, error.value), (0.5, 0.5));
        assert_eq!(height("1", "2").constant(), Some(0.25));
        assert_eq!(height("2", "1").constant(), None);
    }
}
