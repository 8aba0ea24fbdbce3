//! The Riesz representative of the action: (grad sigma, grad phi_j) = z_j for every interior vertex j (4.1).
//!
//! The sigma of a file is not solved for again but proved. With r_j = z_j - (grad sigma, grad phi_j), the error e = sigma_h - sigma fulfils
//! (grad e, grad phi_j) = r_j, and with d the width of the domain between two parallel lines
//!
//! ```text
//! |e|_1 <= 2 (d/pi) (sum_j r_j^2 / |D_j|)^(1/2)
//! ```
//!
//! by Poincare's inequality ||e|| <= (d/pi) |e|_1 on the strip and sum_j |D_j| e_j^2 <= 4 ||e||^2 of first-order functions. Where that is too coarse,
//! conjugate gradients with Jacobi's preconditioner solve for e: with iterates e_k, orthogonal in energy to what is left,
//! |e_k|_1^2 <= |e|_1^2 <= |e_k|_1^2 + (the bound of their residual)^2, so the iteration ends with a proof either way.

use std::f64::consts::PI;

use crate::data::Discrete;
use crate::number::{TOLERANCE, largest, sum};
use crate::report::{Claim, Report, show};

/// Largest nodal residual, relative to the diagonal entry times the largest sigma: a single value that is wrong by [`TOLERANCE`]
/// of the largest leaves a hundred times as much.
const NODAL: f64 = 0.01 * TOLERANCE;

/// Rounding of the terms of a nodal residual, in units of the last place.
const UNITS: f64 = 64.0;

/// Checks the sigma of a file: every nodal residual, and the error in the H^1 seminorm.
pub(crate) fn check(level: &Discrete<'_>, file: &str, report: &mut Report) {
    let count = level.vertices();
    let equation = Equation::new(level);
    let size = largest(&level.sigma);
    let residual = equation.residual(&level.sigma, Some(&level.force));
    let terms = equation.terms(&level.sigma, &level.force);
    let expected: Vec<f64> = (0..count).map(|j| level.force[j] - residual[j]).collect();
    let claim = Claim {
        file,
        name: "action_force = (grad sigma, grad phi_j)",
        place: "vertex",
        claimed: &level.physical(&level.force, level.scale.force()),
        recomputed: &expected,
        exponent: level.scale.force(),
    };
    report.values(&claim, |j| {
        NODAL * equation.diagonal[j] * size + UNITS * f64::EPSILON * terms[j]
    });
    let norm = seminorm(level, &level.sigma);
    let wrong = match equation.error(&residual, TOLERANCE * norm) {
        Verdict::Within => None,
        Verdict::Beyond(error) => Some(format!(
            "it is wrong by `{}` of its H^1 seminorm",
            show(error / norm)
        )),
        Verdict::Open => Some("its error could not be bounded".into()),
    };
    report.property(file, "sigma", wrong);
}

/// |v|_1 of a nodal function.
pub(crate) fn seminorm(level: &Discrete<'_>, values: &[f64]) -> f64 {
    let square = |e: &crate::element::Element| {
        let [x, y] = e.gradient(values);
        e.area * (x * x + y * y)
    };
    sum(level.elements.iter().map(square)).sqrt()
}

/// What is known of |e|_1.
#[derive(Debug, PartialEq)]
enum Verdict {
    /// At most the limit.
    Within,
    /// At least this, which is more than the limit.
    Beyond(f64),
    /// Neither could be shown.
    Open,
}

/// The equation with the stiffness of coefficient 1, applied element by element.
struct Equation<'a> {
    level: &'a Discrete<'a>,
    diagonal: Vec<f64>,
    /// 2 d/pi.
    poincare: f64,
}

impl<'a> Equation<'a> {
    fn new(level: &'a Discrete<'a>) -> Self {
        let mut diagonal = vec![0.0; level.vertices()];
        for e in &level.elements {
            for (k, &j) in e.vertices.iter().enumerate() {
                diagonal[j] += e.area * (e.hat[k][0].powi(2) + e.hat[k][1].powi(2));
            }
        }
        let width = [0, 1].map(|k| {
            let range = level.mesh.points().iter().map(|p| p[k]);
            range.clone().fold(f64::NEG_INFINITY, f64::max) - range.fold(f64::INFINITY, f64::min)
        });
        Equation {
            level,
            diagonal,
            poincare: 2.0 * width[0].min(width[1]) / PI,
        }
    }

    /// force_j - (grad v, grad phi_j) at interior vertices, 0 on the boundary.
    fn residual(&self, v: &[f64], force: Option<&[f64]>) -> Vec<f64> {
        let mut rest = match force {
            Some(force) => force.to_vec(),
            None => vec![0.0; v.len()],
        };
        for e in &self.level.elements {
            let [x, y] = e.gradient(v).map(|g| e.area * g);
            for (k, &j) in e.vertices.iter().enumerate() {
                rest[j] -= x * e.hat[k][0] + y * e.hat[k][1];
            }
        }
        self.clear_boundary(rest)
    }

    /// The absolute values of the terms of a residual, summed.
    fn terms(&self, v: &[f64], force: &[f64]) -> Vec<f64> {
        let mut terms: Vec<f64> = force.iter().map(|f| f.abs()).collect();
        for e in &self.level.elements {
            for (k, &j) in e.vertices.iter().enumerate() {
                for (l, &m) in e.vertices.iter().enumerate() {
                    let product = e.hat[k][0] * e.hat[l][0] + e.hat[k][1] * e.hat[l][1];
                    terms[j] += e.area * product.abs() * v[m].abs();
                }
            }
        }
        terms
    }

