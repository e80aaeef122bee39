//! A table in the forms that reports have: text, Markdown, HTML.

use crate::markdown::escaped;
use crate::page;
use maud::{Markup, html};

/// A table. Every row has as many fields as there are columns.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// Its title, which its Markdown does not show.
    pub title: String,
    /// Headings of the columns.
    pub columns: Vec<&'static str>,
    /// The rows.
    pub rows: Vec<Vec<String>>,
    /// Remarks below it.
    pub notes: Vec<String>,
}

impl Table {
    /// The table as text: columns as wide as their widest field. The words of a heading are below each other.
    pub fn text(&self) -> String {
        let words = |title: &&str| title.split(' ').map(str::to_owned).collect::<Vec<String>>();
        let titles: Vec<Vec<String>> = self.columns.iter().map(words).collect();
        let height = titles.iter().map(Vec::len).max().unwrap_or(0);
        let line = |i: usize| {
            let word = |title: &Vec<String>| {
                (i + title.len()).checked_sub(height).map(|at| title[at].clone())
            };
            titles.iter().map(|title| word(title).unwrap_or_default()).collect::<Vec<String>>()
        };
        let head: Vec<Vec<String>> = (0..height).map(line).collect();
        let all = || head.iter().chain(&self.rows);
        let width = |column: usize| all().map(|row| row[column].chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..self.columns.len()).map(width).collect();
        // Numbers are to the right.
        let is_number = |field: &String| {
            field.trim_start_matches(['+', '-']).starts_with(|first: char| first.is_ascii_digit())
        };
        let right =
            |column: usize| column > 0 && self.rows.iter().any(|row| is_number(&row[column]));
        let aligned = |(column, field): (usize, &String)| match (right(column), widths[column]) {
            (false, width) => format!("{field:<width$}"),
            (true, width) => format!("{field:>width$}"),
        };
        let line = |row: &Vec<String>| {
            let fields: Vec<String> = row.iter().enumerate().map(aligned).collect();
            fields.join("  ").trim_end().to_owned()
        };
        let title = Some(self.title.clone()).filter(|title| !title.is_empty());
        let lines = title.into_iter().chain(all().map(line)).chain(self.notes.iter().cloned());
        lines.map(|line| line + "\n").collect()
    }

    /// The table as Markdown, with the columns of this range to the right.
    pub fn markdown(&self, right: std::ops::Range<usize>) -> String {
        let line = |fields: Vec<String>| format!("| {} |\n", fields.join(" | "));
        let rule = |i: usize| if right.contains(&i) { "---:" } else { "---" }.to_owned();
        let mut text = line(self.columns.iter().map(|title| escaped(title)).collect());
        text += &line((0..self.columns.len()).map(rule).collect());
        let rows =
            self.rows.iter().map(|row| line(row.iter().map(|field| escaped(field)).collect()));
        text + &rows.collect::<String>()
    }

    /// The table with its title and remarks as HTML.
    pub fn html(&self) -> Markup {
        let row = |row: &Vec<String>| row.iter().map(|field| html! { (field) }).collect();
        let rows: Vec<Vec<Markup>> = self.rows.iter().map(row).collect();
        html! {
            h3 { (self.title) }
            (page::table(None, &self.columns, &rows))
            @for note in &self.notes { p { (note) } }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Table {
        let rows =
            [["a", "<x>", "7"], ["long", "_y_", "-12"]].map(|row| row.map(str::to_owned).to_vec());
        let columns = vec!["a|b", "two words", "n"];
        Table { title: "t".into(), columns, rows: rows.to_vec(), notes: vec!["n".into()] }
    }

    #[test]
    fn columns_are_aligned_below_the_words_of_their_headings() {
        assert_eq!(
            sample().text(),
            "t\n      two\na|b   words    n\na     <x>      7\nlong  _y_    -12\nn\n"
        );
    }

    #[test]
    fn fields_cannot_become_markup() {
        let expected = "| a\\|b | two words | n |\n| --- | --- | ---: |\n| a | &lt;x&gt; | 7 |\n| long | \\_y\\_ | -12 |\n";
        assert_eq!(sample().markdown(2..3), expected);
        assert!(sample().html().into_string().contains("<td>&lt;x&gt;</td>"));
    }
}
