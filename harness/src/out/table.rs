//! The table for people: a line for each case's serial run, one for each rank count, then everything that
//! failed, was left out, or is worth a note.

use crate::verify::report::{CaseReport, Check, Outcome, Report, Run, Tally};
use std::fmt::Write;

/// Headings of the table's columns.
pub const COLUMNS: [&str; 11] = [
    "case",
    "facets",
    "base",
    "cells",
    "ranks",
    "hold",
    "fail",
    "left out",
    "time s",
    "M cells/s",
    "B/cell",
];

/// The column that compares with the paper's 38 k cells per second on one core.
pub const COLUMN_PAPER: &str = "x paper";

/// The report as plain text.
pub fn table(report: &Report) -> String {
    let mut rows = vec![
        COLUMNS
            .iter()
            .chain([&COLUMN_PAPER])
            .map(|title| (*title).to_owned())
            .collect(),
    ];
    rows.extend(report.cases.iter().flat_map(rows_of));
    let mut text = aligned(&rows);
    for line in remarks(report) {
        // Writing into a string cannot fail.
        let _ = writeln!(text, "{line}");
    }
    let _ = writeln!(text, "{}", report.verdict());
    text
}

/// The rows of one case, each with one field per column.
pub fn rows_of(case: &CaseReport) -> Vec<Vec<String>> {
    let serial = case
        .runs
        .iter()
        .find(|run| run.program == "mesher" && run.layout.is_none());
    let of_case = case
        .checks
        .iter()
        .filter(|check| check.ranks.is_none())
        .collect();
    let mut first = vec![
        case.name.clone(),
        case.facets.to_string(),
        case.leaves_base.to_string(),
    ];
    first.extend([case.cells.to_string(), "serial".to_owned()]);
    first.extend(results(of_case, serial));
    let mut rows = vec![first];
    for ranks in rank_counts(case) {
        let with_ranks = |run: &&Run| {
            run.layout
                .as_ref()
                .is_some_and(|layout| layout.ranks == ranks)
        };
        let runs = case.runs.iter().filter(with_ranks);
        // Layouts differ in time and not in result; the table shows what the best of them gives.
        let fastest = runs.min_by(|a, b| a.time_wall_s.total_cmp(&b.time_wall_s));
        let checks = case
            .checks
            .iter()
            .filter(|check| check.ranks == Some(ranks))
            .collect();
        let mut row = vec![String::new(); 4];
        row.push(ranks.to_string());
        row.extend(results(checks, fastest));
        rows.push(row);
    }
    rows
}

fn rank_counts(case: &CaseReport) -> Vec<usize> {
    let mut counts: Vec<usize> = case.checks.iter().filter_map(|check| check.ranks).collect();
    counts.sort_unstable();
    counts.dedup();
    counts
}

fn results(tally: Tally, run: Option<&Run>) -> Vec<String> {
    let mut fields = vec![
        tally.pass.to_string(),
        tally.fail.to_string(),
        tally.left_out.to_string(),
    ];
    match run {
        Some(run) => fields.extend([
            format!("{:.3}", run.time_wall_s),
            format!("{:.3}", run.cells_per_s() / 1e6),
            format!("{:.1}", run.bytes_per_cell()),
            format!("{:.1}", run.speedup_over_paper()),
        ]),
        None => fields.extend(vec!["-".to_owned(); 4]),
    }
    fields
}

/// Everything below the table: what is missing, then each case's failures, omissions and notes.
pub fn remarks(report: &Report) -> Vec<String> {
    let missing = report.missing.iter();
    let mut lines: Vec<String> = missing
        .map(|missing| format!("left out: {} because {}", missing.what, missing.why))
        .collect();
    for case in &report.cases {
        if let Some(error) = &case.input_error {
            lines.push(format!("input: {}: {error}", case.name));
        }
        lines.extend(
            case.checks
                .iter()
                .flat_map(|check| remarks_of(case, check, report)),
        );
        lines.extend(
            case.kept
                .iter()
                .map(|place| format!("kept: {}: {place}", case.name)),
        );
        lines.extend(
            case.repeat_with
                .iter()
                .map(|command| format!("repeat with: {command}")),
        );
    }
    lines
}

fn remarks_of(case: &CaseReport, check: &Check, report: &Report) -> Vec<String> {
    let what = format!("{}: {}: {}", case.name, check.subject, check.name);
    let mut lines = match &check.outcome {
        Outcome::Pass => Vec::new(),
        Outcome::Fail(why) => vec![format!("FAILED: {what}: {why}")],
        // What is missing everywhere has been said once.
        Outcome::LeftOut(why) if report.missing.iter().any(|missing| missing.why == *why) => {
            Vec::new()
        }
        Outcome::LeftOut(why) => vec![format!("left out: {what} because {why}")],
    };
    lines.extend(
        check
            .notes
            .iter()
            .map(|note| format!("note: {what}: {note}")),
    );
    lines
}

/// Columns as wide as their widest field; all but the first set to the right.
fn aligned(rows: &[Vec<String>]) -> String {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width =
        |row: &Vec<String>, column: usize| row.get(column).map_or(0, |field| field.chars().count());
    let widest = |column| rows.iter().map(|row| width(row, column)).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns).map(widest).collect();
    let mut text = String::new();
    for row in rows {
        let fields = row
            .iter()
            .zip(&widths)
            .enumerate()
            .map(|(column, (field, &width))| match column {
                0 => format!("{field:<width$}"),
                _ => format!("{field:>width$}"),
            });
        let line = fields.collect::<Vec<_>>().join("  ");
        let _ = writeln!(text, "{}", line.trim_end());
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verify::report::tests::sample;

    #[test]
    fn a_line_for_the_serial_run_and_one_for_each_rank_count() {
        let text = table(&sample());
        let lines: Vec<Vec<&str>> = text
            .lines()
            .map(|line| line.split_whitespace().collect())
            .collect();
        assert_eq!(
            lines[1][..9],
            [
                "cube_small",
                "12",
                "5000",
                "7600",
                "serial",
                "1",
                "0",
                "1",
                "0.100"
            ]
        );
        assert_eq!(
            lines[2],
            ["4", "0", "1", "0", "0.050", "0.152", "10.0", "4.0"]
        );
    }

    #[test]
    fn failures_omissions_and_notes_are_all_there_once() {
        let text = table(&sample());
        for line in [
            "left out: p4est because the engine is not built",
            "FAILED: cube_small: 4 ranks, metis, base auto: same leaves: first difference <at> root",
            "note: cube_small: serial: oracles: open3d was wrong at 1 point",
            "kept: cube_small: out/cube_small",
            "repeat with: harness verify cube_small --ranks 4",
        ] {
            assert_eq!(
                text.lines().filter(|found| *found == line).count(),
                1,
                "{line}\n{text}"
            );
        }
        assert!(text.ends_with("1 cases: 1 checks hold, 1 fail, 1 left out, in 2.0 s: FAILED\n"));
    }
}
