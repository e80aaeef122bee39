//! The page of a benchmark report.

use super::groups::{Subject, is_summarised};
use super::latex::{commands, machines};
use super::rules::Broken;
use super::tables;
use crate::figure::Figure;
use crate::page::{figure as page_figure, page as whole_page, with_code};
use bench::experiments::entry::{Entry, Line};
use bench::experiments::group::Groups;
use bench::experiments::number::grouped;
use maud::{Markup, html};

/// A figure with its drawing and its values.
#[derive(Clone, Debug)]
pub struct Drawn<'a> {
    /// The model.
    pub figure: &'a Figure,
    /// The SVG document.
    pub svg: String,
    /// The values as CSV.
    pub csv: String,
}

/// The page.
pub fn page(groups: &Groups, drawn: &[Drawn], broken: &[Broken], lines: &[Line]) -> String {
    let content = html! {
        (summary(groups, lines))
        h2 id="figures" { "Figures" }
        p {
            "Filled markers were measured with at most one rank per core. Hollow markers were measured with more ranks than \
             cores, projected from simulated ranks, or quoted from the paper."
        }
        @for one in drawn { (figure(one)) }
        h2 id="tables" { "Tables" }
        p { "Load imbalance λ = max/mean over ranks; efficiencies by the POP definitions. Exposed faces are those that the mesh shows to the body; W is the number of cells that each weighs." }
        @for table in tables::tables(groups) { (table.html()) }
        h2 id="rules" { "The twelve rules of Hoefler and Belli" }
        (rules(broken))
        h2 id="machine" { "Machine and commands" }
        (machine(lines))
    };
    whole_page("Oct-tree meshing: scaling and load balance", &content)
}

fn summary(groups: &Groups, lines: &[Line]) -> Markup {
    let runs: usize = groups.all.iter().map(|g| g.runs.len()).sum();
    let failed = lines.iter().filter(|l| matches!(l.entry, Entry::Failure(_))).count();
    html! {
        p {
            (runs) " runs of " (groups.all.len()) " configurations"
            @if failed > 0 { ", " (failed) " more failed" }
            ". For simulated ranks, time is the critical path: the sum over phases of the CPU time of the slowest rank, plus "
            (groups.network) "."
        }
        nav {
            a href="#figures" { "figures" } " " a href="#tables" { "tables" } " "
            a href="#rules" { "twelve rules" } " " a href="#machine" { "machine and commands" }
        }
        h2 { "Causes of lost efficiency" }
        ul {
            @for group in groups.all.iter().filter(|g| is_summarised(g)) {
                li {
                    b { (Subject::of(&group.setup)) } ", " (group.setup.experiment) " scaling, " (grouped(group.cells())) " cells: "
                    (with_code(&groups.cause(group)))
                }
            }
        }
    }
}

fn figure(drawn: &Drawn) -> Markup {
    let f = drawn.figure;
    let data = format!("data:text/csv;charset=utf-8,{}", percent_encoded(&drawn.csv));
    let caption = html! { (f.caption) " " a download={ (f.id) ".csv" } href=(data) { "CSV" } };
    page_figure(&f.id, &f.title, &drawn.svg, &caption)
}

fn rules(broken: &[Broken]) -> Markup {
    html! {
        @if broken.is_empty() { p { "The record breaks none of them." } }
        ul { @for (rule, why) in broken { li { strong { "Rule " (rule) " is broken" } ": " (why) } } }
    }
}

fn machine(lines: &[Line]) -> Markup {
    html! {
        @for machine in machines(lines) { p { (machine) } }
        pre { @for command in commands(lines) { (command) "\n" } }
    }
}

/// Text with every byte encoded that is special in a URL.
fn percent_encoded(text: &str) -> String {
    let encoded = |byte: u8| match byte {
        b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'.' | b'-' | b'_' => {
            char::from(byte).to_string()
        }
        _ => format!("%{byte:02X}"),
    };
    text.bytes().map(encoded).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn urls_encode_commas_and_line_ends() {
        assert_eq!(percent_encoded("a,b\nλ"), "a%2Cb%0A%CE%BB");
    }
}
