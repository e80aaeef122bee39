//! What the runs of a record must give when they are repeated elsewhere: digests and counts exactly, ratios within bands. Times are
//! those of a machine, so they are shown and not judged.
//!
//! Invariants, executed by `Expected::check_invariants` before anything is written or printed: a quantity of a run is there once; a band
//! contains its value. Verdicts are not stored: they follow from both values.

use crate::experiments::entry::{Line, Run, Setup};
use crate::experiments::group::{Group, Groups};
use crate::study::judge::of_last_origin;
use contract::failure::{Failure, Result};
use contract::number::duration;
use serde::Serialize;
use statistics::Median;
use std::collections::BTreeSet;

/// Name and version of the schema.
const SCHEMA: &str = "octree-replay/3";
/// How far a ratio may be outside of the interval of its repetitions.
pub const TOLERANCE: f64 = 0.25;
/// The share of all ratios that must be inside of their bands.
const INSIDE: f64 = 0.95;

/// What a repetition must give.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Expected {
    schema: String,
    /// The commit of the programs; empty if it is unknown.
    pub commit: String,
    /// The time that all runs took, in seconds.
    pub seconds: f64,
    /// The time that one run of each took, with its warm-up.
    pub seconds_once: f64,
    /// The values, run by run.
    pub values: Vec<Value>,
    /// The runs that failed, were left out or never made, and so are not repeated, a sentence each.
    #[serde(skip)]
    pub missing: Vec<String>,
    /// The runs, and how often each was repeated.
    #[serde(skip)]
    pub runs: Vec<(Setup, usize)>,
}

/// A quantity of a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Value {
    /// The run.
    pub run: String,
    /// The quantity.
    pub quantity: String,
    /// Its value.
    #[serde(flatten)]
    pub found: Found,
}

/// A value, by how it is compared.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Found {
    /// The same everywhere.
    Exact(String),
    /// A ratio of times or of memory, with the band in which it is expected.
    Ratio {
        /// The median.
        value: f64,
        /// Lower end.
        low: f64,
        /// Upper end.
        high: f64,
        /// `measured`, `projected` ..., and over which run: only the same are compared.
        how: String,
    },
    /// Seconds, which are not compared.
    Time(f64),
}

impl Expected {
    /// The values of the runs of the last machine and program in a record.
    ///
    /// # Errors
    /// If it has no run.
    pub fn of(lines: &[Line]) -> Result<Self> {
        let lines = of_last_origin(lines);
        let groups = Groups::of(&lines);
        if groups.all.is_empty() {
            return Err(Failure::missing("the record has no run that could be repeated"));
        }
        let all = || lines.iter().filter_map(Line::run);
        let seconds = all().map(|run| run.time_launch_s).sum();
        let warm_ups = all().filter(|run| run.warm_up).map(|run| run.time_launch_s);
        let longest = |of: &Group| of.runs.iter().map(|run| run.time_launch_s).fold(0.0, f64::max);
        let seconds_once = warm_ups.chain(groups.all.iter().map(longest)).sum();
        let values = groups.all.iter().flat_map(|group| values(&groups, group)).collect();
        let runs = groups.all.iter().map(|group| (group.setup.clone(), group.runs.len())).collect();
        let commit = lines.iter().rev().find_map(Line::session).map(|s| s.machine.commit.clone());
        let (schema, commit) = (SCHEMA.to_owned(), commit.unwrap_or_default());
        let missing = groups.missing;
        let expected = Self { schema, commit, seconds, seconds_once, values, missing, runs };
        expected.check_invariants();
        Ok(expected)
    }

    /// The runs, and how often each may be repeated in that many seconds: no more often than in the record.
    ///
    /// # Errors
    /// If one repetition takes longer.
    pub fn runs_within(&self, limit_s: f64) -> Result<Vec<(Setup, usize)>> {
        let is_whole = self.seconds <= limit_s;
        let most = if is_whole { usize::MAX } else { (limit_s / self.seconds_once) as usize };
        let once = duration(self.seconds_once);
        let why = format!("one run of each took {once} on the archive's machine: give --minutes");
        Failure::unless(most > 0, why)?;
        Ok(self.runs.iter().map(|(setup, count)| (setup.clone(), most.min(*count))).collect())
    }

