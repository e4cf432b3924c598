//! Numbers for people: axis labels, table cells.

/// Sign for an unknown value.
pub const UNKNOWN: &str = "–";

/// Formats `value` with a fixed number of decimals, a real minus sign and thousands separated; NaN is unknown.
pub fn fixed(value: f64, decimals: usize) -> String {
    if value.is_nan() {
        return UNKNOWN.to_owned();
    }
    if value.abs() >= 1e15 {
        return format!("{value:.2e}").replace('-', "−");
    }
    let text = format!("{:.decimals$}", value.abs());
    let (whole, fraction) = match text.split_once('.') {
        Some((whole, fraction)) => (whole, format!(".{fraction}")),
        None => (text.as_str(), String::new()),
    };
    let mut out = String::new();
    // A value that rounds to zero has no sign.
    if value < 0.0 && text.chars().any(|c| ('1'..='9').contains(&c)) {
        out.push('−');
    }
    for (i, digit) in whole.chars().enumerate() {
        if i > 0 && (whole.len() - i).is_multiple_of(3) {
            out.push(',');
        }
        out.push(digit);
    }
    out + &fraction
}

/// Formats `value` without decimals, for counts; NaN is unknown.
pub fn whole(value: f64) -> String {
    fixed(value, 0)
}

/// Formats ticks: without decimals if whole, since medians and quartiles may lie between two ticks; NaN is unknown.
pub fn ticks(value: f64) -> String {
    if value.fract() == 0.0 { whole(value) } else { fixed(value, 1) }
}

/// Formats `1 step`, `2 steps`; `1 key`, `2 keys`; `1 entity`, `2 entities`; `1 class`, `2 classes`.
pub fn counted(count: u64, what: &str) -> String {
    match what.strip_suffix('y').filter(|stem| !stem.ends_with(['a', 'e', 'i', 'o', 'u'])) {
        _ if count == 1 => format!("1 {what}"),
        Some(stem) => format!("{count} {stem}ies"),
        None if what.ends_with('s') => format!("{count} {what}es"),
        None => format!("{count} {what}s"),
    }
}

/// Formats a count as `once` or `3 times`.
pub fn times(count: u32) -> String {
    if count == 1 { "once".to_owned() } else { format!("{count} times") }
}

/// Formats `value` with about four significant digits, for numbers of unknown size; NaN is unknown.
pub fn readable(value: f64) -> String {
    let size = value.abs();
    match size {
        _ if size == 0.0 || !size.is_finite() => fixed(value, 0),
        _ if size < 1e-4 => scientific(value),
        _ => fixed(value, decimals_of(size)),
    }
}

/// Formats `mean ± spread`, both with the decimals that [`readable`] gives the larger one.
pub fn readable_with_spread(mean: f64, spread: f64) -> String {
    let size = mean.abs().max(spread.abs());
    if size < 1e-4 || !size.is_finite() {
        return format!("{} ± {}", readable(mean), readable(spread));
    }
    mean_and_error(mean, spread, decimals_of(size))
}

fn decimals_of(size: f64) -> usize {
    (3.0 - libm::log10(size).floor()).clamp(0.0, 6.0) as usize
}

/// Formats a share (0 to 1) in percent with one decimal, as `40.0 %`.
pub fn percent(share: f64) -> String {
    if share.is_nan() { UNKNOWN.to_owned() } else { format!("{} %", fixed(share * 100.0, 1)) }
}

/// Returns the decimals that show at least one digit of every standard error above 0; 2 if there is no such error.
pub(crate) fn decimals_for(errors: impl Iterator<Item = f64>) -> usize {
    let smallest = errors.filter(|e| *e > 0.0).fold(f64::INFINITY, f64::min);
    if smallest.is_finite() { (-libm::log10(smallest).floor()).clamp(0.0, 4.0) as usize } else { 2 }
}

/// Formats a mean and, if known, its standard error.
pub fn mean_and_error(mean: f64, error: f64, decimals: usize) -> String {
    if mean.is_nan() || error.is_nan() {
        return fixed(mean, decimals);
    }
    format!("{} ± {}", fixed(mean, decimals), fixed(error, decimals))
}

