//! `harness track`: a history of metrics by commit, and the commits at which they changed.
//!
//! [`history`] is the file; [`crate::statistics::change_points`] finds the changes.
//!
//! Invariant: the same history and options give the same result on every machine.

pub mod history;

use crate::statistics::change_points::{Rules, change_points};
use crate::statistics::median_of;
use history::Record;
use serde::Serialize;

/// Metrics that are results, not costs: a change is neither better nor worse.
const NEUTRAL: [&str; 2] = ["cells", "leaves"];

/// One metric over the history.
#[derive(Clone, Debug, Serialize)]
pub struct Series {
    /// `CASE/METRIC`.
    pub name: String,
    /// Index of the record and value.
    pub points: Vec<(usize, f64)>,
    /// The change points.
    pub changes: Vec<Change>,
}

/// A change point.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Change {
    /// Index of the first new value in `points`.
    pub at: usize,
    /// The last commit with the old values.
    pub last_old: String,
    /// The first commit with the new ones.
    pub first_new: String,
    /// Median of the values since the previous change.
    pub before: f64,
    /// Median of the values up to the next change.
    pub after: f64,
    /// Relative change in percent; `None` if it was 0.
    pub percent: Option<f64>,
    /// The p-value of the permutation test.
    pub p: f64,
}

impl Series {
    /// Whether an increase is worse.
    pub fn is_cost(&self) -> bool {
        let plain = self.name.rsplit('/').next().unwrap_or(&self.name);
        !NEUTRAL.contains(&plain)
    }

    /// Returns the last change if it is for the worse and its first new value is among the last `recent`.
    pub fn worse_recently(&self, recent: usize) -> Option<&Change> {
        let last = self.changes.last()?;
        let new = self.points.len() - last.at <= recent;
        (self.is_cost() && new && last.after > last.before).then_some(last)
    }
}

/// Returns every metric of the history with its change points.
pub fn analyse(records: &[Record], rules: &Rules) -> Vec<Series> {
    let mut names: Vec<&String> = records.iter().flat_map(|record| record.metrics.keys()).collect();
    names.sort();
    names.dedup();
    names.into_iter().map(|name| series(name, records, rules)).collect()
}

fn series(name: &str, records: &[Record], rules: &Rules) -> Series {
    let value = |record: &Record| record.metrics.get(name).copied();
    let points: Vec<(usize, f64)> =
        records.iter().enumerate().filter_map(|(i, record)| Some((i, value(record)?))).collect();
    let values: Vec<f64> = points.iter().map(|(_, value)| *value).collect();
    let found = change_points(&values, rules);
    let commit = |at: usize| records[points[at].0].commit.clone();
    let changes = (0..found.len()).map(|i| {
        let (at, p) = found[i];
        let from = if i == 0 { 0 } else { found[i - 1].0 };
        let until = found.get(i + 1).map_or(values.len(), |next| next.0);
        let (before, after) = (median_of(&values[from..at]), median_of(&values[at..until]));
        let percent = (before != 0.0).then(|| (after / before - 1.0) * 100.0);
        Change { at, last_old: commit(at - 1), first_new: commit(at), before, after, percent, p }
    });
    Series { name: name.to_owned(), changes: changes.collect(), points }
}

/// Returns a text with one change point per line.
pub fn summary(all: &[Series]) -> String {
    let short = |commit: &str| commit.chars().take(12).collect::<String>();
    let mut text = String::new();
    for series in all {
        for change in &series.changes {
            let percent = change.percent.map_or("from 0".to_owned(), |by| format!("{by:+.2} %"));
            text.push_str(&format!(
                "{}: {} -> {} ({percent}) in {}..{}, p = {:.3}\n",
                series.name,
                change.before,
                change.after,
                short(&change.last_old),
                short(&change.first_new),
                change.p
            ));
        }
    }
    if text.is_empty() {
        text.push_str("no change points\n");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::history as sample;

    #[test]
    fn a_change_point_has_its_commits_and_size() {
        let all = analyse(&sample(), &Rules::default());
        assert!(all[0].changes.is_empty());
        let [change] = &all[1].changes[..] else { panic!("{:?}", all[1].changes) };
        assert_eq!((change.at, &change.first_new), (20, &format!("{:040x}", 20)));
        assert!((9.0..11.0).contains(&change.percent.unwrap()), "{change:?}");
        assert!(summary(&all).starts_with("uav/words: 100"), "{}", summary(&all));
    }

    #[test]
    fn only_recent_changes_for_the_worse_are_returned() {
        let all = analyse(&sample(), &Rules::default());
        assert!(all[1].worse_recently(10).is_some() && all[1].worse_recently(9).is_none());
        let mut better = all[1].clone();
        better.changes[0].after = 1.0;
        assert!(better.worse_recently(10).is_none());
        let neutral = Series { name: "uav/cells".into(), ..all[1].clone() };
        assert!(neutral.worse_recently(10).is_none());
    }
}
