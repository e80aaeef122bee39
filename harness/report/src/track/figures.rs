//! Figures of the history that `harness track` keeps, one per metric.
//!
//! Points are not joined: there are no values between two commits.

use crate::figure::{Axis, Figure, Mark, Point, Provenance, Series as Plotted, file_name};
use bench::track::history::Record;
use bench::track::{Change, Series};

/// Height of the figure of a metric.
const HEIGHT: u32 = 560;

fn case_and_metric(series: &Series) -> (&str, &str) {
    series.name.rsplit_once('/').unwrap_or(("", &series.name))
}

/// The figure of one metric, with its steps as vertical lines. Outliers do not widen the
/// axis: they are drawn at its ends.
pub fn of_metric(records: &[Record], series: &Series) -> Figure {
    let note = |&(commit, value): &(usize, f64)| {
        let record = &records[commit];
        format!("{} {value} {}\n{}", short_commit(&record.commit), series.unit, record.subject)
    };
    let x = |at: usize| series.points[at].0 as f64;
    let mark = |change: &Change| {
        let (name, style) = match (series.is_worse(change), change.accepted) {
            (None, _) => ("change", 3),
            (Some(_), true) => ("accepted", 3),
            (Some(true), false) => ("worse", 1),
            (Some(false), false) => ("better", 2),
        };
        // Between the last commit with the old value and the first with the new one.
        Mark { name: name.to_owned(), x: x(change.at - 1).midpoint(x(change.at)), style }
    };
    let (low, high) = range(series);
    let is_inside = |point: &&(usize, f64)| (low..=high).contains(&point.1);
    let (inside, outside): (Vec<_>, Vec<_>) = series.points.iter().partition(is_inside);
    let plotted = |name: &str, how: Provenance, style: usize, shown: &[&(usize, f64)]| {
        let point =
            |&&(commit, value): &&(usize, f64)| Point::exact(commit as f64, value.clamp(low, high));
        let notes = shown.iter().map(|point| note(point)).collect();
        let plotted = Plotted::new(name, how, style, shown.iter().map(point).collect());
        Plotted { notes, ..plotted.not_joined() }
    };
    let mut lines = vec![plotted(case_and_metric(series).1, Provenance::Measured, 0, &inside)];
    if !outside.is_empty() {
        let name = "beyond the axis, drawn at its end";
        lines.push(plotted(name, Provenance::Oversubscribed, 5, &outside));
    }
    let y = Axis { range: Some((low, high)), ..Axis::linear(series.unit) };
    Figure {
        height: HEIGHT,
        marks: series.changes.iter().map(mark).collect(),
        ..Figure::new(
            file_name(&format!("metric-{}", series.name)),
            series.name.clone(),
            String::new(),
            [commits(records.len()), y],
            lines,
        )
    }
}

/// The first ten characters of a commit's hash.
pub fn short_commit(commit: &str) -> String {
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
    let kept = match sorted.len() > 2 * cut {
        true => &sorted[cut..sorted.len() - cut],
        false => &sorted[..],
    };
    let levels = series.changes.iter().flat_map(|change| [change.before, change.after]);
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
    Axis { range, ..Axis::linear("commit (index in the history)").with_ticks(ticks) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bench::track::analyse;
    use statistics::change_points::Rules;

    #[test]
    fn an_outlier_does_not_squash_the_plot() {
        let mut records = bench::testing::history();
        records[5].metrics.insert("uav/words".into(), 1e9);
        let all = analyse(&records, &Rules::default());
        let words = all.iter().find(|s| s.name == "uav/words").unwrap();
        let figure = of_metric(&records, words);
        let (low, high) = figure.y.range.unwrap();
        assert!((500.0..1000.0).contains(&low) && (1110.0..1500.0).contains(&high), "{low} {high}");
        let series = figure.series;
        assert_eq!((series[0].points.len(), series[1].points.len()), (29, 1));
        assert_eq!(series[1].points[0].y, high);
        assert!(series[1].notes[0].contains("1000000000"), "{:?}", series[1].notes);
    }

    #[test]
    fn a_change_point_lies_between_its_commits() {
        let records = bench::testing::history();
        let all = analyse(&records, &Rules::default());
        let words = all.iter().find(|s| s.name == "uav/words").unwrap();
        let Figure { series, marks, .. } = of_metric(&records, words);
        assert_eq!(marks, [Mark { name: "worse".into(), x: 19.5, style: 1 }]);
        assert!(series[0].notes[20].ends_with("\n<b>"), "{:?}", series[0].notes[20]);
    }
}
