//! A verification as a text table: a line for the serial run of each case and one per rank count, then the remarks.

use super::remarks::remarks;
use crate::table::Table;
use run::verify::report::{CaseReport, Check, Outcome, Report, Run, Tally};

/// The table.
pub(super) fn table_of(report: &Report) -> Table {
    let columns = vec![
        "case",
        "facets",
        "base",
        "cells",
        "ranks",
        "hold",
        "fail",
        "left out",
        "time s",
        "process s",
        "M cells/s",
        "B/cell",
    ];
    let rows: Vec<Vec<String>> = report.cases.iter().flat_map(rows_of).collect();
    check_invariants(&rows, report);
    Table { columns, rows, ..Table::default() }
}

/// The report as plain text.
pub fn table(report: &Report) -> String {
    let notes = remarks(report).into_iter().chain([report.verdict()]).collect();
    Table { notes, ..table_of(report) }.text()
}

/// The rows of one case, each with one field per column.
fn rows_of(case: &CaseReport) -> Vec<Vec<String>> {
    let serial = case.runs.iter().find(|run| run.program == "mesher" && run.layout.is_none());
    let counts = rank_counts(case);
    let of_case = |check: &&Check| check.ranks.is_none_or(|ranks| !counts.contains(&ranks));
    let of_case = case.checks.iter().filter(of_case).collect();
    let mut first = vec![case.name.clone(), case.facets.to_string(), case.leaves_base.to_string()];
    first.extend([case.cells.to_string(), "serial".to_owned()]);
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
    let mut fields =
        vec![tally.pass.to_string(), tally.fail.to_string(), tally.left_out.to_string()];
    match run {
        Some(run) => fields.extend([
            match run.is_time_reported {
                true => format!("{:.3}", run.time_wall_s),
                false => "-".to_owned(),
            },
            format!("{:.3}", run.time_process_s),
            format!("{:.3}", run.cells_per_s() / 1e6),
            format!("{:.1}", run.bytes_per_cell()),
        ]),
        None => fields.extend(vec!["-".to_owned(); 4]),
    }
    fields
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
            lines[2][..9],
            ["cube_small", "12", "5000", "7600", "serial", "1", "0", "1", "0.100"]
        );
        assert_eq!(lines[3], ["4", "1", "1", "0", "0.050", "0.200", "0.152", "10.0"]);
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
}
