//! The moves of a descent: a step of conjugate gradients on the present contact set, and the monotone cycle.

use super::descent::{Descent, dot};
use super::unknowns::Unknowns;
use crate::error::SolveError;

/// Monotone cycles from a cold start, at most.
const COLD_CYCLES: usize = 8;

/// A monotone cycle from a cold start that gains more than this part of what the one before gained is the last.
const SLOW: f64 = 0.08;

/// From a cold start a step that closes more gaps than this part of the contact set is followed by a monotone cycle.
const OVERSHOOT: f64 = 1e-3;

/// A gap of up to this many units of rounding after a monotone cycle is closed.
const CLOSED: f64 = 8.0 * f64::EPSILON;

/// A value changed outside a step: its rank, the change, and the residual before.
type Change<U> = (usize, <U as Unknowns>::Value, <U as Unknowns>::Value);

impl<U: Unknowns> Descent<'_, U> {
    /// r = b - A x.
    pub(super) fn residual(&mut self) {
        self.finest
            .multiply(self.hierarchy, &self.x, &mut self.scratch);
        for ((r, &b), &y) in self.r.iter_mut().zip(&self.b).zip(&self.scratch) {
            *r = U::plus(b, -1.0, y);
        }
        self.hierarchy.clear_fixed(&mut self.r);
    }

    /// image = A direction, 0 on the boundary.
    fn multiply_direction(&mut self) {
        self.finest
            .multiply(self.hierarchy, &self.direction, &mut self.image);
        self.hierarchy.clear_fixed(&mut self.image);
    }

    /// Truncates on the present contact set and brings the direction into the new space.
    fn truncate(&mut self) -> Result<(), SolveError> {
        if self.swept {
            return Ok(());
        }
        self.levels
            .sweep(self.hierarchy, self.finest, &self.contact)?;
        self.swept = true;
        if self.curvature.is_some() {
            for p in 0..self.contact.len() {
                if self.contact[p] {
                    self.direction[p] = U::spread(self.direction[p], self.finest.share(p));
                }
            }
            self.multiply_direction();
            let curvature = dot::<U>(&self.direction, &self.image);
            self.curvature = (curvature > 0.0).then_some(curvature);
        }
        Ok(())
    }

    /// One step; twice the energy it has lost, negative and taken back if it has risen, `None` if there is no direction of descent.
    pub(super) fn step(&mut self) -> Result<Option<f64>, SolveError> {
        self.truncate()?;
        self.levels
            .cycle(self.hierarchy, &mut self.scratch, &mut self.correction);
        if self.inequality {
            let rows = self.correction.iter_mut().zip(&self.contact);
            for ((c, &contact), &d) in rows.zip(&self.finest.diagonal) {
                if contact {
                    *c = U::spread(*c, U::share(d));
                }
            }
        }
        match self.curvature {
            Some(curvature) => {
                let beta = -dot::<U>(&self.correction, &self.image) / curvature;
                for (d, &c) in self.direction.iter_mut().zip(&self.correction) {
                    *d = U::plus(c, beta, *d);
                }
            }
            // Without a direction before it the correction is the direction.
            None => std::mem::swap(&mut self.direction, &mut self.correction),
        }
        self.multiply_direction();
        let (mut curvature, mut slope) = (0.0, 0.0);
        let moves = self.direction.iter().zip(&self.image);
        for ((&d, &y), &r) in moves.zip(&self.r) {
            curvature += U::dot(d, y);
            slope += U::dot(d, r);
        }
        if !(curvature > 0.0 && slope > 0.0 && curvature.is_finite()) {
            self.curvature = None;
            return Ok(None);
        }
        self.curvature = Some(curvature);
        let length = slope / curvature;
        let rows = self.x.iter_mut().zip(&mut self.r);
        let moves = self.direction.iter().zip(&self.image);
        if !self.inequality {
            let mut squared = 0.0;
            for (((x, r), (&d, &y)), rest) in rows.zip(moves).zip(&mut self.scratch) {
                *x = U::plus(*x, length, d);
                *r = U::plus(*r, -length, y);
                *rest = *r;
                squared += U::dot(*r, *r);
            }
            self.read_ahead = Some(squared);
            return Ok(Some(length * slope));
        }
        let mut closed = Vec::new();
        for ((p, (x, r)), (&d, &y)) in rows.enumerate().zip(moves) {
            let moved = U::plus(*x, length, d);
            *r = U::plus(*r, -length, y);
            *x = moved;
            if U::gap(moved) < 0.0 {
                *x = U::close(moved, self.finest.share(p));
                closed.push((p, U::plus(*x, -1.0, moved), *r));
            }
        }
        let raised = self.move_residual(&closed);
        let loss = length * slope - raised;
        if loss < 0.0 {
            // Closing gaps leaves kinks behind. A monotone cycle smooths them; if the energy is still higher, the step is taken back.
            self.monotone_cycles += 1;
            let mut before = self.x.clone();
            for &(p, change, _) in &closed {
                before[p] = U::plus(before[p], -1.0, change);
            }
            for ((p, x), &d) in before.iter_mut().enumerate().zip(&self.direction) {
                *x = U::plus(*x, -length, d);
                if U::gap(*x) < 0.0 {
                    *x = U::close(*x, self.finest.share(p));
                }
            }
            let total = loss + self.monotone()?;
            if total >= 0.0 {
                return Ok(Some(total));
            }
            self.taken_back += 1;
            self.monotone_cycles += 1;
            self.x = before;
            self.residual();
            return Ok(Some(self.monotone()?));
        }
        if self.cold && !closed.is_empty() {
            // From a cold start, closing many gaps at once overshoots; released they are only a layer of vertices a step.
            let contact = self.contact.iter().filter(|&&c| c).count();
            if closed.len() as f64 > OVERSHOOT * contact as f64 {
                self.monotone_cycles += 1;
                return Ok(Some(loss + self.monotone()?));
            }
        }
        Ok(Some(loss))
    }

    /// Takes changes of single values into the residual; twice the energy they cost.
    fn move_residual(&mut self, changes: &[Change<U>]) -> f64 {
        let (hierarchy, finest) = (self.hierarchy, self.finest);
        for &(p, change, _) in changes {
            let own = U::plain_times(-1.0, finest.diagonal[p]);
            self.r[p] = U::plus_plain(self.r[p], own, change);
            for (q, slot) in hierarchy.edges(p) {
                if !hierarchy.fixed[q] {
                    let a = U::plain_times(-1.0, finest.slot[slot]);
                    self.r[q] = U::plus_plain(self.r[q], a, change);
                }
            }
        }
        changes
            .iter()
            .map(|&(p, change, before)| -U::dot(change, U::plus(before, 1.0, self.r[p])))
            .sum()
    }

    /// One monotone cycle; twice the energy it has lost.
    fn monotone(&mut self) -> Result<f64, SolveError> {
        let n = self.x.len();
        self.levels.sweep(self.hierarchy, self.finest, &[])?;
        self.swept = false;
        self.curvature = None;
        let mut bound: Vec<f64> = (0..n).map(|p| -U::gap(self.x[p]).max(0.0)).collect();
        self.scratch.copy_from_slice(&self.r);
        let mut old_bound = Vec::new();
        self.levels.monotone_cycle(
            self.hierarchy,
            &mut self.scratch,
            &mut self.correction,
            &mut bound,
            &mut old_bound,
        );
        let before = std::mem::take(&mut self.r);
        self.r = std::mem::take(&mut self.image);
        for p in 0..n {
            let x = U::plus(self.x[p], 1.0, self.correction[p]);
            // Two values that were brought together differ by rounding.
            let rounding = CLOSED * (U::size(self.x[p]) + U::size(self.correction[p]));
            let new = if U::gap(x) <= rounding {
                U::close(x, self.finest.share(p))
            } else {
                x
            };
            self.correction[p] = U::plus(new, -1.0, self.x[p]);
            self.x[p] = new;
        }
        self.residual();
        let mut loss = 0.0;
        for p in 0..n {
            loss += U::dot(self.correction[p], U::plus(before[p], 1.0, self.r[p]));
        }
        self.image = before;
        Ok(loss.max(0.0))
    }

    /// Monotone cycles until they gain little.
    pub(super) fn monotone_start(&mut self) -> Result<(), SolveError> {
        let mut last = None;
        for _ in 0..COLD_CYCLES {
            let loss = self.monotone()?;
            self.monotone_cycles += 1;
            let slow = last.is_some_and(|l: f64| loss > SLOW * l);
            last = Some(loss);
            if slow || loss == 0.0 {
                break;
            }
        }
        Ok(())
    }
}
