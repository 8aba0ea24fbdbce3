//! `membranes verify`: honest runs hold, changed ones do not.

mod arrays;
mod claims;
mod folder;
mod honest;

use std::sync::OnceLock;

use self::folder::Copy;
use crate::run::{Run, config, run};

/// Three levels on the disk with everything written.
pub fn honest() -> &'static Run {
    static RUN: OnceLock<Run> = OnceLock::new();
    // Nothing is said without a change, so that whatever is said is about the change.
    RUN.get_or_init(|| {
        let run = disk("stop.levels=3");
        assert_eq!(said(&Copy::of(&run.out)), [""; 0]);
        run
    })
}

pub fn disk(stop: &str) -> Run {
    let keys = ["output.fields=\"all\"", "output.edges=true", stop];
    let arguments: Vec<&str> = keys.iter().flat_map(|key| ["--set", key]).collect();
    run(&config("disk"), &arguments)
}

/// Numbers below a bound, always the same.
pub fn random() -> impl FnMut(usize) -> usize {
    let mut state = 20_260_727u64;
    move |below: usize| {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        ((state >> 33) as usize) % below
    }
}

/// The fields of the last level.
pub const LAST: &str = "level_0002.vtu";

/// What is said about a changed copy.
pub fn said(copy: &Copy) -> Vec<String> {
    let report = verify::verify(&copy.path()).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(report.holds(), report.failures.is_empty());
    report.failures.iter().map(ToString::to_string).collect()
}

/// A change with checksums that fit must be found by what it claims.
pub fn found(name: &str, change: impl FnOnce(&Copy), expected: &[&str]) {
    let copy = Copy::of(&honest().out);
    change(&copy);
    copy.fit();
    let said = said(&copy);
    assert!(
        !said.iter().any(|s| s.contains("SHA-256")),
        "{name}: {said:#?}"
    );
    for words in expected {
        assert!(
            said.iter().any(|s| s.contains(words)),
            "{name}: no `{words}` in {said:#?}"
        );
    }
    println!("{name}: {}", said.join("; "));
}

/// An interior vertex of the last level with an open gap, and one in contact.
pub fn vertices(copy: &Copy) -> (usize, usize) {
    let (gap, contact) = (copy.read(LAST, "gap"), copy.bytes_of(LAST, "contact"));
    let force = copy.read(LAST, "action_force");
    let radius: Vec<f64> = copy
        .read(LAST, "Points")
        .chunks(3)
        .map(|p| p[0].hypot(p[1]))
        .collect();
    let open = (0..gap.len())
        .find(|&j| gap[j] > 0.0 && radius[j] < 0.95)
        .expect("one");
    let closed = (0..gap.len())
        .find(|&j| contact[j] == 1 && force[j] > 0.0)
        .expect("one");
    (open, closed)
}
