//! The changes of a history as text.

use super::Series;

/// Returns a text with one step per line.
pub fn summary(all: &[Series]) -> String {
    let short = |commit: &str| commit.chars().take(12).collect::<String>();
    let mut text = String::new();
    for series in all {
        let is_count = series.unit == "count";
        let unit = if is_count { String::new() } else { format!(" {}", series.unit) };
        for change in &series.changes {
            let shown = |value| if is_count { value } else { rounded(value) };
            let [before, after] = [change.before, change.after].map(shown);
            let by = change.percent.map_or("from 0".to_owned(), |by| format!("{by:+.2} %"));
            let commits = format!("{}..{}", short(&change.last_old), short(&change.first_new));
            let accepted = if change.accepted { ", accepted" } else { "" };
            text += &format!(
                "{}: {before} -> {after}{unit} ({by}) in {commits}, p = {:.2e}{accepted}\n",
                series.name, change.p
            );
        }
    }
    if text.is_empty() {
        text.push_str("no change points\n");
    }
    text
}

/// The value with five significant digits.
fn rounded(value: f64) -> f64 {
    if value == 0.0 {
        return value;
    }
    let unit = 10f64.powf(value.abs().log10().floor() - 4.0);
    // Dividing by a power of ten is exact in the digits that are printed; multiplying by its inverse is not.
    if unit < 1.0 {
        (value / unit).round() / (1.0 / unit).round()
    } else {
        (value / unit).round() * unit
    }
}

#[cfg(test)]
mod tests {
    use super::rounded;

    #[test]
    fn values_have_five_significant_digits() {
        let values = [0.0, 999_701_499.175, 1_118_011_144.6, 0.123_456_789, -12.345_678];
        assert_eq!(values.map(rounded), [0.0, 999_700_000.0, 1_118_000_000.0, 0.123_46, -12.346]);
    }
}
