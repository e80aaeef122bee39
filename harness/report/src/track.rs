//! The history as a page, with the steps as a table and a figure per metric, as text and as JUnit XML.

use crate::figure::svg::svg;
use crate::figure::{
    Axis, Figure, Kind, Point, Provenance, Series as Plotted, file_name, tick_label,
};
use crate::junit::{skipped, suite, test, to_text, unsuccessful};
use crate::page::{figure, page as whole_page, table};
use bench::track::history::Record;
use bench::track::{Change, Series, VALUES_MIN};
use maud::{Markup, html};
use quick_junit::NonSuccessKind::Failure;
use quick_junit::TestCaseStatus;
use std::cmp::Reverse;

/// Placeholder for the hash of a commit in its address.
pub const COMMIT: &str = "{commit}";

/// The page. Metrics with changes come first. `link` is the address of a commit, with [`COMMIT`] for its hash.
pub fn page(records: &[Record], all: &[Series], link: Option<&str>) -> String {
    let mut sorted: Vec<&Series> = all.iter().collect();
    sorted.sort_by_key(|series| series.changes.is_empty());
    let ends = [("from", records.first()), ("to", records.last())];
    let dated = |record: &Record| {
        let date = record.time.map(|time| time.strftime("%Y-%m-%d").to_string());
        html! { (linked(&record.commit, link)) " (" (date.as_deref().unwrap_or("no date")) ")" }
    };
    let content = html! {
        p {
            "Commits: " (records.len())
            @for (word, end) in ends { @if let Some(record) = end { " " (word) " " (dated(record)) } }
        }
        (changes(records, all, link))
        h2 { "Metrics, those with changes first" }
        @for f in sorted.into_iter().map(|series| of_metric(records, series)) {
            (figure(&f, &svg(&f)))
        }
    };
    whole_page("Trend", &content)
}

/// The beginning of a commit's hash, with a link if there is an address.
fn linked(commit: &str, link: Option<&str>) -> Markup {
    let short = html! { code { (short_commit(commit)) } };
    match link {
        Some(link) => html! { a href=(link.replace(COMMIT, commit)) { (short) } },
        None => short,
    }
}

/// All steps, the latest first. The class of a change is that of its cell in the style sheet.
fn changes(records: &[Record], all: &[Series], link: Option<&str>) -> Markup {
    let mut found = steps(all);
    if found.is_empty() {
        return html! { p { "No change points." } };
    }
    let first_new = |(series, change): &(&Series, &Change)| series.points[change.step.at].0;
    found.sort_by_key(|change| Reverse(first_new(change)));
    let row = |both: &(&Series, &Change)| {
        let (series, change) = *both;
        let [before, after, by] = values(series, change);
        let sign = sign(series, change);
        vec![
            html! { (series.name) },
            html! { (before) },
            html! { (after) },
            html! { span class=[sign] { (by) } },
            html! { (linked(&change.last_old, link)) ".." (linked(&change.first_new, link)) },
            html! { @if change.accepted { "accepted" } },
            html! { (records[first_new(both)].subject) },
        ]
    };
    let columns = ["metric", "before", "after", "change", "commits", "", "first commit after"];
    html! { h2 { "Change points" } (table(&columns, &found.iter().map(row).collect::<Vec<_>>())) }
}

/// Both values of a step with their unit, and the change.
fn values(series: &Series, change: &Change) -> [String; 3] {
    let value = |value: f64| match series.unit {
        // Counts are exact, but for those of a line.
        "count" if value.abs() >= 1000.0 => value.round().to_string(),
        "count" => tick_label(value),
        unit => format!("{} {unit}", tick_label(value)),
    };
    let by = change.percent.map_or("from 0".to_owned(), |by| format!("{by:+.2} %"));
    [value(change.step.before), value(change.step.after), by]
}

/// Whether a step is for the `worse` or the `better`; `None` if it is neither.
fn sign(series: &Series, change: &Change) -> Option<&'static str> {
    Some(if series.is_worse(change.step.before, change.step.after)? { "worse" } else { "better" })
}

/// All steps with their series.
fn steps(all: &[Series]) -> Vec<(&Series, &Change)> {
    all.iter().flat_map(|s| s.changes.iter().map(move |change| (s, change))).collect()
}

