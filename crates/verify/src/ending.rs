//! How the run ended: outcome, rule and exit code against the rules of the scene.

use adapt::output::folder::{HISTORY, SUMMARY};
use adapt::{Reason, Settings};
use fem_core::scale::times_power_of_two;
use serde_json::{Map, Value};

use crate::columns::Recomputed;
use crate::level::unseen;
use crate::report::Report;
use crate::tables::{Cell, History};

/// Part of the largest element contribution up to which a bound counts as rounding (a zero solution ends the run).
const ROUNDING_SHARE: f64 = 1e-12;

/// The rules of a scene, in the order in which they are asked.
const RULES: [Reason; 5] = [
    Reason::RelativeError,
    Reason::Error,
    Reason::Vertices,
    Reason::Levels,
    Reason::Seconds,
];

/// Whether a rule holds; unknown where it hangs on a level without fields or on rounding.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Held {
    Yes,
    No,
    Unknown,
}

impl Held {
    fn of(holds: bool) -> Held {
        if holds { Held::Yes } else { Held::No }
    }

    /// value <= limit, unknown within the slack.
    fn at_most(value: f64, slack: f64, limit: f64) -> Held {
        let slack = slack + 1e-9 * limit.abs();
        if value <= limit - slack {
            Held::Yes
        } else if value > limit + slack {
            Held::No
        } else {
            Held::Unknown
        }
    }

    fn and(self, other: Held) -> Held {
        match (self, other) {
            (Held::No, _) | (_, Held::No) => Held::No,
            (Held::Yes, Held::Yes) => Held::Yes,
            _ => Held::Unknown,
        }
    }
}

/// Whether an accuracy goal holds on a recomputed level.
fn goal(reason: Reason, limit: f64, level: &Recomputed<'_>) -> Held {
    let Some(bound) = level.bound() else {
        return Held::Unknown;
    };
    let hidden = unseen(level);
    let limit = match reason {
        Reason::RelativeError => {
            // Both in the unit of the bound.
            let exponent = level.norm.exponent - bound.exponent;
            let norm = times_power_of_two(level.norm.value, exponent);
            limit * norm + ROUNDING_SHARE * hidden.contribution
        }
        _ => times_power_of_two(limit, -bound.exponent),
    };
    let within = |value: f64, slack: f64| Held::at_most(value, slack, limit);
    within(bound.value, bound.slack).and(within(hidden.oscillation.value, hidden.oscillation.slack))
}

/// Whether a rule holds on a level; `None` if the scene does not set it.
fn held(
    reason: Reason,
    settings: &Settings,
    number: usize,
    history: &History,
    level: Option<&Recomputed<'_>>,
) -> Option<Held> {
    let stop = &settings.stop;
    let accuracy = |limit: f64| level.map_or(Held::Unknown, |l| goal(reason, limit, l));
    let reaches = |name: &str, limit: f64| {
        let value = history.number(number, name);
        value.map_or(Held::Unknown, |v| Held::of(v >= limit))
    };
    match reason {
        Reason::RelativeError => stop.relative_error.map(accuracy),
        Reason::Error => stop.error.map(accuracy),
        Reason::Vertices => stop.vertices.map(|n| reaches("vertices", n as f64)),
        Reason::Levels => stop.levels.map(|n| Held::of(number + 1 >= n)),
        Reason::Seconds => stop.seconds.map(|s| reaches("seconds_total", s)),
    }
}

/// No rule may hold on a level after which the run went on.
pub(crate) fn check_earlier(
    settings: &Settings,
    number: usize,
    history: &History,
    level: Option<&Recomputed<'_>>,
    report: &mut Report,
) {
    let holds =
        |&reason: &Reason| held(reason, settings, number, history, level) == Some(Held::Yes);
    let wrong = RULES.into_iter().find(holds).map(|reason| {
        format!(
            "`{}` holds on level {number}, and the run went on",
            reason.key()
        )
    });
    report.property(HISTORY, "stop", wrong);
}

/// Compares outcome, rule and exit code of the summary with the rules on the last level.
pub(crate) fn check_last(
    settings: &Settings,
    summary: &Map<String, Value>,
    history: &History,
    level: Option<&Recomputed<'_>>,
    report: &mut Report,
) {
    let Some(number) = history.len().checked_sub(1) else {
        return;
    };
    let text = |key: &str| summary.get(key).and_then(Value::as_str).unwrap_or_default();
    let (outcome, stopped_by) = (text("outcome"), text("stopped_by"));
    let held = |reason| held(reason, settings, number, history, level);
    let has_goal = settings.stop.relative_error.is_some() || settings.stop.error.is_some();
    let mut wrong = None;
    let code = match outcome {
        "failed" | "interrupted" => {
            let held = RULES.into_iter().find(|&r| held(r) == Some(Held::Yes));
            wrong = held.map(|r| format!("`{}` holds on the last level", r.key()));
            if outcome == "failed" {
                let head = format!("level {}: ", number + 1);
                if !stopped_by.starts_with(&head) {
                    wrong = Some(format!("`{stopped_by}` does not name level {}", number + 1));
                }
                3
            } else {
                130
            }
        }
        _ => match RULES.into_iter().find(|r| r.key() == stopped_by) {
            None => {
                report.property(
                    SUMMARY,
                    "stopped_by",
                    Some(format!("`{stopped_by}` is no rule")),
                );
                return;
            }
            Some(reason) => {
                match held(reason) {
                    None => wrong = Some(format!("the scene does not set `{stopped_by}`")),
                    Some(Held::No) => wrong = Some(format!("`{stopped_by}` does not hold")),
                    Some(_) => {}
                }
                let before = RULES.into_iter().take_while(|r| *r != reason);
                if let Some(first) = before.into_iter().find(|&r| held(r) == Some(Held::Yes)) {
                    wrong = Some(format!("`{}` holds before `{stopped_by}`", first.key()));
                }
                let expected = if reason.is_goal() { "goal" } else { "limit" };
                report.same(SUMMARY, "outcome", outcome, expected);
                if reason.is_goal() || !has_goal { 0 } else { 5 }
            }
        },
    };
    report.property(SUMMARY, "stopped_by", wrong);
    let claimed = Cell::of_json(summary.get("exit_code")).shown();
    report.same(SUMMARY, "exit_code", claimed, code.to_string());
}