    /// Executes the invariants at the head of this file.
    fn check_invariants(&self) {
        let mut seen = BTreeSet::new();
        for Value { run, quantity, found } in &self.values {
            assert!(seen.insert((run, quantity)), "{run}: {quantity} is there twice");
            if let Found::Ratio { value, low, high, .. } = found {
                assert!(low <= value && value <= high, "{run}: {quantity} is not in its band");
            }
        }
        assert!(self.seconds_once <= self.seconds + 1e-6, "one run takes longer than all");
    }

    /// Compares with a record of the repetition.
    pub fn compare(&self, lines: &[Line]) -> Replayed {
        let groups = Groups::of(lines);
        let all: Vec<Value> = groups.all.iter().flat_map(|group| values(&groups, group)).collect();
        let row = |expected: &Value| {
            let Value { run, quantity, .. } = expected;
            let measured = all.iter().find(|of| (&of.run, &of.quantity) == (run, quantity));
            let measured = measured.map(|of| of.found.clone());
            // A counter that varies in the repetition.
            let is_exact = matches!(expected.found, Found::Exact(_));
            let varies = is_exact && all.iter().any(|of| of.run == *run);
            let several = varies.then(|| Found::Exact("no single value".to_owned()));
            Row { expected: expected.clone(), measured: measured.or(several) }
        };
        Replayed(self.values.iter().map(row).collect())
    }
}

/// The verdict on a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verdict {
    /// An exact value is the same.
    Equal,
    /// An exact value is another.
    Differs,
    /// A ratio is within its band.
    Inside,
    /// A ratio is not.
    Outside,
    /// A time, or a ratio that was measured in another way.
    NotCompared,
    /// The repetition does not have it.
    Missing,
}

/// A value and what the repetition gave.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// What was expected.
    pub expected: Value,
    /// What was found.
    pub measured: Option<Found>,
}

impl Row {
    /// The verdict.
    pub fn verdict(&self) -> Verdict {
        match (&self.expected.found, &self.measured) {
            (_, None) => Verdict::Missing,
            (Found::Exact(a), Some(Found::Exact(b))) if a == b => Verdict::Equal,
            (Found::Exact(_), _) => Verdict::Differs,
            (Found::Ratio { low, high, how, .. }, Some(Found::Ratio { value, how: here, .. }))
                if how == here =>
            {
                let is_inside = (low..=high).contains(&value);
                if is_inside { Verdict::Inside } else { Verdict::Outside }
            }
            _ => Verdict::NotCompared,
        }
    }
}

/// A repetition beside what was expected.
#[derive(Clone, Debug, PartialEq)]
pub struct Replayed(pub Vec<Row>);

impl Replayed {
    /// The number of values with this verdict.
    pub fn count(&self, verdict: Verdict) -> usize {
        self.0.iter().filter(|row| row.verdict() == verdict).count()
    }

    /// Whether no exact value differs, and enough ratios are inside of their bands.
    pub fn holds(&self) -> bool {
        let [inside, outside] = [Verdict::Inside, Verdict::Outside].map(|v| self.count(v) as f64);
        self.count(Verdict::Differs) == 0 && inside >= INSIDE * (inside + outside)
    }

    /// Whether something was compared.
    pub fn is_judged(&self) -> bool {
        self.0.iter().any(|row| row.verdict() < Verdict::NotCompared)
    }
}

