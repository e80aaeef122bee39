//! The layer of correctness: `harness verify` on the candidate and the gate's cases, serially and on the ranks of the rules. Where the
//! candidate fails checks, it is compared with the baseline: see [`super::known`].

use super::known::{Known, against, known};
use super::measures::Measures;
use super::report::{CHECKS, GateFinding, Layer, LayerName, Verdict};
use super::rules::Selected;
use super::subject::Baseline;
use super::{Bench, GateError};
use run::engine::interrupt;
use run::engine::programs::Programs;
use run::engine::runner::Engine;
use run::verify::options::Options;
use run::verify::report::{CaseReport, Check, Outcome, Tally};
use run::verify::{VerifyError, verify};

/// Verifies the candidate on the cases of this layer: every check of what it promises. Oracles and p4est are left to
/// `harness verify`.
///
/// # Errors
/// If verification cannot start.
pub fn layer(
    bench: &Bench,
    baseline: &Baseline,
    measures: &mut Measures,
    layer: &mut Layer,
) -> Result<(), GateError> {
    for case in bench.cases_of(LayerName::Correctness) {
        if interrupt::requested() {
            break;
        }
        let name = &case.rule.name;
        let report = verified(bench, &bench.candidate, case)?;
        measures.case(name).findings = known(&report);
        let known = match report.failed() {
            true => findings_of(bench, baseline, case)?,
            false => None,
        };
        match known {
            Some(known) => layer.findings.push(against(name, &report, &known)),
            None => layer.findings.extend(findings(bench, case, &report)),
        }
        layer.findings.extend(bench.ranks_left_out(case));
    }
    Ok(())
}

/// Returns the failed checks of the baseline; `None` without a baseline.
fn findings_of(
    bench: &Bench,
    baseline: &Baseline,
    case: &Selected,
) -> Result<Option<Known>, GateError> {
    Ok(match baseline {
        Baseline::None => None,
        Baseline::Record(_, record) => {
            record.cases.get(&case.rule.name).map(|case| case.findings.clone())
        }
        Baseline::Program(subject) => Some(known(&verified(bench, &subject.engine, case)?)),
    })
}

/// Verifies a program on a case.
fn verified(bench: &Bench, engine: &Engine, case: &Selected) -> Result<CaseReport, GateError> {
    let programs = Programs { engine: engine.clone(), ..bench.programs.clone() };
    let path = case.path.clone().map_err(GateError::Input)?;
    let ranks = bench.ranks_on_mpi(case);
    let options = Options {
        timeout: bench.options.timeout,
        // The files of a case that fails end with the gate.
        out: Some(bench.place.join("correctness")),
        no_mpi: ranks.is_empty(),
        ranks: Some(ranks),
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
fn findings(bench: &Bench, case: &Selected, report: &CaseReport) -> Vec<GateFinding> {
    let name = &case.rule.name;
    if let Some(why) = &report.input_error {
        return vec![GateFinding::noted(name, CHECKS, Verdict::Regression, why)];
    }
    let ranks = std::iter::once(None).chain(bench.ranks_on_mpi(case).into_iter().map(Some));
    let of_ranks = |ranks: Option<usize>| {
        let checks: Vec<&Check> =
            report.checks.iter().filter(|check| check.ranks == ranks).collect();
        let metric = ranks.map_or(CHECKS.to_owned(), |ranks| format!("{ranks} MPI ranks/{CHECKS}"));
        finding(name, &metric, &checks)
    };
    ranks.map(of_ranks).collect()
}

fn finding(case: &str, metric: &str, checks: &[&Check]) -> GateFinding {
    let tally: Tally = checks.iter().copied().collect();
    let failure = checks.iter().find_map(|check| match &check.outcome {
        Outcome::Fail { why } => {
            let first = why.lines().next().unwrap_or_default();
            Some(format!("{}: {}: {first}", check.subject, check.name))
        }
        _ => None,
    });
    let left_out = checks.iter().find_map(|check| match &check.outcome {
        Outcome::LeftOut { why } => Some(why.clone()),
        _ => None,
    });
    let compared = (tally.pass + tally.fail) as u64;
    let (verdict, note) = match failure {
        None if compared == 0 => {
            (Verdict::Missing, left_out.unwrap_or_else(|| "no check was run".to_owned()))
        }
        Some(why) => (Verdict::Regression, format!("{} checks fail, the first: {why}", tally.fail)),
        None => (Verdict::Unchanged, format!("{} checks hold", tally.pass)),
    };
    GateFinding { compared, ..GateFinding::noted(case, metric, verdict, note) }
}
