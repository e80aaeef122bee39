//! A verification as JUnit XML: a suite per case, a test per check. Checks that were left out are skipped tests with a
//! reason.

use quick_junit::{NonSuccessKind, TestCase, TestCaseStatus, TestSuite};
use run::verify::report::{CaseReport, Check, Outcome, Report, Tally};
use std::time::Duration;

/// The report as JUnit XML.
pub fn junit(report: &Report) -> String {
    let mut xml = quick_junit::Report::new("harness verify");
    xml.set_time(Duration::from_secs_f64(report.time_s));
    xml.add_test_suites(report.cases.iter().map(suite));
    if report.missing.iter().any(|missing| missing.required) {
        xml.add_test_suite(requirements(report));
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

/// JUnit XML as text, valid by the schema of Jenkins' xUnit plugin (junit-10.xsd), which does not allow `skipped` on the
/// outermost element.
pub fn to_text(report: &quick_junit::Report) -> String {
    let text = report.to_string().expect("a report is representable in XML");
    let Some((start, end)) = text.find("<testsuites").and_then(|from| {
        let until = from + text[from..].find('>')?;
        let skipped = from + text[from..until].find(" skipped=\"")?;
        let value = skipped + " skipped=\"".len();
        Some((skipped, value + text[value..until].find('"')? + 1))
    }) else {
        return text;
    };
    format!("{}{}", &text[..start], &text[end..])
}

fn suite(case: &CaseReport) -> TestSuite {
    let mut suite = TestSuite::new(case.name.as_str());
    suite.set_time(Duration::from_secs_f64(case.time_s));
    suite.add_test_cases(case.checks.iter().map(test));
    if let Some(error) = &case.input_error {
        let mut status = TestCaseStatus::non_success(NonSuccessKind::Error);
        status.set_message(error.as_str());
        suite.add_test_case(TestCase::new("the programs take the case", status));
    }
    suite
}

fn test(check: &Check) -> TestCase {
    let status = match &check.outcome {
        Outcome::Pass { .. } => TestCaseStatus::success(),
        Outcome::Fail { why } => {
            let mut status = TestCaseStatus::non_success(NonSuccessKind::Failure);
            status
                .set_message(why.lines().next().unwrap_or_default())
                .set_description(why.as_str());
            status
        }
        Outcome::LeftOut { why } => {
            let mut status = TestCaseStatus::skipped();
            status.set_message(format!("left out: {why}"));
            status
        }
    };
    let mut test = TestCase::new(format!("{}: {}", check.subject, check.name), status);
    test.set_time(Duration::from_secs_f64(check.time_s));
    if !check.notes.is_empty() {
        test.set_system_out(check.notes.join("\n"));
    }
    test
}

/// A missing program that `--require` names fails the build, so it is an error here too.
fn requirements(report: &Report) -> TestSuite {
    let mut suite = TestSuite::new("required");
    for missing in report.missing.iter().filter(|missing| missing.required) {
        let mut status = TestCaseStatus::non_success(NonSuccessKind::Error);
        status.set_message(missing.why.as_str());
        suite.add_test_case(TestCase::new(missing.what.as_str(), status));
    }
    suite
}

#[cfg(test)]
mod tests {
    use super::*;
    use run::testing::report as sample;

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
