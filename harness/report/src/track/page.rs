//! The trend page: one HTML file without scripts or links to anywhere, a small chart for each metric.

use bench::track::history::Record;
use bench::track::{Change, Series};
use std::fmt::Write as _;

/// A chart's size and margins, in pixels.
const WIDTH: f64 = 560.0;
const HEIGHT: f64 = 150.0;
const LEFT: f64 = 76.0;
const RIGHT: f64 = 12.0;
const TOP: f64 = 12.0;
const BOTTOM: f64 = 26.0;

const STYLE: &str = "
:root { color-scheme: light dark; --ink: #1f2933; --faint: #6b7785; --line: #d5dbe1; --page: #ffffff; --data: #1f6fb2; --worse: #c2410c; --better: #15803d; --other: #7c3aed; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6eaee; --faint: #9aa5b1; --line: #3a444e; --page: #14191e; --data: #6fb3e8; --worse: #fb923c; --better: #4ade80; --other: #b794f6; } }
body { margin: 2rem auto; max-width: 76rem; padding: 0 1.5rem; background: var(--page); color: var(--ink); font: 15px/1.5 system-ui, sans-serif; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.1rem; margin-top: 2rem; }
p, caption { color: var(--faint); } table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { text-align: left; padding: .25rem .9rem .25rem 0; border-bottom: 1px solid var(--line); } td.number { text-align: right; }
code { font-size: .9em; } .worse { color: var(--worse); } .better { color: var(--better); } .other { color: var(--other); }
.charts { display: grid; grid-template-columns: repeat(auto-fill, minmax(34rem, 1fr)); gap: 1.2rem 1.5rem; }
figure { margin: 0; } figcaption { font-weight: 600; } svg { width: 100%; height: auto; }
svg text { fill: var(--faint); font: 11px system-ui, sans-serif; } .axis { stroke: var(--line); } .data { fill: none; stroke: var(--data); stroke-width: 1.6; }
.dot { fill: var(--data); } .median { stroke: var(--faint); stroke-dasharray: 3 3; }
line.worse { stroke: var(--worse); } line.better { stroke: var(--better); } line.other { stroke: var(--other); }
";

/// The page. Metrics that changed come first.
pub fn page(records: &[Record], all: &[Series]) -> String {
    let mut text =
        String::from("<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n");
    text.push_str("<meta name=\"viewport\" content=\"width=device-width\"><title>Trend</title>\n");
    // Writing into a string cannot fail.
    let _ = writeln!(text, "<style>{STYLE}</style></head><body>\n<h1>Trend</h1>");
    let _ = writeln!(text, "<p>{}</p>", span(records));
    text.push_str(&changes(records, all));
    let (moved, still): (Vec<&Series>, Vec<&Series>) =
        all.iter().partition(|series| !series.changes.is_empty());
    for (title, part) in
        [("Metrics that changed", moved), ("Metrics without a change point", still)]
    {
        if part.is_empty() {
            continue;
        }
        let _ = writeln!(text, "<h2>{title}</h2>\n<div class=\"charts\">");
        part.iter().for_each(|series| text.push_str(&figure(records, series)));
        text.push_str("</div>\n");
    }
    text.push_str("</body></html>\n");
    text
}

fn span(records: &[Record]) -> String {
    match records {
        [] => "No records.".to_owned(),
        [first, .., last] => {
            format!("{} commits, {} to {}.", records.len(), told(first), told(last))
        }
        [one] => format!("One commit, {}.", told(one)),
    }
}

/// Commit and date.
fn told(record: &Record) -> String {
    let date = record.time.get(..10).unwrap_or("no date");
    format!("<code>{}</code> ({})", escaped(&short(&record.commit)), escaped(date))
}

fn short(commit: &str) -> String {
    commit.chars().take(10).collect()
}

/// All change points, the latest first.
fn changes(records: &[Record], all: &[Series]) -> String {
    let mut found: Vec<(&Series, &Change)> = all
        .iter()
        .flat_map(|series| series.changes.iter().map(move |change| (series, change)))
        .collect();
    if found.is_empty() {
        return "<p>No change points.</p>\n".to_owned();
    }
    found.sort_by_key(|(series, change)| std::cmp::Reverse(series.points[change.at].0));
    let mut text = "<h2>Change points</h2>\n<table><tr><th>metric</th><th>before</th><th>after</th><th>change</th>\
                    <th>commits</th><th>first with the new values</th></tr>\n".to_owned();
    for (series, change) in found {
        let record = &records[series.points[change.at].0];
        let percent = change.percent.map_or("new".to_owned(), |by| format!("{by:+.2} %"));
        let _ = writeln!(
            text,
            "<tr><td>{}</td><td class=\"number\">{}</td><td class=\"number\">{}</td><td class=\"number {}\">{percent}</td>\
             <td><code>{}..{}</code></td><td>{}</td></tr>",
            escaped(&series.name),
            number(change.before),
            number(change.after),
            class(series, change),
            escaped(&short(&change.last_old)),
            escaped(&short(&change.first_new)),
            escaped(&record.subject)
        );
    }
    text.push_str("</table>\n");
    text
}

fn class(series: &Series, change: &Change) -> &'static str {
    match (series.is_cost(), change.after > change.before) {
        (false, _) => "other",
        (true, true) => "worse",
        (true, false) => "better",
    }
}

