//! Numbers for readers, and from files of the kernel.

use std::iter;

/// A length with three significant digits.
pub fn number(x: f64) -> String {
    if x == 0.0 || (1e-4..1e6).contains(&x.abs()) { digits(x) } else { format!("{x:.2e}") }
}

/// Three significant digits, and all before the decimal point.
pub fn digits(value: f64) -> String {
    let magnitude = if value == 0.0 { 2.0 } else { value.abs().log10().floor() };
    let decimals = (2.0 - magnitude).clamp(0.0, 9.0) as usize;
    format!("{value:.decimals$}")
}

/// A number with thousands separators.
pub fn grouped(n: u64) -> String {
    if n < 1000 { n.to_string() } else { format!("{},{:03}", grouped(n / 1000), n % 1000) }
}

/// This name, or else the first that is free with a number after it, from 2 on.
pub fn numbered(name: &str, separator: char, is_free: impl FnMut(&String) -> bool) -> String {
    let numbered = (2..).map(|number| format!("{name}{separator}{number}"));
    iter::once(name.to_owned()).chain(numbered).find(is_free).expect("numbers do not end")
}

/// A duration in seconds up to two minutes, and in minutes beyond, rounded up.
pub fn duration(seconds: f64) -> String {
    match seconds.ceil() {
        ..=1.0 => "1 second".to_owned(),
        short @ ..=120.0 => format!("{short} seconds"),
        _ => format!("{} minutes", (seconds / 60.0).ceil()),
    }
}

/// A point.
pub fn point([x, y, z]: [f64; 3]) -> String {
    format!("({x}, {y}, {z})")
}

/// The number in a line of a file of `/proc`, by its label.
pub fn labelled(text: &str, label: &str) -> Option<u64> {
    text.lines().find_map(|line| line.strip_prefix(label))?.split_whitespace().next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_have_three_significant_digits() {
        for (length, text) in [
            (0.0, "0"),
            (1.0, "1.00"),
            (-12.34, "-12.3"),
            (99_999.0, "99999"),
            (1e5, "100000"),
            (1e6, "1.00e6"),
            (123_456.0, "123456"),
            (0.000_123_4, "0.000123"),
            (0.000_099_9, "9.99e-5"),
            (0.012_345, "0.0123"),
        ] {
            assert_eq!(number(length), text);
        }
    }
}
