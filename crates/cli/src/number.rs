//! Numbers for people.

/// Four significant digits, without exponent between 1e-4 and 1e6.
pub fn short(value: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    if !value.is_finite() {
        return value.to_string();
    }
    let rounded = format!("{value:.3e}");
    let exponent: i32 = rounded
        .split_once('e')
        .and_then(|(_, e)| e.parse().ok())
        .unwrap_or(0);
    if !(-4..6).contains(&exponent) {
        return rounded;
    }
    let decimals = usize::try_from(3 - exponent).unwrap_or(0);
    let text = format!("{value:.decimals$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

/// Three significant digits and the sign of percent.
pub fn percent(value: f64) -> String {
    let value = 100.0 * value;
    match value {
        v if !v.is_finite() => format!("{v} %"),
        v if v >= 99.95 => format!("{v:.0} %"),
        v if v >= 9.995 => format!("{v:.1} %"),
        v if v >= 0.005 || v == 0.0 => format!("{v:.2} %"),
        v => format!("{v:.1e} %"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_digits() {
        for (value, text) in [
            (0.0, "0"),
            (1.2345678, "1.235"),
            (0.1570796, "0.1571"),
            (1.0, "1"),
            (-0.25, "-0.25"),
            (123456.7, "123457"),
            (9999.96, "10000"),
            (0.00012346, "0.0001235"),
            (1e-5, "1.000e-5"),
            (2.5e7, "2.500e7"),
            (f64::INFINITY, "inf"),
        ] {
            assert_eq!(short(value), text);
        }
    }

    #[test]
    fn percentages() {
        for (value, text) in [
            (0.00981, "0.98 %"),
            (0.1234, "12.3 %"),
            (2.5, "250 %"),
            (0.0, "0.00 %"),
            (1e-7, "1.0e-5 %"),
        ] {
            assert_eq!(percent(value), text);
        }
    }
}
