//! Numbers as tables, figures and sentences show them.

/// Returns a number with thousands separators.
pub fn grouped(n: u64) -> String {
    match n {
        0..1000 => n.to_string(),
        _ => format!("{},{:03}", grouped(n / 1000), n % 1000),
    }
}

/// Returns a duration in seconds up to two minutes, and in whole minutes beyond, rounded up.
pub fn duration(seconds: f64) -> String {
    match seconds {
        ..=120.0 => format!("{:.0} seconds", seconds.ceil()),
        _ => format!("{:.0} minutes", (seconds / 60.0).ceil()),
    }
}
