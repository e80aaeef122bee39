//! The HTML page that every report is put into: self-contained, without scripts, light and dark, narrow and wide.

use crate::figure::Figure;
use maud::{DOCTYPE, Markup, PreEscaped, Render, html};

const STYLE: &str = include_str!("page.css");

/// A page with a title, which is its heading too.
pub fn page(title: &str, content: &Markup) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { (title) }
                style { (PreEscaped(STYLE)) }
            }
            body { main { h1 { (title) } (content) } }
        }
    };
    page.into_string() + "\n"
}

/// A table with numbers to the right.
pub fn table<T: Render>(columns: &[&str], rows: &[Vec<T>]) -> Markup {
    html! {
        div.scroll { table {
            thead { tr { @for column in columns { th { (column) } } } }
            tbody { @for row in rows { "\n" tr { @for field in row { td { (field) } } } } }
        } }
    }
}

/// A figure with its heading, drawing and caption.
pub(crate) fn figure(figure: &Figure, svg: &str) -> Markup {
    html! {
        "\n"
        figure id=(figure.id) {
            h3 { (figure.title) }
            div.plot { (PreEscaped(svg)) }
            figcaption { (figure.caption) }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_escaped() {
        let page = page("a & b", &table(&["<x>"], &[vec![html! { "<y>" }]]));
        for part in ["<title>a &amp; b</title>", "<th>&lt;x&gt;</th>", "<td>&lt;y&gt;</td>"] {
            assert!(page.contains(part), "{part} is missing in\n{page}");
        }
    }
}
