//! The report of a gate, which every output form prints.
//!
//! Invariants, executed by [`GateReport::check_invariants`] before it is printed:
//! - every case that a layer was asked for has a finding in it, unless the layer was left out or interrupted, and no other case has one;
//! - a change is that of the two values beside it, and a verdict for the worse or better has the sign of its change;
//! - a finding that was left out or is missing compared nothing.
//!
//! [`End::Holds`] carries the number of comparisons, which is not 0: a report that compared nothing of a case that it was asked for
//! cannot hold.

use super::measures::{LayerName, Measured, Measures};
use serde::{Deserialize, Serialize};
use std::cmp::Ordering;
use std::fmt;
use std::num::NonZeroU64;

/// Version of the JSON form.
pub const SCHEMA: &str = "octree-gate/1";

/// The assessment of a finding, best first after those without a comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Not examined, because a prerequisite is missing, for the reason in the note.
    LeftOut,
    /// Measured, and nothing was given to compare with.
    Measured,
    /// Better than the baseline.
    Improvement,
    /// Equal to the baseline.
    Unchanged,
    /// Different from the baseline, within the tolerance.
    Changed,
    /// The measurement was not sensitive enough.
    Inconclusive,
    /// Asked for, and not there to be compared.
    Missing,
    /// Worse than the tolerance, or incorrect.
    Regression,
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.pad(&crate::name_of(self).replace('_', " "))
    }
}

/// One metric of one case.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct GateFinding {
    /// The case.
    pub case: String,
    /// The metric.
    pub metric: String,
    /// The assessment.
    pub verdict: Verdict,
    /// Number of quantities or checks that were compared, or measured if there is no baseline.
    pub compared: u64,
    /// Value of the baseline.
    pub baseline: Option<f64>,
    /// Value of the candidate.
    pub candidate: Option<f64>,
    /// Change relative to the baseline, in percent.
    pub change_percent: Option<f64>,
    /// The reason and its certainty, as text.
    pub note: String,
}

impl GateFinding {
    /// Returns a finding without numbers, which compared nothing.
    pub fn noted(case: &str, metric: &str, verdict: Verdict, note: impl Into<String>) -> Self {
        Self {
            case: case.to_owned(),
            metric: metric.to_owned(),
            verdict,
            compared: 0,
            baseline: None,
            candidate: None,
            change_percent: None,
            note: note.into(),
        }
    }

    /// Returns a finding about two values.
    pub fn of_values(
        case: &str,
        metric: &str,
        verdict: Verdict,
        [baseline, candidate]: [f64; 2],
        note: String,
    ) -> Self {
        Self {
            compared: 1,
            baseline: Some(baseline),
            candidate: Some(candidate),
            change_percent: change_percent(baseline, candidate),
            ..Self::noted(case, metric, verdict, note)
        }
    }

    fn check_invariants(&self) {
        if let (Some(baseline), Some(candidate)) = (self.baseline, self.candidate) {
            let expected = change_percent(baseline, candidate);
            assert_eq!(expected, self.change_percent, "the change is that of the values: {self:?}");
            let expected = match self.verdict {
                Verdict::Regression => Some(Ordering::Greater),
                Verdict::Improvement => Some(Ordering::Less),
                _ => None,
            };
            let found = candidate.partial_cmp(&baseline);
            let is_right = expected.is_none_or(|_| found == expected);
            assert!(is_right, "the verdict has the sign of the change: {self:?}");
        }
        let is_empty = matches!(self.verdict, Verdict::LeftOut | Verdict::Missing);
        assert!(!is_empty || self.compared == 0, "nothing was compared: {self:?}");
    }
}

/// Metric of the checks.
pub(super) const CHECKS: &str = "checks";

/// Returns the change in percent; `None` of a baseline of 0.
pub(super) fn change_percent(baseline: f64, candidate: f64) -> Option<f64> {
    match (baseline == candidate, baseline == 0.0) {
        (true, _) => Some(0.0),
        (_, true) => None,
        _ => Some((candidate / baseline - 1.0) * 100.0),
    }
}

/// One layer.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Layer {
    /// Its name.
    pub name: LayerName,
    /// The cases for which it was asked.
    pub cases: Vec<String>,
    /// Why it was skipped as a whole: a prerequisite is missing.
    pub left_out: Option<String>,
    /// The findings.
    pub findings: Vec<GateFinding>,
    /// Wall time, in seconds.
    pub time_s: f64,
}

