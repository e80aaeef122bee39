//! Judges rows from the declaration and the lines of a record alone.
//!
//! The verdict on a row is not stored: it follows from the value and the bounds. Invariant of a judged row, executed by `check_invariants`
//! before it is printed: a row without a value, and an efficiency above 1, states the reason.

use super::file::{Row, Study};
use super::measure::Sample;
use crate::experiments::entry::{Entry, Line, Network, Run, Setup};
use crate::experiments::group::{Group, Groups};
use crate::experiments::pop::{ABOVE_ONE, DISTURBED, Efficiency, above_one};
use crate::name_of;
use serde::Serialize;
use std::collections::HashMap;

/// A row of a table of targets.
#[derive(Clone, Debug)]
pub struct Judged {
    /// The row.
    pub row: Row,
    /// The measured value, and how it was measured: `serial`, `measured`, `oversubscribed` or `projected`.
    pub measured: Option<(f64, &'static str)>,
    /// Whether a run of a row without a value failed.
    pub failed: bool,
    /// Why it was left out or failed, or why an efficiency is above 1.
    pub why: String,
}

/// The verdict on a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The value is within the bounds.
    Met,
    /// The value is outside the bounds.
    Missed,
    /// The row has no bounds.
    ForComparison,
    /// A run failed.
    Failed,
    /// The row was not measured: the user excluded it or a prerequisite is missing.
    LeftOut,
}

impl Verdict {
    /// The words for it.
    pub fn words(self) -> String {
        name_of(&self).replace('_', " ")
    }
}

/// Judges every row by the runs in these lines: those of the last machine and program, if there are several.
pub fn judged(study: &Study, lines: &[Line]) -> Vec<Judged> {
    let lines = of_last_origin(lines);
    study.row.iter().map(|row| judge(study, row, &lines)).collect()
}

/// Returns the lines of sessions on the same machine and given network as the last one, without runs of other builds of a program, or with
/// other rules or geometry of a case, than in its last run.
pub(crate) fn of_last_origin(lines: &[Line]) -> Vec<Line> {
    let origin = |line: &Line| line.session().map(|session| session.machine.label());
    let Some(last) = lines.iter().rev().find_map(origin) else { return lines.to_vec() };
    let of_last = lines.iter().filter(|line| origin(line).as_ref() == Some(&last));
    let mut sessions: Vec<&str> = of_last.map(|line| line.session.as_str()).collect();
    let given = |(session, of): (_, Network)| (session, of.given.then(|| of.to_string()));
    let networks: Vec<_> = lines.iter().filter_map(Line::network).map(given).collect();
    if let Some((_, last)) = networks.iter().rfind(|(session, _)| sessions.contains(session)) {
        sessions.retain(|name| networks.iter().all(|(of, given)| of != name || given == last));
    }
    let of_sessions = || lines.iter().filter(|line| sessions.contains(&line.session.as_str()));
    fn made(run: &Run) -> [([&String; 2], &String); 2] {
        let Setup { experiment, engine, case, .. } = &run.setup;
        [([engine, engine], &run.program), ([experiment, case], &run.inputs)]
    }
    let last: HashMap<_, &String> = of_sessions().filter_map(Line::run).flat_map(made).collect();
    let is_last = |run: &Run| made(run).into_iter().all(|(what, of)| last[&what] == of);
    of_sessions().filter(|line| line.run().is_none_or(is_last)).cloned().collect()
}

/// Judges one row. If a run that it needs failed or is missing, the result contains the reason.
pub(super) fn judge(study: &Study, row: &Row, lines: &[Line]) -> Judged {
    // A run that failed is not repeated: it failed if its last line says so, whatever other repetitions took.
    let failure = |name: &String| {
        let is_run = |line: &&Line| line.setup().is_some_and(|of| study.is_run(name, of));
        let is_of = |line: &&Line| is_run(line) && !matches!(line.entry, Entry::LeftOut(_));
        let Entry::Failure(failed) = &lines.iter().rfind(is_of)?.entry else { return None };
        Some(format!("run {name} failed: {}", failed.why))
    };
    let judged = match row.runs().find_map(failure) {
        Some(why) => unjudged(row, true, why),
        None => measured(study, row, lines).unwrap_or_else(|why| unjudged(row, false, why)),
    };
    check_invariants(&judged);
    judged
}

