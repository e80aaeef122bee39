//! Known findings: a mesher whose baseline fails checks passes if it fails none that the baseline holds, and none with more
//! findings.

use super::report::{CHECKS, GateFinding, Verdict};
use run::verify::case::RUNS;
use run::verify::report::{CaseReport, Check, Outcome};
use std::collections::BTreeMap;

/// The failed checks of a case: number of findings by mesh and name of the check.
pub type Known = BTreeMap<String, u64>;

fn key(check: &Check) -> String {
    format!("{}: {}", check.subject, check.name)
}

/// Returns the failed checks of a case.
pub fn known(case: &CaseReport) -> Known {
    let failed = case.checks.iter().filter(|check| check.failed());
    failed.map(|check| (key(check), check.counts.get("findings").copied().unwrap_or(1))).collect()
}

/// Compares a case that fails checks with the failed checks of the baseline.
pub fn against(name: &str, case: &CaseReport, baseline: &Known) -> GateFinding {
    let candidate = known(case);
    let is_worse = |check: &&Check| {
        check.failed() && baseline.get(&key(check)).is_none_or(|old| candidate[&key(check)] > *old)
    };
    let first = |check: &Check| match &check.outcome {
        Outcome::Fail { why } => why.lines().next().unwrap_or_default().to_owned(),
        _ => String::new(),
    };
    let total = |known: &Known| known.values().sum::<u64>();
    let counts = format!(
        "{} checks fail with {} findings, in the baseline {} with {}",
        candidate.len(),
        total(&candidate),
        baseline.len(),
        total(baseline)
    );
    let without_mesh = case.checks.iter().find(|check| check.failed() && check.name == RUNS);
    let (verdict, note) = match (case.checks.iter().find(is_worse), without_mesh) {
        (Some(worse), _) => {
            let (check, why) = (key(worse), first(worse));
            (Verdict::Regression, format!("{counts}; worse than the baseline: {check}: {why}"))
        }
        (None, Some(check)) => {
            let note = format!("neither program makes a mesh: {}", first(check));
            return GateFinding::noted(name, CHECKS, Verdict::Missing, note);
        }
        (None, None) if candidate == *baseline => (Verdict::Unchanged, counts),
        (None, None) => (Verdict::Improvement, counts),
    };
    let numbers = [total(baseline), total(&candidate)].map(|count| count as f64);
    GateFinding::of_values(name, CHECKS, verdict, numbers, note)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn case(failed: &[(&str, u64)]) -> CaseReport {
        let check = |(name, findings): &(&str, u64)| {
            let counts = [("findings".to_owned(), *findings)].into();
            Check { counts, ..Check::new("serial", *name, Outcome::fail("here\nthere")) }
        };
        let mut checks: Vec<Check> = failed.iter().map(check).collect();
        checks.push(Check::new("serial", "balance", Outcome::held(1)));
        CaseReport { name: "c".into(), checks, ..CaseReport::default() }
    }

    #[test]
    fn only_new_and_more_findings_are_a_regression() {
        let baseline = known(&case(&[("layer", 7), ("spacing", 2)]));
        let of = |failed: &[(&str, u64)]| against("c", &case(failed), &baseline).verdict;
        assert_eq!(of(&[("layer", 7), ("spacing", 2)]), Verdict::Unchanged);
        assert_eq!(of(&[("layer", 6), ("spacing", 2)]), Verdict::Improvement);
        assert_eq!(of(&[("layer", 7)]), Verdict::Improvement);
        assert_eq!(of(&[("layer", 8), ("spacing", 1)]), Verdict::Regression);
        assert_eq!(of(&[("layer", 1), ("sides", 1)]), Verdict::Regression);
        let note = against("c", &case(&[("sides", 1)]), &baseline).note;
        assert!(note.contains("worse than the baseline: serial: sides: here"), "{note}");
    }

    #[test]
    fn two_programs_without_a_mesh_cannot_be_compared() {
        let baseline = known(&case(&[(RUNS, 1)]));
        let finding = |known: &Known| against("c", &case(&[(RUNS, 1)]), known);
        let missing = finding(&baseline);
        assert_eq!((missing.verdict, missing.compared), (Verdict::Missing, 0));
        assert_eq!(finding(&Known::new()).verdict, Verdict::Regression);
    }
}
