//! A verification for programs: JSON, whose schema is documented in harness/doc/verify.md, and JUnit XML, a suite per case and a test per check. Checks that were left
//! out are skipped tests with a reason.

use crate::junit::{skipped, suite, test, to_text, unsuccessful};
use quick_junit::NonSuccessKind::{Error, Failure};
use quick_junit::{TestCase, TestCaseStatus};
use run::verify::report::{CaseReport, Check, Outcome, Report, Tally};
use std::time::Duration;

/// The report as JSON, ending in a line feed.
///
/// # Panics
/// If a reader would not find the same outcomes in it.
pub fn json(report: &Report) -> String {
    let text = crate::json::pretty(report);
    check_json(&text, report);
    text
}

fn check_json(text: &str, report: &Report) {
    let read: Report = serde_json::from_str(text).expect("the report is read as it was written");
    read.check_invariants();
    let of = |report: &Report| (report.tally(), report.exit_code());
    assert_eq!(of(&read), of(report), "outcomes in the JSON, and in the report");
}

/// The report as JUnit XML.
pub fn junit(report: &Report) -> String {
    let mut xml = quick_junit::Report::new("harness verify");
    xml.set_time(Duration::from_secs_f64(report.time_s));
    xml.add_test_suites(
        report.cases.iter().map(|case| suite(&case.name, case.time_s, tests(case))),
    );
    // A missing program that `--require` names fails the build, so it is an error here too.
    let required = report.missing.iter().filter(|missing| missing.required);
    let required: Vec<TestCase> =
        required.map(|one| test(&one.what, unsuccessful(Error, &one.why), "")).collect();
    if !required.is_empty() {
        xml.add_test_suite(suite("required", 0.0, required));
    }
    check_invariants(&xml, report);
    to_text(&xml)
}

/// Each check is a test, and so is each input that was refused and each requirement that is missing: these are errors.
fn check_invariants(xml: &quick_junit::Report, report: &Report) {
    let Tally { pass, fail, left_out } = report.tally();
    let refused = report.cases.iter().filter(|case| case.input_error.is_some()).count();
    let errors = refused + report.missing.iter().filter(|missing| missing.required).count();
    let expected = (pass + fail + left_out + errors, fail, errors);
    assert_eq!((xml.tests, xml.failures, xml.errors), expected, "tests, failures, errors of JUnit");
}

fn tests(case: &CaseReport) -> impl Iterator<Item = TestCase> {
    let refused = case.input_error.iter();
    let refused =
        refused.map(|error| test("the programs take the case", unsuccessful(Error, error), ""));
    let of_check = |check: &Check| {
        let ended = match &check.outcome {
            Outcome::Pass { .. } => TestCaseStatus::success(),
            Outcome::Fail { why } => unsuccessful(Failure, why),
            Outcome::LeftOut { why } => skipped(format!("left out: {why}")),
        };
        let name = format!("{}: {}", check.subject, check.name);
        let mut test = test(name, ended, &check.notes.join("\n"));
        test.set_time(Duration::from_secs_f64(check.time_s));
        test
    };
    case.checks.iter().map(of_check).chain(refused)
}

#[cfg(test)]
mod tests {
    use super::*;
    use run::testing::report as sample;

    #[test]
    fn reading_restores_the_report() {
        let text = json(&sample());
        let back: Report = serde_json::from_str(&text).unwrap();
        assert_eq!(json(&back), text);
    }

    #[test]
    #[should_panic(expected = "outcomes in the JSON")]
    fn an_outcome_that_changed_is_noticed() {
        let text = json(&sample()).replace("\"fail\"", "\"left_out\"");
        check_json(&text, &sample());
    }

    #[test]
    fn outcomes_are_named_and_have_reasons() {
        let value: serde_json::Value = serde_json::from_str(&json(&sample())).unwrap();
        let checks = value["cases"][0]["checks"].as_array().unwrap();
        let outcomes: Vec<_> =
            checks.iter().map(|check| check["outcome"].as_str().unwrap()).collect();
        assert_eq!(outcomes, ["pass", "pass", "fail", "left_out"]);
        assert_eq!(checks[3]["why"], "the engine is not built");
    }

    #[test]
    fn the_outermost_element_has_only_attributes_of_the_schema() {
        let text = junit(&sample());
        let outermost = text.lines().find(|line| line.starts_with("<testsuites")).unwrap();
        assert!(
            !outermost.contains("skipped") && outermost.contains("failures=\"1\""),
            "{outermost}"
        );
        assert!(
            text.lines().any(|line| line.contains("<testsuite ") && line.contains("skipped=\"1\"")),
            "{text}"
        );
    }

    #[test]
    #[should_panic(expected = "tests, failures, errors of JUnit")]
    fn a_test_that_is_missing_is_noticed() {
        let report = sample();
        check_invariants(&quick_junit::Report::new("harness verify"), &report);
    }

    #[test]
    fn a_reader_finds_the_counts_and_reasons() {
        let mut report = sample();
        report.missing[0].required = true;
        let back = quick_junit::Report::deserialize_from_str(&junit(&report)).unwrap();
        assert_eq!((back.tests, back.failures, back.errors), (5, 1, 1));
        let case = &back.test_suites[0];
        assert_eq!((case.name.as_str(), case.tests), ("cube_small", 4));
        let TestCaseStatus::Skipped { message, .. } = &case.test_cases[3].status else {
            panic!("a check that was left out must be skipped");
        };
        assert_eq!(message.as_ref().unwrap().as_str(), "left out: the engine is not built");
    }
}
