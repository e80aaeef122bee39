//! The page of a benchmark report, and which of the twelve rules of Hoefler and Belli, "Scientific Benchmarking of Parallel Computing
//! Systems" (SC15), a record breaks. reports/README.md lists the rules, and how every report keeps those that no record can break.

use super::groups::PROJECTED;
use super::tables;
use crate::figure::Figure;
use crate::page::{figure, page as whole_page};
use bench::experiments::entry::{Entry, Line, Machine, Session};
use bench::experiments::group::Groups;
use bench::order::distinct;
use bench::shown;
use maud::html;

/// A figure and its SVG document.
pub type Drawn<'a> = (&'a Figure, String);

/// The page; every figure is given with its SVG document.
pub fn page(groups: &Groups, drawn: &[Drawn], broken: &[Broken], lines: &[Line]) -> String {
    let runs: usize = groups.all.iter().map(|g| g.runs.len()).sum();
    let content = html! {
        p {
            (runs) " runs of " (groups.all.len()) " configurations, " (failures(lines)) " more failed. For simulated ranks, time is the critical path: \
             the sum over phases of the CPU time of the slowest rank, plus " (Groups::networks(&groups.all)) "."
        }
        ul { @for note in &groups.notes { li { (note) } } }
        nav {
            a href="#figures" { "figures" } " " a href="#tables" { "tables" } " " a href="#causes" { "causes" } " "
            a href="#rules" { "twelve rules" } " " a href="#machine" { "machine and commands" }
        }
        h2 id="figures" { "Figures" }
        p {
            "Filled markers were measured with at most one rank per core. Hollow markers were measured with more ranks than \
             cores, projected from simulated ranks, or quoted from the paper."
        }
        @for (f, svg) in drawn { (figure(f, svg)) }
        h2 id="tables" { "Tables" }
        p { "Load imbalance λ = max/mean over ranks; efficiencies by the POP definitions." (PROJECTED) }
        @for table in tables::tables(groups) { (table.html()) }
        h2 id="causes" { "Causes of lost efficiency" }
        ul { @for cause in tables::causes(groups) { li { (cause) } } }
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
    distinct(lines.iter().filter_map(Line::session).map(|session| shown(&session.command)))
}

/// A rule that the record breaks: its number, 1 to 12, and the reason in a sentence.
pub type Broken = (usize, String);

/// The rules that a record breaks, in the order of the rules.
pub fn broken(groups: &Groups, lines: &[Line]) -> Vec<Broken> {
    let failures = failures(lines);
    let failed = || format!("{failures} runs failed and are missing in the figures");
    let poor = groups.all.iter().filter(|g| g.time_s.coverage < 0.95);
    let poor: Vec<usize> = poor.map(|g| g.runs.len()).collect();
    let count = poor.len();
    let vague = |least| {
        format!(
            "{count} configurations have fewer than the six runs that an interval with 95 % coverage needs (minimum: {least})"
        )
    };
    let machines = machines(lines);
    let is_known = |m: &Machine| {
        let names = [&m.cpu, &m.kernel, &m.compiler, &m.commit];
        names.iter().all(|name| !name.is_empty()) && m.memory_bytes > 0
    };
    let is_unknown = machines.is_empty() || !machines.iter().all(is_known);
    let unknown = || "machine, compiler or commit are missing in the record".to_owned();
    let is_unclean = machines.iter().any(|machine| machine.commit.ends_with("-dirty"));
    let unclean = || "a session ran with files that differ from its commit".to_owned();
    let rules = [
        (2, (failures > 0).then(failed)),
        (5, poor.iter().min().map(vague)),
        (9, is_unknown.then(unknown)),
        (9, is_unclean.then(unclean)),
        (9, lines.iter().filter_map(Line::session).find_map(Session::disturbed)),
    ];
    rules.into_iter().filter_map(|(rule, why)| Some((rule, why?))).collect()
}

/// Number of runs that failed.
fn failures(lines: &[Line]) -> usize {
    lines.iter().filter(|l| matches!(l.entry, Entry::Failure(_))).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use bench::experiments::entry::Comm;
    use bench::testing::{line, run};

    fn session(load_average: f64, commit: &str) -> Line {
        let machine = Machine {
            cpu: "c".into(),
            cores: 2,
            memory_bytes: 1,
            kernel: "k".into(),
            mpi: String::new(),
            compiler: "r".into(),
            commit: commit.into(),
        };
        let (command, lacks) = (vec![], Default::default());
        line(Entry::Session(Box::new(Session {
            command,
            machine,
            nodes: String::new(),
            load_average,
            lacks,
        })))
    }

    fn rules(lines: &[Line]) -> Vec<usize> {
        broken(&Groups::of(lines), lines).into_iter().map(|(rule, _)| rule).collect()
    }

    #[test]
    fn a_disturbed_machine_and_uncommitted_files_break_rule_9_and_so_does_a_record_without_sessions()
     {
        assert_eq!(rules(&[session(0.1, "abc")]), [0; 0]);
        assert_eq!(rules(&[session(1.9, "abc")]), [9]);
        assert_eq!(rules(&[session(0.1, "abc-dirty")]), [9]);
        assert_eq!(rules(&[]), [9]);
    }

    #[test]
    fn times_without_an_interval_break_rule_5() {
        let one = || line(Entry::Run(Box::new(run(Comm::Mpi, 9, &[("a", &[1.0])]))));
        let mut lines = vec![session(0.1, "abc")];
        lines.extend((0..5).map(|_| one()));
        assert_eq!(rules(&lines), [5]);
        lines.push(one());
        assert_eq!(rules(&lines), [0; 0]);
    }
}
