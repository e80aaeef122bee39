//! A verification as Markdown, for the summary page of a CI system and for the report of the demo.

use super::remarks::remarks;
use super::table::table_of;
use crate::markdown::escaped;
use run::verify::report::Report;

/// The report as Markdown: verdict, table, remarks.
pub fn markdown(report: &Report) -> String {
    let mut text = format!("## harness verify\n\n{}\n\n", report.verdict());
    text += &table_of(report).markdown();
    let remarks = remarks(report);
    if !remarks.is_empty() {
        text.push('\n');
    }
    for remark in remarks {
        text.push_str(&format!("- {}\n", escaped(&remark)));
    }
    text
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
        assert!(rows.iter().all(|row| row.matches(" |").count() == 12), "{text}");
    }

    #[test]
    fn text_of_a_failure_cannot_become_markup() {
        let text = markdown(&sample());
        assert!(text.contains("first difference &lt;at&gt; root"), "{text}");
        assert!(text.contains("cube\\_small"), "{text}");
    }
}
