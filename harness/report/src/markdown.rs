//! Tables in Markdown.

/// A table with its head. Every row has as many fields as the head; `align` gives the rule below each column, `---` or
/// `---:`.
pub fn table<F: AsRef<str>>(
    columns: &[&str],
    align: impl Fn(usize) -> &'static str,
    rows: impl IntoIterator<Item = impl AsRef<[F]>>,
) -> String {
    let line = |fields: Vec<String>| format!("| {} |\n", fields.join(" | "));
    let mut text = line(columns.iter().map(|title| escaped(title)).collect());
    text += &line((0..columns.len()).map(|i| align(i).to_owned()).collect());
    for row in rows {
        text += &line(row.as_ref().iter().map(|field| escaped(field.as_ref())).collect());
    }
    text
}

/// Text on one line in which Markdown and HTML find no markup.
pub fn escaped(text: &str) -> String {
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

    #[test]
    fn fields_cannot_become_markup() {
        let text = table(&["a|b", "c"], |_| "---", [["<x>", "_y_"]]);
        assert_eq!(text, "| a\\|b | c |\n| --- | --- |\n| &lt;x&gt; | \\_y\\_ |\n");
    }
}