fn figure(records: &[Record], series: &Series) -> String {
    let mut text = format!("<figure><figcaption>{}</figcaption>\n", escaped(&series.name));
    let _ = writeln!(
        text,
        "<svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"{} by commit\">",
        escaped(&series.name)
    );
    let values = series.points.iter().map(|(_, value)| *value);
    let (low, high) = bounds(
        values.clone().fold(f64::INFINITY, f64::min),
        values.fold(f64::NEG_INFINITY, f64::max),
    );
    let last = records.len().saturating_sub(1).max(1) as f64;
    let x = |record: usize| LEFT + (WIDTH - LEFT - RIGHT) * record as f64 / last;
    let y = |value: f64| TOP + (HEIGHT - TOP - BOTTOM) * (high - value) / (high - low);
    for value in [low, (low + high) / 2.0, high] {
        let at = y(value);
        let _ = writeln!(
            text,
            "<line class=\"axis\" x1=\"{LEFT}\" x2=\"{}\" y1=\"{at:.1}\" y2=\"{at:.1}\"/>",
            WIDTH - RIGHT
        );
        let _ = writeln!(
            text,
            "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
            LEFT - 6.0,
            at + 4.0,
            number(value)
        );
    }
    for (record, anchor) in [(0, "start"), (records.len().saturating_sub(1), "end")] {
        let commit =
            records.get(record).map_or(String::new(), |record| escaped(&short(&record.commit)));
        let _ = writeln!(
            text,
            "<text x=\"{:.1}\" y=\"{}\" text-anchor=\"{anchor}\">{commit}</text>",
            x(record),
            HEIGHT - 8.0
        );
    }
    for change in &series.changes {
        // Between the last old and the first new commit.
        let at = (x(series.points[change.at].0) + x(series.points[change.at - 1].0)) / 2.0;
        let class = class(series, change);
        let _ = writeln!(
            text,
            "<line class=\"{class}\" x1=\"{at:.1}\" x2=\"{at:.1}\" y1=\"{TOP}\" y2=\"{}\"/>",
            HEIGHT - BOTTOM
        );
    }
    let path: Vec<String> =
        series.points.iter().map(|&(i, value)| format!("{:.1},{:.1}", x(i), y(value))).collect();
    let _ = writeln!(text, "<polyline class=\"data\" points=\"{}\"/>", path.join(" "));
    for &(i, value) in &series.points {
        let record = &records[i];
        let _ = writeln!(
            text,
            "<circle class=\"dot\" cx=\"{:.1}\" cy=\"{:.1}\" r=\"2.4\"><title>{} {}\n{}</title></circle>",
            x(i),
            y(value),
            escaped(&short(&record.commit)),
            value,
            escaped(&record.subject)
        );
    }
    text.push_str("</svg></figure>\n");
    text
}

/// The range shown: a little more than the values', so that a flat line lies in the middle and noise does not look
/// like a mountain.
fn bounds(low: f64, high: f64) -> (f64, f64) {
    let middle = (low + high) / 2.0;
    let half = ((high - low) * 0.6).max(middle.abs() * 0.02).max(1e-9);
    (middle - half, middle + half)
}

/// Four figures, with the usual letters for thousands.
fn number(value: f64) -> String {
    let size = value.abs();
    let (scale, letter) = match size {
        s if s >= 1e9 => (1e9, " G"),
        s if s >= 1e6 => (1e6, " M"),
        s if s >= 1e4 => (1e3, " k"),
        _ => (1.0, ""),
    };
    let scaled = value / scale;
    let digits = match scaled.abs() {
        s if s >= 1000.0 || (scale == 1.0 && value.fract() == 0.0) => 0,
        s if s >= 100.0 => 1,
        s if s >= 10.0 => 2,
        s if s >= 1.0 => 3,
        _ => 5,
    };
    format!("{scaled:.digits$}{letter}")
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;
    use bench::statistics::change_points::Rules;
    use bench::testing::history as sample;
    use bench::track::analyse;

    #[test]
    fn the_page_stands_alone_and_shows_every_change() {
        let records = sample();
        let page = page(&records, &analyse(&records, &Rules::default()));
        assert!(!page.contains("http") && !page.contains("<script"));
        assert_eq!(page.matches("<figure>").count(), 2);
        assert_eq!(page.matches("<line class=\"worse\"").count(), 1);
        assert!(!page.contains("<b>") && page.contains("&lt;b&gt;"));
    }

    #[test]
    fn nothing_and_one_commit_are_pages_too() {
        assert!(page(&[], &[]).contains("No records"));
        let one = &sample()[..1];
        assert!(page(one, &analyse(one, &Rules::default())).contains("One commit"));
    }

    #[test]
    fn numbers_are_short() {
        let told = [0.0, 12.0, 0.01473, 8123.0, 82_448.0, 870_912.0, 1.5e9].map(number);
        assert_eq!(told, ["0", "12", "0.01473", "8123", "82.45 k", "870.9 k", "1.500 G"]);
    }
}
