//! The trend page: the change points as a table, then a figure per metric.

use super::figures::{of_metric, short_commit};
use crate::figure::svg::svg;
use crate::figure::tick_label;
use crate::page::{figure, page as whole_page, table};
use bench::track::history::Record;
use bench::track::{Change, Series};
use maud::{Markup, html};
use std::cmp::Reverse;

/// The page. Metrics with change points come first.
pub fn page(records: &[Record], all: &[Series]) -> String {
    let (changed, constant): (Vec<&Series>, Vec<&Series>) =
        all.iter().partition(|series| !series.changes.is_empty());
    let sections =
        [("Metrics with change points", changed), ("Metrics without change points", constant)];
    let content = html! {
        p { (span(records)) }
        (changes(records, all))
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

fn span(records: &[Record]) -> Markup {
    html! {
        @match records {
            [] => "No records.",
            [one] => { "One commit, " (dated(one)) "." }
            [first, .., last] => { (records.len()) " commits, " (dated(first)) " to " (dated(last)) "." }
        }
    }
}

fn dated(record: &Record) -> Markup {
    let date = record.time.get(..10).unwrap_or("no date");
    html! { code { (short_commit(&record.commit)) } " (" (date) ")" }
}

/// All change points, the latest first.
fn changes(records: &[Record], all: &[Series]) -> Markup {
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
        let percent = change.percent.map_or("new".to_owned(), |by| format!("{by:+.2} %"));
        vec![
            html! { (series.name) },
            html! { (tick_label(change.before)) },
            html! { (tick_label(change.after)) },
            html! { span class=[class(series, change)] { (percent) } },
            html! { code { (short_commit(&change.last_old)) ".." (short_commit(&change.first_new)) } },
            html! { (records[first_new(both)].subject) },
        ]
    };
    let columns =
        ["metric", "median before", "median after", "change", "commits", "first commit after"];
    let rows: Vec<Vec<Markup>> = found.iter().map(row).collect();
    html! { h2 { "Change points" } (table(None, &columns, &rows)) }
}

/// The class of a change in the style sheet; none if the metric is not a cost.
fn class(series: &Series, change: &Change) -> Option<&'static str> {
    series.is_cost().then_some(if change.after > change.before { "worse" } else { "better" })
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
        let page = page(&records, &analyse(&records, &Rules::default()));
        assert!(!page.replace("http://www.w3.org/2000/svg", "").contains("http"));
        assert!(!page.contains("<script"));
        assert_eq!(page.matches("<figure").count(), 2);
        assert_eq!(page.matches("class=\"worse\"").count(), 1);
        assert!(!page.contains("<b>") && page.contains("&lt;b&gt;"));
    }

    #[test]
    fn histories_of_zero_and_one_commits_have_a_page() {
        assert!(page(&[], &[]).contains("No records"));
        let one = &sample()[..1];
        assert!(page(one, &analyse(one, &Rules::default())).contains("One commit"));
    }
}
