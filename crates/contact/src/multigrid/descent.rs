//! Conjugate gradients on a contact set that is read anew before every step, preconditioned by one cycle.
//!
//! A step: read the contact set off the iterate and its residual (gap closed, and nothing pulls it open); if it has changed, truncate
//! the hat functions anew and bring the previous direction into the new space; precondition the residual by one
//! cycle, make it conjugate to the previous direction, go to the least energy along it, and close the gaps that went negative.
//! The iterate is feasible at all times. Closing gaps may raise the energy: a step that raises it is taken back, and
//! a monotone cycle, which cannot, is made in its place. From a cold start monotone cycles come first, since truncation is worth little before
//! the contact set is roughly known.
//!
//! The algebraic error is judged by what the steps gain: the energy lost in a step is the difference of the squared errors before and after, so that with
//! a ratio rho of successive losses the squared error that remains is the last loss times rho/(1 - rho) (the sum of
//! Hestenes and Stiefel, its tail extrapolated). One step shows no ratio. Then the part of the squared error that the first step left on
//! an earlier mesh stands in, and where that is not good enough, or not known, at least three steps are made, and more until their gains have
//! died away: slow parts of the error, as jumps of the tension or slivers make them, show only after the quick ones have gone.

use super::finest::Finest;
use super::galerkin::Levels;
use super::hierarchy::Hierarchy;
use super::row_magnitude;
use super::unknowns::Unknowns;
use crate::error::SolveError;
use crate::solution::Status;

/// Steps after which a field is left to the direct method.
const LIMIT: usize = 60;

/// From this step on the number still needed is predicted, and the attempt ended if the sum exceeds twice the limit.
const FORESEEN: usize = 25;

/// Steps that raise the energy, at most.
const RISES: usize = 6;

/// Pulls up to this many units of rounding of their row do not open a gap.
const RELEASE: f64 = 16.0 * f64::EPSILON;

/// The ratio of successive losses where none was seen: the error is as large as the last loss.
const UNKNOWN_RATIO: f64 = 0.5;

/// A ratio is taken to be at least this, and at most one minus this.
const LEAST_RATIO: f64 = 1e-3;

/// Ratios of losses among which the largest counts.
const RECENT: usize = 3;

/// Steps that show how the method converges on a mesh, at least.
const LOOK: usize = 3;

/// They go on until this part or less of what they gained after the first one seems to be left.
const SEEN: f64 = 0.1;

/// Up to so many vertices the gains of a step say little as long as the contact set changes.
const SMALL: usize = 2000;

/// A first step is never believed to leave less than this part of the squared error.
const LEAST_LEFT: f64 = 0.01;

/// When an iterate is good enough.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Goal {
    /// The largest |r_j|/d_j in the rows that must vanish is at most this part of the largest value.
    Kkt(f64),
    /// |r| <= 1e-12 |b| in the Euclidean norm, or what rounding allows, and the largest |r_j|/d_j at most this part of the largest value: where the
    /// tension jumps the norm does not see its low side.
    Tight(f64),
    /// The estimate of the squared error in the norm of the matrix is at most this.
    Energy(f64),
}

/// How a descent went.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Report {
    /// Preconditioned steps.
    pub steps: usize,
    /// Monotone cycles.
    pub monotone: usize,
    /// Factorisations of the initial mesh so far, by the levels that were used.
    pub factorisations: usize,
    /// How it ended.
    pub status: Status,
    /// Estimate of the squared error in the norm of the matrix.
    pub error_squared: f64,
    /// The largest ratio of successive losses among the last steps, if there were two.
    pub ratio: Option<f64>,
    /// Part of the squared error that the first step left, as the later ones showed, if there were any.
    pub left: Option<f64>,
}

impl Report {
    /// Draws the conclusions from the losses; `left` is the part left by a first step elsewhere.
    fn judge(&mut self, losses: &[f64], left: Option<f64>) {
        let Some(&last) = losses.last() else {
            return;
        };
        let recent = &losses[losses.len().saturating_sub(RECENT + 1)..];
        self.ratio = recent
            .windows(2)
            .map(|pair| {
                if pair[0] > 0.0 {
                    pair[1] / pair[0]
                } else {
                    0.0
                }
            })
            .reduce(f64::max);
        let part = match self.ratio {
            Some(ratio) => ratio,
            None => left.unwrap_or(UNKNOWN_RATIO),
        };
        let part = part.clamp(LEAST_RATIO, 1.0 - LEAST_RATIO);
        self.error_squared = last * part / (1.0 - part);
        let later = losses[1..].iter().sum::<f64>() + self.error_squared;
        if losses.len() > 1 && losses[0] + later > 0.0 {
            self.left = Some((later / (losses[0] + later)).max(LEAST_LEFT));
        }
    }
}

