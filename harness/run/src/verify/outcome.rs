//! How checks came out, one by one and counted.

use crate::engine::mesher::Layout;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// How a check came out.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "outcome", content = "why")]
pub enum Outcome {
    /// It holds.
    Pass,
    /// It does not; why, in a sentence or more.
    Fail(String),
    /// It was not done; because of what.
    LeftOut(String),
}

/// One check of one result.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Check {
    /// What was checked: `serial`, `base tree`, `p4est` or the layout of a run on MPI.
    pub subject: String,
    /// Ranks of the run on MPI that was checked.
    pub ranks: Option<usize>,
    /// The check's name.
    pub name: String,
    /// How it came out.
    #[serde(flatten)]
    pub outcome: Outcome,
    /// Time that the check itself took, in seconds.
    pub time_s: f64,
    /// What it has to say even where it holds, such as where the oracles disagreed.
    pub notes: Vec<String>,
    /// Its own figures, in its own words.
    pub figures: Option<String>,
    /// What it counted.
    pub counts: BTreeMap<String, u64>,
}

impl Check {
    /// A check that has nothing to add to its outcome.
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
            counts: BTreeMap::new(),
        }
    }

    /// A check of one run on MPI.
    pub fn of_layout(layout: &Layout, name: impl Into<String>, outcome: Outcome) -> Self {
        Self { ranks: Some(layout.ranks), ..Self::new(layout.to_string(), name, outcome) }
    }

    /// Whether it failed.
    pub fn failed(&self) -> bool {
        matches!(self.outcome, Outcome::Fail(_))
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
                Outcome::Pass => tally.pass += 1,
                Outcome::Fail(_) => tally.fail += 1,
                Outcome::LeftOut(_) => tally.left_out += 1,
            }
        }
        tally
    }
}

/// A run that did not.
#[derive(Debug, PartialEq, Eq)]
pub enum Trouble {
    /// The program holds the user's input to be at fault; what it said.
    Input(String),
    /// It failed; how.
    Failed(String),
    /// It did not end within its time limit.
    Hung(String),
    /// The user asked to end.
    Interrupted,
}
