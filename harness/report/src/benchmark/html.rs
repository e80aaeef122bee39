//! The page of a benchmark report.

use super::groups::{Subject, is_summarised};
use super::latex::{commands, machines};
use super::rules::Broken;
use super::tables;
use crate::figure::Figure;
use crate::page::{figure, page as whole_page, with_code};
use bench::experiments::entry::{Entry, Line};
use bench::experiments::group::Groups;
use bench::experiments::number::grouped;
use maud::{Markup, html};

/// A figure, and its SVG document.
pub type Drawn<'a> = (&'a Figure, String);

/// The page.
pub fn page(groups: &Groups, drawn: &[Drawn], broken: &[Broken], lines: &[Line]) -> String {
    let content = html! {
        (summary(groups, lines))
        h2 id="figures" { "Figures" }
        p {
            "Filled markers were measured with at most one rank per core. Hollow markers were measured with more ranks than \
             cores, projected from simulated ranks, or quoted from the paper."
        }
        @for (f, svg) in drawn { (figure(&f.id, &f.title, svg, &html! { (f.caption) })) }
        h2 id="tables" { "Tables" }
        p { "Load imbalance λ = max/mean over ranks; efficiencies by the POP definitions." }
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
            (Groups::networks(&groups.all)) "."
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
