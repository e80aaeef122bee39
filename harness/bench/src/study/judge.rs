//! Judges rows from the declaration and the lines of a record alone.
//!
//! Invariants of a judged row, executed by `check_invariants` before it is printed or recorded: it has a value if and only if it is
//! met, missed or for comparison, and then states how that was measured; met is within the bounds, missed is not, and for comparison
//! has none; a row without a value, and an efficiency above 1, states the reason.

use super::file::{Row, Study};
use super::measure::{Input, Measure, Sample};
use crate::experiments::entry::{Audited, Entry, Judged, Line, Verdict};
use crate::experiments::group::{Group, Groups};
use crate::experiments::pop::{Efficiency, above_one};
use std::collections::HashMap;

/// Judges every row by the runs in these lines: those of the last machine and program, if there are several.
pub fn judged(study: &Study, lines: &[Line]) -> Vec<Judged> {
    let lines = of_last_origin(lines);
    study.row.iter().map(|row| judge(study, row, &lines)).collect()
}

/// Returns the lines of sessions on the same machine and commit as the last one, without runs of other builds of a program than in its
/// last run.
pub(crate) fn of_last_origin(lines: &[Line]) -> Vec<Line> {
    let origin =
        |line: &Line| line.session().map(|s| (s.machine.label(), s.machine.commit.clone()));
    let Some(last) = lines.iter().rev().find_map(origin) else { return lines.to_vec() };
    let built: HashMap<&String, &String> = lines.iter().filter_map(program).collect();
    let of_last = lines.iter().filter(|line| origin(line).as_ref() == Some(&last));
    let sessions: Vec<&str> = of_last.map(|line| line.session.as_str()).collect();
    let is_of = |line: &&Line| {
        sessions.contains(&line.session.as_str())
            && program(line).is_none_or(|(engine, of)| built[engine] == of)
    };
    lines.iter().filter(is_of).cloned().collect()
}

/// Program and build of a run.
fn program(line: &Line) -> Option<(&String, &String)> {
    match &line.entry {
        Entry::Run(run) => Some((&run.setup.engine, &run.program)),
        _ => None,
    }
}

/// Judges one row. If a run that it needs failed or is missing, the result contains the reason.
pub(super) fn judge(study: &Study, row: &Row, lines: &[Line]) -> Judged {
    let judged = match measured(study, row, lines) {
        Ok((value, how, why)) => Judged {
            measured: Some(value),
            how: how.to_owned(),
            verdict: verdict(row.at_least, row.at_most, value),
            ..unjudged(row, Verdict::ForComparison, why)
        },
        Err(why) => {
            let failed = study.runs_of(row).into_iter().find_map(|n| failure(study, n, lines));
            match failed {
                Some(why) => unjudged(row, Verdict::Failed, why),
                None => unjudged(row, Verdict::LeftOut, why),
            }
        }
    };
    check_invariants(&judged);
    judged
}

/// Executes the invariants at the head of this file.
fn check_invariants(row: &Judged) {
    use Verdict::{Failed, ForComparison, LeftOut, Met, Missed};
    let Judged { name, at_least, at_most, measured, how, verdict: found, why, .. } = row;
    let has_value = matches!(found, Met | Missed | ForComparison);
    let is_measured = has_value == measured.is_some() && has_value != how.is_empty();
    assert!(is_measured, "{name}: a value is measured: {row:?}");
    assert!(has_value || !why.is_empty(), "{name}: a row without a value has a reason: {row:?}");
    let Some(value) = *measured else { return assert!(matches!(found, Failed | LeftOut)) };
    let expected = verdict(*at_least, *at_most, value);
    assert_eq!(*found, expected, "{name}: the verdict is that of value and bounds: {row:?}");
    let is_efficiency = Measure::named(&row.measure).is_some_and(Measure::is_efficiency);
    let explained = !is_efficiency || value <= EXPLAINED || !why.is_empty();
    assert!(explained, "{name}: an efficiency above 1 has a reason: {row:?}");
}

/// Efficiencies up to this need no explanation.
const EXPLAINED: f64 = 1.01;

/// Returns a row without a measured value.
pub fn unjudged(row: &Row, verdict: Verdict, why: String) -> Judged {
    Judged {
        name: row.name.clone(),
        runs: row.run.clone(),
        against: row.against.clone(),
        measure: row.measure.name.to_owned(),
        at_least: row.at_least,
        at_most: row.at_most,
        measured: None,
        how: String::new(),
        verdict,
        why,
    }
}

fn verdict(at_least: Option<f64>, at_most: Option<f64>, value: f64) -> Verdict {
    // NaN is within no bounds.
    let is_within =
        at_least.is_none_or(|least| value >= least) && at_most.is_none_or(|most| value <= most);
    match (at_least.is_some() || at_most.is_some(), is_within) {
        (false, _) => Verdict::ForComparison,
        (true, true) => Verdict::Met,
        (true, false) => Verdict::Missed,
    }
}

