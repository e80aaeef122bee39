//! What a verification found: the one model that every output format prints.
//!
//! Invariant: everything asked for appears in it. What was not done is a check that was left out, with
//! the reason; nothing is silently absent.

pub use super::outcome::{Check, Outcome, Tally};
use crate::engine::mesher::Layout;
use serde::{Deserialize, Serialize};

/// Version of the JSON form; changes when a field's meaning does or a field goes.
pub const SCHEMA: &str = "octree-verify/1";

/// The paper's speed on one core, in cells per second.
pub const PAPER_CELLS_PER_S: f64 = 38_000.0;

/// One run of mesher or reference.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Run {
    /// `mesher` or `reference`.
    pub program: String,
    /// How it was spread over ranks; none for a serial run.
    pub layout: Option<Layout>,
    /// Cells of the final mesh.
    pub cells: u64,
    /// By the program's own clock, in seconds, without writing files where that was measured apart.
    pub time_wall_s: f64,
    /// By the harness's clock, start and end of the processes included.
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

    /// How many times faster than the paper's one core.
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
    /// The runs whose time and memory are of interest.
    pub runs: Vec<Run>,
    /// All checks.
    pub checks: Vec<Check>,
    /// The user's input is at fault: the sentence that the programs said.
    pub input_error: Option<String>,
    /// Where the results are, if they were kept.
    pub kept: Option<String>,
    /// A command that repeats the first failure.
    pub repeat_with: Option<String>,
    /// Wall time of the whole case, in seconds.
    pub time_s: f64,
}

impl CaseReport {
    /// All its checks, counted.
    pub fn tally(&self) -> Tally {
        self.checks.iter().collect()
    }

    /// Whether any check failed.
    pub fn failed(&self) -> bool {
        self.checks.iter().any(Check::failed)
    }
}

/// Something that was asked for by `--require` or by name, and is not there.
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
    /// Cores of the machine it ran on.
    pub cores: usize,
    /// What was not there, and so was left out of every case.
    pub missing: Vec<Missing>,
    /// One report for each case.
    pub cases: Vec<CaseReport>,
    /// The user ended it before its end.
    pub interrupted: bool,
    /// Wall time, in seconds.
    pub time_s: f64,
}

/// Exit code: all checks hold.
pub const EXIT_HOLDS: u8 = 0;
/// Exit code: at least one check failed.
pub const EXIT_FAILED: u8 = 1;
/// Exit code: the user's input is at fault.
pub const EXIT_INPUT: u8 = 2;
/// Exit code: something that was asked for is missing.
pub const EXIT_MISSING: u8 = 3;
/// Exit code: ended by the user.
pub const EXIT_INTERRUPTED: u8 = 130;

impl Report {
    /// The exit code: the user's end before all, then a failed check, the user's input, what is missing.
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

    /// One sentence on the whole.
    pub fn verdict(&self) -> String {
        let all = self.cases.iter().flat_map(|case| &case.checks);
        let Tally { pass, fail, left_out } = all.collect();
        let cases = self.cases.len();
        let counts = format!("{cases} cases: {pass} checks hold, {fail} fail, {left_out} left out");
        let end = match self.exit_code() {
            EXIT_HOLDS => "all hold",
            EXIT_FAILED => "FAILED",
            EXIT_INPUT => "the input is at fault",
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
    fn exit_codes_in_order_of_weight() {
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
    fn speeds_are_those_of_the_paper_s_table() {
        let run = &report().cases[0].runs[0];
        assert_eq!((run.cells_per_s(), run.bytes_per_cell()), (76_000.0, 10.0));
        assert_eq!(run.speedup_over_paper(), 2.0);
    }
}
