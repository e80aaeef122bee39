//! The result of a verification: the one model that every output format prints.
//!
//! Invariants, which [`Report::check_invariants`] executes before any form of the report is printed:
//! - the cases are those that were asked for, in order; of an interrupted run, the first of them;
//! - a case that no program refuses has checks, among them at least one for each rank count and for each outside program asked for; one
//!   that was not run is left out, with the reason;
//! - a run on ranks has a digest and exactly one check `runs` that holds, and the other way round;
//! - a run whose mesh is `identical` to the serial one has its digest and number of cells;
//! - a green report has a check of a mesh that holds, of every case that was named, and misses nothing required.

use super::outcome::RUNS;
pub use super::outcome::{Check, Outcome, Tally};
use crate::engine::layout::Layout;
use check::checks::identical;
use serde::{Deserialize, Serialize};

/// Version of the JSON form; it changes when the meaning of a field changes or a field is removed.
pub const SCHEMA: &str = "octree-verify/1";

/// The paper's speed on one core, in cells per second.
pub const PAPER_CELLS_PER_S: f64 = 38_000.0;

/// One run of mesher or reference.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Run {
    /// `mesher` or `reference`.
    pub program: String,
    /// The layout of a run on MPI; `None` for a serial run.
    pub layout: Option<Layout>,
    /// Cells of the final mesh.
    pub cells: u64,
    /// Digest of the final mesh.
    pub digest: String,
    /// Wall time by the program's own clock, in seconds; without writing files if that is measured separately.
    pub time_wall_s: f64,
    /// Wall time by the harness's clock, in seconds, including the start and end of the processes.
    pub time_process_s: f64,
    /// Peak resident memory of all ranks together.
    pub peak_rss_bytes: u64,
}

impl Run {
    /// Cells per second of wall time.
    pub fn cells_per_s(&self) -> f64 {
        self.cells as f64 / self.time_wall_s.max(1e-9)
    }

    /// Peak memory per cell.
    pub fn bytes_per_cell(&self) -> f64 {
        self.peak_rss_bytes as f64 / (self.cells.max(1)) as f64
    }

    /// Speed relative to the paper's on one core.
    pub fn speedup_over_paper(&self) -> f64 {
        self.cells_per_s() / PAPER_CELLS_PER_S
    }
}

/// One case.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct CaseReport {
    /// Its name in the catalogue, or its path.
    pub name: String,
    /// Number of facets.
    pub facets: u64,
    /// Leaves of the base tree.
    pub leaves_base: u64,
    /// Cells of the final mesh.
    pub cells: u64,
    /// The runs whose time and memory are reported.
    pub runs: Vec<Run>,
    /// All checks.
    pub checks: Vec<Check>,
    /// The mesher's error message, if the case is invalid.
    pub input_error: Option<String>,
    /// Directory of the results, if they were kept.
    pub kept: Option<String>,
    /// A command that repeats the first failure.
    pub repeat_with: Option<String>,
    /// Wall time of the whole case, in seconds.
    pub time_s: f64,
}

/// What was asked for.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Asked {
    /// Names of the cases.
    pub cases: Vec<String>,
    /// Whether the user named them; otherwise they were selected by size.
    pub named: bool,
    /// Rank counts on MPI.
    pub ranks: Vec<usize>,
    /// Subjects of the checks by outside programs.
    pub subjects: Vec<String>,
}

impl CaseReport {
    /// Whether any check has this subject.
    pub fn has(&self, subject: &str) -> bool {
        self.checks.iter().any(|check| check.subject.starts_with(subject))
    }

    /// Whether a check of a mesh was run: that a program ran shows nothing about its mesh.
    pub fn is_checked(&self) -> bool {
        let of_mesh = |check: &Check| check.outcome.holds() && check.name != RUNS;
        self.checks.iter().any(|check| check.failed() || of_mesh(check))
    }