/// Returns the row's value, how it was measured, and the reason for an efficiency above 1.
fn measured(
    study: &Study,
    row: &Row,
    lines: &[Line],
) -> Result<(f64, &'static str, String), String> {
    let absent = |name: &String| format!("run {name} is not in the record");
    let groups = Groups::of(lines);
    let mut sample = Sample { runs: &[], against: None, phases: &row.phase, audits: &[] };
    if row.measure.input == Input::Audit {
        let name = &row.run[0];
        let audit = |line: &'_ Line| match &line.entry {
            Entry::Audit(audited) if study.is_run(name, &audited.setup) => Some(audited.clone()),
            _ => None,
        };
        let audits: Vec<Audited> = lines.iter().filter_map(audit).collect();
        if audits.is_empty() {
            return Err(absent(name));
        }
        sample.audits = &audits;
        return Ok(((row.measure.of)(&sample)?, "audited", String::new()));
    }
    let find = |name: &String| {
        let found = groups.all.iter().find(|g| study.is_run(name, &g.setup));
        found.ok_or_else(|| absent(name))
    };
    let runs = row.run.iter().map(find).collect::<Result<Vec<&Group>, String>>()?;
    let against = row.against.as_ref().map_or(Ok(runs[0]), find)?;
    (sample.runs, sample.against) = (&runs, Some(against));
    let efficiencies = runs.iter().map(|run| run.efficiency(against));
    let efficiencies: Vec<Efficiency> =
        efficiencies.filter(|e| row.measure.is_efficiency() && e.is_above_one()).collect();
    let why = above_one(&efficiencies).unwrap_or_default();
    // The least trustworthy run counts.
    let rank = |how: &&str| {
        ["serial", "measured", "oversubscribed", "projected"].iter().position(|h| h == how)
    };
    let how = runs.iter().map(|g| g.how()).max_by_key(rank).unwrap_or("measured");
    Ok(((row.measure.of)(&sample)?, how, why))
}

/// Returns the reason for which a run failed, if it did.
fn failure(study: &Study, name: &str, lines: &[Line]) -> Option<String> {
    lines.iter().find_map(|line| match &line.entry {
        Entry::Failure(f) if study.is_run(name, &f.setup) => {
            Some(format!("run {name} failed: {}", f.why))
        }
        _ => None,
    })
}

impl Judged {
    /// Returns name, target, measured value, how it was measured, and verdict.
    pub fn fields(&self) -> [String; 5] {
        let measure = Measure::named(&self.measure);
        let show = |value: f64| measure.map_or_else(|| value.to_string(), |m| (m.show)(value));
        let bounds = [("at least ", self.at_least), ("at most ", self.at_most)];
        let bounds = bounds.into_iter().filter_map(|(word, b)| Some(format!("{word}{}", show(b?))));
        let target = bounds.collect::<Vec<_>>().join(", ");
        let word = match self.verdict {
            Verdict::Met => "met",
            Verdict::Missed => "MISSED",
            Verdict::ForComparison => "for comparison",
            Verdict::Failed => "FAILED",
            Verdict::LeftOut => "left out",
        };
        let why = if self.why.is_empty() { "" } else { ": " };
        let verdict = format!("{word}{why}{}", self.why);
        let dash = |text: String| if text.is_empty() { "-".to_owned() } else { text };
        let measured = dash(self.measured.map(show).unwrap_or_default());
        [self.name.clone(), dash(target), measured, dash(self.how.clone()), verdict]
    }
}

#[cfg(test)]
mod tests {
    use super::super::file::EXPERIMENT;
    use super::*;
    use crate::experiments::entry::{Comm, Failure, Machine, Session, Setup};
    use crate::testing::line;
    use crate::testing::run;
    use crate::testing::study as read;
    use proptest::prelude::*;

    const FILE: &str = r#"
        mesh.cube.case = "cube-small"
        run.one = { mesh = "cube" }
        run.two = { mesh = "cube", ranks = 2 }
        run.disk = { mesh = "cube", comm = "solo", audit = true }
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
        [[row]]
        name = "audit"
        run = "disk"
        measure = "audit_holds"
        at_least = 1
    "#;

    fn setup(ranks: usize) -> Setup {
        let of = run(Comm::Mpi, 1, &[("a", &vec![1.0; ranks])]).setup;
        let (experiment, case) = (EXPERIMENT.to_owned(), "cube".to_owned());
        Setup { experiment, case, partitioner: String::new(), weights: String::new(), ..of }
    }

    fn ran(ranks: usize, time_s: f64) -> Line {
        let mut run = run(Comm::Mpi, 900, &[("a", &vec![time_s; ranks])]);
        run.setup = setup(ranks);
        line(Entry::Run(Box::new(run)))
    }

