//! The layer of correctness: `harness verify` on the candidate and the gate's cases, serially and on the ranks of the rules.
//!
//! A mesher whose baseline fails checks passes if it fails none that the baseline holds, and none with more findings.

use super::measures::{LayerName, Measures, Numbers};
use super::report::{CHECKS, GateFinding, Layer, Verdict};
use super::rules::Selected;
use super::subject::Baseline;
use super::{Bench, GateError};
use run::engine::programs::Programs;
use run::engine::runner::Engine;
use run::verify::case::RUNS;
use run::verify::options::Options;
use run::verify::report::{CaseReport, Check, Outcome, Tally};
use run::verify::{VerifyError, verify};

/// Verifies the candidate on the cases of this layer: every check of what it promises. Oracles and p4est are left to
/// `harness verify`.
///
/// # Errors
/// If verification cannot start.
pub fn layer(bench: &Bench, measures: &mut Measures, layer: &mut Layer) -> Result<(), GateError> {
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
        match baseline {
            Some(baseline) => layer.findings.push(against(name, &report, &baseline)),
            None => layer.findings.extend(findings(case, &report)),
        }
    }
    Ok(())
}

/// Verifies a program on a case.
fn verified(bench: &Bench, engine: &Engine, case: &Selected) -> Result<CaseReport, GateError> {
    let programs = Programs { engine: engine.clone(), ..bench.programs.clone() };
    let path = case.path.clone().map_err(GateError::Input)?;
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
    let report = verify(&options, &programs).map_err(|error| match error {
        VerifyError::Input(why) => GateError::Input(why),
        VerifyError::Missing(why) => GateError::Missing(why),
    })?;
    let mut cases = report.cases.into_iter();
    cases.next().ok_or_else(|| GateError::Input(format!("{} was not verified", case.rule.name)))
}

/// A finding for the serial mesh, and one for each number of ranks.
fn findings(case: &Selected, report: &CaseReport) -> Vec<GateFinding> {
    let name = &case.rule.name;
    if let Some(why) = &report.input_error {
        return vec![GateFinding::noted(name, CHECKS, Verdict::Regression, why)];
    }
    let of_ranks = |ranks: Option<usize>| {
        let checks: Vec<&Check> = report.checks.iter().filter(|c| c.ranks == ranks).collect();
        let metric = ranks.map_or(CHECKS.to_owned(), |ranks| format!("{ranks} MPI ranks/{CHECKS}"));
        finding(name, &metric, &checks)
    };
    std::iter::once(None).chain(case.mpi.iter().copied().map(Some)).map(of_ranks).collect()
}

fn finding(case: &str, metric: &str, checks: &[&Check]) -> GateFinding {
    let Tally { pass, fail, .. } = checks.iter().copied().collect();
    let failure = checks.iter().find(|check| check.failed());
    let left_out = checks.iter().find_map(|check| match &check.outcome {
        Outcome::LeftOut { why } => Some(why.clone()),
        _ => None,
    });
    let (verdict, note) = match failure {
        None if pass == 0 => (Verdict::Missing, left_out.unwrap_or("no check was run".to_owned())),
        Some(check) => {
            let (name, why) = (key(check), first_line(check));
            (Verdict::Regression, format!("{fail} checks fail, the first: {name}: {why}"))
        }
        None => (Verdict::Unchanged, format!("{pass} checks hold")),
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

/// The number of findings of the failed checks of a case, by mesh and name of the check.
fn known(case: &CaseReport) -> Numbers {
    let failed = case.checks.iter().filter(|check| check.failed());
    failed.map(|check| (key(check), check.counts.get("findings").copied().unwrap_or(1))).collect()
}

/// Compares a case that fails checks with the failed checks of the baseline.
fn against(name: &str, case: &CaseReport, baseline: &Numbers) -> GateFinding {
    let candidate = known(case);
    let is_worse = |check: &&Check| {
        check.failed() && baseline.get(&key(check)).is_none_or(|old| candidate[&key(check)] > *old)
    };
    let [old, new] = [baseline, &candidate].map(|known| (known.len(), known.values().sum::<u64>()));
    let counts = format!(
        "{} checks fail with {} findings, in the baseline {} with {}",
        new.0, new.1, old.0, old.1
    );
    let without_mesh = case.checks.iter().find(|check| check.failed() && check.name == RUNS);
    let (verdict, note) = match (case.checks.iter().find(is_worse), without_mesh) {
        (Some(worse), _) => {
            let (check, why) = (key(worse), first_line(worse));
            (Verdict::Regression, format!("{counts}; worse than the baseline: {check}: {why}"))
        }
        (None, Some(check)) => {
            let note = format!("neither program makes a mesh: {}", first_line(check));
            return GateFinding::noted(name, CHECKS, Verdict::Missing, note);
        }
        (None, None) if candidate == *baseline => (Verdict::Unchanged, counts),
        (None, None) => (Verdict::Improvement, counts),
    };
    GateFinding::of_values(name, CHECKS, verdict, [old.1 as f64, new.1 as f64], note)
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
        let finding = |known: &Numbers| against("c", &case(&[(RUNS, 1)]), known);
        let missing = finding(&baseline);
        assert_eq!((missing.verdict, missing.compared), (Verdict::Missing, 0));
        assert_eq!(finding(&Numbers::new()).verdict, Verdict::Regression);
    }
}
