//! Settings by the names that the scene file has for them.

use adapt::settings::{Children, Estimator, Fields, Final, Stop, Strategy};
use contact::{Solver, Tolerance};
use serde_json::Value;

/// `solve.solver`.
pub fn solver(solver: Solver) -> &'static str {
    match solver {
        Solver::Auto => "auto",
        Solver::Clarabel => "clarabel",
        Solver::ActiveSet => "active-set",
        Solver::Multigrid => "multigrid",
    }
}

/// `solve.tolerance`.
pub fn tolerance(tolerance: Tolerance) -> String {
    match tolerance {
        Tolerance::Balanced => "balanced".into(),
        // With an exponent where it is small.
        Tolerance::Relative(value) => format!("{value:?}"),
    }
}

/// `estimate.estimator`.
pub fn estimator(estimator: Estimator) -> &'static str {
    match estimator {
        Estimator::Certified => "certified",
        Estimator::Residual => "residual",
        Estimator::Paper => "paper",
    }
}

/// `estimate.final`.
pub fn last(last: Final) -> &'static str {
    match last {
        Final::Sharp => "sharp",
        Final::Fast => "fast",
    }
}

/// `mark.strategy`.
pub fn strategy(strategy: Strategy) -> &'static str {
    match strategy {
        Strategy::Doerfler => "doerfler",
        Strategy::Maximum => "maximum",
        Strategy::Uniform => "uniform",
    }
}

/// `mark.children`.
pub fn children(children: Children) -> usize {
    match children {
        Children::Two => 2,
        Children::Four => 4,
    }
}

/// `output.fields`.
pub fn fields(fields: Fields) -> String {
    match fields {
        Fields::All => "all".into(),
        Fields::Last => "last".into(),
        Fields::None => "none".into(),
        Fields::Every(n) => format!("every {n}"),
    }
}

/// The rules under `[stop]` that apply, with their values.
pub fn rules(stop: &Stop) -> Vec<(&'static str, Value)> {
    [
        ("relative_error", stop.relative_error.map(Value::from)),
        ("error", stop.error.map(Value::from)),
        ("vertices", stop.vertices.map(Value::from)),
        ("levels", stop.levels.map(Value::from)),
        ("seconds", stop.seconds.map(Value::from)),
    ]
    .into_iter()
    .filter_map(|(name, value)| Some((name, value?)))
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tolerances_are_short() {
        for (value, text) in [(1e-10, "1e-10"), (2.5e-7, "2.5e-7"), (0.001, "0.001")] {
            assert_eq!(tolerance(Tolerance::Relative(value)), text);
        }
    }
}
