//! The report of a gate, which every output form prints.

use super::measures::{Measured, Measures};
use serde::{Deserialize, Serialize};
use std::fmt;

/// Version of the JSON form.
pub const SCHEMA: &str = "octree-gate/1";

/// The layers, in the order in which they are run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum LayerName {
    /// The checks of the candidate's meshes.
    Correctness,
    /// Deterministic counters.
    Counters,
    /// Instructions and allocations, counted by valgrind.
    Instructions,
    /// Run times of baseline and candidate in one session.
    Time,
}

impl LayerName {
    /// All layers.
    pub const ALL: [Self; 4] = [Self::Correctness, Self::Counters, Self::Instructions, Self::Time];
}

impl fmt::Display for LayerName {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.pad(match self {
            Self::Correctness => "correctness",
            Self::Counters => "counters",
            Self::Instructions => "instructions",
            Self::Time => "time",
        })
    }
}

/// The assessment of a finding, best first after those that were left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// Not examined, for the reason in the note.
    #[serde(rename = "left_out")]
    LeftOut,
    /// Better than the baseline.
    Improvement,
    /// Equal to the baseline.
    Unchanged,
    /// Different from the baseline, within the tolerance.
    Changed,
    /// The measurement was not sensitive enough.
    Inconclusive,
    /// Worse than the tolerance, or incorrect.
    Regression,
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.pad(match self {
            Self::LeftOut => "left out",
            Self::Improvement => "improvement",
            Self::Unchanged => "unchanged",
            Self::Changed => "changed",
            Self::Inconclusive => "inconclusive",
            Self::Regression => "regression",
        })
    }
}

/// One metric of one case.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Finding {
    /// The case.
    pub case: String,
    /// The metric.
    pub metric: String,
    /// The assessment.
    pub verdict: Verdict,
    /// Value of the baseline.
    pub baseline: Option<f64>,
    /// Value of the candidate.
    pub candidate: Option<f64>,
    /// Change relative to the baseline, in percent.
    pub change_percent: Option<f64>,
    /// The reason and its certainty, as text.
    pub note: String,
}

impl Finding {
    /// Returns a finding without numbers.
    pub fn without_numbers(
        case: &str,
        metric: &str,
        verdict: Verdict,
        note: impl Into<String>,
    ) -> Self {
        Self {
            case: case.to_owned(),
            metric: metric.to_owned(),
            verdict,
            baseline: None,
            candidate: None,
            change_percent: None,
            note: note.into(),
        }
    }

    /// Returns the finding for a deterministic number with a tolerance in percent.
    pub fn exact(case: &str, metric: &str, baseline: u64, candidate: u64, tolerance: f64) -> Self {
        let change = match baseline {
            0 if candidate == 0 => 0.0,
            0 => f64::INFINITY,
            _ => (candidate as f64 / baseline as f64 - 1.0) * 100.0,
        };
        let verdict = match candidate.cmp(&baseline) {
            std::cmp::Ordering::Equal => Verdict::Unchanged,
            std::cmp::Ordering::Less => Verdict::Improvement,
            // Rounding: 11 / 10 - 1 exceeds 0.1 in binary.
            std::cmp::Ordering::Greater if change <= tolerance + 1e-9 => Verdict::Changed,
            std::cmp::Ordering::Greater => Verdict::Regression,
        };
        let note = match verdict {
            Verdict::Regression => format!("exceeds the tolerance of {tolerance} %"),
            Verdict::Changed => format!("within the tolerance of {tolerance} %"),
            _ => String::new(),
        };
        Self {
            baseline: Some(baseline as f64),
            candidate: Some(candidate as f64),
            change_percent: Some(change).filter(|change| change.is_finite()),
            ..Self::without_numbers(case, metric, verdict, note)
        }
    }
}

/// One layer.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Layer {
    /// Its name.
    pub name: LayerName,
    /// Why it was skipped.
    pub left_out: Option<String>,
    /// The findings.
    pub findings: Vec<Finding>,
    /// Wall time, in seconds.
    pub time_s: f64,
}

impl Layer {
    /// Returns an empty value.
    pub fn new(name: LayerName) -> Self {
        Self { name, left_out: None, findings: Vec::new(), time_s: 0.0 }
    }