impl Layer {
    /// Returns an empty value.
    pub fn new(name: LayerName, cases: Vec<String>) -> Self {
        Self { name, cases, left_out: None, findings: Vec::new(), time_s: 0.0 }
    }

    /// Returns the worst verdict of the findings.
    pub fn verdict(&self) -> Verdict {
        let worst = self.findings.iter().map(|finding| finding.verdict).max();
        worst.unwrap_or(Verdict::LeftOut)
    }
}

/// How a gate ends.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum End {
    /// Nothing got worse in this number of comparisons, at least one for every case of every layer that was not left out.
    Holds(NonZeroU64),
    /// The user interrupted it.
    Interrupted,
    /// Something got worse.
    Regression,
    /// Something that was asked for was not compared; the reason.
    Incomplete(String),
}

/// The whole comparison.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct GateReport {
    /// [`SCHEMA`].
    pub schema: String,
    /// Name and version of the harness.
    pub program: String,
    /// The baseline; `None` if the candidate was only recorded.
    pub baseline: Option<Measured>,
    /// The candidate.
    pub candidate: Measured,
    /// The requested layers.
    pub layers: Vec<Layer>,
    /// Whether layers and cases must not be left out.
    pub require_layers: bool,
    /// The exact measures of the candidate, which can serve as a baseline.
    pub candidate_measures: Measures,
    /// Whether the user interrupted it.
    pub interrupted: bool,
    /// Wall time, in seconds.
    pub time_s: f64,
}

impl GateReport {
    /// Returns a report without layers.
    pub fn new(baseline: Option<Measured>, candidate_measures: Measures) -> Self {
        Self {
            schema: SCHEMA.to_owned(),
            program: format!("harness {}", env!("CARGO_PKG_VERSION")),
            baseline,
            candidate: candidate_measures.of.clone(),
            layers: Vec::new(),
            require_layers: false,
            candidate_measures,
            interrupted: false,
            time_s: 0.0,
        }
    }

    /// Returns how the gate ends.
    pub fn end(&self) -> End {
        if self.interrupted {
            return End::Interrupted;
        }
        if self.layers.iter().any(|layer| layer.verdict() == Verdict::Regression) {
            return End::Regression;
        }
        let mut total = 0;
        for layer in &self.layers {
            for case in &layer.cases {
                let of_case = || layer.findings.iter().filter(|finding| finding.case == *case);
                let compared: u64 = of_case().map(|finding| finding.compared).sum();
                total += compared;
                let is_left_out = |finding: &GateFinding| finding.verdict == Verdict::LeftOut;
                let is_excused = layer.left_out.is_some()
                    || of_case().next().is_some() && of_case().all(is_left_out);
                if compared == 0 && (self.require_layers || !is_excused) {
                    let unmet = of_case().find(|f| is_left_out(f) || f.verdict == Verdict::Missing);
                    let why = layer.left_out.as_ref().or(unmet.map(|finding| &finding.note));
                    let why = why.map_or("it has no quantity", String::as_str);
                    let name = layer.name;
                    return End::Incomplete(format!(
                        "{name} of {case}: nothing was compared: {why}"
                    ));
                }
            }
            let is_missing = |f: &&GateFinding| {
                f.verdict == Verdict::Missing
                    || self.require_layers && f.verdict == Verdict::LeftOut
            };
            let mut missing = layer.findings.iter().filter(is_missing);
            if let Some(GateFinding { case, metric, note, .. }) = missing.next() {
                return End::Incomplete(format!("{} of {case}: {metric}: {note}", layer.name));
            }
            if layer.cases.is_empty() {
                return End::Incomplete(format!("the rules have no case for {}", layer.name));
            }
        }
        let none = || End::Incomplete("nothing was compared".to_owned());
        NonZeroU64::new(total).map_or_else(none, End::Holds)
    }

    /// Executes the invariants at the head of this file.
    pub fn check_invariants(&self) {
        for layer in &self.layers {
            for finding in &layer.findings {
                finding.check_invariants();
                assert!(layer.cases.contains(&finding.case), "a case of the rules: {finding:?}");
            }
            let found = |case: &String| layer.findings.iter().any(|f| f.case == *case);
            let silent = layer.cases.iter().find(|case| !found(case));
            let excused = self.interrupted || layer.left_out.is_some();
            assert!(excused || silent.is_none(), "{} has no finding on {silent:?}", layer.name);
        }
    }
}

#[cfg(test)]
mod tests;
