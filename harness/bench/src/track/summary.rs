//! The changes of a history as text.

use super::Series;

/// Returns a text with one step or drift per line.
pub fn summary(all: &[Series]) -> String {
    let short = |commit: &str| commit.chars().take(12).collect::<String>();
    let relative =
        |percent: Option<f64>| percent.map_or("from 0".to_owned(), |by| format!("{by:+.2} %"));
    let mut text = String::new();
    for series in all {
        let unit = if series.unit == "count" { String::new() } else { format!(" {}", series.unit) };
        for change in &series.changes {
            text.push_str(&format!(
                "{}: {} -> {}{unit} ({}) in {}..{}, p = {:.2e}{}\n",
                series.name,
                change.before,
                change.after,
                relative(change.percent),
                short(&change.last_old),
                short(&change.first_new),
                change.p,
                if change.accepted { ", accepted" } else { "" }
            ));
        }
        for drift in &series.drifts {
            text.push_str(&format!(
                "{}: drifts from {:.6} to {:.6}{unit} ({}) over {}..{}, p = {:.2e}\n",
                series.name,
                drift.before,
                drift.after,
                relative(drift.percent),
                short(&drift.first),
                short(&drift.last),
                drift.p
            ));
        }
    }
    if text.is_empty() {
        text.push_str("no change points\n");
    }
    text
}