/// Returns the labels of axis ticks that are `step` apart, all with the same unit prefix (no prefix, k, M, G).
pub fn tick_labels(ticks: &[f64], step: f64) -> Vec<String> {
    let largest = ticks.iter().fold(0.0f64, |m, t| m.max(t.abs()));
    if largest >= 1e13 || (largest > 0.0 && largest < 1e-3) {
        return ticks.iter().map(|t| scientific(*t)).collect();
    }
    let (unit, name) = match largest {
        l if l >= 1e9 => (1e9, "G"),
        l if l >= 1e6 => (1e6, "M"),
        l if l >= 1e4 => (1e3, "k"),
        _ => (1.0, ""),
    };
    // Steps are 1, 2, 2.5 or 5 times a power of ten.
    let step = step / unit;
    let decimals = (0..12).find(|&d| (step * 10f64.powi(d)).fract().abs() < 1e-6).unwrap_or(12) as usize;
    ticks.iter().map(|&t| if t == 0.0 { "0".to_owned() } else { fixed(t / unit, decimals) + name }).collect()
}

fn scientific(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let text = format!("{value:.2e}");
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let mantissa = mantissa.trim_end_matches('0').trim_end_matches('.');
    format!("{mantissa}e{exponent}").replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells() {
        assert_eq!(fixed(-1234567.891, 1), "−1,234,567.9");
        assert_eq!(fixed(-0.001, 1), "0.0");
        assert_eq!(fixed(f64::NAN, 1), "–");
        assert_eq!(percent(0.9744), "97.4 %");
        assert_eq!([counted(0, "step"), counted(1, "try"), counted(2, "try")], ["0 steps", "1 try", "2 tries"]);
        assert_eq!([counted(1, "class"), counted(2, "class")], ["1 class", "2 classes"]);
        assert_eq!([counted(1, "entity"), counted(0, "entity")], ["1 entity", "0 entities"]);
        assert_eq!([counted(3, "try"), counted(2, "key")], ["3 tries", "2 keys"]);
        let shown = [0.0, 8.53125, -0.00312, 0.00002, 81920.4, 1.0, f64::NAN, f64::INFINITY].map(readable);
        assert_eq!(shown, ["0", "8.531", "−0.003120", "2e−5", "81,920", "1.000", "–", "inf"]);
        assert_eq!(readable_with_spread(8.53125, 0.04041), "8.531 ± 0.040");
        assert_eq!(readable_with_spread(0.0, 0.0), "0 ± 0");
        assert_eq!(readable_with_spread(f64::NAN, f64::NAN), "– ± –");
        assert_eq!(mean_and_error(9.7432, 0.1234, 2), "9.74 ± 0.12");
        assert_eq!(mean_and_error(1234.5, 45.6, 0), "1,234 ± 46");
        assert_eq!(mean_and_error(5.0, f64::NAN, 2), "5.00");
        assert_eq!(mean_and_error(f64::NAN, 1.0, 2), "–");
        assert_eq!(decimals_for([0.5, 0.08, f64::NAN, 0.0].into_iter()), 2);
        assert_eq!(decimals_for([45.6].into_iter()), 0);
        assert_eq!(decimals_for([f64::NAN].into_iter()), 2);
    }

    #[test]
    fn ticks_share_a_unit() {
        assert_eq!(tick_labels(&[0.0, 2e6, 4e6], 2e6), ["0", "2M", "4M"]);
        assert_eq!(tick_labels(&[0.0, 0.25, 0.5], 0.25), ["0", "0.25", "0.50"]);
        assert_eq!(tick_labels(&[-500.0, 0.0, 500.0], 500.0), ["−500", "0", "500"]);
        assert_eq!(tick_labels(&[25_000.0, 50_000.0], 25_000.0), ["25k", "50k"]);
        assert_eq!(tick_labels(&[5e-5, 1e-4], 5e-5), ["5e−5", "1e−4"]);
        assert_eq!(tick_labels(&[], 1.0), [] as [&str; 0]);
    }
}
