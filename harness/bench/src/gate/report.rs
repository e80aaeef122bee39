//! The report of a gate, which every output form prints.
//!
//! Invariants, executed by [`GateReport::check_invariants`] before it is printed:
//! - every case that a layer was asked for has a finding in it, unless the layer was left out or interrupted, and no other case has one;
//! - a change is that of the two values beside it, and a verdict for the worse or better has the sign of its change;
//! - a finding that was left out, accepted or is missing compared nothing;
//! - a mesh is accepted only if the correctness of its case was compared.
//!
//! [`End::Holds`] carries the number of comparisons, which is not 0: a report that compared nothing of a case that it was asked for
//! cannot hold.

use super::measures::{LayerName, Measured, Measures};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::num::NonZeroU64;

/// Version of the JSON form.
pub const SCHEMA: &str = "octree-gate/1";

/// The assessment of a finding, best first after those without a comparison.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Not examined, because a prerequisite is missing, for the reason in the note.
    #[default]
    LeftOut,
    /// Not compared, because the mesh is another one, which the user accepts.
    Accepted,
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
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
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
        let (case, metric, note) = (case.to_owned(), metric.to_owned(), note.into());
        Self { case, metric, verdict, note, ..Self::default() }
    }

    /// Returns the finding with the values of baseline and candidate.
    #[must_use]
    pub fn of_values(self, [baseline, candidate]: [f64; 2]) -> Self {
        let change_percent = change_percent(baseline, candidate);
        let (baseline, candidate) = (Some(baseline), Some(candidate));
        Self { compared: 1, baseline, candidate, change_percent, ..self }
    }

    fn check_invariants(&self) {
        if let (Some(baseline), Some(candidate)) = (self.baseline, self.candidate) {
            let expected = change_percent(baseline, candidate);
            assert_eq!(expected, self.change_percent, "the change is that of the values: {self:?}");
            let is_right = match self.verdict {
                Verdict::Regression => candidate > baseline,
                Verdict::Improvement => candidate < baseline,
                _ => true,
            };
            assert!(is_right, "the verdict has the sign of the change: {self:?}");
        }
        let is_empty = self.verdict <= Verdict::Accepted || self.verdict == Verdict::Missing;
        assert!(!is_empty || self.compared == 0, "nothing was compared: {self:?}");
    }
}

/// Metric of the checks.
pub(super) const CHECKS: &str = "checks";

