//! The report of a verification: a table with a line for the serial run of each case and one per rank count, and remarks, as text and as Markdown;
//! and for programs as JUnit XML, a suite per case and a test per check. Checks that were left out are skipped tests with a reason. The JSON is the report itself, whose
//! schema is documented in harness/doc/verify.md.

use crate::junit::{skipped, suite, test, to_text, unsuccessful};
use crate::table::{Table, escaped};
use bench::order::by_key;
use quick_junit::NonSuccessKind::{Error, Failure};
use quick_junit::{TestCase, TestCaseStatus};
use run::verify::case::PROOF;
use run::verify::report::{CaseReport, Check, Outcome, Report, Run, Tally};
use std::collections::BTreeSet;
use std::time::Duration;

/// The report as plain text.
pub fn table(report: &Report) -> String {
    let notes = remarks(report).into_iter().chain([report.verdict()]).collect();
    Table { notes, ..table_of(report) }.text()
}

/// The report as Markdown, for the summary page of a CI system and for the report of the demo.
pub fn markdown(report: &Report) -> String {
    let (verdict, table) = (report.verdict(), table_of(report).markdown());
    let remarks = remarks(report).into_iter().map(|remark| format!("- {}\n", escaped(&remark)));
    format!("## harness verify\n\n{verdict}\n\n{table}\n{}", remarks.collect::<String>())
}

fn table_of(report: &Report) -> Table {
    let columns = "case,facets,base,cells,ranks,hold,fail,left\nout,time\ns,M\ncells/s,B/cell";
    let rows: Vec<Vec<String>> = report.cases.iter().flat_map(rows_of).collect();
    check_rows(&rows, report);
    Table { columns: columns.split(',').collect(), rows, ..Table::default() }
}

/// The rows of one case, each with one field per column.
fn rows_of(case: &CaseReport) -> Vec<Vec<String>> {
    // The rank counts on which anything was run.
    let run = case.checks.iter().filter(|c| !matches!(c.outcome, Outcome::LeftOut { .. }));
    let counts: BTreeSet<usize> = run.filter_map(|check| check.ranks).collect();
    let sizes = [case.facets, case.leaves_base, case.cells].map(|size| size.to_string());
    let of_case = [vec![case.name.clone()], sizes.to_vec()].concat();
    let row_of = |ranks: Option<usize>| {
        let is_of = |run: &&Run| {
            let layout = run.layout.as_ref();
            run.program == "mesher" && layout.map(|layout| layout.ranks.count()) == ranks
        };
        // All layouts give the same mesh; the table has the time of the fastest.
        let runs = case.runs.iter().filter(is_of);
        let fastest = runs.min_by(|a, b| a.time_wall_s.total_cmp(&b.time_wall_s));
        let is_in = |check: &&Check| check.ranks.filter(|n| counts.contains(n)) == ranks;
        let checks = Tally::of(case.checks.iter().filter(is_in));
        let label = ranks.map_or("serial".to_owned(), |ranks| ranks.to_string());
        let head = ranks.map_or(of_case.clone(), |_| vec![String::new(); 4]);
        [head, vec![label], numbers(checks, fastest)].concat()
    };
    [None].into_iter().chain(counts.iter().copied().map(Some)).map(row_of).collect()
}

/// Each check is in one row.
fn check_rows(rows: &[Vec<String>], report: &Report) {
    let sum = |column: usize| rows.iter().map(|of| of[column].parse::<usize>().unwrap_or(0)).sum();
    let shown = Tally { pass: sum(5), fail: sum(6), left_out: sum(7) };
    assert_eq!(shown, report.tally(), "checks in the rows of the table, and in the report");
}

/// The counts of a row's checks, and time, rate and memory of its run.
fn numbers(Tally { pass, fail, left_out }: Tally, run: Option<&Run>) -> Vec<String> {
    let measured = run.map(|run| {
        let cells = run.cells as f64;
        let time_s = run.is_time_reported.then(|| format!("{:.3}", run.time_wall_s));
        let memory = run.peak_rss_bytes.filter(|_| run.cells > 0);
        let memory = memory.map(|peak| format!("{:.1}", peak as f64 / cells));
        let rate = Some(format!("{:.3}", cells / run.time_wall_s.max(1e-9) / 1e6));
        [time_s, rate, memory].map(|number| number.unwrap_or("-".to_owned()))
    });
    let counts = [pass, fail, left_out].map(|n| n.to_string());
    [counts, measured.unwrap_or(["-"; 3].map(str::to_owned))].concat()
}

