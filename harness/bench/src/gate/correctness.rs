//! The layer of correctness: `harness verify` on the candidate and the gate's cases, serially and on the ranks of the rules.
//!
//! A mesher whose baseline fails checks passes if it fails none that the baseline holds, and none with more findings. A check that had
//! nothing to check is compared only if the baseline's had nothing either: what a mesh no longer states cannot be found wrong.

use super::Bench;
use super::measures::{LayerName, Numbers};
use super::report::{CHECKS, GateFinding, Layer, Verdict};
use super::rules::Selected;
use check::checks::CHECKS as CHECKS_OF_MESHES;
use contract::failure::Failure;
use run::engine::programs::Programs;
use run::engine::runner::Engine;
use run::verify::case::RUNS;
use run::verify::options::Options;
use run::verify::report::{CaseReport, Check, Outcome, Tally};
use run::verify::verify;
use std::collections::BTreeSet;

/// Verifies the candidate on the cases of this layer: every check of what it promises. Oracles and p4est are left to
/// `harness verify`.
///
/// # Errors
/// If verification cannot start.
pub fn layer(bench: &Bench, layer: &mut Layer) -> Result<(), Failure> {
    for case in bench.cases_of(LayerName::Correctness) {
        let report = verified(bench, &bench.candidate, case)?;
        let is_plain = report.checks.iter().all(|check| !check.failed() && !is_unchecked(check));
        let baseline = match &bench.baseline {
            // Nothing of it can be better.
            Some(_) if is_plain => Some(Known::default()),
            Some(subject) => Some(Known::of(&verified(bench, &subject.engine, case)?)),
            None => None,
        };
        layer.findings.extend(findings(&case.rule.name, &case.mpi, &report, baseline.as_ref()));
    }
    Ok(())
}

/// Verifies a program on a case.
fn verified(bench: &Bench, engine: &Engine, case: &Selected) -> Result<CaseReport, Failure> {
    let programs = Programs { engine: engine.clone(), ..bench.programs.clone() };
    let path = case.path.clone()?;
    let options = Options {
        timeout: bench.options.timeout,
        // The files of a case that fails end with the gate.
        out: Some(bench.place.join("correctness")),
        no_mpi: case.mpi.is_empty(),
        ranks: Some(case.mpi.clone()),
        // `harness verify` varies the partition.
        partitioners: vec!["morton".to_owned()],
        level_bases: vec!["auto".to_owned()],
        ..Options::of_leaves_alone(vec![path.to_string_lossy().into_owned()])
    };
    let report = verify(&options, &programs)?;
    let mut cases = report.cases.into_iter();
    cases.next().ok_or_else(|| Failure::input(format!("{} was not verified", case.rule.name)))
}

/// What is known of the checks of a program on a case.
#[derive(Default)]
struct Known {
    /// Number of findings by failed check.
    findings: Numbers,
    /// The checks of meshes that were left out; `None` without a mesh, when no check of it is known to have been possible.
    unchecked: Option<BTreeSet<String>>,
}

impl Known {
    fn of(case: &CaseReport) -> Self {
        let failed = case.checks.iter().filter(|check| check.failed());
        let unchecked = case.checks.iter().filter(|check| is_unchecked(check));
        let has_mesh = !case.checks.iter().any(|check| check.failed() && check.name == RUNS);
        Self {
            findings: failed.map(|check| (key(check), count(check))).collect(),
            unchecked: has_mesh.then(|| unchecked.map(key).collect()),
        }
    }
}

/// Whether a mesh gave this check nothing to check.
fn is_unchecked(check: &Check) -> bool {
    let is_of_mesh = CHECKS_OF_MESHES.iter().any(|of_mesh| of_mesh.name == check.name);
    is_of_mesh && matches!(check.outcome, Outcome::LeftOut { .. })
}

/// A finding for the serial mesh, and one for each number of ranks.
fn findings(
    case: &str,
    mpi: &[usize],
    report: &CaseReport,
    baseline: Option<&Known>,
) -> Vec<GateFinding> {
    if let Some(why) = &report.input_error {
        return vec![GateFinding::noted(case, CHECKS, Verdict::Regression, why)];
    }
    let of_ranks = |ranks: Option<usize>| {
        let checks: Vec<&Check> = report.checks.iter().filter(|c| c.ranks == ranks).collect();
        let metric = ranks.map_or(CHECKS.to_owned(), |ranks| format!("{ranks} MPI ranks/{CHECKS}"));
        finding(case, &metric, &checks, baseline)
    };
    std::iter::once(None).chain(mpi.iter().copied().map(Some)).map(of_ranks).collect()
}

