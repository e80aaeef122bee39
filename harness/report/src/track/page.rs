//! The trend page: the change points as a table, then a figure per metric.

use super::figures::{of_metric, short_commit};
use crate::figure::svg::svg;
use crate::figure::tick_label;
use crate::page::{figure, page as whole_page, table};
use bench::track::history::Record;
use bench::track::link::COMMIT;
use bench::track::{Change, Drift, Series};
use maud::{Markup, html};
use std::cmp::Reverse;

/// The page. Metrics with changes come first. `link` is the address of a commit, with [`COMMIT`] for its hash.
pub fn page(records: &[Record], all: &[Series], link: Option<&str>) -> String {
    let (changed, constant): (Vec<&Series>, Vec<&Series>) =
        all.iter().partition(|series| !series.changes.is_empty() || !series.drifts.is_empty());
    let sections = [("Metrics with changes", changed), ("Metrics without changes", constant)];
    let content = html! {
        p { (span(records, link)) }
        (changes(records, all, link))
        (drifts(records, all, link))
        @for (title, series) in sections.iter().filter(|(_, series)| !series.is_empty()) {
            h2 { (title) }
            @for one in series { (drawn(records, one)) }
        }
    };
    whole_page("Trend", &content)
}

fn drawn(records: &[Record], series: &Series) -> Markup {
    let f = of_metric(records, series);
    figure(&f.id, &f.title, &svg(&f), &html! {})
}

fn span(records: &[Record], link: Option<&str>) -> Markup {
    html! {
        @match records {
            [] => "No records.",
            [one] => { "One commit, " (dated(one, link)) "." }
            [first, .., last] => { (records.len()) " commits, " (dated(first, link)) " to " (dated(last, link)) "." }
        }
    }
}

fn dated(record: &Record, link: Option<&str>) -> Markup {
    let date = record.time.get(..10).unwrap_or("no date");
    html! { (linked(&record.commit, link)) " (" (date) ")" }
}

/// The beginning of a commit's hash, with a link if there is an address.
fn linked(commit: &str, link: Option<&str>) -> Markup {
    let short = html! { code { (short_commit(commit)) } };
    match link {
        Some(link) => html! { a href=(link.replace(COMMIT, commit)) { (short) } },
        None => short,
    }
}

/// A relative change, with the class of its cell in the style sheet.
fn change_of(series: &Series, before: f64, after: f64, percent: Option<f64>) -> Markup {
    let text = percent.map_or("new".to_owned(), |by| format!("{by:+.2} %"));
    let class = series.is_cost().then_some(if after > before { "worse" } else { "better" });
    html! { span class=[class] { (text) } }
}

/// A value with its unit.
fn value(series: &Series, value: f64) -> Markup {
    html! { (tick_label(value)) @if series.unit != "count" { " " (series.unit) } }
}

/// All drifts.
fn drifts(records: &[Record], all: &[Series], link: Option<&str>) -> Markup {
    let row = |(series, drift): (&Series, &Drift)| {
        vec![
            html! { (series.name) },
            value(series, drift.before),
            value(series, drift.after),
            change_of(series, drift.before, drift.after, drift.percent),
            html! { (linked(&drift.first, link)) ".." (linked(&drift.last, link)) },
            html! { (drift.until - drift.from) " of " (records.len()) },
        ]
    };
    let all = all.iter().flat_map(|series| series.drifts.iter().map(move |drift| (series, drift)));
    let rows: Vec<Vec<Markup>> = all.map(row).collect();
    let columns = ["metric", "mean before", "mean after", "change", "commits", "number of commits"];
    html! { @if !rows.is_empty() { h2 { "Drifts" } (table(None, &columns, &rows)) } }
}

/// All change points, the latest first.
fn changes(records: &[Record], all: &[Series], link: Option<&str>) -> Markup {
    let of_series = |series| -> Vec<(&Series, &Change)> {
        let series: &Series = series;
        series.changes.iter().map(|change| (series, change)).collect()
    };
    let mut found: Vec<(&Series, &Change)> = all.iter().flat_map(of_series).collect();
    if found.is_empty() {
        return html! { p { "No change points." } };
    }
    let first_new = |(series, change): &(&Series, &Change)| series.points[change.at].0;
    found.sort_by_key(|change| Reverse(first_new(change)));
    let row = |both: &(&Series, &Change)| {
        let (series, change) = *both;
        vec![
            html! { (series.name) },
            value(series, change.before),
            value(series, change.after),
            change_of(series, change.before, change.after, change.percent),
            html! { (linked(&change.last_old, link)) ".." (linked(&change.first_new, link)) },
            html! { @if change.accepted { "accepted" } },
            html! { (records[first_new(both)].subject) },
        ]
    };
    let columns =
        ["metric", "median before", "median after", "change", "commits", "", "first commit after"];
    let rows: Vec<Vec<Markup>> = found.iter().map(row).collect();
    html! { h2 { "Change points" } (table(None, &columns, &rows)) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bench::statistics::change_points::Rules;
    use bench::testing::history as sample;
    use bench::track::analyse;

    #[test]
    fn the_page_is_self_contained_and_has_every_change_point() {
        let records = sample();
        let page = page(&records, &analyse(&records, &Rules::default()), None);
        assert!(!page.replace("http://www.w3.org/2000/svg", "").contains("http"));
        assert!(!page.contains("<script"));
        assert_eq!(page.matches("<figure").count(), 2);
        assert_eq!(page.matches("class=\"worse\"").count(), 1);
        assert!(!page.contains("<b>") && page.contains("&lt;b&gt;"));
    }

    #[test]
    fn commits_are_linked_if_there_is_an_address() {
        let records = sample();
        let all = analyse(&records, &Rules::default());
        let page = page(&records, &all, Some("https://host.org/a/b/commit/{commit}"));
        let address = format!("href=\"https://host.org/a/b/commit/{:040x}\"", 20);
        assert_eq!(page.matches(&address).count(), 1, "{page}");
    }

    #[test]
    fn histories_of_zero_and_one_commits_have_a_page() {
        assert!(page(&[], &[], None).contains("No records"));
        let one = &sample()[..1];
        assert!(page(one, &analyse(one, &Rules::default()), None).contains("One commit"));
    }
}