/// A step per line.
pub fn summary(all: &[Series]) -> String {
    let line = |(series, change): (&Series, &Change)| {
        let [before, after, by] = values(series, change);
        let accepted = if change.accepted { ", accepted" } else { "" };
        let sign = sign(series, change).map_or(String::new(), |sign| format!(", {sign}"));
        format!(
            "{}: {before} -> {after} ({by}{sign}) in {}, p = {:.2e}{accepted}\n",
            series.name,
            [&change.last_old, &change.first_new].map(|commit| short_commit(commit)).join(".."),
            change.step.p
        )
    };
    let text: String = steps(all).into_iter().map(line).collect();
    if text.is_empty() { "no change points\n".to_owned() } else { text }
}

/// A test per metric. It fails if the last change point is one for the worse among the last `recent` values.
pub fn junit(all: &[Series], recent: usize) -> String {
    let mut xml = quick_junit::Report::new("harness track");
    let of_series = |series: &Series| {
        let text = summary(std::slice::from_ref(series));
        let ended = match series.worse_recently(recent) {
            Some(_) => unsuccessful(Failure, text.trim_end()),
            None if series.points.len() < VALUES_MIN => skipped("too few values for a step".into()),
            None => TestCaseStatus::success(),
        };
        test(&series.name, ended, if series.changes.is_empty() { "" } else { &text })
    };
    xml.add_test_suite(suite("track", 0.0, all.iter().map(of_series)));
    to_text(&xml)
}

/// The figure of one metric, with its steps as vertical lines. Outliers do not widen the
/// axis: they are drawn at its ends.
fn of_metric(records: &[Record], series: &Series) -> Figure {
    let note = |&(commit, value): &(usize, f64)| {
        let record = &records[commit];
        format!("{} {value} {}\n{}", short_commit(&record.commit), series.unit, record.subject)
    };
    let x = |at: usize| series.points[at].0 as f64;
    let (low, high) = range(series);
    let mark = |change: &Change| {
        let (name, style) = match sign(series, change) {
            None => ("change", 3),
            Some(_) if change.accepted => ("accepted", 3),
            Some(sign) => (sign, if sign == "worse" { 1 } else { 2 }),
        };
        // Between the last commit with the old value and the first with the new one.
        let at = change.step.at;
        Plotted::vertical(name, style, x(at - 1).midpoint(x(at)), (low, high))
    };
    let metric = series.name.rsplit('/').next().unwrap_or_default();
    let point = |&(commit, value): &(usize, f64)| Point::exact(commit as f64, value);
    let points = series.points.iter().map(point).collect();
    let values = Plotted::new(metric, Provenance::Measured, 0, points).drawn_as(Kind::Scattered);
    let values = Plotted { notes: series.points.iter().map(note).collect(), ..values };
    let beyond = series.points.iter().filter(|(_, value)| !(low..=high).contains(value)).count();
    let caption = match beyond {
        0 => String::new(),
        _ => format!("{beyond} values are beyond the axis, and drawn at its ends."),
    };
    Figure {
        caption,
        id: file_name(&format!("metric-{}", series.name)),
        title: series.name.clone(),
        x: commits(records.len()),
        y: Axis { range: Some((low, high)), ..Axis::linear(series.unit) },
        series: [values].into_iter().chain(series.changes.iter().map(mark)).collect(),
        is_flat: true,
        ..Figure::default()
    }
}

/// The first ten characters of a commit's hash.
fn short_commit(commit: &str) -> String {
    commit.chars().take(10).collect()
}

/// Fraction of the values at either end that may be outliers.
const OUTLIERS: f64 = 0.05;

