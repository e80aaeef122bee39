//! The page of a benchmark report.

use super::groups::{Subject, is_summarised};
use super::rules::Broken;
use super::tables;
use crate::figure::Figure;
use crate::page::{figure, page as whole_page, with_code};
use bench::experiments::entry::{Entry, Line, Machine};
use bench::experiments::group::Groups;
use bench::experiments::number::grouped;
use bench::order::distinct;
use maud::html;

/// The page; every figure is given with its SVG document.
pub fn page(
    groups: &Groups,
    drawn: &[(&Figure, String)],
    broken: &[Broken],
    lines: &[Line],
) -> String {
    let runs: usize = groups.all.iter().map(|g| g.runs.len()).sum();
    let failed = lines.iter().filter(|l| matches!(l.entry, Entry::Failure(_))).count();
    let summarised = || groups.all.iter().filter(|g| is_summarised(g));
    let content = html! {
        p {
            (runs) " runs of " (groups.all.len()) " configurations, " (failed) " more failed. For simulated ranks, time is the critical path: \
             the sum over phases of the CPU time of the slowest rank, plus " (Groups::networks(&groups.all)) "."
        }
        nav {
            a href="#figures" { "figures" } " " a href="#tables" { "tables" } " "
            a href="#rules" { "twelve rules" } " " a href="#machine" { "machine and commands" }
        }
        h2 { "Causes of lost efficiency" }
        ul {
            @for group in summarised() {
                li {
                    b { (Subject::of(&group.setup)) } ", " (group.setup.experiment) " scaling, " (grouped(group.cells())) " cells: "
                    (with_code(&groups.cause(group)))
                }
            }
        }
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
        @if broken.is_empty() { p { "The record breaks none of them." } }
        ul { @for (rule, why) in broken { li { strong { "Rule " (rule) " is broken" } ": " (why) } } }
        h2 id="machine" { "Machine and commands" }
        @for machine in machines(lines) { p { (machine) } }
        pre { @for command in commands(lines) { (command) "\n" } }
    };
    whole_page("Oct-tree meshing: scaling and load balance", &content)
}

/// The machines of a record, without repetitions.
pub fn machines(lines: &[Line]) -> Vec<Machine> {
    distinct(lines.iter().filter_map(Line::session).map(|session| session.machine.clone()))
}

/// The command lines of the sessions, without repetitions and without absolute directories.
fn commands(lines: &[Line]) -> Vec<String> {
    let commands = lines.iter().filter_map(Line::session).map(|session| {
        let words = session.command.iter().map(|word| match word.starts_with('/') {
            true => word.rsplit('/').next().unwrap_or(word),
            false => word,
        });
        shlex::try_join(words).expect("an argument of a process has no zero bytes")
    });
    distinct(commands)
}
