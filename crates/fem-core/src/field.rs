//! Data given at points: loads, tensions, boundary heights, exact solutions.

/// Points at which a field is wanted, one array a coordinate.
#[derive(Clone, Copy, Debug)]
pub struct Samples<'a> {
    /// First coordinates, scaled.
    pub x: &'a [f64],
    /// Second coordinates, scaled.
    pub y: &'a [f64],
    /// Region tags of the triangles that the points lie in, as numbers.
    pub region: &'a [f64],
}

impl<'a> Samples<'a> {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.x.len()
    }

    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.x.is_empty()
    }
}

/// A value that is not finite, with the place where it was met.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("`{name}` is {value} at ({x}, {y})")]
pub struct FieldError {
    /// What the user calls the field.
    pub name: String,
    /// The value met.
    pub value: f64,
    /// First coordinate, in the user's units.
    pub x: f64,
    /// Second coordinate, in the user's units.
    pub y: f64,
}

/// A scalar function of the place.
pub trait Field: Send + Sync {
    /// Writes the values at `at` to `out`, which has the same length; scaled, all finite.
    ///
    /// # Errors
    /// The first value that is not finite.
    fn sample(&self, at: Samples<'_>, out: &mut [f64]) -> Result<(), FieldError>;

    /// The value, if it is the same everywhere.
    fn constant(&self) -> Option<f64> {
        None
    }

    /// What samples this field and another one together, and which of the two it is, 0 or 1; none where that saves nothing.
    fn joint(&self) -> Option<(&dyn JointFields, usize)> {
        None
    }
}

/// Two fields with work in common.
pub trait JointFields: Send + Sync {
    /// Writes the values at `at` that [`Field::sample`] gives for the one and the other, bit for bit.
    ///
    /// # Errors
    /// The first value of the first field that is not finite, or else of the second.
    fn sample(&self, at: Samples<'_>, out: [&mut [f64]; 2]) -> Result<(), FieldError>;
}

/// Two fields to be sampled at the same points, together if they are made for that.
#[derive(Clone, Copy)]
pub struct FieldPair<'a> {
    fields: [&'a dyn Field; 2],
    joint: Option<&'a dyn JointFields>,
}

impl<'a> FieldPair<'a> {
    /// The pair of these fields.
    pub fn new(fields: [&'a dyn Field; 2]) -> Self {
        let joint = match fields.map(|field| field.joint()) {
            [Some((first, 0)), Some((second, 1))] if std::ptr::addr_eq(first, second) => {
                Some(first)
            }
            _ => None,
        };
        FieldPair { fields, joint }
    }

    /// Writes the values of both at `at`, all finite.
    ///
    /// # Errors
    /// The first value of the first field that is not finite, or else of the second.
    pub fn sample(
        &self,
        at: Samples<'_>,
        [first, second]: [&mut [f64]; 2],
    ) -> Result<(), FieldError> {
        match self.joint {
            Some(joint) => joint.sample(at, [first, second]),
            None => {
                self.fields[0].sample(at, first)?;
                self.fields[1].sample(at, second)
            }
        }
    }
}

/// A field that has one value everywhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Constant(pub f64);

impl Field for Constant {
    fn sample(&self, _: Samples<'_>, out: &mut [f64]) -> Result<(), FieldError> {
        out.fill(self.0);
        Ok(())
    }

    fn constant(&self) -> Option<f64> {
        Some(self.0)
    }
}

impl<F: Fn(f64, f64) -> f64 + Send + Sync> Field for F {
    fn sample(&self, at: Samples<'_>, out: &mut [f64]) -> Result<(), FieldError> {
        for (k, value) in out.iter_mut().enumerate() {
            *value = self(at.x[k], at.y[k]);
            if !value.is_finite() {
                return Err(FieldError {
                    name: "field".into(),
                    value: *value,
                    x: at.x[k],
                    y: at.y[k],
                });
            }
        }
        Ok(())
    }
}
