//! The report of a verification: a table with a line for the serial run of each case and one per rank count, and remarks, as text and as Markdown;
//! JUnit XML and JSON in [`machine`].

pub mod machine;

use crate::table::{Table, escaped};
use bench::order::by_key;
use run::verify::case::PROOF;
use run::verify::report::{CaseReport, Check, Outcome, Report, Run, Tally};

/// The report as plain text.
pub fn table(report: &Report) -> String {
    let notes = remarks(report).into_iter().chain([report.verdict()]).collect();
    Table { notes, ..table_of(report) }.text()
}

/// The report as Markdown, for the summary page of a CI system and for the report of the demo.
pub fn markdown(report: &Report) -> String {
    let mut text = format!("## harness verify\n\n{}\n\n", report.verdict());
    text += &table_of(report).markdown();
    text.push('\n');
    text.extend(remarks(report).iter().map(|remark| format!("- {}\n", escaped(remark))));
    text
}

fn table_of(report: &Report) -> Table {
    let columns = "case,facets,base,cells,ranks,hold,fail,left out,time s,M cells/s,B/cell";
    let columns = columns.split(',').collect();
    let rows: Vec<Vec<String>> = report.cases.iter().flat_map(rows_of).collect();
    check_invariants(&rows, report);
    Table { columns, rows, ..Table::default() }
}

/// The rows of one case, each with one field per column.
fn rows_of(case: &CaseReport) -> Vec<Vec<String>> {
    let serial = case.runs.iter().find(|run| run.program == "mesher" && run.layout.is_none());
    let counts = rank_counts(case);
    let of_case = |check: &&Check| check.ranks.is_none_or(|ranks| !counts.contains(&ranks));
    let of_case = case.checks.iter().filter(of_case).collect();
    let sizes = [case.facets, case.leaves_base, case.cells];
    let mut first = vec![case.name.clone()];
    first.extend(sizes.map(|size| size.to_string()));
    first.push("serial".to_owned());
    first.extend(results(of_case, serial));
    let mut rows = vec![first];
    for ranks in counts {
        let with_ranks =
            |run: &&Run| run.layout.as_ref().is_some_and(|layout| layout.ranks.count() == ranks);
        let runs = case.runs.iter().filter(with_ranks);
        // All layouts give the same mesh; the table has the time of the fastest.
        let fastest = runs.min_by(|a, b| a.time_wall_s.total_cmp(&b.time_wall_s));
        let checks = case.checks.iter().filter(|check| check.ranks == Some(ranks)).collect();
        let mut row = vec![String::new(); 4];
        row.push(ranks.to_string());
        row.extend(results(checks, fastest));
        rows.push(row);
    }
    rows
}

/// Each check is in one row.
fn check_invariants(rows: &[Vec<String>], report: &Report) {
    let sum =
        |column: usize| rows.iter().map(|row| row[column].parse::<usize>().unwrap_or(0)).sum();
    let shown = Tally { pass: sum(5), fail: sum(6), left_out: sum(7) };
    assert_eq!(shown, report.tally(), "checks in the rows of the table, and in the report");
}

/// The rank counts on which anything was run.
fn rank_counts(case: &CaseReport) -> Vec<usize> {
    let run = case.checks.iter().filter(|c| !matches!(c.outcome, Outcome::LeftOut { .. }));
    let mut counts: Vec<usize> = run.filter_map(|check| check.ranks).collect();
    counts.sort_unstable();
    counts.dedup();
    counts
}

fn results(tally: Tally, run: Option<&Run>) -> Vec<String> {
    let Tally { pass, fail, left_out } = tally;
    let measured = |run: &Run| {
        let time_s = run.is_time_reported.then(|| format!("{:.3}", run.time_wall_s));
        let rate = format!("{:.3}", run.cells_per_s() / 1e6);
        [time_s.unwrap_or("-".to_owned()), rate, format!("{:.1}", run.bytes_per_cell())]
    };
    let measured = run.map_or_else(|| ["-"; 3].map(str::to_owned), measured);
    [pass, fail, left_out].map(|n| n.to_string()).into_iter().chain(measured).collect()
}

/// Missing programs, then failures, omissions and notes of each case, one line each.
fn remarks(report: &Report) -> Vec<String> {
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
    fn the_serial_run_and_every_rank_count_have_a_line() {
        let text = table(&sample());
        let lines: Vec<Vec<&str>> =
            text.lines().map(|line| line.split_whitespace().collect()).collect();
        assert_eq!(
            lines[2],
            ["cube_small", "12", "5000", "7600", "serial", "1", "0", "1", "0.100", "0.076", "10.0"]
        );
        assert_eq!(lines[3], ["4", "1", "1", "0", "0.050", "0.152", "10.0"]);
    }

    #[test]
    #[should_panic(expected = "checks in the rows of the table")]
    fn a_row_that_is_missing_is_noticed() {
        let report = sample();
        let rows: Vec<Vec<String>> = report.cases.iter().flat_map(rows_of).collect();
        check_invariants(&rows[1..], &report);
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
}
