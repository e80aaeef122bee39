//! Times over all rounds of a case, and the phases that changed. A change that is too small for the whole process is often
//! clear in its phase.
//!
//! Invariant: a phase that became slower is a regression only if the other phases do not save that time, because
//! work may move from one phase to another.

use super::report::{GateFinding, Verdict};
use super::rules::TimeRules;
use crate::statistics::comparison::{Comparison, Round};
use crate::statistics::trimmed_mean;

/// CPU time of the whole process.
pub const CPU: &str = "CPU time";
/// Wall time of the whole process.
pub const WALL: &str = "wall time";

/// CPU time of the process outside all phases that it reports: before the first, between them, after the last.
pub(super) const OUTSIDE: &str = "outside the phases";

/// A time that the gate compares, over all rounds of a case on some ranks.
#[derive(Debug)]
pub(super) struct Quantity {
    pub case: String,
    /// Its name in the report.
    pub metric: String,
    /// Logarithms of its times.
    pub rounds: Vec<Round>,
    /// The comparison of its rounds; its p-value is adjusted for all quantities of all cases.
    pub found: Comparison,
}

impl Quantity {
    /// Times of baseline and candidate, in seconds. That of the candidate follows from the effect: means of their own would
    /// discard other rounds at their ends than the mean of the differences does, and could have a ratio of the other sign.
    fn times(&self) -> [f64; 2] {
        let baseline: Vec<f64> = self.rounds.iter().map(|r| (r[0] + r[1]) / 2.0).collect();
        let baseline = trimmed_mean(&baseline).exp();
        [baseline, baseline * (1.0 + self.found.effect)]
    }

    /// The finding about this time.
    pub fn finding(&self, verdict: Verdict, note: String) -> GateFinding {
        GateFinding::of_values(&self.case, &self.metric, verdict, self.times(), note)
    }

    /// The certainty of the effect, as text.
    pub fn certainty(&self) -> String {
        let Comparison { low, high, p, floor, .. } = self.found;
        let [low, high, floor] = [low, high, floor].map(|ratio| ratio * 100.0);
        format!(
            "99 % interval {low:+.1} to {high:+.1} %, p = {p:.5} among all times; noise floor {floor:.1} %"
        )
    }

    /// Whether the effect is significant, and larger than both the noise floor and the effects of code alignment (`effect_min`).
    pub fn is_changed(&self, rules: &TimeRules) -> bool {
        let least = self.found.floor.max(rules.effect_min / 100.0);
        self.found.p <= rules.alpha && size(self.found.effect) > least
    }
}

/// The size of an effect: as a ratio, 1/3 less time equals 1/2 more time.
pub(super) fn size(effect: f64) -> f64 {
    if effect < 0.0 { 1.0 / (1.0 + effect) - 1.0 } else { effect }
}

/// Returns a finding for every phase that changed; `whole` is the CPU time of the process.
pub(super) fn findings(
    whole: &Quantity,
    phases: &[Quantity],
    rules: &TimeRules,
) -> Vec<GateFinding> {
    let whole_s = whole.times()[0];
    let least_s = rules.phase_min / 100.0 * whole_s;
    let change_s = |phase: &Quantity| phase.times()[1] - phase.times()[0];
    let is_changed = |phase: &&Quantity| phase.is_changed(rules) && change_s(phase).abs() > least_s;
    let changed: Vec<&Quantity> = phases.iter().filter(is_changed).collect();
    let net_s: f64 = changed.iter().map(|phase| change_s(phase)).sum();
    let finding = |phase: &&Quantity| {
        let (verdict, why) = match (change_s(phase) > 0.0, net_s > least_s) {
            (true, true) => (Verdict::Regression, ""),
            (true, false) => (Verdict::Changed, "; other phases save as much"),
            (false, _) => (Verdict::Improvement, ""),
        };
        let part = 100.0 * change_s(phase) / whole_s;
        phase.finding(verdict, format!("{part:+.1} % of the whole{why}; {}", phase.certainty()))
    };
    changed.iter().map(finding).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::comparison::compare;
    use proptest::prelude::*;

    fn of(name: &str, rounds: Vec<Round>, found: Comparison) -> Quantity {
        Quantity { case: "c".into(), metric: name.into(), rounds, found }
    }

    /// A quantity with a certain change of its time.
    fn quantity(name: &str, before: f64, after: f64) -> Quantity {
        let round = [before.ln(), before.ln(), after.ln()];
        let effect = after / before - 1.0;
        let found =
            Comparison { effect, p: 1e-5, floor: 0.01, visible: 0.02, low: effect, high: effect };
        of(name, vec![round; 4], found)
    }

    fn verdicts(phases: &[Quantity]) -> Vec<(String, Verdict)> {
        let whole = quantity("CPU time", 1.0, 1.01);
        let found = findings(&whole, phases, &TimeRules::default());
        found.into_iter().map(|finding| (finding.metric, finding.verdict)).collect()
    }

    #[test]
    fn the_guilty_phase_is_named() {
        let phases = [quantity("read", 0.3, 0.3), quantity("grade", 0.1, 0.11)];
        assert_eq!(verdicts(&phases), [("grade".into(), Verdict::Regression)]);
        let after = [quantity(OUTSIDE, 0.01, 0.1)];
        assert_eq!(verdicts(&after), [(OUTSIDE.to_owned(), Verdict::Regression)]);
    }

    #[test]
    fn work_that_moves_between_phases_is_no_regression() {
        let phases = [quantity("read", 0.3, 0.2), quantity("grade", 0.1, 0.2)];
        let expected =
            [("read".to_owned(), Verdict::Improvement), ("grade".to_owned(), Verdict::Changed)];
        assert_eq!(verdicts(&phases), expected);
    }

    #[test]
    fn a_change_that_hardly_matters_for_the_whole_is_ignored() {
        assert!(verdicts(&[quantity("read", 0.01, 0.014)]).is_empty());
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        /// Of rounds of which half are disturbed, the means of both programs may have the other order than the effect.
        #[test]
        fn the_times_have_the_ratio_of_the_effect(drawn in prop::collection::vec(prop::array::uniform3(0.0..2.0f64), 8..20)) {
            let found = compare(&drawn, 0.01, 1);
            let effect = found.effect;
            let times = of(CPU, drawn, found).times();
            prop_assert!((times[1] / times[0] - 1.0 - effect).abs() < 1e-9);
        }
    }
}
