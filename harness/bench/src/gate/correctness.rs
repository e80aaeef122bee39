//! The layer of correctness: `harness verify` on the candidate and the gate's cases. Where the candidate fails checks, it is
//! compared with the baseline: see [`super::known`].

use super::known::{Known, against, known};
use super::measures::Measures;
use super::report::{Finding, Layer, LayerName, Verdict};
use super::subject::Baseline;
use super::{Bench, GateError};
use run::engine::programs::Programs;
use run::engine::runner::Engine;
use run::verify::options::Options;
use run::verify::report::{CaseReport, Outcome, Report};
use run::verify::{VerifyError, verify};

/// Verifies the candidate serially on the cases of this layer: every check of what it promises.
/// Ranks, oracles and p4est are left to `harness verify`.
///
/// # Errors
/// If verification cannot start.
pub fn layer(
    bench: &Bench,
    baseline: &Baseline,
    measures: &mut Measures,
) -> Result<Layer, GateError> {
    let mut layer = Layer::new(LayerName::Correctness);
    let (mut cases, mut names) = (Vec::new(), Vec::new());
    for case in bench.cases_of(LayerName::Correctness) {
        if let Ok(path) = &case.path {
            cases.push(path.to_string_lossy().into_owned());
            names.push(case.rule.name.as_str());
        }
    }
    if cases.is_empty() {
        return Ok(layer);
    }
    let report = verified(bench, &bench.candidate, cases.clone())?;
    for ((case, path), name) in report.cases.iter().zip(cases).zip(names) {
        measures.case(name).findings = known(case);
        layer.findings.push(match case.failed() {
            false => finding(case),
            true => match findings_of(bench, baseline, name, path)? {
                Some(known) => against(case, &known),
                None => finding(case),
            },
        });
    }
    Ok(layer)
}

/// Returns the failed checks of the baseline; `None` without a baseline.
fn findings_of(
    bench: &Bench,
    baseline: &Baseline,
    name: &str,
    path: String,
) -> Result<Option<Known>, GateError> {
    Ok(match baseline {
        Baseline::None => None,
        Baseline::Record(_, record) => record.cases.get(name).map(|case| case.findings.clone()),
        Baseline::Program(subject) => {
            let report = verified(bench, &subject.engine, vec![path])?;
            report.cases.first().map(known)
        }
    })
}

/// Verifies a program.
fn verified(bench: &Bench, engine: &Engine, cases: Vec<String>) -> Result<Report, GateError> {
    let programs = Programs { engine: engine.clone(), ..bench.programs.clone() };
    // The files of a case that fails end with the gate.
    let out = Some(bench.place.join("correctness"));
    let options =
        Options { timeout: bench.options.limit.as_secs(), out, ..Options::of_leaves_alone(cases) };
    verify(&options, &programs).map_err(|error| match error {
        VerifyError::Input(why) => GateError::Input(why),
        VerifyError::Missing(why) => GateError::Missing(why),
    })
}

fn finding(case: &CaseReport) -> Finding {
    let tally = case.tally();
    let failure = case.checks.iter().find_map(|check| match &check.outcome {
        Outcome::Fail { why } => {
            let first = why.lines().next().unwrap_or_default();
            Some(format!("{}: {}: {first}", check.subject, check.name))
        }
        _ => None,
    });
    let failure = failure.or(case.input_error.clone());
    let left_out = case.checks.iter().find_map(|check| match &check.outcome {
        Outcome::LeftOut { why } => Some(why.clone()),
        _ => None,
    });
    let (verdict, note) = match failure {
        None if tally.pass == 0 => (Verdict::LeftOut, left_out.unwrap_or_default()),
        Some(why) => (Verdict::Regression, format!("{} checks fail, the first: {why}", tally.fail)),
        None => (Verdict::Unchanged, format!("{} checks hold", tally.pass)),
    };
    Finding::without_numbers(&case.name, "checks", verdict, note)
}
