//! `harness track`: a history of metrics by commit, and the commits at which they changed.
//!
//! [`history`] is the file; [`statistics::change_points`] finds steps in one metric, and
//! [`statistics::comparison::adjusted`] controls how many of all of them are false.
//!
//! Invariant: the same history and options give the same result on every machine.
//!
//! Invariants of the answer, executed by `Series::check_invariants` before it is printed: steps are in order and
//! within the series; both values beside a change lie among the values of their segments, and its percentage is theirs; its
//! commits are those of the history; p is a probability.

pub mod history;

use crate::gate::report::change_percent;
use history::Record;
use serde::Serialize;
use statistics::change_points::{Change as Step, change_points};
pub use statistics::change_points::{LEVEL_MIN, VALUES_MIN};
use statistics::comparison::adjusted;
use std::collections::BTreeSet;

/// Metrics that are results, not costs: a change is neither better nor worse.
const NEUTRAL: [&str; 2] = ["cells", "leaves"];
/// Words in the names of metrics of which more is better. All others are costs.
const GAINS: &str =
    "per_s per_sec per_second efficiency speed_up speedup throughput bandwidth load_balance hold";
/// The same, unless it is a time.
const RATES: &str = "rate hit_ratio checks";
/// Beginnings of words of which less is better, whatever the other words are.
const LOSSES: &str = "miss error fail wait";

/// Whether a metric has one of these words, or a word that begins so, in upper or lower case; `end` is `_` for whole words.
fn has(name: &str, words: &str, end: &str) -> bool {
    let name = plain(name).to_lowercase().replace(|c: char| !c.is_alphanumeric(), "_");
    words.split(' ').any(|word| format!("_{name}_").contains(&format!("_{word}{end}")))
}

/// Whether a metric has a word of a gain, although another one may make it a loss. Such metrics depend on the machine.
pub(crate) fn has_gain(name: &str) -> bool {
    has(name, GAINS, "_") || has(name, RATES, "_")
}

/// Whether more of a metric is better; `None` if it is neither better nor worse.
pub fn is_gain(name: &str) -> Option<bool> {
    let is_time = has(name, "seconds time", "_") && !has(name, GAINS, "_");
    let is_cost = is_time || has(name, LOSSES, "") || !has_gain(name);
    (!NEUTRAL.contains(&plain(name))).then_some(!is_cost)
}

/// By how much a step may be located too early or too late, and still is the change that the user accepted: values of the metric, and
/// commits.
const ACCEPTED_WITHIN: [usize; 2] = [2, 10];

/// One metric over the history.
#[derive(Clone, Debug, Serialize)]
pub struct Series {
    /// `CASE/METRIC`.
    pub name: String,
    /// Unit of the values.
    pub unit: &'static str,
    /// Index of the record and value.
    pub points: Vec<(usize, f64)>,
    /// The steps.
    pub changes: Vec<Change>,
}

/// A step.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Change {
    /// The step of the values in `points`.
    #[serde(flatten)]
    pub step: Step,
    /// The commit of the value before it.
    pub last_old: String,
    /// The commit of the first new value.
    pub first_new: String,
    /// Relative change in percent; `None` if it was 0.
    pub percent: Option<f64>,
    /// Whether the user has accepted the new values.
    pub accepted: bool,
}

impl Series {
    /// Executes the invariants at the head of this file.
    fn check_invariants(&self, records: &[Record]) {
        let Self { name, points, changes, .. } = self;
        let is_within = |value: f64, part: &[(usize, f64)]| {
            part.iter().any(|p| p.1 <= value) && part.iter().any(|p| p.1 >= value)
        };
        let mut from = 0;
        let ends = changes.iter().map(|change| change.step.at).skip(1).chain([points.len()]);
        for (Change { step, last_old, first_new, percent, .. }, until) in changes.iter().zip(ends) {
            let at = step.at;
            assert!(from < at && at < until, "{name}: in order: {step:?}");
            let (old, new) = (&points[from..at], &points[at..until]);
            let beside = is_within(step.before, old) && is_within(step.after, new);
            assert!(beside, "{name}: values beside a step are of their segments: {step:?}");
            let Step { before, after, p, .. } = step;
            let commits = [at - 1, at].map(|at| &records[points[at].0].commit);
            assert_eq!([last_old, first_new], commits, "{name}: commits of a step");
            let by = change_percent(*before, *after);
            assert_eq!(*percent, by, "{name}: the percentage is that of {before} and {after}");
            assert!(*p > 0.0 && *p <= 1.0, "{name}: {p} is a probability");
            from = at;
        }
    }

