//! The result of a verification: the one model that every output format prints.
//!
//! Invariants, which [`Report::check_invariants`] executes before any form of the report is printed:
//! - the cases are those that were asked for, in order; of an interrupted run, the first of them;
//! - a case that no program refuses has checks, among them at least one for each rank count and for each outside program asked for; one
//!   that was not run is left out, with the reason;
//! - a run on ranks has a digest and exactly one check `runs` that holds, and the other way round;
//! - the runs whose mesh is `identical` to the serial one, with a true `manifest`, have one digest and number of cells, which are those
//!   of the timed serial run if the check `deterministic` holds;
//! - a green report has a check of a mesh that holds, of every case that was named, and misses nothing required.

use crate::engine::layout::Layout;
pub use check::checks::Outcome;
use check::checks::{CheckResult, identical, manifest};
use contract::failure::{EXIT_FAILED, EXIT_HOLDS, EXIT_INPUT, EXIT_INTERRUPTED, EXIT_MISSING};
use serde::{Deserialize, Serialize};

/// Name of the check that a program runs to its end and that its run report is true.
pub const RUNS: &str = "runs";

/// Name of the check that two serial runs give the same mesh.
pub(super) const DETERMINISTIC: &str = "deterministic";

/// Version of the JSON form; it changes when the meaning of a field changes or a field is removed.
pub const SCHEMA: &str = "octree-verify/2";

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
    /// Wall time by the program's own clock, in seconds; without writing files if that is measured separately. That of the process if
    /// the program reports none.
    pub time_wall_s: f64,
    /// Whether the program reported that time.
    pub is_time_reported: bool,
    /// Wall time by the harness's clock, in seconds, including the start and end of the processes.
    pub time_process_s: f64,
    /// Peak resident memory of all ranks together, if it is known.
    pub peak_rss_bytes: Option<u64>,
}

/// One check of one result.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Check {
    /// The mesh that was checked: `serial`, `base tree`, `p4est` or the layout of a run on MPI.
    pub subject: String,
    /// Ranks of the run on MPI that was checked.
    pub ranks: Option<usize>,
    /// The check's name.
    pub name: String,
    /// The outcome.
    #[serde(flatten)]
    pub outcome: Outcome,
    /// Time of the check itself, in seconds.
    pub time_s: f64,
    /// Remarks that matter even if the check holds, such as points on which the oracles disagree.
    pub notes: Vec<String>,
    /// Figures of the check, as text.
    pub figures: Option<String>,
    /// Number of findings, if it counts them.
    pub findings: u64,
}

impl Check {
    /// A check without remarks.
    pub fn new(subject: impl Into<String>, name: impl Into<String>, outcome: Outcome) -> Self {
        let (subject, name, notes) = (subject.into(), name.into(), Vec::new());
        let (ranks, figures, time_s, findings) = (None, None, 0.0, 0);
        Self { subject, ranks, name, outcome, time_s, notes, figures, findings }
    }

    /// The result of a check of the crate `check`.
    pub(super) fn of_result(subject: &str, result: CheckResult) -> Self {
        Self {
            findings: result.findings_total,
            figures: Some(result.note.clone()).filter(|note| !note.is_empty()),
            ..Self::new(subject, result.name, result.outcome())
        }
    }

    /// Whether it failed.
    pub fn failed(&self) -> bool {
        self.outcome.failed()
    }
}

/// Numbers of checks by outcome.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Passed.
    pub pass: usize,
    /// Failed.
    pub fail: usize,
    /// Left out.
    pub left_out: usize,
}

