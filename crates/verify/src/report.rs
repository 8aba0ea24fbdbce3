//! What was found: how many claims were looked at, and which of them fail.

use std::fmt;

use fem_core::scale::times_power_of_two;

use crate::number::{Number, TOLERANCE, largest};

/// A claim of a run that does not hold.
#[derive(Clone, Debug, PartialEq)]
pub struct Failure {
    /// Name of the file that makes the claim.
    pub file: String,
    /// What it is about: a key, column, array, or a property in words.
    pub claim: String,
    /// Where in an array, for example `vertex 12`; empty for a single value.
    pub place: String,
    /// What the file says; for a property, what is wrong.
    pub claimed: String,
    /// What was recomputed; none for a property.
    pub recomputed: Option<String>,
    /// Absolute difference of the two, where both are numbers, in the unit of the file.
    pub difference: Option<f64>,
    /// How many other values of the array fail too.
    pub others: usize,
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}`: `{}`", self.file, self.claim)?;
        if !self.place.is_empty() {
            write!(f, " at {}", self.place)?;
        }
        match &self.recomputed {
            Some(recomputed) => {
                write!(f, " is `{}`, recomputed `{recomputed}`", self.claimed)?;
            }
            None => write!(f, ": {}", self.claimed)?,
        }
        if let Some(difference) = self.difference {
            write!(f, ", difference `{difference:e}`")?;
        }
        match self.others {
            0 => Ok(()),
            1 => write!(f, ", and 1 other value"),
            n => write!(f, ", and {n} other values"),
        }
    }
}

/// The outcome of a verification.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Report {
    /// Claims that were compared; an array is one.
    pub claims: usize,
    /// Those that do not hold, in the order they were met.
    pub failures: Vec<Failure>,
    /// Levels of the run.
    pub levels: usize,
    /// Levels whose fields were recomputed.
    pub recomputed: Vec<usize>,
}

impl Report {
    /// Whether every claim holds.
    pub fn holds(&self) -> bool {
        self.failures.is_empty()
    }

    fn fail(&mut self, failure: Failure) {
        self.failures.push(failure);
    }

    /// A property: holds, or `wrong` says what is the matter.
    pub(crate) fn property(&mut self, file: &str, claim: &str, wrong: Option<String>) {
        self.claims += 1;
        if let Some(wrong) = wrong {
            self.fail(Failure {
                file: file.to_owned(),
                claim: claim.to_owned(),
                place: String::new(),
                claimed: wrong,
                recomputed: None,
                difference: None,
                others: 0,
            });
        }
    }

    /// Two values that must be the same.
    pub(crate) fn same<T: PartialEq + fmt::Display>(
        &mut self,
        file: &str,
        claim: &str,
        claimed: T,
        recomputed: T,
    ) {
        self.claims += 1;
        if claimed != recomputed {
            self.differ(
                file,
                claim,
                &claimed.to_string(),
                &recomputed.to_string(),
                None,
            );
        }
    }

    /// Records that a single value is not what it should be.
    pub(crate) fn differ(
        &mut self,
        file: &str,
        claim: &str,
        claimed: &str,
        recomputed: &str,
        difference: Option<f64>,
    ) {
        self.fail(Failure {
            file: file.to_owned(),
            claim: claim.to_owned(),
            place: String::new(),
            claimed: claimed.to_owned(),
            recomputed: Some(recomputed.to_owned()),
            difference,
            others: 0,
        });
    }

    /// A number in the user's units.
    pub(crate) fn number(&mut self, file: &str, claim: &str, claimed: f64, expected: Number) {
        self.claims += 1;
        if !expected.agrees(claimed) {
            let recomputed = expected.physical();
            self.differ(
                file,
                claim,
                &show(claimed),
                &show(recomputed),
                Some((claimed - recomputed).abs()),
            );
        }
    }

    /// An array in the user's units against recomputed values in units of 2^exponent.
    ///
    /// Every value may differ by [`TOLERANCE`] of the largest one, and by `slack(k)` beyond that.
    pub(crate) fn array(&mut self, claim: &Claim<'_>, slack: impl Fn(usize) -> f64) {
        let size = TOLERANCE * largest(claim.recomputed);
        self.values(claim, |k| size + slack(k));
    }

    /// As [`Report::array`], but every value may differ by `slack(k)` and no more.
    pub(crate) fn values(&mut self, claim: &Claim<'_>, slack: impl Fn(usize) -> f64) {
        self.claims += 1;
        let mut worst: Option<(usize, f64)> = None;
        let mut count = 0;
        for (k, (&claimed, &value)) in claim.claimed.iter().zip(claim.recomputed).enumerate() {
            let expected = Number {
                value,
                slack: slack(k),
                exponent: claim.exponent,
            };
            if !expected.agrees(claimed) {
                count += 1;
                let difference = (claimed - expected.physical()).abs();
                if worst.is_none_or(|(_, d)| difference.is_nan() || difference > d) {
                    worst = Some((k, difference));
                }
            }
        }
        if let Some((k, difference)) = worst {
            let recomputed = times_power_of_two(claim.recomputed[k], claim.exponent);
            self.fail(Failure {
                file: claim.file.to_owned(),
                claim: claim.name.to_owned(),
                place: format!("{} {k}", claim.place),
                claimed: show(claim.claimed[k]),
                recomputed: Some(show(recomputed)),
                difference: Some(difference),
                others: count - 1,
            });
        }
    }

    /// A property of every value of an array, or of every place of a mesh: `wrong(k)` is what the file has there where it fails, and
    /// what it should have if that can be said.
    pub(crate) fn everywhere(
        &mut self,
        file: &str,
        claim: &str,
        place: &str,
        count: usize,
        wrong: impl Fn(usize) -> Option<(String, Option<String>)>,
    ) {
        self.claims += 1;
        let mut failed = (0..count).filter_map(|k| Some((k, wrong(k)?)));
        if let Some((first, (claimed, recomputed))) = failed.next() {
            let claimed = match recomputed {
                Some(_) => claimed,
                None => format!("there it is `{claimed}`"),
            };
            self.fail(Failure {
                file: file.to_owned(),
                claim: claim.to_owned(),
                place: format!("{place} {first}"),
                claimed,
                recomputed,
                difference: None,
                others: failed.count(),
            });
        }
    }
}

/// An array of a file and what it should be.
pub(crate) struct Claim<'a> {
    /// The file.
    pub file: &'a str,
    /// Name of the array.
    pub name: &'a str,
    /// What it has one entry for: `vertex`, `triangle`, `edge`.
    pub place: &'a str,
    /// The values of the file.
    pub claimed: &'a [f64],
    /// The recomputed ones in units of 2^exponent; as many.
    pub recomputed: &'a [f64],
    /// Exponent of their unit.
    pub exponent: i32,
}

/// A number so that every digit is seen; counts as counts.
pub(crate) fn show(value: f64) -> String {
    let (plain, exponent) = (format!("{value}"), format!("{value:e}"));
    let short = value.fract() == 0.0 && value.abs() < 1e9;
    if short || plain.len() <= exponent.len() {
        plain
    } else {
        exponent
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn compared(claimed: &[f64]) -> Report {
        let mut report = Report::default();
        let claim = Claim {
            file: "level_0000.vtu",
            name: "u1",
            place: "vertex",
            claimed,
            recomputed: &[1.0, 0.0, -4.0],
            exponent: 1,
        };
        report.array(&claim, |_| 0.0);
        report
    }

    #[test]
    fn arrays_are_judged_by_their_largest_value() {
        assert!(compared(&[2.0 + 7e-9, 7e-9, -8.0]).holds());
        let report = compared(&[2.0 + 9e-9, 1.0, -8.0]);
        assert_eq!(report.claims, 1);
        assert_eq!(
            report.failures[0].to_string(),
            "`level_0000.vtu`: `u1` at vertex 1 is `1`, recomputed `0`, difference `1e0`, and 1 other value"
        );
        assert!(!compared(&[2.0, 0.0, f64::NAN]).holds());
    }

    #[test]
    fn messages() {
        let mut report = Report::default();
        report.same("summary.json", "levels", 3, 4);
        report.property(
            "level_0001.vtu",
            "triangulation",
            Some("the mesh has no triangles".into()),
        );
        report.everywhere("level_0001.vtu", "gap >= 0", "vertex", 9, |k| {
            (k > 6).then(|| ("-1".into(), None))
        });
        report.everywhere("level_0001.vtu", "region", "triangle", 2, |_| {
            Some(("1".into(), Some("2".into())))
        });
        report.number("summary.json", "energy", 2.5, Number::plain(2.0, 0));
        let said: Vec<String> = report.failures.iter().map(Failure::to_string).collect();
        assert_eq!(
            said,
            [
                "`summary.json`: `levels` is `3`, recomputed `4`",
                "`level_0001.vtu`: `triangulation`: the mesh has no triangles",
                "`level_0001.vtu`: `gap >= 0` at vertex 7: there it is `-1`, and 1 other value",
                "`level_0001.vtu`: `region` at triangle 0 is `1`, recomputed `2`, and 1 other value",
                "`summary.json`: `energy` is `2.5`, recomputed `2`, difference `5e-1`",
            ]
        );
    }
}
