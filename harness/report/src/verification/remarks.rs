//! The lines below the table: failures, omissions and notes.

use bench::order::by_key;
use run::verify::case::PROOF;
use run::verify::report::{CaseReport, Check, Outcome, Report};

/// Missing programs, then failures, omissions and notes of each case, one line each.
pub fn remarks(report: &Report) -> Vec<String> {
    let missing = report.missing.iter();
    let mut lines: Vec<String> =
        missing.map(|m| format!("left out: {} because {}", m.what, m.why)).collect();
    for case in &report.cases {
        let name = &case.name;
        lines.extend(case.input_error.iter().map(|error| format!("input: {name}: {error}")));
        lines.extend(outcomes(case, report));
        let notes = case.checks.iter().flat_map(|c| c.notes.iter().map(move |note| (c, note)));
        let line = |(c, note): (&Check, &String)| {
            format!("note: {name}: {}: {}: {note}", c.subject, c.name)
        };
        lines.extend(notes.map(line));
        lines.extend(case.kept.iter().map(|place| format!("kept: {name}: {place}")));
        lines.extend(case.repeat_with.iter().map(|command| format!("repeat with: {command}")));
    }
    lines.extend(proofs(report));
    lines
}

/// What is proven of the meshes that the proven checker accepted, and what is only tested.
fn proofs(report: &Report) -> Option<String> {
    let accepted = |check: &&Check| check.subject == PROOF.0 && check.outcome.holds();
    let proofs: Vec<&Check> =
        report.cases.iter().filter_map(|case| case.checks.iter().find(accepted)).collect();
    let meaning = proofs.first()?.figures.as_deref().unwrap_or_default();
    Some(format!("proof: {} of {} cases: {meaning}", proofs.len(), report.cases.len()))
}

/// The checks of a case that did not pass. Those with the same reason share a line, because a fault with one layout of ranks
/// is often a fault with all.
fn outcomes(case: &CaseReport, report: &Report) -> Vec<String> {
    let groups = by_key(&case.checks, |check| (&check.name, &check.outcome));
    let lines = groups.into_iter().filter_map(|((name, outcome), checks)| {
        let subjects: Vec<&str> = checks.iter().map(|check| check.subject.as_str()).collect();
        let what = format!("{}: {}: {name}", case.name, subjects.join("; "));
        match outcome {
            Outcome::Pass { .. } => None,
            Outcome::Fail { why } => Some(format!("FAILED: {what}: {why}")),
            // The line about the missing program covers it.
            Outcome::LeftOut { why } if report.missing.iter().any(|one| one.why == *why) => None,
            Outcome::LeftOut { why } => Some(format!("left out: {what} because {why}")),
        }
    });
    lines.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use run::testing::report as sample;

    #[test]
    fn failures_omissions_and_notes_have_one_line_each() {
        let expected = [
            "left out: p4est because the engine is not built",
            "FAILED: cube_small: 4 ranks, metis, base auto: same leaves: first difference <at> root",
            "note: cube_small: serial: oracles: open3d was wrong at 1 point",
            "kept: cube_small: out/cube_small",
            "repeat with: harness verify cube_small --ranks 4",
        ];
        assert_eq!(remarks(&sample()), expected);
    }

    #[test]
    fn checks_that_fail_for_one_reason_share_a_line() {
        let mut report = sample();
        let again = Check { subject: "7 ranks".into(), ..report.cases[0].checks[2].clone() };
        report.cases[0].checks.push(again);
        let failed = "FAILED: cube_small: 4 ranks, metis, base auto; 7 ranks: same leaves: first difference <at> root";
        assert_eq!(remarks(&report)[1], failed);
    }
}
