//! The phases that changed. A change that is too small for the whole process is often clear in its phase.
//!
//! Invariant: a phase that became slower is a regression only if the other phases do not save that time, because
//! work may move from one phase to another.

use super::quantity::{OUTSIDE, Quantity, certainty, size};
use super::report::{Finding, Verdict};
use super::rules::TimeRules;

/// Returns a finding for every phase that changed; `whole` is the CPU time of the process.
pub(super) fn findings(
    case: &str,
    whole: &Quantity,
    phases: &[Quantity],
    rules: &TimeRules,
) -> Vec<Finding> {
    let whole_s = whole.means().0;
    let is_changed = |phase: &&Quantity| {
        let (before, after) = phase.means();
        phase.found.is_some_and(|found| {
            let least = found.floor.max(rules.effect_min / 100.0);
            found.p <= rules.alpha
                && size(found.effect) > least
                && (after - before).abs() > rules.phase_min / 100.0 * whole_s
        })
    };
    let changed: Vec<&Quantity> = phases.iter().filter(is_changed).collect();
    let change_s = |phase: &&Quantity| phase.means().1 - phase.means().0;
    let net_s: f64 = changed.iter().map(change_s).sum();
    let finding = |phase: &&Quantity| {
        let (before, after) = phase.means();
        let (verdict, why) = match (after > before, net_s > rules.phase_min / 100.0 * whole_s) {
            (true, true) => (Verdict::Regression, ""),
            (true, false) => (Verdict::Changed, "; other phases save as much"),
            (false, _) => (Verdict::Improvement, ""),
        };
        let found = phase.found?;
        let part = 100.0 * change_s(phase) / whole_s;
        let note = format!("{part:+.1} % of the whole{why}; {}", certainty(&found));
        Some(Finding {
            baseline: Some(before),
            candidate: Some(after),
            change_percent: Some(100.0 * found.effect),
            ..Finding::without_numbers(case, &metric(&phase.name), verdict, note)
        })
    };
    changed.iter().filter_map(finding).collect()
}

/// The name of a phase's time in the report.
pub fn metric(phase: &str) -> String {
    if phase == OUTSIDE { format!("CPU time {phase}") } else { format!("CPU time in {phase}") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::comparison::{Comparison, Round};

    /// A quantity with a certain change of its time.
    fn quantity(name: &str, before: f64, after: f64) -> Quantity {
        let round = Round { a: before.ln(), a_again: before.ln(), b: after.ln() };
        let effect = after / before - 1.0;
        let found =
            Comparison { effect, p: 1e-5, floor: 0.01, visible: 0.02, low: effect, high: effect };
        Quantity { name: name.into(), rounds: vec![round; 4], found: Some(found) }
    }

    fn verdicts(phases: &[Quantity]) -> Vec<(String, Verdict)> {
        let whole = quantity("CPU time", 1.0, 1.01);
        let found = findings("c", &whole, phases, &TimeRules::default());
        found.into_iter().map(|finding| (finding.metric, finding.verdict)).collect()
    }

    #[test]
    fn the_guilty_phase_is_named() {
        let phases = [quantity("read", 0.3, 0.3), quantity("grade", 0.1, 0.11)];
        assert_eq!(verdicts(&phases), [("CPU time in grade".into(), Verdict::Regression)]);
        let after = [quantity(OUTSIDE, 0.01, 0.1)];
        assert_eq!(verdicts(&after), [(metric(OUTSIDE), Verdict::Regression)]);
    }

    #[test]
    fn work_that_moves_between_phases_is_no_regression() {
        let phases = [quantity("read", 0.3, 0.2), quantity("grade", 0.1, 0.2)];
        let expected = [
            ("CPU time in read".to_owned(), Verdict::Improvement),
            ("CPU time in grade".to_owned(), Verdict::Changed),
        ];
        assert_eq!(verdicts(&phases), expected);
    }

    #[test]
    fn a_change_that_hardly_matters_for_the_whole_is_ignored() {
        assert!(verdicts(&[quantity("read", 0.01, 0.014)]).is_empty());
    }
}