/// Executes the invariants at the head of this file.
fn check_invariants(judged: &Judged) {
    let is_above = |value| judged.row.measure.is_efficiency() && value > ABOVE_ONE;
    let needs_reason = judged.measured.is_none_or(|(value, _)| is_above(value));
    assert!(!needs_reason || !judged.why.is_empty(), "the row has a reason: {judged:?}");
}

/// Returns a row without a measured value.
pub fn unjudged(row: &Row, failed: bool, why: String) -> Judged {
    Judged { row: row.clone(), measured: None, failed, why }
}

/// Returns the row with its value, how it was measured, and the reason for an efficiency above 1.
fn measured(study: &Study, row: &Row, lines: &[Line]) -> Result<Judged, String> {
    let groups = Groups::of(lines);
    let find = |name: &String| {
        // Of several spacings for one number of cells the last one.
        let found = groups.all.iter().rfind(|g| study.is_run(name, &g.setup));
        found.ok_or_else(|| format!("run {name} is not in the record"))
    };
    let runs = row.run.iter().map(find).collect::<Result<Vec<&Group>, String>>()?;
    let against = row.against.as_ref().map_or(Ok(runs[0]), find)?;
    let is_efficiency = row.measure.is_efficiency();
    let above = runs.iter().filter_map(|run| run.efficiency(against));
    let above: Vec<Efficiency> = above.filter(|e| is_efficiency && e.is_above_one()).collect();
    // The least trustworthy run counts.
    let ranking = ["serial", "measured", "oversubscribed", "projected"];
    let rank = |how: &&str| ranking.iter().position(|h| h == how);
    let how = runs.iter().chain([&against]).map(|g| g.how()).max_by_key(rank).unwrap_or("measured");
    let value =
        (row.measure.of)(&Sample { run: runs[0], runs: &runs, against, phases: &row.phase })?;
    let disturbed = (is_efficiency && value > ABOVE_ONE).then(|| DISTURBED.to_owned());
    let why = above_one(&above).or(disturbed).unwrap_or_default();
    Ok(Judged { measured: Some((value, how)), ..unjudged(row, false, why) })
}

impl Judged {
    /// Returns the verdict.
    pub fn verdict(&self) -> Verdict {
        let Row { at_least, at_most, .. } = self.row;
        // NaN is not within them.
        let bounds = at_least.unwrap_or(f64::NEG_INFINITY)..=at_most.unwrap_or(f64::INFINITY);
        match self.measured {
            None if self.failed => Verdict::Failed,
            None => Verdict::LeftOut,
            Some(_) if at_least.or(at_most).is_none() => Verdict::ForComparison,
            Some((value, _)) if bounds.contains(&value) => Verdict::Met,
            Some(_) => Verdict::Missed,
        }
    }

    /// Whether it is missed, or a run failed.
    pub fn is_bad(&self) -> bool {
        matches!(self.verdict(), Verdict::Missed | Verdict::Failed)
    }

    /// Returns name, target, measured value, how it was measured, and verdict.
    pub fn fields(&self) -> [String; 5] {
        let Row { name, measure, at_least, at_most, .. } = &self.row;
        let bounds = [("at least ", at_least), ("at most ", at_most)];
        let shown = |(word, b): (&str, &Option<f64>)| Some(word.to_owned() + &measure.show((*b)?));
        let target = bounds.into_iter().filter_map(shown).collect::<Vec<_>>().join(", ");
        let words = self.verdict().words();
        let words = if self.is_bad() { words.to_uppercase() } else { words };
        let why = if self.why.is_empty() { "" } else { ": " };
        let target = if target.is_empty() { "-".to_owned() } else { target };
        let measured = self.measured.map(|(value, how)| (measure.show(value), how));
        let (value, how) = measured.unwrap_or(("-".to_owned(), "-"));
        [name.clone(), target, value, how.to_owned(), format!("{words}{why}{}", self.why)]
    }
}

