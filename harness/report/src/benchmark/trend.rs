//! Figures of the history that `harness track` keeps: costs by commit, relative to the first one.
//!
//! Numbers of one case have units of their own, so each is divided by its first value; those that moved most are
//! shown. Points are not joined: there is nothing between two commits.

use super::figure::{Axis, Body, Claims, Figure, How, Point, Series as Shown, short};
use bench::track::history::Record;
use bench::track::{self, Series};

/// Most metrics in a figure: as many as there are markers.
const SHOWN: usize = 6;
/// Change by which a metric counts as moved.
const MOVED: f64 = 1e-3;

/// A figure for every case, of what moved in it.
pub fn figures(records: &[Record], all: &[Series]) -> Vec<Figure> {
    let mut cases: Vec<&str> = all.iter().map(|s| split(s).0).collect();
    cases.dedup();
    cases.into_iter().filter_map(|case| figure(records, all, case)).collect()
}

/// Where numbers changed, a line each; as `harness track` tells it.
pub fn told(records: &[Record], all: &[Series]) -> String {
    format!("{} commits, {} metrics\n{}", records.len(), all.len(), track::summary(all))
}

/// Case and metric.
fn split(series: &Series) -> (&str, &str) {
    series.name.rsplit_once('/').unwrap_or(("", &series.name))
}

/// How far a metric got from its first value; nothing where that is none to divide by.
fn reach(series: &Series) -> Option<f64> {
    let first = series.points.first().map(|p| p.1).filter(|v| *v > 0.0)?;
    let off = series.points.iter().map(|p| (p.1 / first - 1.0).abs());
    Some(off.fold(0.0, f64::max))
}

fn figure(records: &[Record], all: &[Series], case: &str) -> Option<Figure> {
    let costs = all.iter().filter(|s| split(s).0 == case && s.is_cost() && s.points.len() > 1);
    let mut moved: Vec<(f64, &Series)> =
        costs.clone().filter_map(|s| Some((reach(s)?, s))).filter(|(by, _)| *by > MOVED).collect();
    moved.sort_by(|a, b| b.0.total_cmp(&a.0));
    let still = costs.count() - moved.len();
    let more = moved.len().saturating_sub(SHOWN);
    moved.truncate(SHOWN);
    let base = &records[moved.iter().map(|(_, s)| s.points[0].0).min()?];
    let named = format!("commit {}", base.commit.chars().take(12).collect::<String>());
    let firsts: Vec<String> =
        moved.iter().map(|(_, s)| format!("{} {}", split(s).1, short(s.points[0].1))).collect();
    Some(Figure {
        id: format!("trend-{case}"),
        title: format!("Trend over commits: {case}"),
        caption: format!(
            "Costs of {case} by commit, each over its first value (at {named} of {}, where its record begins: {}). Shown are those that moved most; {more} \
             more moved, {still} did not. Counters repeat exactly; commits without a record are left out, and nothing lies between two of them.",
            base.time.get(..10).unwrap_or("an unknown day"),
            firsts.join(", ")
        ),
        x: commits(records.len()),
        y: Axis::linear("value / first value"),
        body: Body::Points(moved.iter().enumerate().map(|(look, (_, s))| shown(look, s)).collect()),
        claims: Claims {
            base_case: Some(named),
            shows_ratios: true,
            // Seconds are of another run at every commit.
            deterministic: moved.iter().all(|(_, s)| split(s).1 != "seconds"),
            ..Claims::default()
        },
    })
}

fn shown(look: usize, series: &Series) -> Shown {
    let first = series.points[0].1;
    let points = series.points.iter().map(|&(at, v)| Point::bare(at as f64, v / first)).collect();
    Shown { name: split(series).1.to_owned(), how: How::Measured, joined: false, points, look }
}

/// An axis of whole numbers.
fn commits(count: usize) -> Axis {
    let last = count.saturating_sub(1).max(1);
    let ticks = (0..=last).step_by(last.div_ceil(8)).map(|t| t as f64).collect();
    let room = last as f64 * 0.03;
    let range = Some((-room, last as f64 + room));
    Axis { range, ..Axis::linear("commit, by its place in the history").with_ticks(ticks) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::benchmark::lint::{Verdict, lint};
    use bench::statistics::change_points::Rules;
    use bench::track::analyse;

    #[test]
    fn what_moved_is_shown_over_its_first_value() {
        let records = bench::testing::history();
        let all = analyse(&records, &Rules::default());
        let figures = figures(&records, &all);
        let [f] = &figures[..] else { panic!("{figures:?}") };
        assert_eq!(f.id, "trend-uav");
        let Body::Points(series) = &f.body else { panic!() };
        // Cells are no cost, and did not move either.
        assert_eq!((series.len(), series[0].name.as_str()), (1, "words"));
        assert_eq!((series[0].points.len(), series[0].points[0].y), (30, 1.0));
        assert!((series[0].points[29].y - 1.1).abs() < 0.01);
        let broken = lint(&figures, &[]);
        let broken =
            broken.iter().filter(|f| f.about == "trend-uav" && f.verdict == Verdict::Broken);
        assert_eq!(broken.count(), 0);
        assert!(told(&records, &all).contains("uav/words: 100"));
    }

    #[test]
    fn a_history_in_which_nothing_moved_has_no_figure() {
        let mut records = bench::testing::history();
        records.truncate(1);
        assert!(figures(&records, &analyse(&records, &Rules::default())).is_empty());
        assert!(figures(&[], &[]).is_empty());
        assert_eq!(commits(3).ticks, [0.0, 1.0, 2.0]);
    }
}