    /// Whether another value is worse; `None` if it is neither better nor worse.
    pub fn is_worse(&self, old: f64, new: f64) -> Option<bool> {
        Some(if is_gain(&self.name)? { new < old } else { new > old })
    }

    /// Whether a step is so near to the commit of a record that accepting this commit may excuse it.
    pub fn has_step_near(&self, commit: usize) -> bool {
        self.changes.iter().any(|change| distance(&self.points, change.step.at, commit).is_some())
    }

    /// Returns the last change for the worse that was not accepted, whose first new value is among the last `recent`, and since which the
    /// metric has not become as good as before.
    pub fn worse_recently(&self, recent: usize) -> Option<&Change> {
        let now = self.changes.last()?.step.after;
        self.changes.iter().rfind(|Change { step, accepted, .. }| {
            let is_worse = |new| self.is_worse(step.before, new) == Some(true);
            let is_new = self.points.len() - step.at <= recent;
            is_new && !accepted && is_worse(step.after) && is_worse(now)
        })
    }
}

/// A metric's name without its case, ranks and origin.
fn plain(name: &str) -> &str {
    let plain = name.rsplit('/').next().unwrap_or(name);
    plain.split_once(" [").map_or(plain, |(plain, _)| plain)
}

/// Returns the unit of a metric.
pub fn unit(name: &str) -> &'static str {
    match plain(name) {
        name if name.ends_with("per_s") => "count",
        name if name.ends_with("seconds") || name.ends_with("_s") => "s",
        name if name.ends_with("bytes") => "bytes",
        "instructions" => "instructions",
        "cells" | "leaves" => "cells",
        _ => "count",
    }
}

/// Returns every metric of the history with its changes. Of all metrics with a change, at most the fraction `alpha`
/// is expected to have none in truth.
pub fn analyse(records: &[Record], alpha: f64) -> Vec<Series> {
    let names: BTreeSet<&String> = records.iter().flat_map(|of| of.metrics.keys()).collect();
    let of_metric = |name: &String| {
        let value = |(i, record): (usize, &Record)| Some((i, *record.metrics.get(name)?));
        let points: Vec<(usize, f64)> = records.iter().enumerate().filter_map(value).collect();
        let values: Vec<f64> = points.iter().map(|point| point.1).collect();
        (name.clone(), points, change_points(&values, alpha))
    };
    let all: Vec<_> = names.into_iter().map(of_metric).collect();
    // A metric is one test: its smallest p-value counts, and 1 if nothing was found.
    let least = |found: &[Step]| found.iter().map(|change| change.p).fold(1.0, f64::min);
    let p_values: Vec<f64> = all.iter().map(|(.., found)| least(found)).collect();
    let mut p_values = adjusted(&p_values).into_iter();
    let of_discovery = |(name, points, found): (String, Vec<(usize, f64)>, Vec<Step>)| {
        let is_discovery = p_values.next() <= Some(alpha);
        let commit = |at: usize| records[points[at].0].commit.clone();
        let change = |(step, accepted): (Step, bool)| Change {
            last_old: commit(step.at - 1),
            first_new: commit(step.at),
            percent: change_percent(step.before, step.after),
            accepted,
            step,
        };
        let accepted = are_accepted(&found, &points, records);
        let found = found.into_iter().zip(accepted);
        let changes = found.filter(|_| is_discovery).map(change).collect();
        let series = Series { unit: unit(&name), name, changes, points };
        series.check_invariants(records);
        series
    };
    all.into_iter().map(of_discovery).collect()
}