#[cfg(test)]
mod tests {
    use super::super::measure::MEASURES;
    use super::*;
    use crate::experiments::entry::{Comm, Machine, NoResult, Session, TARGETS};
    use crate::testing::line;
    use crate::testing::run;
    use crate::testing::study as read;
    use proptest::prelude::*;

    const FILE: &str = r#"
        mesh.cube.case = "cube-small"
        run.one = { mesh = "cube" }
        run.two = { mesh = "cube", ranks = 2 }
        [[row]]
        name = "rate"
        run = "one"
        measure = "cells_per_second_per_core"
        at_least = 100.0
        [[row]]
        name = "two"
        run = "two"
        against = "one"
        measure = "speed_up"
        at_least = 1.8
        at_most = 2.2
        [[row]]
        name = "seconds"
        run = "two"
        measure = "seconds"
    "#;

    fn setup(ranks: usize) -> Setup {
        let of = run(Comm::Mpi, 1, &[("a", &vec![1.0; ranks])]).setup;
        let (experiment, case) = (TARGETS.to_owned(), "cube".to_owned());
        Setup { experiment, case, partitioner: String::new(), weights: String::new(), ..of }
    }

    fn ran(ranks: usize, time_s: f64) -> Line {
        let mut run = run(Comm::Mpi, 900, &[("a", &vec![time_s; ranks])]);
        run.setup = setup(ranks);
        line(Entry::Run(Box::new(run)))
    }

    fn failed(ranks: usize) -> Line {
        let why = "killed after 9 s".to_owned();
        line(Entry::Failure(NoResult { setup: setup(ranks), why }))
    }

    #[test]
    fn bounds_are_met_and_missed() {
        let targets = read(FILE).unwrap();
        let verdicts = |lines: &[Line]| -> Vec<Verdict> {
            judged(&targets, lines).iter().map(Judged::verdict).collect()
        };
        use Verdict::{Failed, ForComparison, LeftOut, Met, Missed};
        assert_eq!(verdicts(&[ran(1, 9.0), ran(2, 5.0)]), [Met, Met, ForComparison]);
        // Too slow, then implausibly fast.
        assert_eq!(verdicts(&[ran(1, 9.1), ran(2, 5.1)]), [Missed, Missed, ForComparison]);
        assert_eq!(verdicts(&[ran(1, 9.0), ran(2, 4.0)]), [Met, Missed, ForComparison]);
        assert_eq!(verdicts(&[ran(1, 9.0), failed(2)]), [Met, Failed, Failed]);
        assert_eq!(verdicts(&[ran(1, 9.0)]), [Met, LeftOut, LeftOut]);
        // A repetition that fails; in a later session it does not.
        assert_eq!(verdicts(&[ran(1, 9.0), failed(1)])[0], Failed);
        assert_eq!(verdicts(&[ran(1, 9.0), failed(1), ran(1, 9.0)])[0], Met);
    }

    #[test]
    fn each_program_has_a_last_build_and_each_case_its_last_rules() {
        let ran_by = |engine: &str, program: &str| {
            let mut run = run(Comm::Solo, 9, &[("a", &[1.0])]);
            (run.setup.engine, run.program) = (engine.to_owned(), program.to_owned());
            run.inputs = if program == "1" { "edited" } else { "" }.to_owned();
            line(Entry::Run(Box::new(run)))
        };
        let opened = line(Entry::Session(Box::default()));
        let (old, new, other) = (ran_by("a", "1"), ran_by("a", "2"), ran_by("b", "3"));
        let kept = of_last_origin(&[opened.clone(), other.clone(), old.clone(), new.clone()]);
        assert_eq!(kept, [opened.clone(), other.clone(), new]);
        assert_eq!(of_last_origin(&[opened.clone(), other, old.clone()]), [opened, old]);
    }

