//! What a user may choose about a run.

pub use fem_core::Children;

/// The estimator that drives marking and stopping, or is computed beside it.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Estimator {
    /// The certificate: a guaranteed bound.
    Certified,
    /// The residual estimator, reliable up to a constant.
    Residual,
    /// The indicators (7.1), (7.2) of the paper.
    Paper,
}

/// The certificate on the last level.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Final {
    /// By RT1 fluxes, sharp to a few per cent.
    Sharp,
    /// By RT0 fluxes as on every level.
    Fast,
}

/// Which estimators are computed.
#[derive(Clone, PartialEq, Debug)]
pub struct Estimate {
    /// The one that drives marking and stopping.
    pub estimator: Estimator,
    /// Computed and written as well.
    pub also: Vec<Estimator>,
    /// The certificate on the last level, where it is computed at all.
    pub last: Final,
}

impl Estimate {
    /// Whether `estimator` is to be computed.
    pub fn wants(&self, estimator: Estimator) -> bool {
        self.estimator == estimator || self.also.contains(&estimator)
    }
}

/// How triangles are marked for refinement.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Strategy {
    /// The smallest set whose squared indicators sum to at least theta of the total.
    Doerfler,
    /// Every triangle whose indicator is at least theta times the largest.
    Maximum,
    /// Every triangle.
    Uniform,
}

/// Settings of the marking.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Mark {
    /// How triangles are chosen.
    pub strategy: Strategy,
    /// The parameter theta in (0, 1].
    pub theta: f64,
    /// How far a marked triangle is divided; uniform marking always divides in four.
    pub children: Children,
}

/// When a run ends: the first rule that holds. `None` does not apply. Errors are in the user's units.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Stop {
    /// Bound over energy norm of the discrete solution.
    pub relative_error: Option<f64>,
    /// Bound.
    pub error: Option<f64>,
    /// Vertices: the run ends on the first level with at least so many.
    pub vertices: Option<usize>,
    /// Number of levels.
    pub levels: Option<usize>,
    /// Wall seconds since the run began.
    pub seconds: Option<f64>,
}

/// Which levels get a file of fields.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Fields {
    /// Every level.
    All,
    /// The last one.
    Last,
    /// None.
    None,
    /// Levels 0, n, 2n, ... and the last one.
    Every(usize),
}

/// What is written besides the history.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Output {
    /// Which levels get a .vtu.
    pub fields: Fields,
    /// Whether eta_e is written on the interior edges.
    pub edges: bool,
}

impl Output {
    /// Whether a level gets a file of fields.
    pub fn wants_fields(&self, level: usize, last: bool) -> bool {
        match self.fields {
            Fields::All => true,
            Fields::Last => last,
            Fields::None => false,
            Fields::Every(n) => last || level.is_multiple_of(n),
        }
    }
}

/// Settings of a run.
#[derive(Clone, PartialEq, Debug)]
pub struct Settings {
    /// Solver.
    pub solve: contact::Settings,
    /// Estimators.
    pub estimate: Estimate,
    /// Marking.
    pub mark: Mark,
    /// Stopping.
    pub stop: Stop,
    /// Files.
    pub output: Output,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            solve: contact::Settings::default(),
            estimate: Estimate {
                estimator: Estimator::Certified,
                also: vec![Estimator::Paper, Estimator::Residual],
                last: Final::Sharp,
            },
            mark: Mark {
                strategy: Strategy::Doerfler,
                theta: 0.5,
                children: Children::Four,
            },
            stop: Stop {
                relative_error: Some(0.01),
                vertices: Some(1_000_000),
                ..Stop::default()
            },
            output: Output {
                fields: Fields::Last,
                edges: false,
            },
        }
    }
}
