//! The columns of a level: one table for the history and the summary.

use contact::Reduction;

use crate::record::LevelRecord;

/// What stands in one column of one level.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Entry {
    /// The column does not apply.
    Empty,
    /// A count.
    Count(usize),
    /// A number, possibly one that no file can hold (infinite or not a number).
    Number(f64),
    /// A name.
    Name(&'static str),
}

impl From<usize> for Entry {
    fn from(value: usize) -> Self {
        Entry::Count(value)
    }
}

impl From<f64> for Entry {
    fn from(value: f64) -> Self {
        Entry::Number(value)
    }
}

impl From<&'static str> for Entry {
    fn from(value: &'static str) -> Self {
        Entry::Name(value)
    }
}

impl From<Option<f64>> for Entry {
    fn from(value: Option<f64>) -> Self {
        value.map_or(Entry::Empty, Entry::Number)
    }
}

/// A column: its name in files and how it is read off a level.
#[derive(Clone, Copy, Debug)]
pub struct Column {
    /// The name.
    pub name: &'static str,
    /// The entry of a level.
    pub entry: fn(&LevelRecord) -> Entry,
}

/// `"name" => expression in the level`, in the order of the file.
macro_rules! columns {
    ($level:ident; $($name:literal => $entry:expr,)*) => {
        &[$(Column {
            name: $name,
            entry: |$level: &LevelRecord| Entry::from($entry),
        }),*]
    };
}

/// Every column, in the order of the files. Some are not computed by this version and stay empty; they hold their place so
/// that a script which counts columns keeps working.
pub const COLUMNS: &[Column] = columns![level;
    "level" => level.level,
    "vertices" => level.vertices,
    "triangles" => level.triangles,
    "unknowns" => level.unknowns,
    "contact_vertices" => level.contact_vertices,
    "contact_area" => level.contact_area,
    "energy" => level.energy,
    "energy_norm" => level.energy_norm,
    "eta_K" => level.eta_k,
    "eta_e_sum" => level.eta_e_sum,
    "residual" => level.residual,
    "certified" => level.certified,
    "oscillation" => level.oscillation,
    "error_bound" => level.error_bound,
    "relative_bound" => level.relative_bound,
    "true_error" => level.true_error,
    "effectivity" => level.effectivity,
    "sigma_error" => level.sigma_error,
    "solver" => level.solver,
    "iterations" => level.iterations,
    "kkt_residual" => level.kkt_residual,
    "seconds_refine" => level.seconds_refine,
    "seconds_assemble" => level.seconds_assemble,
    "seconds_solve" => level.seconds_solve,
    "seconds_estimate" => level.seconds_estimate,
    "seconds_total" => level.seconds_total,
    "peak_memory_mb" => level.peak_memory_mb,
    "bound_kind" => level.bound_kind,
    "eta_alg" => level.eta_alg,
    "bound_711" => level.bound_711,
    "bound_711_repaired" => level.bound_711_repaired,
    "h1_error" => level.h1_error,
    "contact_force" => level.contact_force,
    "max_action" => level.max_action,
    "contact_area_error" => level.contact_area_error,
    "contact_jaccard" => level.contact_jaccard,
    "contact_hausdorff" => level.contact_hausdorff,
    "algebraic_error" => level.algebraic_error,
];

/// The name of a reduction in files and messages.
pub fn reduction_name(reduction: Reduction) -> &'static str {
    match reduction {
        Reduction::NoContact => "no-contact",
        Reduction::FullContact => "full-contact",
        Reduction::ConstantTensions => "constant-tensions",
        Reduction::ConstantRatio => "constant-ratio",
        Reduction::TwoField => "two-field",
    }
}