    fn check_invariants(&self, asked: &Asked) {
        let name = &self.name;
        if self.input_error.is_none() {
            assert!(!self.checks.is_empty(), "{name} has no check");
            for ranks in &asked.ranks {
                let named = self.checks.iter().any(|check| check.ranks == Some(*ranks));
                assert!(named, "{name}: {ranks} ranks were asked for and are not in the report");
            }
            for subject in &asked.subjects {
                assert!(
                    self.has(subject),
                    "{name}: {subject} was asked for and is not in the report"
                );
            }
        }
        let held = |subject: &str, name: &str| {
            let of = |c: &&Check| c.subject == subject && c.name == name && c.outcome.holds();
            self.checks.iter().filter(of).count()
        };
        let serial = self.runs.iter().find(|run| run.program == "mesher" && run.layout.is_none());
        for run in &self.runs {
            assert!(!run.digest.is_empty(), "{name}: a run of {} has no digest", run.program);
            let Some(layout) = &run.layout else { continue };
            let subject = layout.to_string();
            assert_eq!(held(&subject, RUNS), 1, "{name}: {subject}: a run without its check");
            if held(&subject, identical::NAME) > 0 {
                let of = |run: &Run| (run.cells, run.digest.clone());
                let expected = serial.map(of);
                assert_eq!(Some(of(run)), expected, "{name}: {subject} is not identical");
            }
        }
        let on_ranks = self.checks.iter().filter(|c| c.ranks.is_some() && c.name == RUNS);
        let held = on_ranks.filter(|check| check.outcome.holds()).count();
        let runs = self.runs.iter().filter(|run| run.layout.is_some()).count();
        assert_eq!(held, runs, "{name}: checks that a run ended well, and runs");
    }

    /// Numbers of its checks by outcome.
    pub fn tally(&self) -> Tally {
        self.checks.iter().collect()
    }

    /// Whether any check failed.
    pub fn failed(&self) -> bool {
        self.checks.iter().any(Check::failed)
    }
}

/// A prerequisite that this machine lacks.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Missing {
    /// `mpi`, `oracles`, `p4est` or `geometries`.
    pub what: String,
    /// Why.
    pub why: String,
    /// Whether `--require` named it.
    pub required: bool,
}

/// The whole verification.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Report {
    /// [`SCHEMA`].
    pub schema: String,
    /// Name and version of the harness.
    pub program: String,
    /// Cores of the machine.
    pub cores: usize,
    /// What was asked for.
    pub asked: Asked,
    /// Missing prerequisites, whose checks were left out of every case.
    pub missing: Vec<Missing>,
    /// One report for each case.
    pub cases: Vec<CaseReport>,
    /// Whether the user interrupted it.
    pub interrupted: bool,
    /// Wall time, in seconds.
    pub time_s: f64,
}

/// Exit code: all checks hold.
pub const EXIT_HOLDS: u8 = 0;
/// Exit code: at least one check failed.
pub const EXIT_FAILED: u8 = 1;
/// Exit code: invalid input.
pub const EXIT_INPUT: u8 = 2;
/// Exit code: a required prerequisite is missing.
pub const EXIT_MISSING: u8 = 3;
/// Exit code: standard output cannot be written.
pub const EXIT_OUTPUT: u8 = 4;
/// Exit code: interrupted by the user.
pub const EXIT_INTERRUPTED: u8 = 130;

/// Returns the exit code of a command for which both codes apply: the first of 130, 1, 2 and 3.
pub fn exit_first(a: u8, b: u8) -> u8 {
    let order = [EXIT_INTERRUPTED, EXIT_FAILED, EXIT_INPUT, EXIT_MISSING];
    order.into_iter().find(|code| [a, b].contains(code)).unwrap_or(EXIT_HOLDS)
}

impl Report {
    /// Executes the invariants.
    ///
    /// # Panics
    /// If one does not hold, which is a bug.
    pub fn check_invariants(&self) {
        let names: Vec<&String> = self.cases.iter().map(|case| &case.name).collect();
        let asked: Vec<&String> = self.asked.cases.iter().collect();
        match self.interrupted {
            true => assert!(asked.starts_with(&names), "cases {names:?} of {asked:?}"),
            false => assert_eq!(names, asked, "cases in the report, and asked for"),
        }
        if !self.interrupted {
            self.cases.iter().for_each(|case| case.check_invariants(&self.asked));
        }
        if self.exit_code() == EXIT_HOLDS {
            let checked = self.cases.iter().filter(|case| case.is_checked()).count();
            let least = if self.asked.named { self.cases.len() } else { 1 };
            assert!(checked >= least.max(1), "green, but {checked} cases were checked");
        }
    }

