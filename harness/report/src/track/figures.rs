//! Figures of the history that `harness track` keeps: one per case, relative to the first commit, and one per metric.
//!
//! Points are not joined: there are no values between two commits.

use crate::figure::palette::MARKERS;
use crate::figure::{
    Axis, Body, Claims, Figure, Mark, Point, Provenance, Series as Plotted, file_name, svg,
    tick_label,
};
use bench::track::history::Record;
use bench::track::{Change, Series};

/// Relative change above which a metric is shown.
const CHANGE_MIN: f64 = 1e-3;
/// Height of the figure of a metric.
const HEIGHT: u32 = 560;

/// A figure per case of the costs that changed most, each relative to its first value because their units differ.
pub fn by_case(records: &[Record], all: &[Series]) -> Vec<Figure> {
    let mut cases: Vec<&str> = all.iter().map(|s| case_and_metric(s).0).collect();
    cases.dedup();
    cases.into_iter().filter_map(|case| of_case(records, all, case)).collect()
}

fn case_and_metric(series: &Series) -> (&str, &str) {
    series.name.rsplit_once('/').unwrap_or(("", &series.name))
}

/// The largest relative change from the first value; none if that is not positive.
fn change_max(series: &Series) -> Option<f64> {
    let first = series.points.first().map(|p| p.1).filter(|v| *v > 0.0)?;
    let changes = series.points.iter().map(|p| (p.1 / first - 1.0).abs());
    Some(changes.fold(0.0, f64::max))
}

fn of_case(records: &[Record], all: &[Series], case: &str) -> Option<Figure> {
    let of_case = |s: &&Series| case_and_metric(s).0 == case && s.is_cost() && s.points.len() > 1;
    let costs = all.iter().filter(of_case);
    let mut changed: Vec<(f64, &Series)> = costs
        .clone()
        .filter_map(|s| Some((change_max(s)?, s)))
        .filter(|(change, _)| *change > CHANGE_MIN)
        .collect();
    changed.sort_by(|a, b| b.0.total_cmp(&a.0));
    let constant = costs.count() - changed.len();
    let more = changed.len().saturating_sub(MARKERS);
    changed.truncate(MARKERS);
    let base = &records[changed.iter().map(|(_, s)| s.points[0].0).min()?];
    let base_case = format!("commit {}", base.commit.chars().take(12).collect::<String>());
    let metric = |s: &Series| case_and_metric(s).1.to_owned();
    let firsts: Vec<String> = changed
        .iter()
        .map(|(_, s)| format!("{} {}", metric(s), tick_label(s.points[0].1)))
        .collect();
    let plotted = |(style, (_, s)): (usize, &(f64, &Series))| relative(style, s);
    Some(Figure {
        id: format!("trend-{case}"),
        title: format!("Trend over commits: {case}"),
        caption: format!(
            "Costs of {case} by commit, relative to the first value of each (at {base_case} of {}, the first on record: {}). The costs that changed \
             most are shown; {more} more changed, {constant} did not. Counters repeat exactly. Commits without a record have no point.",
            base.time.get(..10).unwrap_or("an unknown day"),
            firsts.join(", ")
        ),
        x: commits(records.len()),
        y: Axis::linear("value / first value"),
        body: Body::points(changed.iter().enumerate().map(plotted).collect()),
        height: svg::HEIGHT,
        claims: Claims {
            base_case: Some(base_case.clone()),
            shows_ratios: true,
            // Every commit has its own measurement of the time.
            deterministic: changed.iter().all(|(_, s)| metric(s) != "seconds"),
            ..Claims::default()
        },
    })
}

fn relative(style: usize, series: &Series) -> Plotted {
    let first = series.points[0].1;
    let point = |&(commit, value): &(usize, f64)| Point::exact(commit as f64, value / first);
    let points = series.points.iter().map(point).collect();
    Plotted::new(case_and_metric(series).1, Provenance::Measured, style, points).not_joined()
}

