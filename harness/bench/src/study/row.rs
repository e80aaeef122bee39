//! A judged row as text.

use super::file::Study;
use super::measure::Measure;
use crate::experiments::entry::{Judged, Verdict};

/// Returns a row as one line, for progress.
pub fn line(study: &Study, row: &Judged) -> String {
    let [name, target, measured, how, verdict] = fields(study, row);
    match row.measured {
        Some(_) => format!("{name}: {measured} ({how}), target {target}: {verdict}"),
        None => format!("{name}: {verdict}"),
    }
}

/// Returns name, target, measured value, how it was measured, and verdict.
pub fn fields(study: &Study, row: &Judged) -> [String; 5] {
    let measure = study.row.iter().find(|r| r.name == row.name).map(|r| r.measure);
    let show = |value: f64| measure.map_or_else(|| value.to_string(), |m: Measure| m.show(value));
    let bounds = [("at least ", row.at_least), ("at most ", row.at_most)];
    let bounds = bounds.into_iter().filter_map(|(word, b)| Some(format!("{word}{}", show(b?))));
    let target = bounds.collect::<Vec<_>>().join(", ");
    let noted = |verdict: &str| match row.why.as_str() {
        "" => verdict.to_owned(),
        why => format!("{verdict}: {why}"),
    };
    let verdict = match row.verdict {
        Verdict::Met => noted("met"),
        Verdict::Missed => noted("MISSED"),
        Verdict::ForComparison => noted("for comparison"),
        Verdict::Failed => format!("FAILED: {}", row.why),
        Verdict::LeftOut => format!("left out: {}", row.why),
    };
    let dash = |text: String| if text.is_empty() { "-".to_owned() } else { text };
    let measured = dash(row.measured.map(show).unwrap_or_default());
    [row.name.clone(), dash(target), measured, dash(row.how.clone()), verdict]
}
