//! The table of targets as text and as Markdown.

use crate::table::{Table, escaped};
use bench::study::judge::Judged;
use bench::study::judge::Verdict::{self, Failed, ForComparison, LeftOut, Met, Missed};

fn table(judged: &[Judged]) -> Table {
    let columns = vec!["row", "target", "measured", "how", "verdict"];
    let rows = judged.iter().map(|row| row.fields().to_vec()).collect();
    Table { columns, rows, ..Table::default() }
}

/// The table as text, followed by the counts of the verdicts.
pub fn text(rows: &[Judged]) -> String {
    Table { notes: vec![count(rows)], ..table(rows) }.text()
}

/// The table as Markdown, below a line about the machine and the counts of the verdicts.
pub fn markdown(rows: &[Judged], machine: &str) -> String {
    let head = format!("# Targets\n\n{}\n\n{}\n\n", escaped(machine), count(rows));
    head + &table(rows).markdown()
}

fn count(rows: &[Judged]) -> String {
    let number = |verdict: Verdict| rows.iter().filter(|r| r.verdict() == verdict).count();
    let [met, missed, failed, left_out, others] =
        [Met, Missed, Failed, LeftOut, ForComparison].map(number);
    format!(
        "{met} met, {missed} missed, {failed} failed, {left_out} left out, {others} for comparison"
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
        let missed =
            Judged { measured: Some((99.5e6, "measured")), ..unjudged(row, false, String::new()) };
        let failed = unjudged(row, true, "run a failed: <no memory>".into());
        let rows = [missed, failed];
        let text = text(&rows);
        for part in [
            "at least 100.00 M cells/s, at most 300.00 M cells/s",
            "99.50 M cells/s  measured  MISSED",
            "FAILED: run a failed: <no memory>",
            "0 met, 1 missed, 1 failed, 0 left out, 0 for comparison",
        ] {
            assert!(text.contains(part), "{part} is missing in\n{text}");
        }
        let markdown = markdown(&rows, "2 cores");
        let table: Vec<&str> = markdown.lines().filter(|l| l.starts_with('|')).collect();
        assert_eq!(table.len(), 4);
        assert!(table[1].starts_with("| --- | --- |"), "{markdown}");
        assert!(table[2].starts_with("| rate\\|1 |") && markdown.contains("&lt;no memory&gt;"));
    }
}