    #[test]
    fn sessions_with_another_given_network_are_left_out() {
        let of = |name: &str, entry: Entry| Line { session: name.into(), ..line(entry) };
        let opening = || Entry::Session(Box::default());
        let network = |measured: bool| {
            Entry::Network(Network {
                latency_s: 1.0,
                bandwidth_bytes_per_s: 1e9,
                measured,
                given: !measured,
            })
        };
        let lines = [
            of("a", opening()),
            of("a", network(true)),
            of("b", opening()),
            of("b", network(false)),
            of("c", opening()),
        ];
        assert_eq!(of_last_origin(&lines), lines[2..]);
    }

    #[test]
    fn runs_of_another_machine_do_not_move_a_median() {
        let targets = read(FILE).unwrap();
        let session = |name: &str, cpu: &str| {
            let machine = Machine { cpu: cpu.into(), ..Machine::default() };
            let session = Session { machine, ..Session::default() };
            Line { session: name.into(), ..line(Entry::Session(Box::new(session))) }
        };
        let of = |name: &str, run: Line| Line { session: name.into(), ..run };
        let lines = [
            session("a", "slow"),
            of("a", ran(1, 90.0)),
            of("a", ran(1, 91.0)),
            session("b", "fast"),
            of("b", ran(1, 9.0)),
        ];
        assert_eq!(judged(&targets, &lines)[0].measured, Some((100.0, "measured")));
    }

    proptest! {
        #[test]
        fn rows_of_drawn_times_satisfy_the_invariants(one in 0.1..9.0f64, two in 0.1..9.0f64) {
            let targets = read(&FILE.replace("speed_up", "efficiency")).unwrap();
            judged(&targets, &[ran(1, one), ran(2, two)]);
        }
    }

    fn planted(fault: impl Fn(&mut Judged)) {
        let targets = read(FILE).unwrap();
        let mut row = judge(&targets, &targets.row[0], &[ran(1, 9.0)]);
        fault(&mut row);
        check_invariants(&row);
    }

    #[test]
    #[should_panic(expected = "the row has a reason")]
    fn a_row_that_is_left_out_without_a_reason_is_noticed() {
        planted(|row| row.measured = None);
    }

    #[test]
    #[should_panic(expected = "the row has a reason")]
    fn an_efficiency_above_1_without_a_reason_is_noticed() {
        planted(|row| row.row.measure = MEASURES.iter().find(|m| m.name == "efficiency").unwrap());
    }

    #[test]
    fn a_row_is_judged_by_the_median_of_its_repetitions() {
        let targets = read(FILE).unwrap();
        let lines = [ran(1, 90.0), ran(1, 8.0), ran(1, 9.0)];
        let rate = judge(&targets, &targets.row[0], &lines);
        assert_eq!((rate.measured, rate.verdict()), (Some((100.0, "measured")), Verdict::Met));
    }

    #[test]
    fn a_row_without_a_value_has_a_reason() {
        let targets = read(FILE).unwrap();
        let all = judged(&targets, &[ran(1, 9.0), failed(2)]);
        assert_eq!(all[1].why, "run two failed: killed after 9 s");
        // Runs of other experiments do not count.
        let mut other = run(Comm::Mpi, 900, &[("a", &[9.0])]);
        other.setup = Setup { experiment: "strong".into(), ..setup(1) };
        let lines = [line(Entry::Run(Box::new(other)))];
        assert_eq!(judge(&targets, &targets.row[0], &lines).why, "run one is not in the record");
    }
}
