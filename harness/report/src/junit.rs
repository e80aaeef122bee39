//! JUnit XML as all reports have it.

use quick_junit::{NonSuccessKind, Report, TestCase, TestCaseStatus, TestSuite};
use std::time::Duration;

/// A test, with a text that is shown with it unless it is empty.
pub fn test(name: impl Into<String>, status: TestCaseStatus, output: &str) -> TestCase {
    let mut test = TestCase::new(name.into(), status);
    if !output.is_empty() {
        test.set_system_out(output);
    }
    test
}

/// What was not run, with the reason.
pub fn skipped(why: String) -> TestCaseStatus {
    let mut status = TestCaseStatus::skipped();
    status.set_message(why);
    status
}

/// What does not hold, or could not be run. The first line of the reason is the message.
pub fn unsuccessful(kind: NonSuccessKind, why: &str) -> TestCaseStatus {
    let mut status = TestCaseStatus::non_success(kind);
    status.set_message(why.lines().next().unwrap_or_default()).set_description(why);
    status
}

/// A suite of tests that took so long together.
pub fn suite(name: &str, time_s: f64, tests: impl IntoIterator<Item = TestCase>) -> TestSuite {
    let mut suite = TestSuite::new(name);
    suite.set_time(Duration::from_secs_f64(time_s));
    suite.add_test_cases(tests);
    suite
}

/// JUnit XML as text, valid by the schema of Jenkins' xUnit plugin (junit-10.xsd), which does not allow `skipped` on the
/// outermost element.
pub fn to_text(report: &Report) -> String {
    let text = report.to_string().expect("a report is representable in XML");
    // The outermost element is the first that has it.
    text.replacen(&format!(" skipped=\"{}\"", report.skipped), "", 1)
}
