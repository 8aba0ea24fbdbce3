//! Loads and tensions as the pass reads them: what is the same everywhere costs nothing.

use contact::DiscreteProblem;
use fem_core::ElementValues;
use fem_core::integrate::Loads;

/// The data of the elements, as the pass reads them; those of both membranes at once.
pub(super) trait Data {
    /// Whether the loads deviate from their means.
    const VARYING: bool;

    /// mu_iK.
    fn tensions(&self, t: usize) -> [f64; 2];

    /// 1/mu_iK.
    fn softness(&self, t: usize) -> [f64; 2];

    /// 1/max(mu_iK, mu_iK') for two neighbours.
    fn stiffer(&self, t: usize, s: usize) -> [f64; 2];

    /// f_ih.
    fn means(&self, t: usize) -> [f64; 2];
}

/// Tensions that are the same everywhere.
pub(super) struct Even {
    tension: [f64; 2],
    softness: [f64; 2],
}

impl Even {
    pub fn of(problem: &DiscreteProblem) -> Option<Even> {
        let [Some(m1), Some(m2)] = problem.tension_mean.each_ref().map(ElementValues::same) else {
            return None;
        };
        Some(Even {
            tension: [m1, m2],
            softness: [1.0 / m1, 1.0 / m2],
        })
    }
}

/// Element means of loads.
pub(super) trait Means {
    /// Whether the loads deviate from them.
    const VARYING: bool;

    /// f_ih.
    fn means(&self, t: usize) -> [f64; 2];
}

/// Loads that are the same everywhere.
impl Means for [f64; 2] {
    const VARYING: bool = false;

    #[inline(always)]
    fn means(&self, _: usize) -> [f64; 2] {
        *self
    }
}

impl Means for &[Loads; 2] {
    const VARYING: bool = true;

    #[inline(always)]
    fn means(&self, t: usize) -> [f64; 2] {
        self.each_ref().map(|f| f.mean(t))
    }
}

/// Constant tensions, and loads.
pub(super) struct Loaded<L> {
    pub even: Even,
    pub loads: L,
}

impl<L: Means> Data for Loaded<L> {
    const VARYING: bool = L::VARYING;

    #[inline(always)]
    fn tensions(&self, _: usize) -> [f64; 2] {
        self.even.tension
    }

    #[inline(always)]
    fn softness(&self, _: usize) -> [f64; 2] {
        self.even.softness
    }

    #[inline(always)]
    fn stiffer(&self, _: usize, _: usize) -> [f64; 2] {
        self.even.softness
    }

    #[inline(always)]
    fn means(&self, t: usize) -> [f64; 2] {
        self.loads.means(t)
    }
}

impl Data for &DiscreteProblem {
    const VARYING: bool = true;

    #[inline(always)]
    fn tensions(&self, t: usize) -> [f64; 2] {
        self.tension_mean.each_ref().map(|mean| mean[t])
    }

    #[inline(always)]
    fn softness(&self, t: usize) -> [f64; 2] {
        self.tensions(t).map(|mu| 1.0 / mu)
    }

    #[inline(always)]
    fn stiffer(&self, t: usize, s: usize) -> [f64; 2] {
        let (here, there) = (self.tensions(t), self.tensions(s));
        [0, 1].map(|i| 1.0 / here[i].max(there[i]))
    }

    #[inline(always)]
    fn means(&self, t: usize) -> [f64; 2] {
        (&self.loads).means(t)
    }
}