/// An iterate in the order of the hierarchy, and the vectors of the method.
pub(crate) struct Descent<'a, U: Unknowns> {
    pub hierarchy: &'a Hierarchy,
    pub finest: &'a Finest<U>,
    pub levels: &'a mut Levels<U>,
    /// Whether the gap must not be negative; else the problem is linear.
    pub inequality: bool,
    /// Sum of the magnitudes that the load of a rank was computed from.
    pub load_scale: &'a dyn Fn(usize) -> f64,
    /// The iterate; 0 on the boundary.
    pub x: Vec<U::Value>,
    /// Loads, boundary columns moved right.
    pub b: Vec<U::Value>,
    /// The largest value on the boundary.
    pub boundary_size: f64,
    /// The contact set. With an inequality the boundary belongs to it: nothing moves there.
    pub contact: Vec<bool>,
    /// b - A x, 0 on the boundary.
    pub r: Vec<U::Value>,
    pub(super) scratch: Vec<U::Value>,
    pub(super) correction: Vec<U::Value>,
    pub(super) direction: Vec<U::Value>,
    pub(super) image: Vec<U::Value>,
    /// direction . image, once there is a direction.
    pub(super) curvature: Option<f64>,
    /// Whether the iterate comes from nothing.
    pub(super) cold: bool,
    /// Monotone cycles so far.
    pub(super) monotone_cycles: usize,
    /// Steps taken back so far.
    pub(super) taken_back: usize,
    /// Whether the levels hold the matrices truncated on `contact`.
    pub(super) swept: bool,
    /// |r|^2 of a linear problem whose residual is in `scratch` already.
    pub(super) read_ahead: Option<f64>,
}

/// What one pass over the residual finds.
struct Reading {
    changed: bool,
    residual_squared: f64,
}