    /// The exit code. An interrupt takes precedence, then a failed check, an input error, a missing prerequisite.
    pub fn exit_code(&self) -> u8 {
        if self.interrupted {
            EXIT_INTERRUPTED
        } else if self.cases.iter().any(CaseReport::failed) {
            EXIT_FAILED
        } else if self.cases.iter().any(|case| case.input_error.is_some()) {
            EXIT_INPUT
        } else if self.missing.iter().any(|missing| missing.required) {
            EXIT_MISSING
        } else {
            EXIT_HOLDS
        }
    }

    /// Numbers of all checks by outcome.
    pub fn tally(&self) -> Tally {
        self.cases.iter().flat_map(|case| &case.checks).collect()
    }

    /// A one-line summary.
    pub fn verdict(&self) -> String {
        let Tally { pass, fail, left_out } = self.tally();
        let cases = self.cases.len();
        let noun = if cases == 1 { "case" } else { "cases" };
        let checks = if pass == 1 { "check holds" } else { "checks hold" };
        let counts = format!("{cases} {noun}: {pass} {checks}, {fail} fail, {left_out} left out");
        let end = match self.exit_code() {
            EXIT_HOLDS => "all hold",
            EXIT_FAILED => "FAILED",
            EXIT_INPUT => "invalid input",
            EXIT_MISSING => "something required is missing",
            _ => "interrupted",
        };
        format!("{counts}, in {:.1} s: {end}", self.time_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::report;
    use proptest::prelude::*;

    #[test]
    fn a_failed_check_takes_precedence_over_a_report_that_cannot_be_written() {
        assert_eq!(exit_first(EXIT_FAILED, EXIT_INPUT), EXIT_FAILED);
        assert_eq!(exit_first(EXIT_INPUT, EXIT_MISSING), EXIT_INPUT);
        assert_eq!(exit_first(EXIT_HOLDS, EXIT_INPUT), EXIT_INPUT);
        assert_eq!(exit_first(EXIT_INPUT, EXIT_INTERRUPTED), EXIT_INTERRUPTED);
        assert_eq!(exit_first(EXIT_HOLDS, EXIT_HOLDS), EXIT_HOLDS);
    }

    #[test]
    fn exit_codes_have_an_order_of_precedence() {
        let mut report = crate::testing::report();
        assert_eq!(report.exit_code(), EXIT_FAILED);
        report.cases[0].checks.remove(2);
        assert_eq!(report.exit_code(), EXIT_HOLDS);
        report.missing[0].required = true;
        assert_eq!(report.exit_code(), EXIT_MISSING);
        report.cases[0].input_error = Some("spacing_min is negative".into());
        assert_eq!(report.exit_code(), EXIT_INPUT);
        report.interrupted = true;
        assert_eq!(report.exit_code(), EXIT_INTERRUPTED);
    }

    /// The message with which the invariants refuse a report that was changed in this way; empty if they hold.
    fn refusal(change: impl Fn(&mut Report) + std::panic::UnwindSafe) -> String {
        let checked = std::panic::catch_unwind(move || {
            let mut report = report();
            change(&mut report);
            report.check_invariants();
        });
        checked.err().map_or(String::new(), |why| *why.downcast::<String>().unwrap())
    }

    #[test]
    fn every_planted_wrong_report_is_refused() {
        assert_eq!(refusal(|_| ()), "");
        let green = |report: &mut Report| drop(report.cases[0].checks.remove(2));
        assert_eq!(refusal(green), "");
        assert!(refusal(|r| r.asked.cases.push("plate".into())).contains("asked for"));
        assert!(refusal(|r| r.cases[0].checks.clear()).contains("has no check"));
        assert!(refusal(|r| r.asked.ranks.push(7)).contains("7 ranks were asked for"));
        assert!(refusal(|r| drop(r.cases[0].checks.pop())).contains("p4est was asked for"));
        assert!(refusal(|r| r.cases[0].runs[1].digest.clear()).contains("no digest"));
        assert!(refusal(|r| drop(r.cases[0].checks.remove(1))).contains("a run without its check"));
        assert!(refusal(|r| drop(r.cases[0].runs.pop())).contains("ended well, and runs"));
        let differs = |report: &mut Report| {
            let of_ranks =
                Check { name: identical::NAME.into(), ..report.cases[0].checks[1].clone() };
            report.cases[0].checks.push(of_ranks);
            report.cases[0].runs[1].digest = "1".repeat(32);
        };
        assert!(refusal(differs).contains("is not identical"));
        let unchecked = move |report: &mut Report| {
            green(report);
            report.cases[0].checks.remove(0);
        };
        assert!(refusal(unchecked).contains("green, but 0 cases were checked"));
        let interrupted = |report: &mut Report| {
            (report.interrupted, report.asked.cases) =
                (true, vec!["cube_small".into(), "b".into()]);
        };
        assert_eq!(refusal(interrupted), "");
        let stranger = |report: &mut Report| {
            (report.interrupted, report.asked.cases) = (true, vec!["plate".into()]);
        };
        assert!(refusal(stranger).contains("cube_small"));
    }

    /// A report of drawn cases, in which every rank count has a run and its checks.
    fn drawn() -> impl Strategy<Value = Report> {
        let ranks = prop::collection::btree_set(1usize..65, 1..4);
        let cases = prop::collection::vec((1u64..1_000_000, any::<u128>(), 0u64..3), 1..4);
        (ranks, cases).prop_map(|(ranks, cases)| {
            let mut all = report();
            all.missing.clear();
            let (name, of_case) = (|i| format!("case-{i}"), all.cases.pop().unwrap());
            let case = |(i, (cells, digest, failures)): (usize, (u64, u128, u64))| {
                let of = Run { cells, digest: format!("{digest:032x}"), ..of_case.runs[0].clone() };
                let layouts: Vec<_> = ranks
                    .iter()
                    .map(|&n| Layout::on(crate::engine::layout::Ranks::Mpi(n)))
                    .collect();
                let on_ranks =
                    layouts.iter().map(|l| Run { layout: Some(l.clone()), ..of.clone() });
                let runs = std::iter::once(of.clone()).chain(on_ranks).collect();
                let of_layout = |l| {
                    [RUNS, identical::NAME]
                        .map(|name| Check::of_layout(l, name, Outcome::held(cells)))
                };
                let mut checks: Vec<_> = layouts.iter().flat_map(of_layout).collect();
                checks.extend(
                    (0..failures).map(|_| Check::new("serial", "balance", Outcome::fail("one"))),
                );
                checks.push(Check::new("p4est", "balance", Outcome::held(cells)));
                CaseReport { name: name(i), runs, checks, ..of_case.clone() }
            };
            all.cases = cases.into_iter().enumerate().map(case).collect();
            all.asked = Asked {
                cases: all.cases.iter().map(|case| case.name.clone()).collect(),
                named: true,
                ranks: ranks.iter().copied().collect(),
                subjects: vec!["p4est".into()],
            };
            all
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, cases: 128, ..ProptestConfig::default() })]

        /// A drawn report satisfies the invariants, and each of these changes to one of its cases violates one.
        #[test]
        fn drawn_reports_are_accepted_and_changed_ones_refused(report in drawn(), at in any::<prop::sample::Index>(), wrong in 0usize..8) {
            report.check_invariants();
            let mut changed = report.clone();
            let at = at.index(report.cases.len());
            let case = &mut changed.cases[at];
            let is_on_ranks = |check: &Check| check.ranks.is_some();
            match wrong {
                0 => drop(changed.cases.remove(at)),
                1 => case.checks.clear(),
                2 => case.checks.retain(|check| !is_on_ranks(check)),
                3 => case.checks.retain(|check| check.subject != "p4est"),
                4 => case.runs[1].digest = "other".into(),
                5 => case.runs[0].cells += 1,
                6 => drop(case.runs.pop()),
                _ => changed.asked.ranks.push(65),
            }
            let refused = std::panic::catch_unwind(move || changed.check_invariants()).is_err();
            prop_assert!(refused, "change {wrong} of {report:?}");
        }
    }

    #[test]
    fn speeds_are_computed_as_in_the_papers_table() {
        let run = &report().cases[0].runs[0];
        assert_eq!((run.cells_per_s(), run.bytes_per_cell()), (76_000.0, 10.0));
        assert_eq!(run.speedup_over_paper(), 2.0);
    }
}
