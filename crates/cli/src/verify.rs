//! `membranes verify`.

use std::path::Path;

use ::verify::{Failure as Claim, Report};
use serde_json::{Value, json};

use crate::args::VerifyArgs;
use crate::failure::{CLAIM_FAILS, Failure, say, tell};

/// Recomputes a run; the exit code says whether every claim holds.
///
/// # Errors
/// The folder holds no finished run, or a file cannot be read.
pub fn verify(arguments: &VerifyArgs) -> Result<u8, Failure> {
    let report = ::verify::verify(&arguments.folder)?;
    for claim in &report.failures {
        tell(&format!("error: {claim}"));
    }
    say(&if arguments.json {
        object(&report, &arguments.folder).to_string()
    } else {
        final_line(&report, &arguments.folder)
    })?;
    Ok(if report.holds() { 0 } else { CLAIM_FAILS })
}

/// The result in one line.
fn final_line(report: &Report, folder: &Path) -> String {
    let verdict = match (report.claims, report.failures.len()) {
        (n, 0) => format!("verified: {n} claims hold"),
        (n, 1) => format!("not verified: 1 of {n} claims fails"),
        (n, failed) => format!("not verified: {failed} of {n} claims fail"),
    };
    let of = match report.levels {
        1 => "1 level".to_owned(),
        n => format!("{n} levels"),
    };
    format!(
        "{verdict}, fields of {} of {of} recomputed, {}",
        report.recomputed.len(),
        folder.display()
    )
}

fn object(report: &Report, folder: &Path) -> Value {
    let failures: Vec<Value> = report.failures.iter().map(failure).collect();
    json!({
        "verified": report.holds(),
        "claims": report.claims,
        "failures": failures,
        "levels": report.levels,
        "recomputed": report.recomputed,
        "folder": folder.display().to_string(),
    })
}

fn failure(claim: &Claim) -> Value {
    json!({
        "file": claim.file,
        "claim": claim.claim,
        "place": claim.place,
        "claimed": claim.claimed,
        "recomputed": claim.recomputed,
        "difference": claim.difference,
        "others": claim.others,
        "message": claim.to_string(),
    })
}