/// Missing programs, then failures, omissions and notes of each case, one line each.
fn remarks(report: &Report) -> Vec<String> {
    let missing = report.missing.iter().map(|m| format!("left out: {} because {}", m.what, m.why));
    let mut lines: Vec<String> = missing.collect();
    for case in &report.cases {
        let name = &case.name;
        lines.extend(case.input_error.iter().map(|error| format!("input: {name}: {error}")));
        lines.extend(outcomes(case, report));
        for check in &case.checks {
            let of = format!("note: {name}: {}: {}", check.subject, check.name);
            lines.extend(check.notes.iter().map(|note| format!("{of}: {note}")));
        }
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

/// The report as JUnit XML.
pub fn junit(report: &Report) -> String {
    let mut xml = quick_junit::Report::new("harness verify");
    xml.set_time(Duration::from_secs_f64(report.time_s));
    let of_case = |case: &CaseReport| suite(&case.name, case.time_s, tests(case));
    xml.add_test_suites(report.cases.iter().map(of_case));
    // A missing program that `--require` names fails the build, so it is an error here too.
    let required = report.missing.iter().filter(|missing| missing.required);
    let required = required.map(|one| (&*one.what, &*one.why));
    let required = required.chain(report.interrupted.then_some(("all cases", "interrupted")));
    let required = required.map(|(what, why)| test(what, unsuccessful(Error, why), ""));
    xml.add_test_suites(Some(suite("required", 0.0, required)).filter(|suite| suite.tests > 0));
    check_junit(&xml, report);
    to_text(&xml)
}

/// Each check is a test, and so is each input that was refused and each requirement that is missing, and an interrupt: these are errors.
fn check_junit(xml: &quick_junit::Report, report: &Report) {
    let Tally { pass, fail, left_out } = report.tally();
    let refused = report.cases.iter().filter(|case| case.input_error.is_some()).count();
    let errors = usize::from(report.interrupted)
        + refused
        + report.missing.iter().filter(|missing| missing.required).count();
    let expected = (pass + fail + left_out + errors, fail, errors);
    assert_eq!((xml.tests, xml.failures, xml.errors), expected, "tests, failures, errors of JUnit");
}

fn tests(case: &CaseReport) -> impl Iterator<Item = TestCase> {
    let refused = |why: &String| test("the programs take the case", unsuccessful(Error, why), "");
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
    case.checks.iter().map(of_check).chain(case.input_error.iter().map(refused))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pretty;
    use run::testing::report as sample;

    #[test]
    fn an_interrupt_is_an_error_of_junit() {
        let mut report = sample();
        let errors = |report: &Report| {
            quick_junit::Report::deserialize_from_str(&junit(report)).unwrap().errors
        };
        let before = errors(&report);
        report.interrupted = true;
        assert_eq!(errors(&report), before + 1);
    }

    #[test]
    fn the_serial_run_and_every_rank_count_have_a_line() {
        let text = table(&sample());
        let lines: Vec<Vec<&str>> =
            text.lines().map(|line| line.split_whitespace().collect()).collect();
        assert_eq!(
            lines[2],
            ["cube_small", "12", "5000", "7600", "serial", "1", "0", "1", "0.100", "0.076", "10.0"]
        );
        assert_eq!(lines[3], ["4", "1", "1", "0", "0.050", "0.152", "10.0"]);
        let mut unknown = sample();
        unknown.cases[0].runs[0].peak_rss_bytes = None;
        assert!(table(&unknown).contains("0.076       -\n"), "{}", table(&unknown));
        assert!(pretty(&unknown).contains("\"peak_rss_bytes\": null"), "{}", pretty(&unknown));
    }

    #[test]
    #[should_panic(expected = "checks in the rows of the table")]
    fn a_row_that_is_missing_is_noticed() {
        let report = sample();
        let rows: Vec<Vec<String>> = report.cases.iter().flat_map(rows_of).collect();
        check_rows(&rows[1..], &report);
    }

    #[test]
    fn the_verdict_comes_last() {
        let verdict = "cases: 1; checks: 2 hold, 1 fail, 1 left out; 2.0 s: FAILED\n";
        assert!(table(&sample()).ends_with(verdict));
    }

    #[test]
    fn every_row_has_every_column() {
        let text = markdown(&sample());
        let rows: Vec<&str> = text.lines().filter(|line| line.starts_with('|')).collect();
        assert_eq!(rows.len(), 4);
        assert!(rows.iter().all(|row| row.matches(" |").count() == 11), "{text}");
    }

    #[test]
    fn text_of_a_failure_cannot_become_markup() {
        let text = markdown(&sample());
        assert!(text.contains("first difference &lt;at&gt; root"), "{text}");
        assert!(text.contains("cube\\_small"), "{text}");
    }

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

    #[test]
    fn reading_restores_the_report() {
        let text = pretty(&sample());
        let back: Report = serde_json::from_str(&text).unwrap();
        assert_eq!(pretty(&back), text);
        let outcomes = |report: &Report| (report.tally(), report.exit_code());
        assert_eq!(outcomes(&back), outcomes(&sample()));
    }

    #[test]
    fn outcomes_are_named_and_have_reasons() {
        let value: serde_json::Value = serde_json::from_str(&pretty(&sample())).unwrap();
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
        check_junit(&quick_junit::Report::new("harness verify"), &report);
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
