//! Numbers as tables, figures and sentences show them.

/// Returns a number with thousands separators.
pub fn grouped(n: u64) -> String {
    match n {
        0..1000 => n.to_string(),
        _ => format!("{},{:03}", grouped(n / 1000), n % 1000),
    }
}

/// Returns a duration in seconds up to two minutes, and in minutes beyond, rounded up.
pub fn duration(seconds: f64) -> String {
    match seconds.ceil() {
        ..=1.0 => "1 second".to_owned(),
        short @ ..=120.0 => format!("{short} seconds"),
        _ => format!("{} minutes", (seconds / 60.0).ceil()),
    }
}
