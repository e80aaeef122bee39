//! A table in the forms that reports have: text, Markdown, HTML.

use crate::page;
use maud::{Markup, html};

/// A table. Every row has as many fields as there are columns.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// Its title, which its Markdown does not show.
    pub title: String,
    /// Headings of the columns, which text shows in as many lines as they have.
    pub columns: Vec<&'static str>,
    /// The rows.
    pub rows: Vec<Vec<String>>,
    /// Remarks below it.
    pub notes: Vec<String>,
}

/// The heading of a column, and its field in the row of an item.
pub type Column<'a, T> = (&'static str, &'a dyn Fn(&T) -> String);

impl Table {
    /// A table with a row for each item.
    pub fn of<T>(title: String, items: &[T], columns: &[Column<T>]) -> Self {
        let row = |item: &T| columns.iter().map(|(_, field)| field(item)).collect();
        let rows = items.iter().map(row).collect();
        let columns = columns.iter().map(|column| column.0).collect();
        Self { title, columns, rows, notes: Vec::new() }
    }

    /// The table as text: columns as wide as their widest field. Headings end in one line.
    pub fn text(&self) -> String {
        let height = self.columns.iter().map(|title| title.lines().count()).max().unwrap_or(0);
        let line_of = |title: &str, up| title.rsplit('\n').nth(up).unwrap_or_default().to_owned();
        let line = |up| self.columns.iter().map(|title| line_of(title, up)).collect();
        let head: Vec<Vec<String>> = (0..height).rev().map(line).collect();
        let all = || head.iter().chain(&self.rows);
        let width = |column: usize| all().map(|row| row[column].chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..self.columns.len()).map(width).collect();
        let aligned = |(column, field): (usize, &String)| match widths[column] {
            width if self.is_number(column) => format!("{field:>width$}"),
            width => format!("{field:<width$}"),
        };
        let line = |row: &Vec<String>| {
            row.iter().enumerate().map(aligned).collect::<Vec<_>>().join("  ").trim_end().to_owned()
        };
        let title = Some(self.title.clone()).filter(|title| !title.is_empty());
        let lines = title.into_iter().chain(all().map(line)).chain(self.notes.iter().cloned());
        lines.map(|line| line + "\n").collect()
    }

    /// Whether a column has numbers, which are to the right.
    fn is_number(&self, column: usize) -> bool {
        let is_number = |field: &String| {
            field.trim_start_matches(['+', '-']).starts_with(|first: char| first.is_ascii_digit())
        };
        column > 0 && self.rows.iter().any(|row| is_number(&row[column]))
    }

    /// The table as Markdown.
    pub fn markdown(&self) -> String {
        let line = |fields: Vec<String>| format!("| {} |\n", fields.join(" | "));
        let rule = |i: usize| if self.is_number(i) { "---:" } else { "---" }.to_owned();
        let mut text = line(self.columns.iter().map(|c| escaped(&c.replace('\n', " "))).collect());
        text += &line((0..self.columns.len()).map(rule).collect());
        let rows = self.rows.iter().map(|row| line(row.iter().map(|of| escaped(of)).collect()));
        text + &rows.collect::<String>()
    }

    /// The table with its title and remarks as HTML.
    pub fn html(&self) -> Markup {
        html! {
            h3 { (self.title) }
            (page::table(&self.columns, &self.rows))
            @for note in &self.notes { p { (note) } }
        }
    }
}

/// Text on one line in which Markdown and HTML find no markup.
pub fn escaped(text: &str) -> String {
    let is_markup = |c: char| "|*_`[]\\".contains(c);
    let html = html! { (text) }.into_string().replace('\n', "<br>");
    html.chars().flat_map(|c| is_markup(c).then_some('\\').into_iter().chain([c])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Table {
        let rows =
            [["a", "<x>", "7"], ["long", "_y_", "-12"]].map(|row| row.map(str::to_owned).to_vec());
        let columns = vec!["a|b", "two\nwords", "n / s"];
        Table { title: "t".into(), columns, rows: rows.to_vec(), notes: vec!["n".into()] }
    }

    #[test]
    fn columns_are_aligned_below_the_words_of_their_headings() {
        assert_eq!(
            sample().text(),
            "t\n      two\na|b   words  n / s\na     <x>        7\nlong  _y_      -12\nn\n"
        );
    }

    #[test]
    fn fields_cannot_become_markup() {
        let expected = "| a\\|b | two words | n / s |\n| --- | --- | ---: |\n| a | &lt;x&gt; | 7 |\n| long | \\_y\\_ | -12 |\n";
        assert_eq!(sample().markdown(), expected);
        assert!(sample().html().into_string().contains("<td>&lt;x&gt;</td>"));
    }
}