fn finding(case: &str, metric: &str, checks: &[&Check], baseline: Option<&Known>) -> GateFinding {
    let Tally { pass, fail, .. } = checks.iter().copied().collect();
    let before = |check: &Check| {
        baseline.and_then(|known| known.findings.get(&key(check))).copied().unwrap_or(0)
    };
    let old: u64 = checks.iter().map(|check| before(check)).sum();
    let new: u64 = checks.iter().map(|check| count(check)).sum();
    let counts = format!("{fail} checks fail with {new} findings, {old} in the baseline");
    let without_mesh = checks.iter().find(|check| check.failed() && check.name == RUNS);
    let known = baseline.and_then(|known| known.unchecked.as_ref());
    let was_checked = |check: &&&Check| known.is_some_and(|known| !known.contains(&key(check)));
    let unchecked = checks.iter().filter(|check| is_unchecked(check)).find(was_checked);
    let worse = checks.iter().find(|check| count(check) > before(check));
    let (verdict, note) = match (worse, unchecked) {
        (Some(worse), _) => {
            let (check, why) = (key(worse), first_line(worse));
            let what = match baseline.is_none() {
                true => format!("{fail} checks fail with {new} findings: {check}: {why}"),
                false => format!("{counts}; worse than the baseline: {check}: {why}"),
            };
            (Verdict::Regression, what)
        }
        (None, _) if without_mesh.is_some() => {
            let why = without_mesh.map_or("", |check| first_line(check));
            let note = format!("neither program makes a mesh: {why}");
            return GateFinding::noted(case, metric, Verdict::Missing, note);
        }
        (None, Some(check)) => {
            let (key, why) = (key(check), first_line(check));
            let note =
                format!("the baseline's {key} is checked, and the candidate's is not: {why}");
            return GateFinding::noted(case, metric, Verdict::Missing, note);
        }
        (None, None) if new < old => (Verdict::Improvement, counts),
        (None, None) if fail > 0 => (Verdict::Unchanged, counts),
        (None, None) if pass > 0 => (Verdict::Unchanged, format!("{pass} checks hold")),
        (None, None) => {
            let why = checks.first().map_or("no check was run", |check| first_line(check));
            (Verdict::Missing, why.to_owned())
        }
    };
    let compared = (pass + fail) as u64;
    GateFinding { compared, ..GateFinding::noted(case, metric, verdict, note) }
}

fn key(check: &Check) -> String {
    format!("{}: {}", check.subject, check.name)
}

/// Why a check fails, or was left out.
fn first_line(check: &Check) -> &str {
    match &check.outcome {
        Outcome::Fail { why } | Outcome::LeftOut { why } => why.lines().next().unwrap_or_default(),
        _ => "",
    }
}

/// The number of findings of a check, at least 1 if it fails.
fn count(check: &Check) -> u64 {
    if check.failed() { check.findings.max(1) } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn case(failed: &[(&str, u64)]) -> CaseReport {
        let check = |&(name, findings): &(&str, u64)| Check {
            findings,
            ..Check::new("serial", name, Outcome::fail("here\nthere"))
        };
        let mut checks: Vec<Check> = failed.iter().map(check).collect();
        for name in ["layer", "spacing", "balance"] {
            if failed.iter().all(|(other, _)| *other != name) {
                checks.push(Check::new("serial", name, Outcome::held(1)));
            }
        }
        CaseReport { name: "c".into(), checks, ..CaseReport::default() }
    }

    fn against(case: &CaseReport, baseline: &Known) -> GateFinding {
        findings("c", &[], case, Some(baseline)).remove(0)
    }

    #[test]
    fn only_new_and_more_findings_are_a_regression() {
        let baseline = Known::of(&case(&[("layer", 7), ("spacing", 2)]));
        let of = |failed: &[(&str, u64)]| against(&case(failed), &baseline).verdict;
        assert_eq!(of(&[("layer", 7), ("spacing", 2)]), Verdict::Unchanged);
        assert_eq!(of(&[("layer", 6), ("spacing", 2)]), Verdict::Improvement);
        assert_eq!(of(&[("layer", 7)]), Verdict::Improvement);
        assert_eq!(of(&[("layer", 8), ("spacing", 1)]), Verdict::Regression);
        assert_eq!(of(&[("layer", 1), ("sides", 1)]), Verdict::Regression);
        let note = against(&case(&[("sides", 1)]), &baseline).note;
        assert!(note.contains("worse than the baseline: serial: sides: here"), "{note}");
    }

    #[test]
    fn a_check_that_the_baseline_has_and_the_candidate_leaves_out_is_missing() {
        let (all, mut without) = (case(&[]), case(&[]));
        without.checks[0].outcome = Outcome::left_out("the sides of the leaves are unknown");
        let missing = against(&without, &Known::of(&all));
        assert_eq!((missing.verdict, missing.compared), (Verdict::Missing, 0));
        assert!(missing.note.contains("serial: layer is checked"), "{}", missing.note);
        assert!(missing.note.ends_with("the sides of the leaves are unknown"), "{}", missing.note);
        let verdict = |known: &Known| against(&without, known).verdict;
        assert_eq!(verdict(&Known::of(&without)), Verdict::Unchanged);
        assert_eq!(verdict(&Known::default()), Verdict::Unchanged, "no mesh");
        assert_eq!(against(&all, &Known::of(&without)).verdict, Verdict::Unchanged);
    }

    #[test]
    fn two_programs_without_a_mesh_cannot_be_compared() {
        let baseline = Known::of(&case(&[(RUNS, 1)]));
        let finding = |known: &Known| against(&case(&[(RUNS, 1)]), known);
        let missing = finding(&baseline);
        assert_eq!((missing.verdict, missing.compared), (Verdict::Missing, 0));
        assert_eq!(finding(&Known::default()).verdict, Verdict::Regression);
    }
}
