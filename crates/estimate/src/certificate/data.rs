//! Loads, tensions and the action inside contact as the passes over the elements read them: what is the same everywhere costs nothing.

use fem_core::integrate::Loads;

use super::Given;
use super::action::{Action, affine_action};
use super::element::Pair;
use super::moments::Moments;

/// The data of the elements; pairs are those of both membranes.
pub(super) trait Data: Sync {
    /// Whether both loads are the same everywhere.
    const SAME: bool;

    /// mu_iK.
    fn tension(&self, t: usize) -> Pair;

    /// The means of 1/mu_i, but for a factor that may be chosen for every membrane: nothing but the factor where tensions are constants.
    #[inline(always)]
    fn weight(&self, _t: usize) -> Pair {
        Pair([1.0; 2])
    }

    /// (f_i, phi_k) for the three corners of a triangle with this area.
    fn hats(&self, t: usize, area: f64) -> [Pair; 3];

    /// The squared deviations of the loads from their means.
    fn deviation(&self, t: usize) -> Pair;

    /// The action inside contact, where the loads have these moments.
    fn action(&self, t: usize, area: f64, hats: &[Pair; 3]) -> Action<'_>;
}

/// Everything the same everywhere.
pub(super) struct Plain {
    tension: [f64; 2],
    loads: [f64; 2],
    action: f64,
}

/// Constant tensions; the action is affine in an element where the loads allow it.
pub(super) struct Loaded<'a> {
    tension: [f64; 2],
    loads: &'a [Loads; 2],
    moments: &'a Moments,
}

/// Anything; all of the action is sampled.
pub(super) struct General<'a>(pub &'a Given<'a>);

/// The tensions, if both are constants.
fn even(given: &Given<'_>) -> Option<[f64; 2]> {
    match given.tension.map(|f| f.constant()) {
        [Some(m1), Some(m2)] => Some([m1, m2]),
        _ => None,
    }
}

impl Plain {
    pub fn of(given: &Given<'_>) -> Option<Plain> {
        let tension = even(given)?;
        let [Some(f1), Some(f2)] = given.loads.each_ref().map(Loads::same) else {
            return None;
        };
        Some(Plain {
            tension,
            loads: [f1, f2],
            action: given.moments.constant_action()?,
        })
    }
}

impl<'a> Loaded<'a> {
    pub fn of(given: &Given<'a>) -> Option<Loaded<'a>> {
        Some(Loaded {
            tension: even(given)?,
            loads: given.loads,
            moments: given.moments,
        })
    }
}

impl Data for Plain {
    const SAME: bool = true;

    #[inline(always)]
    fn tension(&self, _: usize) -> Pair {
        Pair(self.tension)
    }

    #[inline(always)]
    fn hats(&self, _: usize, area: f64) -> [Pair; 3] {
        [Pair(self.loads) * (area / 3.0); 3]
    }

    #[inline(always)]
    fn deviation(&self, _: usize) -> Pair {
        Pair::default()
    }

    #[inline(always)]
    fn action(&self, _: usize, _: f64, _: &[Pair; 3]) -> Action<'_> {
        Action::Affine([self.action; 3])
    }
}

/// The moments of two loads by corners.
#[inline(always)]
pub(super) fn hats(loads: &[Loads; 2], t: usize, area: f64) -> [Pair; 3] {
    let [f, g] = loads.each_ref().map(|f| f.moments(t, area));
    [0, 1, 2].map(|k| Pair([f[k], g[k]]))
}

/// The squared deviations of two loads from their means.
#[inline(always)]
pub(super) fn deviation(loads: &[Loads; 2], t: usize) -> Pair {
    Pair(loads.each_ref().map(|f| f.deviation_squared(t)))
}

impl Data for Loaded<'_> {
    const SAME: bool = false;

    #[inline(always)]
    fn tension(&self, _: usize) -> Pair {
        Pair(self.tension)
    }

    #[inline(always)]
    fn hats(&self, t: usize, area: f64) -> [Pair; 3] {
        hats(self.loads, t, area)
    }

    #[inline(always)]
    fn deviation(&self, t: usize) -> Pair {
        deviation(self.loads, t)
    }

    #[inline]
    fn action(&self, t: usize, area: f64, hats: &[Pair; 3]) -> Action<'_> {
        if let Some(value) = self.moments.constant_action() {
            return Action::Affine([value; 3]);
        }
        match affine_action(self.tension, area, hats, self.deviation(t)) {
            Some(corners) => Action::Affine(corners),
            None => self.moments.action(t),
        }
    }
}

impl Data for General<'_> {
    const SAME: bool = false;

    #[inline(always)]
    fn tension(&self, t: usize) -> Pair {
        Pair(self.0.tension_mean.each_ref().map(|mean| mean[t]))
    }

    #[inline(always)]
    fn weight(&self, t: usize) -> Pair {
        Pair(self.0.moments.softness.each_ref().map(|s| s.at(t)))
    }

    #[inline(always)]
    fn hats(&self, t: usize, area: f64) -> [Pair; 3] {
        hats(self.0.loads, t, area)
    }

    #[inline(always)]
    fn deviation(&self, t: usize) -> Pair {
        deviation(self.0.loads, t)
    }

    #[inline(always)]
    fn action(&self, t: usize, _: f64, _: &[Pair; 3]) -> Action<'_> {
        self.0.moments.action(t)
    }
}
