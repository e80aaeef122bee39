//! The layer of correctness: `harness verify` on the candidate and the gate's cases.

use super::report::{Finding, Layer, LayerName, Verdict};
use super::{Bench, GateError};
use run::engine::programs::Programs;
use run::verify::options::Options;
use run::verify::report::{CaseReport, Outcome};
use run::verify::{VerifyError, verify};

/// Verifies the candidate serially on the cases of this layer: every check of what it promises.
/// Ranks, oracles and p4est are left to `harness verify`.
///
/// # Errors
/// If verification cannot start.
pub fn layer(bench: &Bench) -> Result<Layer, GateError> {
    let mut layer = Layer::new(LayerName::Correctness);
    let runnable =
        bench.cases_of(LayerName::Correctness).filter_map(|case| case.path.as_ref().ok());
    let cases: Vec<String> = runnable.map(|path| path.to_string_lossy().into_owned()).collect();
    if cases.is_empty() {
        return Ok(layer);
    }
    let programs = Programs { engine: bench.candidate.clone(), ..bench.programs.clone() };
    let options = Options { limit: bench.options.limit, ..Options::of_leaves_alone(cases) };
    let report = verify(&options, &programs).map_err(|error| match error {
        VerifyError::Input(why) => GateError::Input(why),
        VerifyError::Missing(why) => GateError::Missing(why),
    })?;
    layer.findings.extend(report.cases.iter().map(finding));
    Ok(layer)
}

fn finding(case: &CaseReport) -> Finding {
    let tally = case.tally();
    let failure = case.checks.iter().find_map(|check| match &check.outcome {
        Outcome::Fail(why) => {
            let first = why.lines().next().unwrap_or_default();
            Some(format!("{}: {}: {first}", check.subject, check.name))
        }
        _ => None,
    });
    let failure = failure.or(case.input_error.clone());
    let left_out = case.checks.iter().find_map(|check| match &check.outcome {
        Outcome::LeftOut(why) => Some(why.clone()),
        _ => None,
    });
    let (verdict, note) = match failure {
        None if tally.pass == 0 => (Verdict::LeftOut, left_out.unwrap_or_default()),
        Some(why) => (Verdict::Regression, format!("{} checks fail, the first: {why}", tally.fail)),
        None => (Verdict::Unchanged, format!("{} checks hold", tally.pass)),
    };
    Finding::without_numbers(&case.name, "checks", verdict, note)
}
