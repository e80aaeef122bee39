//! The checks of a verification with their outcomes.

use crate::engine::layout::Layout;
pub use check::checks::Outcome;
use serde::{Deserialize, Serialize};

/// Name of the check that a program runs to its end and that its run report is true.
pub const RUNS: &str = "runs";

/// Name of the check that two serial runs give the same mesh.
pub const DETERMINISTIC: &str = "deterministic";

/// The outcome of [`RUNS`] for a run whose number of cells and digest are those of its mesh.
pub fn ended_well() -> Outcome {
    Outcome::held(2)
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
        let (subject, name) = (subject.into(), name.into());
        Self {
            subject,
            ranks: None,
            name,
            outcome,
            time_s: 0.0,
            notes: Vec::new(),
            figures: None,
            findings: 0,
        }
    }

    /// A check of one run.
    pub fn of_layout(layout: &Layout, name: impl Into<String>, outcome: Outcome) -> Self {
        Self { ranks: layout.rank_count(), ..Self::new(layout.to_string(), name, outcome) }
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

impl<'a> FromIterator<&'a Check> for Tally {
    fn from_iter<I: IntoIterator<Item = &'a Check>>(checks: I) -> Self {
        let mut tally = Self::default();
        for check in checks {
            match check.outcome {
                Outcome::Pass { .. } => tally.pass += 1,
                Outcome::Fail { .. } => tally.fail += 1,
                Outcome::LeftOut { .. } => tally.left_out += 1,
            }
        }
        tally
    }
}