    fn failed(ranks: usize) -> Line {
        let (command, why) = (String::new(), "killed after 9 s".to_owned());
        line(Entry::Failure(Failure { setup: setup(ranks), command, why }))
    }

    fn audited(holds: bool) -> Line {
        line(Entry::Audit(Audited {
            setup: Setup { comm: Comm::Solo, ..setup(1) },
            command: String::new(),
            cells: 9,
            holds,
            found: Vec::new(),
            time_cpu_s: 1.0,
            time_wall_s: 1.0,
            peak_rss_bytes: 1,
        }))
    }

    #[test]
    fn bounds_are_met_and_missed() {
        let targets = read(FILE).unwrap();
        let verdicts = |lines: &[Line]| -> Vec<Verdict> {
            judged(&targets, lines).iter().map(|j| j.verdict).collect()
        };
        use Verdict::{Failed, ForComparison, LeftOut, Met, Missed};
        assert_eq!(
            verdicts(&[ran(1, 9.0), ran(2, 5.0), audited(true)]),
            [Met, Met, ForComparison, Met]
        );
        // Too slow, then implausibly fast.
        assert_eq!(
            verdicts(&[ran(1, 9.1), ran(2, 5.1), audited(false)]),
            [Missed, Missed, ForComparison, Missed]
        );
        assert_eq!(verdicts(&[ran(1, 9.0), ran(2, 4.0)]), [Met, Missed, ForComparison, LeftOut]);
        assert_eq!(verdicts(&[ran(1, 9.0), failed(2)]), [Met, Failed, Failed, LeftOut]);
    }

    #[test]
    fn each_program_has_a_last_build() {
        let ran_by = |engine: &str, program: &str| {
            let mut run = run(Comm::Solo, 9, &[("a", &[1.0])]);
            (run.setup.engine, run.program) = (engine.to_owned(), program.to_owned());
            line(Entry::Run(Box::new(run)))
        };
        let opened = line(Entry::Session(Box::new(Session {
            command: Vec::new(),
            machine: Machine::default(),
            nodes: String::new(),
            load_average: 0.0,
            lacks: Default::default(),
        })));
        let (old, new, other) = (ran_by("a", "1"), ran_by("a", "2"), ran_by("b", "3"));
        let kept = of_last_origin(&[opened.clone(), other.clone(), old, new.clone()]);
        assert_eq!(kept, [opened, other, new]);
    }

    #[test]
    fn runs_of_another_machine_do_not_move_a_median() {
        let targets = read(FILE).unwrap();
        let session = |name: &str, cpu: &str| {
            let machine = Machine { cpu: cpu.into(), ..Machine::default() };
            let (command, lacks) = (Vec::new(), Default::default());
            let session =
                Session { command, machine, nodes: String::new(), load_average: 0.0, lacks };
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
        assert_eq!(judged(&targets, &lines)[0].measured, Some(100.0));
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
    #[should_panic(expected = "the verdict is that of value and bounds")]
    fn a_row_that_is_met_outside_its_bounds_is_noticed() {
        planted(|row| row.at_most = Some(1.0));
    }

    #[test]
    #[should_panic(expected = "a row without a value has a reason")]
    fn a_row_that_is_left_out_without_a_reason_is_noticed() {
        let left_out = |row: &mut Judged| {
            (row.measured, row.verdict, row.how) = (None, Verdict::LeftOut, String::new());
        };
        planted(left_out);
    }

    #[test]
    #[should_panic(expected = "an efficiency above 1 has a reason")]
    fn an_efficiency_above_1_without_a_reason_is_noticed() {
        planted(|row| row.measure = "efficiency".into());
    }

    #[test]
    fn a_row_is_judged_by_the_median_of_its_repetitions() {
        let targets = read(FILE).unwrap();
        let lines = [ran(1, 90.0), ran(1, 8.0), ran(1, 9.0)];
        let rate = judge(&targets, &targets.row[0], &lines);
        assert_eq!(
            (rate.measured, rate.verdict, rate.how.as_str()),
            (Some(100.0), Verdict::Met, "measured")
        );
    }

    #[test]
    fn a_row_without_a_value_has_a_reason() {
        let targets = read(FILE).unwrap();
        let all = judged(&targets, &[ran(1, 9.0), failed(2)]);
        assert_eq!(all[1].why, "run two failed: killed after 9 s");
        assert_eq!(all[3].why, "run disk is not in the record");
        // Runs of other experiments do not count.
        let mut other = run(Comm::Mpi, 900, &[("a", &[9.0])]);
        other.setup = Setup { experiment: "strong".into(), ..setup(1) };
        let lines = [line(Entry::Run(Box::new(other)))];
        assert_eq!(judge(&targets, &targets.row[0], &lines).why, "run one is not in the record");
    }
}
