//! Markdown, for a CI system's summary page and for the demo's report.

use super::remarks::remarks;
use super::table::{COLUMN_PAPER, COLUMNS, rows_of};
use run::verify::report::Report;

/// The report as Markdown: verdict, table, remarks.
pub fn markdown(report: &Report) -> String {
    let titles: Vec<String> =
        COLUMNS.iter().chain([&COLUMN_PAPER]).map(|title| (*title).to_owned()).collect();
    let rule = vec!["---".to_owned(); titles.len()];
    let rows = report.cases.iter().flat_map(rows_of);
    let mut text = format!("## harness verify\n\n{}\n\n", report.verdict());
    for row in [titles, rule].into_iter().chain(rows) {
        let fields: Vec<String> = row.iter().map(|field| escaped(field)).collect();
        text.push_str(&format!("| {} |\n", fields.join(" | ")));
    }
    let remarks = remarks(report);
    if !remarks.is_empty() {
        text.push('\n');
    }
    for remark in remarks {
        text.push_str(&format!("- {}\n", escaped(&remark)));
    }
    text
}

/// Text in which Markdown and HTML see nothing of theirs, on one line.
pub(crate) fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '&' => out.push_str("&amp;"),
            '\n' => out.push_str("<br>"),
            '|' | '*' | '_' | '`' | '[' | ']' | '\\' => out.extend(['\\', character]),
            _ => out.push(character),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use run::testing::report as sample;

    #[test]
    fn every_row_has_every_column() {
        let text = markdown(&sample());
        let rows: Vec<&str> = text.lines().filter(|line| line.starts_with('|')).collect();
        assert_eq!(rows.len(), 4);
        assert!(rows.iter().all(|row| row.matches(" |").count() == COLUMNS.len() + 1), "{text}");
    }

    #[test]
    fn text_of_a_failure_cannot_become_markup() {
        let text = markdown(&sample());
        assert!(text.contains("first difference &lt;at&gt; root"), "{text}");
        assert!(text.contains("cube\\_small"), "{text}");
    }
}
