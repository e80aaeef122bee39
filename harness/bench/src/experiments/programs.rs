//! Several programs on the same cases, on one core: CPU time, geometry search, memory, and what each cannot do.
//!
//! Times are CPU times of whole processes, seen from outside: they include the start of the program and reading, hardly
//! depend on other processes, and mean the same for every program. A phase named `search` is the part of that time in which
//! a program finds the facets near an octant.

use super::entry::{Comm, LeftOut, Run};
use super::group::{Group, Groups};
use crate::order::by_key;
use crate::statistics::{Median, median};

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
    pub fn comparisons<'a>(&'a self) -> Vec<Comparison<'a>> {
        let is_compared = |g: &&Group| {
            let s = &g.setup;
            let by_size = ["strong", "spacing"].contains(&s.experiment.as_str());
            by_size && s.ranks == 1 && s.comm != Comm::Sim && g.cpu_s().is_some()
        };
        let of_case = |g: &'a Group| (g.setup.case.as_str(), g.setup.layer_cells_min);
        let by_case = by_key(self.all.iter().filter(is_compared), of_case);
        let comparison = |((case, layer_cells_min), groups): ((&'a str, u32), Vec<&'a Group>)| {
            let mut programs = by_key(groups, |g| g.setup.engine.as_str());
            programs.iter_mut().for_each(|(_, groups)| groups.sort_by_key(|group| group.cells()));
            Comparison { case, layer_cells_min, programs }
        };
        let all = by_case.into_iter().map(comparison);
        all.filter(|comparison| comparison.programs.len() > 1).collect()
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