    fn clear_boundary(&self, mut values: Vec<f64>) -> Vec<f64> {
        let boundary = self.level.mesh.boundary();
        values
            .iter_mut()
            .zip(boundary)
            .filter(|(_, b)| **b)
            .for_each(|(v, _)| *v = 0.0);
        values
    }

    /// The upper bound of |e|_1 by the residual alone.
    fn bound(&self, residual: &[f64]) -> f64 {
        let squares = residual
            .iter()
            .zip(&self.level.dual_area)
            .map(|(r, d)| r * r / d);
        self.poincare * sum(squares).sqrt()
    }

    /// Compares |e|_1 of the error with this residual with a limit.
    fn error(&self, residual: &[f64], limit: f64) -> Verdict {
        if self.bound(residual) <= limit {
            return Verdict::Within;
        }
        let steps = 1000 + 50 * (residual.len() as f64).sqrt() as usize;
        let mut rest = residual.to_vec();
        let preconditioned = |rest: &[f64]| -> Vec<f64> {
            rest.iter()
                .zip(&self.diagonal)
                .map(|(r, d)| r / d)
                .collect()
        };
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let mut direction = preconditioned(&rest);
        let mut product = dot(&rest, &direction);
        let mut square = 0.0;
        for _ in 0..steps {
            // Minus the residual of zero force: (grad p, grad phi_j).
            let image: Vec<f64> = self.residual(&direction, None).iter().map(|r| -r).collect();
            let step = product / dot(&direction, &image);
            if !step.is_finite() {
                break;
            }
            // |e_k|_1^2 grows by this in every step (Hestenes and Stiefel 1952).
            square += step * product;
            rest.iter_mut()
                .zip(&image)
                .for_each(|(r, i)| *r -= step * i);
            if square.sqrt() > limit {
                return Verdict::Beyond(square.sqrt());
            }
            if square + self.bound(&rest).powi(2) <= limit * limit {
                return Verdict::Within;
            }
            let next = preconditioned(&rest);
            let before = std::mem::replace(&mut product, dot(&rest, &next));
            let turn = product / before;
            direction
                .iter_mut()
                .zip(&next)
                .for_each(|(d, n)| *d = n + turn * *d);
        }
        Verdict::Open
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{level, noise, square};

    /// A level on which sigma solves its equation to rounding, with a factor of it in the file.
    fn with_factor(factor: f64, spike: f64) -> Report {
        let mesh = square(16);
        let count = mesh.vertex_count();
        let zero = vec![0.0; count];
        let bump = |p: &[f64; 2]| (1.0 - p[0] * p[0]) * (1.0 - p[1] * p[1]);
        let sigma: Vec<f64> = mesh.points().iter().map(bump).collect();
        let plain = level(
            &mesh,
            [zero.clone(), zero.clone()],
            zero.clone(),
            sigma.clone(),
        );
        let force: Vec<f64> = Equation::new(&plain)
            .residual(&sigma, None)
            .iter()
            .map(|r| -r)
            .collect();
        let mut written: Vec<f64> = sigma.iter().map(|s| factor * s).collect();
        let middle = count / 2;
        written[middle] *= spike;
        let mut report = Report::default();
        let level = level(&mesh, [zero.clone(), zero], force, written);
        check(&level, "f", &mut report);
        report
    }

    #[test]
    fn a_single_value_and_a_common_factor_are_seen() {
        assert!(with_factor(1.0, 1.0).holds());
        let report = with_factor(1.0, 1.0 + 1e-9);
        assert!(
            report.failures[0].to_string().contains("at vertex 144 is"),
            "{:?}",
            report.failures
        );
        assert_eq!(report.failures[0].others, 4);
        let report = with_factor(1.0 + 2e-9, 1.0);
        // On a mesh as coarse as this one both see it; on a fine one only the seminorm does.
        let said: Vec<String> = report.failures.iter().map(ToString::to_string).collect();
        assert!(
            said.iter().any(|s| s.contains("of its H^1 seminorm")),
            "{said:?}"
        );
        assert!(!with_factor(0.0, 1.0).holds());
    }

    #[test]
    fn the_iteration_decides_where_the_bound_is_too_coarse() {
        let mesh = square(24);
        let zero = || vec![0.0; mesh.vertex_count()];
        let level = level(&mesh, [zero(), zero()], zero(), zero());
        let equation = Equation::new(&level);
        let error = equation.clear_boundary(noise(mesh.vertex_count()));
        let residual: Vec<f64> = equation.residual(&error, None).iter().map(|r| -r).collect();
        let norm = seminorm(&level, &error);
        assert!(equation.bound(&residual) > 2.0 * norm);
        assert_eq!(equation.error(&residual, 1.001 * norm), Verdict::Within);
        match equation.error(&residual, 0.999 * norm) {
            Verdict::Beyond(found) => assert!(found > 0.999 * norm && found <= 1.000001 * norm),
            other => panic!("{other:?}"),
        }
        assert_eq!(equation.error(&zero(), 0.0), Verdict::Within);
    }
}