/// The distance of a commit from those between the last old value of a step and its first new one; `None` if it is not near.
fn distance(points: &[(usize, f64)], at: usize, commit: usize) -> Option<usize> {
    let [values, commits] = ACCEPTED_WITHIN;
    let first = points[(at - 1).saturating_sub(values)].0 + 1;
    let last = points[(at + values).min(points.len() - 1)].0;
    let [from, until] = [points[at - 1].0 + 1, points[at].0];
    let off = from.saturating_sub(commit).max(commit.saturating_sub(until));
    (off <= commits && (first..=last).contains(&commit)).then_some(off)
}

/// Returns of every step whether it was accepted. A commit that was accepted excuses one step, the nearest.
fn are_accepted(found: &[Step], points: &[(usize, f64)], records: &[Record]) -> Vec<bool> {
    let mut all = vec![false; found.len()];
    for commit in (0..records.len()).filter(|i| records[*i].accepted) {
        let off = |(step, i): (&Step, usize)| Some((distance(points, step.at, commit)?, i));
        found.iter().zip(0..).filter_map(off).min().into_iter().for_each(|(_, i)| all[i] = true);
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::history as sample;
    use proptest::prelude::*;

    #[test]
    fn a_change_point_has_its_commits_and_size() {
        let all = analyse(&sample(), 0.01);
        assert!(all[0].changes.is_empty());
        let [change] = &all[1].changes[..] else { panic!("{:?}", all[1].changes) };
        assert_eq!((change.step.at, &change.first_new), (20, &format!("{:040x}", 20)));
        assert!((9.0..11.0).contains(&change.percent.unwrap()), "{change:?}");
    }

    #[test]
    fn only_recent_changes_for_the_worse_are_returned() {
        let all = analyse(&sample(), 0.01);
        assert!(all[1].worse_recently(10).is_some() && all[1].worse_recently(9).is_none());
        let mut better = all[1].clone();
        better.changes[0].step.after = 1.0;
        assert!(better.worse_recently(10).is_none());
        // A recovery that is not complete does not hide the change before it.
        for (after, holds) in [(1050.0, false), (1000.0, true), (900.0, true)] {
            let mut recovered = all[1].clone();
            let mut second = recovered.changes[0].clone();
            recovered.changes[0].step.before = 1000.0;
            second.step = Step { at: 25, before: 1100.0, after, ..second.step };
            recovered.changes.push(second);
            assert_eq!(recovered.worse_recently(10).is_none(), holds, "{after}");
        }
        let neutral = Series { name: "uav/cells".into(), ..all[1].clone() };
        assert!(neutral.worse_recently(10).is_none());
        // Of these, less is worse.
        for gain in [
            "cells_per_s",
            "cells_per_second",
            "mpi-2/cells_per_second_per_core [2]",
            "speed_up",
            "hold",
            "Speedup",
            "parallel efficiency",
            "load balance",
            "hit_ratio",
            "mcells_per_sec",
            "checks",
        ] {
            let more = Series { name: format!("uav/{gain}"), ..all[1].clone() };
            let less = Series { name: more.name.clone(), ..better.clone() };
            assert!(
                more.worse_recently(10).is_none() && less.worse_recently(10).is_some(),
                "{gain}"
            );
        }
    }

    #[test]
    fn what_is_missed_or_takes_time_is_no_gain() {
        for cost in [
            "cache_miss_rate",
            "error_rate",
            "rate_limit_waits",
            "seconds_per_checks",
            "failed_checks",
            "load imbalance",
            "balance_seconds",
        ] {
            assert_eq!(is_gain(&format!("uav/{cost}")), Some(false), "{cost}");
        }
    }

    #[test]
    fn an_accepted_change_is_still_shown_and_no_longer_worse() {
        for (accepted, holds) in [(17, false), (18, true), (20, true), (22, true), (23, false)] {
            let mut records = sample();
            records[accepted].accepted = true;
            let all = analyse(&records, 0.01);
            assert_eq!(all[1].changes.len(), 1);
            assert_eq!(all[1].worse_recently(10).is_none(), holds, "{accepted}");
        }
    }

    /// Two steps at commits 20 and 22; then values of every tenth commit only, with a step after that of commit 200.
    #[test]
    fn an_accepted_commit_excuses_the_nearest_step_alone() {
        let left = |count: usize, every: usize, level: fn(usize) -> f64, accepted: &[usize]| {
            let record = |i: usize| {
                let value = level(i) + (i * 7919 % 13) as f64 / 13.0;
                let metrics = i.is_multiple_of(every).then(|| ("c/words".to_owned(), value));
                let metrics = metrics.into_iter().collect();
                let accepted = accepted.contains(&i);
                Record { metrics, accepted, ..Record::new(format!("{i:040x}")) }
            };
            let all = analyse(&(0..count).map(record).collect::<Vec<_>>(), 0.01);
            let open = all[0].changes.iter().filter(|change| !change.accepted);
            open.map(|change| change.step.at).collect::<Vec<usize>>()
        };
        let two = |i: usize| [1000.0, 1200.0, 1500.0][usize::from(i >= 20) + usize::from(i >= 22)];
        assert_eq!(left(40, 1, two, &[]), [20, 22]);
        assert_eq!(left(40, 1, two, &[20]), [22]);
        assert_eq!(left(40, 1, two, &[21]), [22], "one of them");
        assert_eq!(left(40, 1, two, &[23]), [20]);
        assert_eq!(left(40, 1, two, &[20, 22]), [0; 0]);
        let rare = |i: usize| if i <= 200 { 1000.0 } else { 1100.0 };
        for (accepted, open) in [(180, true), (191, false), (205, false), (220, false), (221, true)]
        {
            assert_eq!(left(400, 10, rare, &[accepted]).is_empty(), !open, "{accepted}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        /// Levels, slopes and noise of any size, with values missing from commits.
        #[test]
        fn drawn_histories_satisfy_the_invariants(
            drawn in prop::collection::vec((0.0..1.0f64, 0..10u8), 4..60), step in -50.0..50.0f64, slope in -2.0..2.0f64,
        ) {
            let record = |(i, &(noise, present)): (usize, &(f64, u8))| {
                let shift = if 2 * i > drawn.len() { step } else { 0.0 };
                let value = 10.0 + noise + shift + slope * i as f64;
                let metrics = (present > 0).then(|| ("c/seconds".to_owned(), value));
                Record { metrics: metrics.into_iter().collect(), ..Record::new(format!("{i:040x}")) }
            };
            let records: Vec<Record> = drawn.iter().enumerate().map(record).collect();
            analyse(&records, 0.01);
        }
    }

    fn planted(fault: impl Fn(&mut Change)) {
        let records = sample();
        let mut wrong = analyse(&records, 0.01).remove(1);
        fault(&mut wrong.changes[0]);
        wrong.check_invariants(&records);
    }

    #[test]
    #[should_panic(expected = "values beside a step are of their segments")]
    fn a_value_of_the_other_segment_is_noticed() {
        planted(|change| change.step.before = change.step.after);
    }

    #[test]
    #[should_panic(expected = "the percentage is that of")]
    fn a_percentage_of_other_values_is_noticed() {
        planted(|change| change.percent = change.percent.map(|by| -by));
    }

    #[test]
    #[should_panic(expected = "commits of a step")]
    fn a_commit_beside_the_step_is_noticed() {
        planted(|change| change.first_new = change.last_old.clone());
    }

    #[test]
    fn units_follow_from_the_names() {
        let names =
            ["a/seconds [2]", "a/4 ranks/message_bytes", "a/cells", "a/rays", "a/time_wall_s"];
        assert_eq!(names.map(unit), ["s", "bytes", "cells", "count", "s"]);
    }
}
