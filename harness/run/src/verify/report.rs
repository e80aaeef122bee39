//! The result of a verification: the one model that every output format prints.
//!
//! Invariant: every requested check appears in it; a check that was not run is listed as left out, with the reason.

pub use super::outcome::{Check, Outcome, Tally};
use crate::engine::layout::Layout;
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

impl CaseReport {
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

    /// A one-line summary.
    pub fn verdict(&self) -> String {
        let all = self.cases.iter().flat_map(|case| &case.checks);
        let Tally { pass, fail, left_out } = all.collect();
        let cases = self.cases.len();
        let noun = if cases == 1 { "case" } else { "cases" };
        let checks = if pass == 1 { "check holds" } else { "checks hold" };
        let counts = format!("{cases} {noun}: {pass} {checks}, {fail} fail, {left_out} left out");
        let end = match self.exit_code() {
            EXIT_HOLDS if pass == 0 => "nothing was checked",
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
        report.cases[0].checks.remove(1);
        assert_eq!(report.exit_code(), EXIT_HOLDS);
        report.missing[0].required = true;
        assert_eq!(report.exit_code(), EXIT_MISSING);
        report.cases[0].input_error = Some("spacing_min is negative".into());
        assert_eq!(report.exit_code(), EXIT_INPUT);
        report.interrupted = true;
        assert_eq!(report.exit_code(), EXIT_INTERRUPTED);
    }

    #[test]
    fn speeds_are_computed_as_in_the_papers_table() {
        let run = &report().cases[0].runs[0];
        assert_eq!((run.cells_per_s(), run.bytes_per_cell()), (76_000.0, 10.0));
        assert_eq!(run.speedup_over_paper(), 2.0);
    }
}
