//! The layer of correctness: `harness verify` on the candidate and the gate's cases, serially and on the ranks of the rules.
//!
//! A mesher whose baseline fails checks passes if it fails none that the baseline holds, and none with more findings.

use super::Bench;
use super::measures::{LayerName, Measures, Numbers};
use super::report::{CHECKS, GateFinding, Layer, Verdict};
use super::rules::Selected;
use super::subject::Baseline;
use contract::failure::Failure;
use run::engine::programs::Programs;
use run::engine::runner::Engine;
use run::verify::case::RUNS;
use run::verify::options::Options;
use run::verify::report::{CaseReport, Check, Outcome, Tally};
use run::verify::verify;

/// Verifies the candidate on the cases of this layer: every check of what it promises. Oracles and p4est are left to
/// `harness verify`.
///
/// # Errors
/// If verification cannot start.
pub fn layer(bench: &Bench, measures: &mut Measures, layer: &mut Layer) -> Result<(), Failure> {
    for case in bench.cases_of(LayerName::Correctness) {
        let name = &case.rule.name;
        let report = verified(bench, &bench.candidate, case)?;
        measures.case(name).findings = known(&report);
        let baseline = match &bench.baseline {
            _ if !report.failed() => None,
            Baseline::None => None,
            Baseline::Record(_, record) => record.cases.get(name).map(|case| case.findings.clone()),
            Baseline::Program(subject) => Some(known(&verified(bench, &subject.engine, case)?)),
        };
        let baseline = baseline.unwrap_or_default();
        layer.findings.extend(findings(name, &case.mpi, &report, &baseline));
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

/// A finding for the serial mesh, and one for each number of ranks. `baseline` has the findings of the baseline's failed checks.
fn findings(
    case: &str,
    mpi: &[usize],
    report: &CaseReport,
    baseline: &Numbers,
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

fn finding(case: &str, metric: &str, checks: &[&Check], baseline: &Numbers) -> GateFinding {
    let Tally { pass, fail, .. } = checks.iter().copied().collect();
    let before = |check: &Check| baseline.get(&key(check)).copied().unwrap_or(0);
    let old: u64 = checks.iter().map(|check| before(check)).sum();
    let new: u64 = checks.iter().map(|check| count(check)).sum();
    let counts = format!("{fail} checks fail with {new} findings, {old} in the baseline");
    let without_mesh = checks.iter().find(|check| check.failed() && check.name == RUNS);
    let left_out = checks.iter().find_map(|check| match &check.outcome {
        Outcome::LeftOut { why } => Some(why.clone()),
        _ => None,
    });
    let (verdict, note) = match checks.iter().find(|check| count(check) > before(check)) {
        Some(worse) => {
            let (check, why) = (key(worse), first_line(worse));
            (Verdict::Regression, format!("{counts}; worse than the baseline: {check}: {why}"))
        }
        None if without_mesh.is_some() => {
            let why = without_mesh.map_or("", |check| first_line(check));
            let note = format!("neither program makes a mesh: {why}");
            return GateFinding::noted(case, metric, Verdict::Missing, note);
        }
        None if new < old => (Verdict::Improvement, counts),
        None if fail > 0 => (Verdict::Unchanged, counts),
        None if pass > 0 => (Verdict::Unchanged, format!("{pass} checks hold")),
        None => (Verdict::Missing, left_out.unwrap_or("no check was run".to_owned())),
    };
    let compared = (pass + fail) as u64;
    GateFinding { compared, ..GateFinding::noted(case, metric, verdict, note) }
}

fn key(check: &Check) -> String {
    format!("{}: {}", check.subject, check.name)
}

/// Why a check fails.
fn first_line(check: &Check) -> &str {
    match &check.outcome {
        Outcome::Fail { why } => why.lines().next().unwrap_or_default(),
        _ => "",
    }
}

/// The number of findings of a check, at least 1 if it fails.
fn count(check: &Check) -> u64 {
    if check.failed() { check.findings.max(1) } else { 0 }
}

/// The number of findings of the failed checks of a case, by mesh and name of the check.
fn known(case: &CaseReport) -> Numbers {
    case.checks.iter().filter(|check| check.failed()).map(|c| (key(c), count(c))).collect()
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

    fn against(case: &CaseReport, baseline: &Numbers) -> GateFinding {
        findings("c", &[], case, baseline).remove(0)
    }

    #[test]
    fn only_new_and_more_findings_are_a_regression() {
        let baseline = known(&case(&[("layer", 7), ("spacing", 2)]));
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
    fn two_programs_without_a_mesh_cannot_be_compared() {
        let baseline = known(&case(&[(RUNS, 1)]));
        let finding = |known: &Numbers| against(&case(&[(RUNS, 1)]), known);
        let missing = finding(&baseline);
        assert_eq!((missing.verdict, missing.compared), (Verdict::Missing, 0));
        assert_eq!(finding(&Numbers::new()).verdict, Verdict::Regression);
    }
}