/// The figure of one metric, with its steps as vertical lines and its drifts as dashed lines. Outliers do not widen the
/// axis: they are drawn at its ends.
pub fn of_metric(records: &[Record], series: &Series) -> Figure {
    let note = |&(commit, value): &(usize, f64)| {
        let record = &records[commit];
        format!("{} {value} {}\n{}", short_commit(&record.commit), series.unit, record.subject)
    };
    let mark = |change: &Change| {
        let position = |at: usize| series.points[at].0 as f64;
        let (name, style) = match (series.is_cost(), change.accepted, change.after > change.before)
        {
            (false, _, _) => ("change", 3),
            (true, true, _) => ("accepted", 3),
            (true, false, true) => ("increase", 1),
            (true, false, false) => ("decrease", 2),
        };
        // Between the last commit with the old value and the first with the new one.
        let x = (position(change.at) + position(change.at - 1)) / 2.0;
        Mark { name: name.to_owned(), x, style }
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
    lines.extend(series.drifts.iter().map(|drift| {
        let x = |at: usize| series.points[at].0 as f64;
        let ends = [(x(drift.from), drift.before), (x(drift.until - 1), drift.after)];
        let points = ends.map(|(x, y)| Point::exact(x, y.clamp(low, high)));
        Plotted::new("drift", Provenance::Bound, 4, points.to_vec())
    }));
    Figure {
        id: file_name(&format!("metric-{}", series.name)),
        title: series.name.clone(),
        caption: String::new(),
        x: commits(records.len()),
        y: Axis { range: Some((low, high)), ..Axis::linear(series.unit) },
        body: Body::Points { series: lines, marks: series.changes.iter().map(mark).collect() },
        height: HEIGHT,
        claims: Claims::default(),
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
    let ends = series.drifts.iter().flat_map(|drift| [drift.before, drift.after]);
    let shown = || kept.iter().copied().chain(levels.clone()).chain(ends.clone());
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
    use crate::benchmark::lint::lint;
    use bench::statistics::change_points::Rules;
    use bench::track::analyse;

    #[test]
    fn costs_that_changed_are_shown_relative_to_their_first_values() {
        let records = bench::testing::history();
        let all = analyse(&records, &Rules::default());
        let figures = by_case(&records, &all);
        let [f] = &figures[..] else { panic!("{figures:?}") };
        assert_eq!(f.id, "trend-uav");
        let Body::Points { series, .. } = &f.body else { panic!("not points: {:?}", f.body) };
        // The number of cells is a result, not a cost.
        assert_eq!((series.len(), series[0].name.as_str()), (1, "words"));
        assert_eq!((series[0].points.len(), series[0].points[0].y), (30, 1.0));
        assert!((series[0].points[29].y - 1.1).abs() < 0.01);
        let broken: Vec<_> =
            lint(&figures, &[]).into_iter().filter(|b| b.about == "trend-uav").collect();
        assert!(broken.is_empty(), "{broken:?}");
    }

    #[test]
    fn a_history_without_changes_has_no_figure() {
        let mut records = bench::testing::history();
        records.truncate(1);
        assert!(by_case(&records, &analyse(&records, &Rules::default())).is_empty());
        assert!(by_case(&[], &[]).is_empty());
        assert_eq!(commits(3).ticks, [0.0, 1.0, 2.0]);
    }

    #[test]
    fn an_outlier_does_not_squash_the_plot() {
        let mut records = bench::testing::history();
        records[5].metrics.insert("uav/words".into(), 1e9);
        let all = analyse(&records, &Rules::default());
        let words = all.iter().find(|s| s.name == "uav/words").unwrap();
        let figure = of_metric(&records, words);
        let (low, high) = figure.y.range.unwrap();
        assert!((500.0..1000.0).contains(&low) && (1110.0..1500.0).contains(&high), "{low} {high}");
        let Body::Points { series, .. } = figure.body else { panic!() };
        assert_eq!((series[0].points.len(), series[1].points.len()), (29, 1));
        assert_eq!(series[1].points[0].y, high);
        assert!(series[1].notes[0].contains("1000000000"), "{:?}", series[1].notes);
    }

    #[test]
    fn a_change_point_lies_between_its_commits() {
        let records = bench::testing::history();
        let all = analyse(&records, &Rules::default());
        let words = all.iter().find(|s| s.name == "uav/words").unwrap();
        let Body::Points { series, marks } = of_metric(&records, words).body else { panic!() };
        assert_eq!(marks, [Mark { name: "increase".into(), x: 19.5, style: 1 }]);
        assert!(series[0].notes[20].ends_with("\n<b>"), "{:?}", series[0].notes[20]);
    }
}