/// The values of a group.
fn values(groups: &Groups, group: &Group) -> Vec<Value> {
    let (first, mut all) = (&group.runs[0], Vec::new());
    let mut add = |quantity: &str, found: Found| {
        let (run, quantity) = (group.setup.to_string(), quantity.to_owned());
        all.push(Value { run, quantity, found });
    };
    let of_mesh = [
        ("cells", first.cells.to_string()),
        ("digest", first.digest.clone()),
        ("facets", first.geometry.clone().unwrap_or_default()),
    ];
    for (quantity, value) in of_mesh.into_iter().filter(|(_, value)| !value.is_empty()) {
        add(quantity, Found::Exact(value));
    }
    for (name, counted) in &first.counters {
        let is_same = |run: &Run| run.counters.get(name).is_some_and(|of| of.sum == counted.sum);
        // A program may count what it does not promise to be the same.
        if group.runs.iter().all(is_same) {
            // It may be called like one of the other quantities.
            add(&format!("counter {name}"), Found::Exact(counted.sum.to_string()));
        }
    }
    let base = groups.reference(group);
    let scales = base.setup.ranks < group.setup.ranks;
    let speedup = (scales && base.cells() == group.cells()).then(|| groups.speedup(group));
    let over_base = format!("{} over {}:{}", group.how(), base.how(), base.setup.ranks);
    let ratios = [
        ("bytes per cell", group.how(), group.bytes_per_cell()),
        ("load imbalance", group.how(), group.imbalance().filter(|_| group.setup.ranks > 1)),
        ("speedup", &over_base, speedup),
        ("efficiency", &over_base, scales.then(|| groups.global_efficiency(group))),
    ];
    for (quantity, how, ratio) in ratios {
        if let Some(Median { value, low, high, .. }) = ratio.filter(|of| of.value.is_finite()) {
            let (low, high) = (low * (1.0 - TOLERANCE), high * (1.0 + TOLERANCE));
            add(quantity, Found::Ratio { value, low, high, how: how.to_owned() });
        }
    }
    add("time", Found::Time(group.time_s.value));
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::entry::{Comm, Entry, Spread};
    use crate::testing::{line, run};
    use proptest::prelude::*;

    /// A record of one mesh on one and on two ranks.
    fn record(two: [f64; 2]) -> Vec<Line> {
        let counted = |run: Run| Run {
            counters: [("rays".to_owned(), Spread::of(&vec![6.0; run.setup.ranks]))].into(),
            time_launch_s: 10.0,
            ..run
        };
        let runs = [&[4.0][..], &two].map(|times| run(Comm::Sim, 1000, &[("a", times)]));
        runs.map(|run| line(Entry::Run(Box::new(counted(run))))).to_vec()
    }

    fn edited(edit: impl Fn(&mut Run)) -> Vec<Line> {
        let mut lines = record([2.0, 2.0]);
        for line in &mut lines {
            if let Entry::Run(run) = &mut line.entry {
                edit(run);
            }
        }
        lines
    }

    fn expected() -> Expected {
        Expected::of(&record([2.0, 2.0])).unwrap()
    }

    #[test]
    fn a_record_replays_itself() {
        let expected = expected();
        let replayed = expected.compare(&record([2.0, 2.0]));
        assert!(replayed.holds() && replayed.is_judged());
        // Cells, digest and rays of two runs; memory of one, and imbalance, speedup and efficiency of one; times.
        let counts = [Verdict::Equal, Verdict::Inside, Verdict::NotCompared, Verdict::Missing];
        assert_eq!(counts.map(|verdict| replayed.count(verdict)), [6, 4, 2, 0]);
        assert!(Expected::of(&[]).is_err());
    }

    /// Series of two sizes may come to the same mesh.
    #[test]
    fn runs_of_two_series_are_apart() {
        let mut lines = edited(|run| run.setup.series_cells = Some(1e4));
        lines.extend(edited(|run| run.setup.series_cells = Some(2e4)));
        let expected = Expected::of(&lines).unwrap();
        assert!(expected.values[0].run.contains(" of 1e4 "), "{}", expected.values[0].run);
        assert!(expected.compare(&lines).holds());
    }

    #[test]
    fn other_meshes_and_counts_fail_and_slower_machines_do_not() {
        let expected = expected();
        let slower = |run: &mut Run| {
            let slow =
                |of: &Spread| Spread::of(&of.by_rank.iter().map(|t| t * 3.0).collect::<Vec<f64>>());
            run.useful_s = slow(&run.useful_s);
            run.phases[0].useful_s = slow(&run.phases[0].useful_s);
        };
        assert!(expected.compare(&edited(slower)).holds());
        let faults: [fn(&mut Run); 3] = [
            |run| run.digest = "1".repeat(32),
            |run| run.counters.values_mut().for_each(|c| *c = Spread::of(&[7.0])),
            |run| run.cells += 1,
        ];
        for fault in faults {
            let replayed = expected.compare(&edited(fault));
            assert!(!replayed.holds() && replayed.count(Verdict::Differs) == 2, "{replayed:?}");
        }
        // An imbalance of 1.6, a speedup of 1.25.
        let replayed = expected.compare(&record([3.2, 0.8]));
        assert_eq!((replayed.count(Verdict::Outside), replayed.holds()), (3, false));
        let missing = expected.compare(&record([2.0, 2.0])[..1]);
        assert_eq!(missing.count(Verdict::Missing), 7);
    }

    #[test]
    fn a_ratio_over_another_base_is_not_compared() {
        let of = |comm, ranks: usize| {
            line(Entry::Run(Box::new(run(comm, 1000, &[("a", &vec![8.0 / ranks as f64; ranks])]))))
        };
        let lines = [of(Comm::Sim, 1), of(Comm::Sim, 2), of(Comm::Sim, 4)];
        let replayed = Expected::of(&lines).unwrap().compare(&lines[1..]);
        // A speedup and an efficiency on four ranks, and two times.
        assert_eq!(
            (replayed.count(Verdict::Outside), replayed.count(Verdict::NotCompared)),
            (0, 4)
        );
        assert!(replayed.holds() && replayed.count(Verdict::Missing) > 0);
    }

    /// Otherwise a replay would say that the values were changed.
    #[test]
    fn the_same_record_gives_the_same_values_to_the_last_digit() {
        let of = |n: u32| {
            let mut run = run(Comm::Sim, 1000, &[("a", &[1.0])]);
            (run.setup.layer_cells_min, run.time_launch_s) = (n, 1.0 / f64::from(n));
            line(Entry::Run(Box::new(run)))
        };
        let lines: Vec<Line> = (1..30).map(of).collect();
        let first = Expected::of(&lines).unwrap();
        assert!((0..30).all(|_| Expected::of(&lines).unwrap() == first));
    }

    #[test]
    fn a_replay_has_as_many_repetitions_as_time() {
        let mut lines = record([2.0, 2.0]);
        lines.extend(record([2.0, 2.0]));
        let expected = Expected::of(&lines).unwrap();
        assert_eq!((expected.seconds, expected.seconds_once), (40.0, 20.0));
        let of = |limit_s: f64| -> Result<Vec<usize>> {
            Ok(expected.runs_within(limit_s)?.iter().map(|(_, count)| *count).collect())
        };
        assert_eq!((of(40.0), of(39.0)), (Ok(vec![2, 2]), Ok(vec![1, 1])));
        assert_eq!([52.0, 121.0].map(duration), ["52 seconds", "3 minutes"]);
        assert!(of(19.0).unwrap_err().why.contains("took 20 seconds"));
    }

    proptest! {
        #[test]
        fn the_invariants_hold_for_drawn_times(a in prop::array::uniform2(0.1..9.0f64), b in prop::array::uniform2(0.1..9.0f64)) {
            let expected = Expected::of(&record(a)).unwrap();
            expected.compare(&record(b));
            prop_assert!(expected.compare(&record(a)).holds(), "equal values agree");
        }
    }

    #[test]
    #[should_panic(expected = "is not in its band")]
    fn a_value_outside_of_its_band_is_noticed() {
        let mut expected = expected();
        for value in &mut expected.values {
            if let Found::Ratio { value, high, .. } = &mut value.found {
                *value = *high + 1.0;
            }
        }
        expected.check_invariants();
    }
}
