//! The table of targets as text and as Markdown.

use crate::markdown::{self, escaped};
use bench::experiments::entry::{Judged, Verdict};
use bench::study::Study;
use bench::study::row::fields;
use std::fmt::Write;

/// Headings of the columns.
const TITLES: [&str; 5] = ["row", "target", "measured", "how", "verdict"];

/// The table as text, followed by the counts of the verdicts.
pub fn text(study: &Study, rows: &[Judged]) -> String {
    let cells: Vec<[String; 5]> = rows.iter().map(|row| fields(study, row)).collect();
    let titles = TITLES.map(str::to_owned);
    let width = |column: usize| {
        let length = |row: &[String; 5]| row[column].chars().count();
        cells.iter().chain([&titles]).map(length).max().unwrap_or(0)
    };
    let [a, b, c, d] = [0, 1, 2, 3].map(width);
    let mut out = String::new();
    for [name, target, measured, how, verdict] in [&titles].into_iter().chain(&cells) {
        // Writing into a string cannot fail.
        let _ = writeln!(out, "{name:a$}  {target:>b$}  {measured:>c$}  {how:d$}  {verdict}");
    }
    let _ = writeln!(out, "{}", count(rows));
    out
}

/// The table as Markdown, below a line about the machine and the counts of the verdicts.
pub fn markdown(study: &Study, rows: &[Judged], machine: &str) -> String {
    let head = format!("# Targets\n\n{}\n\n{}\n\n", escaped(machine), count(rows));
    head + &markdown::table(&TITLES, |_| "---", rows.iter().map(|row| fields(study, row)))
}

fn count(rows: &[Judged]) -> String {
    let number = |verdict| rows.iter().filter(|r| r.verdict == verdict).count();
    format!(
        "{} met, {} missed, {} failed, {} left out, {} for comparison",
        number(Verdict::Met),
        number(Verdict::Missed),
        number(Verdict::Failed),
        number(Verdict::LeftOut),
        number(Verdict::ForComparison)
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use bench::study::judge::unjudged;
    use bench::testing::study as read;

    #[test]
    fn every_verdict_is_shown_with_its_reason() {
        let targets = read(
            "mesh.a.case = \"a\"\nrun.a.mesh = \"a\"\n[[row]]\nname = \"rate|1\"\nrun = \"a\"\n\
             measure = \"cells_per_second_per_core\"\nat_least = 100e6\nat_most = 3e8\n",
        )
        .unwrap();
        let row = &targets.row[0];
        let missed = Judged {
            measured: Some(99.5e6),
            how: "measured".into(),
            ..unjudged(row, Verdict::Missed, String::new())
        };
        let failed = unjudged(row, Verdict::Failed, "run a failed: <no memory>".into());
        let rows = [missed, failed];
        let text = text(&targets, &rows);
        for part in [
            "at least 100.00 M cells/s, at most 300.00 M cells/s",
            "99.50 M cells/s  measured  MISSED",
            "FAILED: run a failed: <no memory>",
            "0 met, 1 missed, 1 failed, 0 left out, 0 for comparison",
        ] {
            assert!(text.contains(part), "{part} is missing in\n{text}");
        }
        let markdown = markdown(&targets, &rows, "2 cores");
        let table: Vec<&str> = markdown.lines().filter(|l| l.starts_with('|')).collect();
        assert_eq!(table.len(), 4);
        assert!(table[1].starts_with("| --- | --- |"), "{markdown}");
        assert!(table[2].starts_with("| rate\\|1 |") && markdown.contains("&lt;no memory&gt;"));
    }
}
