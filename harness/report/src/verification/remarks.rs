//! What a table cannot hold: everything that failed, was left out, or is worth a note, a line each.

use run::verify::report::{CaseReport, Check, Outcome, Report};

/// What is missing, then each case's failures, omissions and notes.
pub fn remarks(report: &Report) -> Vec<String> {
    let missing = report.missing.iter();
    let told = missing.map(|missing| format!("left out: {} because {}", missing.what, missing.why));
    let mut lines: Vec<String> = told.collect();
    for case in &report.cases {
        let name = &case.name;
        lines.extend(case.input_error.iter().map(|error| format!("input: {name}: {error}")));
        lines.extend(outcomes(case, report));
        let noted = |check: &Check| {
            let (subject, check, notes) = (check.subject.clone(), check.name.clone(), &check.notes);
            let told = move |note| format!("note: {name}: {subject}: {check}: {note}");
            notes.iter().map(told).collect::<Vec<_>>()
        };
        lines.extend(case.checks.iter().flat_map(noted));
        lines.extend(case.kept.iter().map(|place| format!("kept: {name}: {place}")));
        lines.extend(case.repeat_with.iter().map(|command| format!("repeat with: {command}")));
    }
    lines
}

/// A case's checks that did not pass; those with one reason are told together, since what is wrong with
/// one layout of ranks is often wrong with all.
fn outcomes(case: &CaseReport, report: &Report) -> Vec<String> {
    let mut groups: Vec<(&Check, Vec<&str>)> = Vec::new();
    for check in &case.checks {
        let same = |(other, _): &&mut (&Check, Vec<&str>)| {
            other.name == check.name && other.outcome == check.outcome
        };
        match groups.iter_mut().find(same) {
            Some((_, subjects)) => subjects.push(&check.subject),
            None => groups.push((check, vec![&check.subject])),
        }
    }
    let told = groups.into_iter().filter_map(|(check, subjects)| {
        let what = format!("{}: {}: {}", case.name, subjects.join("; "), check.name);
        match &check.outcome {
            Outcome::Pass => None,
            Outcome::Fail(why) => Some(format!("FAILED: {what}: {why}")),
            // What is missing everywhere has been said once.
            Outcome::LeftOut(why) if report.missing.iter().any(|one| one.why == *why) => None,
            Outcome::LeftOut(why) => Some(format!("left out: {what} because {why}")),
        }
    });
    told.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use run::testing::report as sample;

    #[test]
    fn failures_omissions_and_notes_are_all_there_once() {
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
    fn one_reason_is_told_once() {
        let mut report = sample();
        let again = Check { subject: "7 ranks".into(), ..report.cases[0].checks[1].clone() };
        report.cases[0].checks.push(again);
        let failed = "FAILED: cube_small: 4 ranks, metis, base auto; 7 ranks: same leaves: first difference <at> root";
        assert_eq!(remarks(&report)[1], failed);
    }
}
