//! The result of a check.
//!
//! Invariants: the listed findings are the first ones, and as many as there are, up to a limit, each with a text; a
//! check that had nothing to check has examined nothing and found nothing; one that holds has examined something. `identical` counts leaves and lists one difference.

use contract::failure::Failure;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::num::NonZeroU64;

/// Findings that are listed in full; further ones are counted only, so that a check takes five lines.
pub const FINDINGS_LISTED: usize = 4;

/// Name of the check that a directory can be read as a leaf set.
pub const FILES: &str = "files";

/// The result of a check on one mesh.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct CheckResult {
    /// Name of the check.
    pub name: &'static str,
    /// Number of objects examined: leaves, unless the note names something else.
    pub examined: u64,
    /// The first [`FINDINGS_LISTED`] findings: the violation and its position, by octant path and coordinates.
    #[serde(skip)]
    pub findings: Vec<String>,
    /// Number of all findings.
    #[serde(rename = "findings")]
    pub findings_total: u64,
    /// Numbers and limitations that are of interest even if the check passes.
    #[serde(skip)]
    pub note: String,
    /// Why the mesh gave the check nothing to examine; such a check neither holds nor fails.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nothing_to_check: Option<String>,
}

impl CheckResult {
    /// A result without findings.
    pub fn new(name: &'static str) -> Self {
        Self { name, ..Self::default() }
    }

    /// The result of [`FILES`] for a directory that cannot be read as a leaf set.
    pub fn unreadable(error: &Failure) -> Self {
        let mut result = Self::new(FILES);
        result.report(error);
        result
    }

    /// States that a premise is missing.
    pub fn lacks(&mut self, why: impl fmt::Display) {
        self.nothing_to_check = Some(why.to_string());
        self.examined = 0;
    }

    /// States which premise is missing, if one is and nothing was found: a check without its premise cannot fail, so it must not count as
    /// one that holds.
    pub(crate) fn requires(&mut self, missing: Option<impl fmt::Display>) {
        if let Some(why) = missing.filter(|_| self.holds() && self.was_run()) {
            self.lacks(why);
        }
    }

    /// States that there was nothing to check, if nothing was examined and found.
    pub fn needs_objects(&mut self, why: &str) {
        self.requires((self.examined == 0).then_some(why));
    }

    /// Panics if an invariant of the answer does not hold.
    pub fn check_invariants(&self) {
        let Self { name, examined, findings, findings_total, .. } = self;
        let listed = (*findings_total).min(FINDINGS_LISTED as u64);
        let are_first = findings.len() as u64 == listed || *name == "identical";
        assert!(are_first, "of {findings_total} findings {name} lists {findings:?}");
        assert!(!findings.contains(&String::new()), "a finding of {name} has no text");
        let is_about_something = *findings_total > 0 || *examined > 0;
        assert_eq!(self.was_run(), is_about_something, "{name} examined {examined} objects");
    }

    /// Whether there are no findings. A check that had nothing to check has none, but shows nothing about the mesh.
    pub fn holds(&self) -> bool {
        self.findings_total == 0
    }

    /// Whether the check examined something.
    pub fn was_run(&self) -> bool {
        self.nothing_to_check.is_none()
    }

    /// The outcome: a check without findings that examined nothing was left out.
    pub fn outcome(&self) -> Outcome {
        if let Some(why) = &self.nothing_to_check {
            return Outcome::left_out(format!("there is nothing to check: {why}"));
        }
        if self.holds() {
            return Outcome::held(self.examined);
        }
        let listed = self.findings.iter().cloned();
        Outcome::fail(listed.chain(self.unlisted()).collect::<Vec<_>>().join("\n"))
    }

    /// How many findings are not listed, as text.
    fn unlisted(&self) -> Option<String> {
        let unlisted = self.findings_total - self.findings.len() as u64;
        (unlisted > 0).then(|| format!("and {unlisted} more"))
    }

    /// Adds a finding. Its text is made only if it is listed: a corrupt mesh may have millions.
    pub fn report(&mut self, finding: impl fmt::Display) {
        self.findings_total += 1;
        if self.findings.len() < FINDINGS_LISTED {
            self.findings.push(finding.to_string());
        }
    }
}