/// Returns the change in percent; `None` of a baseline of 0.
pub(crate) fn change_percent(baseline: f64, candidate: f64) -> Option<f64> {
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
        self.findings.iter().map(|finding| finding.verdict).max().unwrap_or(Verdict::LeftOut)
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
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
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
        let candidate = candidate_measures.of.clone();
        let program = format!("harness {}", env!("CARGO_PKG_VERSION"));
        let schema = SCHEMA.to_owned();
        Self { schema, program, baseline, candidate, candidate_measures, ..Self::default() }
    }

    /// Appends a layer, the one of correctness before all others: without a comparison there, no mesh of a case is accepted.
    pub fn push(&mut self, mut layer: Layer) {
        for finding in &mut layer.findings {
            if !self.may_contain(finding) {
                finding.verdict = Verdict::Missing;
                finding.note += "; it cannot be accepted, as its correctness was not compared";
            }
        }
        self.layers.push(layer);
    }

    /// Whether the layer of correctness compared anything of the case of a finding that accepts a mesh.
    fn may_contain(&self, finding: &GateFinding) -> bool {
        let judges = self.layers.iter().filter(|layer| layer.name == LayerName::Correctness);
        let mut judged = judges.flat_map(|layer| &layer.findings).filter(|f| f.compared > 0);
        finding.verdict != Verdict::Accepted || judged.any(|f| f.case == finding.case)
    }

    /// Returns how the gate ends.
    pub fn end(&self) -> End {
        if self.interrupted {
            return End::Interrupted;
        }
        if self.layers.iter().any(|layer| layer.verdict() == Verdict::Regression) {
            return End::Regression;
        }
        let unmet = self.layers.iter().find_map(|layer| self.unmet(layer));
        let findings = self.layers.iter().flat_map(|layer| &layer.findings);
        let total = findings.map(|finding| finding.compared).sum();
        match (unmet, NonZeroU64::new(total)) {
            (Some(why), _) => End::Incomplete(why),
            (None, None) => End::Incomplete("nothing was compared".to_owned()),
            (None, Some(total)) => End::Holds(total),
        }
    }

    /// Returns what a layer was asked for and did not compare, and why.
    fn unmet(&self, layer: &Layer) -> Option<String> {
        let name = layer.name;
        for case in &layer.cases {
            let is_left_out = |finding: &GateFinding| finding.verdict == Verdict::LeftOut;
            let of_case = || layer.findings.iter().filter(|finding| finding.case == *case);
            let all_left_out = of_case().next().is_some() && of_case().all(is_left_out);
            let is_accepted = of_case().any(|finding| finding.verdict == Verdict::Accepted);
            let is_excused =
                is_accepted || !self.require_layers && (layer.left_out.is_some() || all_left_out);
            if !is_excused && of_case().all(|finding| finding.compared == 0) {
                let unmet = of_case().find(|f| is_left_out(f) || f.verdict == Verdict::Missing);
                let why = layer.left_out.as_ref().or(unmet.map(|finding| &finding.note));
                let why = why.map_or("it has no quantity", String::as_str);
                return Some(format!("{name} of {case}: nothing was compared: {why}"));
            }
        }
        let is_unmet = |f: &&GateFinding| {
            f.verdict == Verdict::Missing || self.require_layers && f.verdict == Verdict::LeftOut
        };
        if let Some(GateFinding { case, metric, note, .. }) = layer.findings.iter().find(is_unmet) {
            return Some(format!("{name} of {case}: {metric}: {note}"));
        }
        layer.cases.is_empty().then(|| format!("the rules have no case for {name}"))
    }

    /// Executes the invariants at the head of this file.
    pub fn check_invariants(&self) {
        for layer in &self.layers {
            for finding in &layer.findings {
                finding.check_invariants();
                assert!(layer.cases.contains(&finding.case), "a case of the rules: {finding:?}");
                assert!(self.may_contain(finding), "a mesh that nothing judged: {finding:?}");
            }
            let found = |case: &String| layer.findings.iter().any(|f| f.case == *case);
            let silent = layer.cases.iter().find(|case| !found(case));
            let excused = self.interrupted || layer.left_out.is_some();
            assert!(excused || silent.is_none(), "{} has no finding on {silent:?}", layer.name);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn report(layers: Vec<Layer>) -> GateReport {
        GateReport { layers, ..GateReport::new(None, Measures::default()) }
    }

    fn layer(findings: &[GateFinding]) -> Layer {
        let cases = vec!["a".to_owned(), "b".to_owned()];
        Layer { findings: findings.to_vec(), ..Layer::new(LayerName::Counters, cases) }
    }

    fn equal(case: &str) -> GateFinding {
        GateFinding::noted(case, "rays", Verdict::Unchanged, "").of_values([7.0, 7.0])
    }

    #[test]
    fn a_gate_that_compared_nothing_of_a_case_does_not_hold() {
        let both = layer(&[equal("a"), equal("b")]);
        assert_eq!(report(vec![both.clone()]).end(), End::Holds(NonZeroU64::new(2).unwrap()));
        let is_incomplete = |layers: Vec<Layer>| matches!(report(layers).end(), End::Incomplete(_));
        assert!(is_incomplete(vec![]), "no layer");
        assert!(is_incomplete(vec![Layer::new(LayerName::Time, vec![])]), "no case");
        assert!(is_incomplete(vec![layer(&[equal("a")])]), "nothing of b");
        let missing = GateFinding::noted("b", "rays", Verdict::Missing, "not in the record");
        assert!(is_incomplete(vec![layer(&[equal("a"), missing.clone()])]), "nothing of b");
        assert!(is_incomplete(vec![layer(&[equal("a"), equal("b"), missing])]), "one of two of b");
        let new = GateFinding::noted("b", "rays", Verdict::Changed, "new");
        assert!(is_incomplete(vec![layer(&[equal("a"), new])]), "no shared quantity of b");
        let out = GateFinding::noted("b", "rays", Verdict::LeftOut, "no boxes");
        let some = report(vec![layer(&[equal("a"), out.clone()])]);
        assert!(matches!(some.end(), End::Holds(_)));
        assert!(matches!(GateReport { require_layers: true, ..some }.end(), End::Incomplete(_)));
        let all = GateFinding { case: "a".into(), ..out.clone() };
        assert!(is_incomplete(vec![layer(&[all, out])]), "all left out");
        let skipped = Layer { left_out: Some("no valgrind".into()), ..layer(&[]) };
        assert!(is_incomplete(vec![skipped.clone()]), "the only layer is left out");
        assert!(matches!(report(vec![both, skipped]).end(), End::Holds(_)));
    }

    proptest! {
        /// Whatever the findings are: a gate that holds compared something of every case that has a finding other than left out.
        #[test]
        fn a_gate_holds_only_on_comparisons(drawn in prop::collection::vec((0..3usize, 0..8usize), 0..12)) {
            use Verdict::*;
            let verdicts = [LeftOut, Measured, Improvement, Unchanged, Changed, Inconclusive, Missing, Regression];
            let finding = |&(case, verdict): &(usize, usize)| {
                let name = ["a", "b", "c"][case];
                let compared = u64::from(!matches!(verdicts[verdict], LeftOut | Missing));
                GateFinding { compared, ..GateFinding::noted(name, "m", verdicts[verdict], "why") }
            };
            let findings: Vec<GateFinding> = drawn.iter().map(finding).collect();
            let cases = ["a", "b", "c"].map(str::to_owned).to_vec();
            let layer = Layer { findings: findings.clone(), ..Layer::new(LayerName::Memory, cases) };
            if let End::Holds(total) = report(vec![layer]).end() {
                prop_assert_eq!(total.get(), findings.iter().map(|f| f.compared).sum::<u64>());
                for case in ["a", "b", "c"] {
                    let of_case: Vec<_> = findings.iter().filter(|f| f.case == case).collect();
                    prop_assert!(!of_case.is_empty());
                    prop_assert!(of_case.iter().all(|f| !matches!(f.verdict, Missing | Regression)));
                }
            }
        }
    }

    fn planted(fault: impl FnOnce(&mut GateFinding)) {
        let mut wrong =
            GateFinding::noted("a", "rays", Verdict::Regression, "").of_values([10.0, 12.0]);
        fault(&mut wrong);
        report(vec![layer(&[wrong, equal("b")])]).check_invariants();
    }

    #[test]
    #[should_panic(expected = "the change is that of the values")]
    fn a_change_that_its_values_do_not_have_is_noticed() {
        planted(|finding| finding.change_percent = Some(-1.0));
    }

    #[test]
    #[should_panic(expected = "the verdict has the sign of the change")]
    fn a_regression_towards_less_is_noticed() {
        planted(|finding| finding.verdict = Verdict::Improvement);
    }

    #[test]
    #[should_panic(expected = "nothing was compared")]
    fn a_missing_quantity_that_counts_is_noticed() {
        planted(|finding| {
            *finding =
                GateFinding { compared: 1, ..GateFinding::noted("a", "m", Verdict::Missing, "") }
        });
    }

    #[test]
    #[should_panic(expected = "has no finding")]
    fn a_case_without_a_finding_is_noticed() {
        report(vec![layer(&[equal("a")])]).check_invariants();
    }

    #[test]
    #[should_panic(expected = "a mesh that nothing judged")]
    fn an_accepted_mesh_that_nothing_judged_is_noticed() {
        planted(|finding| *finding = GateFinding::noted("a", "digest", Verdict::Accepted, ""));
    }

    #[test]
    fn a_record_and_a_report_read_back() {
        let mut measures =
            Measures::of_program(Measured { named: "m".into(), ..Measured::default() });
        let case = measures.cases.entry("cube".into()).or_default();
        case.exact.insert("rays".into(), u64::MAX);
        let json = serde_json::to_string(&measures).unwrap();
        assert_eq!(Measures::parse(json.as_bytes()).unwrap(), measures);
        let text = serde_json::to_vec(&GateReport::new(None, measures.clone())).unwrap();
        assert_eq!(Measures::parse(&text).unwrap(), measures);
        assert!(Measures::parse(b"{\"cells\": 1}").is_err());
        let other = json.replace("measures/1", "measures/9");
        assert!(Measures::parse(other.as_bytes()).unwrap_err().contains("measures/9"));
    }
}