/// The range shown: that of the values without outliers, with a margin, so that a constant is in the middle and noise looks
/// small. The levels between steps are never outliers.
fn range(series: &Series) -> (f64, f64) {
    let mut sorted: Vec<f64> = series.points.iter().map(|p| p.1).collect();
    sorted.sort_by(f64::total_cmp);
    let cut = (sorted.len() as f64 * OUTLIERS).ceil() as usize;
    let kept = sorted.get(cut..sorted.len().saturating_sub(cut)).filter(|kept| !kept.is_empty());
    let kept = kept.unwrap_or(&sorted);
    let levels = series.changes.iter().flat_map(|change| [change.step.before, change.step.after]);
    let shown = || kept.iter().copied().chain(levels.clone());
    let low = shown().fold(f64::INFINITY, f64::min);
    let high = shown().fold(f64::NEG_INFINITY, f64::max);
    let middle = (low + high) / 2.0;
    let half = ((high - low) * 0.8).max(middle.abs() * 0.02).max(1e-9);
    (middle - half, middle + half)
}

/// An axis of indices into the history.
fn commits(count: usize) -> Axis {
    let last = count.saturating_sub(1).max(1);
    let ticks = (0..=last).step_by(last.div_ceil(8)).map(|t| t as f64).collect();
    let margin = last as f64 * 0.03;
    let range = Some((-margin, last as f64 + margin));
    Axis { range, ticks, ..Axis::linear("commit (index in the history)") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bench::testing::history as sample;
    use bench::track::analyse;

    #[test]
    fn the_page_is_self_contained_and_has_every_change_point() {
        let records = sample();
        let page = page(&records, &analyse(&records, 0.01), None);
        assert!(!page.replace("http://www.w3.org/2000/svg", "").contains("http"));
        assert!(!page.contains("<script"));
        assert_eq!(page.matches("<figure").count(), 2);
        assert_eq!(page.matches("class=\"worse\"").count(), 1);
        assert!(!page.contains("<b>") && page.contains("&lt;b&gt;"));
    }

    #[test]
    fn commits_are_linked_if_there_is_an_address() {
        let records = sample();
        let all = analyse(&records, 0.01);
        let page = page(&records, &all, Some("https://host.org/a/b/commit/{commit}"));
        let address = format!("href=\"https://host.org/a/b/commit/{:040x}\"", 20);
        assert_eq!(page.matches(&address).count(), 1, "{page}");
    }

    #[test]
    fn histories_of_zero_and_one_commits_have_a_page() {
        assert!(page(&[], &[], None).contains("Commits: 0<"));
        let one = &sample()[..1];
        assert!(page(one, &analyse(one, 0.01), None).contains("Commits: 1 from"));
    }

    #[test]
    fn a_recent_increase_of_a_cost_is_a_failed_test() {
        let all = analyse(&sample(), 0.01);
        let failures = |recent| {
            quick_junit::Report::deserialize_from_str(&junit(&all, recent)).unwrap().failures
        };
        assert_eq!((failures(10), failures(5)), (1, 0));
        let few = analyse(&sample()[..4], 0.01);
        assert_eq!(junit(&few, 10).matches("<skipped").count(), few.len());
    }

    #[test]
    fn an_outlier_does_not_squash_the_plot() {
        let mut records = bench::testing::history();
        records[5].metrics.insert("uav/words".into(), 1e9);
        let all = analyse(&records, 0.01);
        let words = all.iter().find(|s| s.name == "uav/words").unwrap();
        let figure = of_metric(&records, words);
        let (low, high) = figure.y.range.unwrap();
        assert!((500.0..1000.0).contains(&low) && (1110.0..1500.0).contains(&high), "{low} {high}");
        assert!(figure.caption.starts_with("1 values are beyond"), "{}", figure.caption);
        let notes = &figure.series[0].notes;
        assert!(notes.iter().any(|note| note.contains("1000000000")), "{notes:?}");
        // It is drawn all the same, at the upper end.
        let svg = svg(&figure);
        assert_eq!(svg.matches("<circle").count(), 2 * 30 + 1, "{svg}");
    }

    #[test]
    fn a_change_point_lies_between_its_commits() {
        let records = bench::testing::history();
        let all = analyse(&records, 0.01);
        let words = all.iter().find(|s| s.name == "uav/words").unwrap();
        let Figure { series, y, .. } = of_metric(&records, words);
        assert_eq!(series[1..], [Plotted::vertical("worse", 1, 19.5, y.range.unwrap())]);
        assert!(series[0].notes[20].ends_with("\n<b>"), "{:?}", series[0].notes[20]);
    }
}