impl fmt::Display for CheckResult {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(why) = &self.nothing_to_check {
            return write!(f, "{:<10} nothing to check: {why}", self.name);
        }
        let verdict = match self.findings_total {
            0 => "holds".to_owned(),
            1 => "1 finding".to_owned(),
            n => format!("{n} findings"),
        };
        write!(f, "{:<10} {verdict}, {} examined", self.name, self.examined)?;
        if !self.note.is_empty() {
            write!(f, "; {}", self.note)?;
        }
        let mut lines = self.findings.iter().cloned().chain(self.unlisted());
        lines.try_for_each(|line| write!(f, "\n    {line}"))
    }
}

/// The outcome of a check.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "outcome")]
pub enum Outcome {
    /// It holds.
    Pass {
        /// Number of things compared: leaves, unless the check's documentation names something else.
        compared: NonZeroU64,
    },
    /// It does not hold.
    Fail {
        /// The reason.
        why: String,
    },
    /// It shows nothing about the mesh.
    LeftOut {
        /// The reason.
        why: String,
    },
}

impl Outcome {
    /// A check without findings, which was left out if it compared nothing.
    pub fn held(compared: u64) -> Self {
        match NonZeroU64::new(compared) {
            Some(compared) => Self::Pass { compared },
            None => Self::left_out("there was nothing to compare"),
        }
    }

    /// A check that failed.
    pub fn fail(why: impl Into<String>) -> Self {
        Self::Fail { why: why.into() }
    }

    /// A check that was left out.
    pub fn left_out(why: impl Into<String>) -> Self {
        Self::LeftOut { why: why.into() }
    }

    /// Whether it holds.
    pub fn holds(&self) -> bool {
        matches!(self, Self::Pass { .. })
    }

    /// Whether it failed.
    pub fn failed(&self) -> bool {
        matches!(self, Self::Fail { .. })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_result_lists_its_first_findings_and_counts_the_others() {
        let mut result = CheckResult { examined: 7, ..CheckResult::new("balance") };
        assert!(result.holds() && result.was_run());
        assert_eq!(result.to_string(), "balance    holds, 7 examined");
        result.note = "a note".to_owned();
        result.report("first".to_owned());
        assert_eq!(result.to_string(), "balance    1 finding, 7 examined; a note\n    first");
        (1..FINDINGS_LISTED).for_each(|i| result.report(format!("finding {i}")));
        let listed = result.to_string();
        assert!(
            listed.starts_with("balance    4 findings, ") && listed.ends_with("\n    finding 3"),
            "{listed}"
        );
        struct NeverShown;
        impl fmt::Display for NeverShown {
            fn fmt(&self, _: &mut fmt::Formatter<'_>) -> fmt::Result {
                unreachable!("this text is not listed")
            }
        }
        result.report(NeverShown);
        assert!(!result.holds());
        assert!(result.to_string().ends_with("\n    finding 3\n    and 1 more"));
        let mut nothing = CheckResult::new("sides");
        nothing.lacks("no leaves");
        assert!(nothing.holds() && !nothing.was_run());
        assert_eq!(nothing.to_string(), "sides      nothing to check: no leaves");
    }
    #[test]
    fn a_result_that_contradicts_itself_is_a_bug() {
        let mut correct = CheckResult { examined: 3, ..CheckResult::new("sides") };
        (0..2 * FINDINGS_LISTED).for_each(|i| correct.report(format!("finding {i}")));
        correct.check_invariants();
        type Fault = fn(&mut CheckResult);
        let faults: [Fault; 4] = [
            |r| r.findings_total = 3,
            |r| drop(r.findings.pop()),
            |r| r.lacks("nothing"),
            |r| *r = CheckResult::new("sides"),
        ];
        for fault in faults {
            let mut wrong = correct.clone();
            fault(&mut wrong);
            assert!(std::panic::catch_unwind(|| wrong.check_invariants()).is_err(), "{wrong}");
        }
    }
}

#[cfg(test)]
mod outcomes {
    use super::*;

    #[test]
    fn nothing_that_compared_nothing_holds() {
        assert!(!Outcome::held(0).holds() && Outcome::held(1).holds());
        assert!(serde_json::from_str::<Outcome>(r#"{"outcome": "pass", "compared": 0}"#).is_err());
        assert!(serde_json::from_str::<Outcome>(r#"{"outcome": "pass"}"#).is_err());
        let text = serde_json::to_string(&Outcome::held(3)).unwrap();
        assert_eq!(text, r#"{"outcome":"pass","compared":3}"#);
        let text = serde_json::to_string(&Outcome::left_out("x")).unwrap();
        assert_eq!(text, r#"{"outcome":"left_out","why":"x"}"#);
    }
}