impl Tally {
    /// Of these checks.
    pub fn of<'a>(checks: impl Iterator<Item = &'a Check> + Clone) -> Self {
        let count = |is: fn(&Outcome) -> bool| checks.clone().filter(|c| is(&c.outcome)).count();
        let (pass, fail) = (count(Outcome::holds), count(Outcome::failed));
        Self { pass, fail, left_out: checks.count() - pass - fail }
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
    /// The error message of the mesher, or of the harness if the mesher was not asked, if the case is invalid.
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

    /// Whether a check of a mesh was run: that a program ran, and wrote what can be read, shows nothing about its mesh.
    pub fn is_checked(&self) -> bool {
        let is_formal = |name: &str| name == RUNS || check::checks::FORMAL.contains(&name);
        let of_mesh = |check: &Check| check.outcome.holds() && !is_formal(&check.name);
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
                let has = self.has(subject);
                assert!(has, "{name}: {subject} was asked for and is not in the report");
            }
        }
        let held = |subject: &str, name: &str| {
            let of = |c: &&Check| c.subject == subject && c.name == name && c.outcome.holds();
            self.checks.iter().filter(of).count()
        };
        // The meshes are compared with a second serial run: that of a mesher that is not deterministic may differ from the timed one, and
        // the digest of either may be false.
        let is_timed = |run: &&Run| run.program == "mesher" && run.layout.is_none();
        let is_second =
            |_: &&Run| [DETERMINISTIC, manifest::NAME].iter().all(|of| held("serial", of) > 0);
        let timed = self.runs.iter().find(is_timed).filter(is_second);
        let mut serial = timed.map(|run| (run.cells, &run.digest));
        for run in &self.runs {
            assert!(!run.digest.is_empty(), "{name}: a run of {} has no digest", run.program);
            let Some(layout) = &run.layout else { continue };
            let subject = layout.to_string();
            assert_eq!(held(&subject, RUNS), 1, "{name}: {subject}: a run without its check");
            if [identical::NAME, manifest::NAME].iter().all(|check| held(&subject, check) > 0) {
                let of_run = (run.cells, &run.digest);
                let expected = *serial.get_or_insert(of_run);
                assert_eq!(of_run, expected, "{name}: {subject} is not identical");
            }
        }
        let on_ranks = self.checks.iter().filter(|c| c.ranks.is_some() && c.name == RUNS);
        let held = on_ranks.filter(|check| check.outcome.holds()).count();
        let runs = self.runs.iter().filter(|run| run.layout.is_some()).count();
        assert_eq!(held, runs, "{name}: checks that a run ended well, and runs");
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

impl Report {
    /// Executes the invariants.
    ///
    /// # Panics
    /// If one does not hold, which is a bug.
    pub fn check_invariants(&self) {
        let names: Vec<&String> = self.cases.iter().map(|case| &case.name).collect();
        let asked: Vec<&String> = self.asked.cases.iter().collect();
        if self.interrupted {
            assert!(asked.starts_with(&names), "cases {names:?} of {asked:?}");
        } else {
            assert_eq!(names, asked, "cases in the report, and asked for");
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
        let Self { cases, missing, .. } = self;
        match () {
            () if self.interrupted => EXIT_INTERRUPTED,
            () if cases.iter().any(CaseReport::failed) => EXIT_FAILED,
            () if cases.iter().any(|case| case.input_error.is_some()) => EXIT_INPUT,
            () if missing.iter().any(|missing| missing.required) => EXIT_MISSING,
            () => EXIT_HOLDS,
        }
    }

    /// Numbers of all checks by outcome.
    pub fn tally(&self) -> Tally {
        Tally::of(self.cases.iter().flat_map(|case| &case.checks))
    }

    /// A one-line summary.
    pub fn verdict(&self) -> String {
        let Tally { pass, fail, left_out } = self.tally();
        let (cases, time_s) = (self.cases.len(), self.time_s);
        let end = match self.exit_code() {
            EXIT_HOLDS => "all hold",
            EXIT_FAILED => "FAILED",
            EXIT_INPUT => "invalid input",
            EXIT_MISSING => "something required is missing",
            _ => "interrupted",
        };
        format!(
            "cases: {cases}; checks: {pass} hold, {fail} fail, {left_out} left out; {time_s:.1} s: {end}"
        )
    }
}

#[cfg(test)]
mod tests;