impl<'a, U: Unknowns> Descent<'a, U> {
    /// An iterate with its load; `untruncated` says that the levels hold the plain matrices.
    pub fn new(
        hierarchy: &'a Hierarchy,
        finest: &'a Finest<U>,
        levels: &'a mut Levels<U>,
        inequality: bool,
        load_scale: &'a dyn Fn(usize) -> f64,
        values: Vectors<U>,
    ) -> Descent<'a, U> {
        let n = hierarchy.len();
        let [r, scratch, correction, direction, image] = [(); 5].map(|()| levels.vector(n));
        Descent {
            hierarchy,
            finest,
            levels,
            inequality,
            load_scale,
            x: values.x,
            b: values.b,
            boundary_size: values.boundary_size,
            contact: if inequality {
                hierarchy.fixed.clone()
            } else {
                vec![false; n]
            },
            r,
            scratch,
            correction,
            direction,
            image,
            curvature: None,
            cold: false,
            monotone_cycles: 0,
            taken_back: 0,
            swept: values.plain,
            read_ahead: None,
        }
    }

    /// Descends until the goal is reached, or no further.
    ///
    /// `left` is the part of the squared error that a first step left on an earlier mesh.
    pub fn run(&mut self, goal: Goal, cold: bool, left: Option<f64>) -> Result<Report, SolveError> {
        let mut report = self.descend(goal, cold, left)?;
        report.monotone = self.monotone_cycles;
        report.factorisations = self.levels.initial.factorisations;
        Ok(report)
    }

    fn descend(&mut self, goal: Goal, cold: bool, left: Option<f64>) -> Result<Report, SolveError> {
        let mut report = Report {
            steps: 0,
            monotone: 0,
            factorisations: 0,
            status: Status::Converged,
            error_squared: 0.0,
            ratio: None,
            left: None,
        };
        let mut losses = Vec::new();
        self.cold = cold;
        if self.inequality {
            for (x, &d) in self.x.iter_mut().zip(&self.finest.diagonal) {
                if U::gap(*x) < 0.0 {
                    *x = U::close(*x, U::share(d));
                }
            }
        }
        self.residual();
        if cold && self.inequality {
            self.monotone_start()?;
        }
        let mut history = Vec::new();
        loop {
            let reading = self.read();
            if reading.changed {
                self.swept = false;
            }
            let reached = match goal {
                Goal::Kkt(t) => {
                    let (worst, size) = self.misfit();
                    history.push(worst / (t * size));
                    worst <= t * size
                }
                Goal::Tight(most) => {
                    let over = (reading.residual_squared / self.tight()).sqrt();
                    history.push(over);
                    over <= 1.0 && {
                        let (worst, size) = self.misfit();
                        worst <= most * size
                    }
                }
                Goal::Energy(target) => {
                    let later = losses.iter().skip(1).sum::<f64>();
                    let rest = report.error_squared;
                    let known = match losses.len() {
                        0 => false,
                        // One step, or two that tell their own ratio.
                        _ if left.is_some() => true,
                        n => n >= LOOK && (rest <= SEEN * later || rest <= SEEN * SEEN * target),
                    };
                    // On a small mesh a few vertices of the contact set hold much of the energy: it must stand first.
                    let settled = !reading.changed || self.x.len() > SMALL;
                    rest <= target && known && settled
                }
            };
            if reached || reading.residual_squared == 0.0 {
                report.status = Status::Converged;
                return Ok(report);
            }
            if !reading.residual_squared.is_finite() || hopeless(&history) {
                report.status = Status::Stagnated;
                return Ok(report);
            }
            if report.steps >= LIMIT {
                report.status = Status::Limit;
                return Ok(report);
            }
            report.steps += 1;
            let Some(loss) = self.step()? else {
                // Nothing left to gain in this precision.
                report.status = Status::Stagnated;
                return Ok(report);
            };
            if self.taken_back > RISES {
                report.status = Status::Stagnated;
                return Ok(report);
            }
            losses.push(loss);
            report.judge(&losses, left);
        }
    }

    /// The iterate, its residual and the contact set; the other vectors go back to the levels.
    pub fn release(mut self) -> (Vec<U::Value>, Vec<U::Value>, Vec<bool>) {
        let spare = [
            &mut self.b,
            &mut self.scratch,
            &mut self.correction,
            &mut self.direction,
            &mut self.image,
        ];
        self.levels.spare.extend(spare.map(std::mem::take));
        if !self.inequality {
            self.levels.spare.push(std::mem::take(&mut self.r));
        }
        (self.x, self.r, self.contact)
    }

    /// The residual computed afresh, and the contact set that belongs to it.
    pub fn settle(&mut self) {
        self.residual();
        self.read();
    }

    /// Reads the contact set and the size of the residual.
    ///
    /// The residual that is to be preconditioned, T'r, is left in `scratch`.
    fn read(&mut self) -> Reading {
        if let Some(residual_squared) = self.read_ahead.take() {
            return Reading {
                changed: false,
                residual_squared,
            };
        }
        let mut changed = false;
        let mut residual_squared = 0.0;
        let (hierarchy, finest, load_scale) = (self.hierarchy, self.finest, self.load_scale);
        // The least over the fields of `|A||x| + |load|` in a row: what its rounding errors are relative to.
        let row_scale = |p: usize, x: &[U::Value]| {
            let sums = row_magnitude(hierarchy, finest, x, p);
            let sums = sums[..U::WIDTH].iter().copied();
            sums.fold(f64::INFINITY, f64::min) + load_scale(p)
        };
        let rows = self.x.iter().zip(&self.r).zip(&mut self.scratch);
        if self.inequality {
            for (p, (((&x, &r), rest), contact)) in rows.zip(&mut self.contact).enumerate() {
                let mut touching = false;
                *rest = r;
                if U::gap(x) <= 0.0 {
                    let share = finest.share(p);
                    let pull = U::pull(r, share);
                    touching = pull <= 0.0 || pull <= RELEASE * row_scale(p, &self.x);
                    if touching {
                        *rest = U::gather(r, share);
                    }
                }
                changed |= touching != *contact;
                *contact = touching;
                residual_squared += U::dot(*rest, *rest);
            }
        } else {
            for ((_, &r), rest) in rows {
                *rest = r;
                residual_squared += U::dot(r, r);
            }
        }
        Reading {
            changed,
            residual_squared,
        }
    }

    /// The largest |r_j|/d_j in the rows that must vanish, and the largest value.
    fn misfit(&self) -> (f64, f64) {
        let (mut worst, mut size) = (0.0f64, self.boundary_size);
        let rows = self.r.iter().zip(&self.x).zip(&self.finest.diagonal);
        for (((&r, &x), &d), &contact) in rows.zip(&self.contact) {
            worst = worst.max(U::misfit(r, d, contact));
            size = size.max(U::size(x));
        }
        (worst, if size == 0.0 { 1.0 } else { size })
    }

    /// What |r|^2 is after a solve as exact as makes sense.
    fn tight(&self) -> f64 {
        let mut rounding = 0.0;
        for (&x, &d) in self.x.iter().zip(&self.finest.diagonal) {
            let y = U::plus_plain(U::Value::default(), d, x);
            rounding += U::dot(y, y);
        }
        (1e-24 * dot::<U>(&self.b, &self.b)).max(f64::EPSILON * f64::EPSILON * rounding)
    }
}

/// What a descent begins with, in the order of the hierarchy.
pub(crate) struct Vectors<U: Unknowns> {
    /// The iterate, 0 on the boundary.
    pub x: Vec<U::Value>,
    /// Loads, boundary columns moved right.
    pub b: Vec<U::Value>,
    /// The largest value on the boundary.
    pub boundary_size: f64,
    /// Whether the levels hold the plain matrices already.
    pub plain: bool,
}

pub(super) fn dot<U: Unknowns>(x: &[U::Value], y: &[U::Value]) -> f64 {
    x.iter().zip(y).map(|(&a, &b)| U::dot(a, b)).sum()
}

/// Whether the residuals of the last ten steps, in units of what is wanted, let more steps be expected than twice the limit.
fn hopeless(history: &[f64]) -> bool {
    let n = history.len();
    if n < FORESEEN {
        return false;
    }
    let fall = (history[n - 11] / history[n - 1]).ln() / 10.0;
    let missing = history[n - 1].ln();
    fall.is_nan() || fall <= 0.0 || n as f64 + missing / fall > 2.0 * LIMIT as f64
}
