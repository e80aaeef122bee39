//! Several programs on the same cases, on one core: CPU time, geometry search, memory, and what each cannot do.
//!
//! Times are CPU times of whole processes, seen from outside: they include the start of the program and reading, hardly
//! depend on other processes, and mean the same for every program. A phase named `search` is the part of that time in which
//! a program finds the facets near an octant.

use super::entry::{Comm, LeftOut, Run};
use super::group::{Group, Groups};
use super::number::grouped;
use crate::statistics::{Median, median};
use std::fmt::Write;

/// The name of the phase that searches the geometry.
const SEARCH: &str = "search";

impl Group {
    /// Returns the CPU time of the whole process, in seconds; `None` if a run does not have it.
    pub fn cpu_s(&self) -> Option<Median> {
        let times: Vec<f64> = self.runs.iter().map(|run| run.time_cpu_s).collect();
        if times.contains(&0.0) { None } else { median(&times) }
    }

    /// Returns the CPU time of the geometry search, in seconds; `None` if the program does not report it.
    pub fn search_s(&self) -> Option<Median> {
        let search = |run: &Run| {
            let phases = run.phases.iter().filter(|phase| phase.name == SEARCH);
            phases.map(|phase| phase.useful_s.sum).reduce(|a, b| a + b)
        };
        median(&self.runs.iter().map(search).collect::<Option<Vec<f64>>>()?)
    }
}

/// The runs of one case and n by several programs.
#[derive(Clone, Debug)]
pub struct Comparison<'a> {
    /// The case.
    pub case: &'a str,
    /// n.
    pub layer_cells_min: u32,
    /// At least two programs in the order of the record, each with its runs by cells.
    pub programs: Vec<(&'a str, Vec<&'a Group>)>,
}

impl Groups {
    /// Returns the comparisons of programs, in the order of the record.
    pub fn comparisons(&self) -> Vec<Comparison<'_>> {
        let is_compared = |g: &&Group| {
            let s = &g.setup;
            let by_size = ["strong", "spacing"].contains(&s.experiment.as_str());
            by_size && s.ranks == 1 && s.comm != Comm::Sim && g.cpu_s().is_some()
        };
        let mut all: Vec<Comparison> = Vec::new();
        for group in self.all.iter().filter(is_compared) {
            let (case, n) = (group.setup.case.as_str(), group.setup.layer_cells_min);
            let known = all.iter().position(|c| (c.case, c.layer_cells_min) == (case, n));
            let at = known.unwrap_or_else(|| {
                all.push(Comparison { case, layer_cells_min: n, programs: Vec::new() });
                all.len() - 1
            });
            let (programs, engine) = (&mut all[at].programs, group.setup.engine.as_str());
            match programs.iter_mut().find(|(name, _)| *name == engine) {
                Some((_, groups)) => groups.push(group),
                None => programs.push((engine, vec![group])),
            }
        }
        all.retain(|comparison| comparison.programs.len() > 1);
        for (_, groups) in all.iter_mut().flat_map(|c| &mut c.programs) {
            groups.sort_by_key(|group| group.cells());
        }
        all
    }
}

impl Comparison<'_> {
    /// Returns the runs that the comparison lacks: failed or left out.
    pub fn left_out<'a>(&self, groups: &'a Groups) -> Vec<&'a LeftOut> {
        let is_of = |l: &&LeftOut| {
            l.setup.case == self.case && l.setup.layer_cells_min == self.layer_cells_min
        };
        groups.left_out.iter().filter(is_of).collect()
    }

    /// Returns for every program that lacks something its name and what it lacks.
    pub fn lacks<'a>(&'a self, groups: &'a Groups) -> impl Iterator<Item = (&'a str, String)> {
        let of = |(name, _): &(&'a str, Vec<&Group>)| {
            let lacks = groups.lacks.get(*name).filter(|lacks| !lacks.is_empty())?;
            Some((*name, lacks.join(", ")))
        };
        self.programs.iter().filter_map(of)
    }
}

/// The texts of a row of the table: program, cells, CPU time, search, rate and memory.
pub fn row(group: &Group) -> [String; 6] {
    let cpu_s = group.cpu_s().map_or(f64::NAN, |time| time.value);
    [
        group.setup.engine.clone(),
        grouped(group.cells()),
        format!("{cpu_s:.2}"),
        group.search_s().map_or("not separate".to_owned(), |time| format!("{:.2}", time.value)),
        format!("{:.3}", group.cells() as f64 / cpu_s / 1e6),
        format!("{:.1}", group.bytes_per_cell().value),
    ]
}

/// Returns the table of every comparison.
pub fn tables(groups: &Groups) -> String {
    let mut out = String::new();
    let line = |cells: [&str; 6]| {
        let [engine, cells, cpu, search, rate, bytes] = cells;
        format!("  {engine:<10} {cells:>13} {cpu:>10} {search:>12} {rate:>11} {bytes:>9}\n")
    };
    for comparison in groups.comparisons() {
        let (case, n) = (comparison.case, comparison.layer_cells_min);
        let _ = writeln!(out, "\nprograms: {case}, n = {n}, one core");
        out += &line(["engine", "cells", "CPU s", "of it search", "Mc/CPU s", "B/cell"]);
        for group in comparison.programs.iter().flat_map(|(_, groups)| groups) {
            out += &line(row(group).each_ref().map(String::as_str));
        }
        for left in comparison.left_out(groups) {
            let _ =
                writeln!(out, "  no mesh at spacing {:.2e}: {}", left.setup.spacing_min, left.why);
        }
        for (engine, lacks) in comparison.lacks(groups) {
            let _ = writeln!(out, "  {engine} does not provide: {lacks}");
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::entry::{Entry, Line, Machine, Session, Setup};
    use super::*;
    use crate::testing::{line, run};

    fn by(engine: &str, cells: u64, phase: &str) -> Line {
        let mut run = run(Comm::Solo, cells, &[(phase, &[0.5]), ("rest", &[1.5])]);
        run.setup.engine = engine.into();
        line(Entry::Run(Box::new(run)))
    }

    #[test]
    fn programs_are_compared_and_what_they_cannot_do_is_stated() {
        let lacks = [("slow".to_owned(), vec!["layers".to_owned(), "MPI".to_owned()])];
        let session = Session {
            command: Vec::new(),
            machine: Machine::default(),
            load_average: 0.0,
            lacks: lacks.into(),
        };
        let setup = run(Comm::Solo, 1, &[("a", &[0.0])]).setup;
        let left = LeftOut {
            setup: Setup { engine: "slow".into(), ..setup },
            why: "slow would take 9 s".into(),
        };
        let lines = [
            line(Entry::Session(Box::new(session))),
            by("mesher", 2_000_000, "refine"),
            by("slow", 1_000_000, "search"),
            line(Entry::LeftOut(left)),
        ];
        let text = tables(&Groups::of(&lines));
        for part in [
            "mesher         2,000,000       2.00 not separate       1.000       0.5",
            "slow           1,000,000       2.00         0.50       0.500       1.0",
            "no mesh at spacing 1.00e-1: slow would take 9 s",
            "slow does not provide: layers, MPI",
        ] {
            assert!(text.contains(part), "{part} is missing in\n{text}");
        }
        assert_eq!(tables(&Groups::of(&lines[..2])), "", "one program is no comparison");
    }
}
