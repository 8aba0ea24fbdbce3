//! What a name that means nothing was probably meant to be.

use crate::function;
use crate::scope::Scope;

/// Names from elsewhere, and what they are here.
const ELSEWHERE: [(&str, &str); 19] = [
    ("and", "write `&&`"),
    ("or", "write `||`"),
    ("not", "write `!`"),
    ("true", "write `1`"),
    ("false", "write `0`"),
    ("pow", "write `a^b`"),
    ("power", "write `a^b`"),
    ("arcsin", "did you mean `asin`?"),
    ("arccos", "did you mean `acos`?"),
    ("arctan", "did you mean `atan`?"),
    ("arctan2", "did you mean `atan2`?"),
    ("tg", "did you mean `tan`?"),
    ("sgn", "did you mean `sign`?"),
    ("heaviside", "did you mean `step`?"),
    ("ceiling", "did you mean `ceil`?"),
    ("fabs", "did you mean `abs`?"),
    ("log2", "write `ln(a)/ln(2)`"),
    ("mod", "write `a - b*floor(a/b)`"),
    ("where", "write `if(condition, then, else)`"),
];

/// What to write for a name that other languages have.
pub(crate) fn foreign(name: &str) -> Option<&'static str> {
    let found = ELSEWHERE
        .iter()
        .find(|entry| entry.0.eq_ignore_ascii_case(name));
    found.map(|entry| entry.1)
}

/// A hint for an unknown name; `called` when `(` follows it.
pub(crate) fn hint(name: &str, called: bool, scope: &Scope) -> String {
    if let Some(hint) = foreign(name) {
        return hint.to_owned();
    }
    let parameters: Vec<&str> = scope.names().collect();
    // In order of preference among names as near.
    let mut candidates: Vec<&str> = Vec::new();
    if called {
        candidates.extend(function::functions());
        candidates.extend(&parameters);
        candidates.extend(function::values());
    } else {
        candidates.extend(&parameters);
        candidates.extend(function::values());
        candidates.extend(function::functions());
    }
    if let Some(same) = candidates
        .iter()
        .find(|known| known.eq_ignore_ascii_case(name))
    {
        return format!("did you mean `{same}`?");
    }
    if !called && let Some((left, right)) = as_product(name, scope) {
        return format!("write `{left}*{right}`");
    }
    let length = name.chars().count();
    // At least one letter must be right.
    let allowed = (1 + length / 4).min(length - 1);
    let nearest = candidates
        .iter()
        .map(|known| (strsim::damerau_levenshtein(name, known), known))
        .filter(|(distance, known)| *distance <= allowed && *distance < known.len().max(2))
        .min_by_key(|(distance, _)| *distance);
    match nearest {
        Some((_, known)) => format!("did you mean `{known}`?"),
        None if called => format!("the functions are {}", list(function::functions())),
        None => format!(
            "the names are {}",
            list(function::values().chain(parameters))
        ),
    }
}

/// The name as two known names put together.
fn as_product<'n>(name: &'n str, scope: &Scope) -> Option<(&'n str, &'n str)> {
    let known =
        |part: &str| function::values().any(|value| value == part) || scope.get(part).is_some();
    (1..name.len())
        .map(|middle| name.split_at(middle))
        .find(|(left, right)| known(left) && known(right))
}

fn list<'n>(names: impl Iterator<Item = &'n str>) -> String {
    let quoted: Vec<String> = names.map(|name| format!("`{name}`")).collect();
    quoted.join(", ")
}