    /// Returns the worst verdict of the findings.
    pub fn verdict(&self) -> Verdict {
        let worst = self.findings.iter().map(|finding| finding.verdict).max();
        worst.unwrap_or(Verdict::LeftOut)
    }

    /// Marks a layer that examined nothing as left out.
    pub fn note_nothing_examined(&mut self) {
        if self.left_out.is_none() && self.verdict() == Verdict::LeftOut {
            let first = self.findings.first().map(|finding| finding.note.clone());
            self.left_out = Some(first.unwrap_or_else(|| "nothing was compared".to_owned()));
        }
    }
}

/// The whole comparison.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Report {
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
    /// The exact measures of the candidate, which can serve as a baseline.
    pub candidate_measures: Measures,
    /// Whether the user interrupted it.
    pub interrupted: bool,
    /// Wall time, in seconds.
    pub time_s: f64,
}

impl Report {
    /// Returns an empty value.
    pub fn new(baseline: Option<Measured>, candidate: Measured) -> Self {
        Self {
            schema: SCHEMA.to_owned(),
            program: format!("harness {}", env!("CARGO_PKG_VERSION")),
            baseline,
            candidate,
            layers: Vec::new(),
            candidate_measures: Measures::default(),
            interrupted: false,
            time_s: 0.0,
        }
    }

    /// Whether no layer has a regression.
    pub fn holds(&self) -> bool {
        self.layers.iter().all(|layer| layer.verdict() < Verdict::Regression)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_growth_beyond_the_tolerance_is_a_regression() {
        let verdict = |baseline, candidate, tolerance| {
            Finding::exact("c", "m", baseline, candidate, tolerance).verdict
        };
        assert_eq!(verdict(100, 100, 0.0), Verdict::Unchanged);
        assert_eq!(verdict(100, 101, 0.0), Verdict::Regression);
        assert_eq!(verdict(100, 101, 1.5), Verdict::Changed);
        assert_eq!(verdict(100, 99, 0.0), Verdict::Improvement);
        assert_eq!(verdict(0, 0, 0.0), Verdict::Unchanged);
        assert_eq!(verdict(0, 1, 50.0), Verdict::Regression);
    }

    #[test]
    fn a_layer_has_the_worst_verdict_of_its_findings() {
        let mut layer = Layer::new(LayerName::Time);
        assert_eq!(layer.verdict(), Verdict::LeftOut);
        for verdict in
            [Verdict::LeftOut, Verdict::Improvement, Verdict::Inconclusive, Verdict::Changed]
        {
            layer.findings.push(Finding::without_numbers("c", "m", verdict, ""));
        }
        assert_eq!(layer.verdict(), Verdict::Inconclusive);
    }

    #[test]
    fn a_layer_without_an_examined_finding_is_left_out() {
        let of = |verdicts: &[Verdict]| {
            let mut layer = Layer::new(LayerName::Time);
            let finding = |&verdict| Finding::without_numbers("c", "m", verdict, "too deep");
            layer.findings = verdicts.iter().map(finding).collect();
            layer.note_nothing_examined();
            layer.left_out
        };
        assert_eq!(of(&[]).as_deref(), Some("nothing was compared"));
        assert_eq!(of(&[Verdict::LeftOut; 2]).as_deref(), Some("too deep"));
        assert_eq!(of(&[Verdict::LeftOut, Verdict::Unchanged]), None);
    }

    #[test]
    fn a_record_and_a_report_read_back() {
        let mut measures = Measures::of_program(Measured { named: "m".into(), revision: None });
        measures.case("cube").exact.insert("rays".into(), u64::MAX);
        assert_eq!(Measures::parse(measures.json().as_bytes()).unwrap(), measures);
        let report = Report {
            candidate_measures: measures.clone(),
            ..Report::new(None, Measured::default())
        };
        let text = serde_json::to_vec(&report).unwrap();
        assert_eq!(Measures::parse(&text).unwrap(), measures);
        assert!(Measures::parse(b"{\"cells\": 1}").is_err());
        let other = measures.json().replace("measures/1", "measures/9");
        assert!(Measures::parse(other.as_bytes()).unwrap_err().contains("measures/9"));
    }
}
