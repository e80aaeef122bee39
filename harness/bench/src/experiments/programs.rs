//! Several programs on the same cases, on one core: CPU time, geometry search, memory, and what each cannot do.
//!
//! Times are CPU times of whole processes, seen from outside: they include the start of the program and reading, hardly
//! depend on other processes, and mean the same for every program. A phase named `search` is the part of that time in which
//! a program finds the facets near an octant. With mpirun, times and memory are those of both.

use super::entry::{Comm, Setup};
use super::group::{Group, Groups};
use crate::order::by_key;
use statistics::Median;

impl Group {
    /// Returns the CPU time of the whole process, in seconds; `None` if a run does not have it.
    pub fn cpu_s(&self) -> Option<Median> {
        self.median_of(|run| Some(run.time_cpu_s).filter(|time| *time != 0.0))
    }

    /// Returns the CPU time of the geometry search, in seconds; `None` if the program does not report it.
    pub fn search_s(&self) -> Option<Median> {
        self.median_of(|run| {
            let search = run.phases.iter().filter(|phase| phase.name == "search");
            search.map(|phase| phase.useful_s.sum).reduce(|a, b| a + b)
        })
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
    /// Runs that failed or were left out, and what the programs do not provide, a sentence each.
    pub notes: Vec<String>,
}

fn is_on_one_core(setup: &Setup) -> bool {
    setup.ranks == 1 && setup.comm != Comm::Sim
}

impl Groups {
    /// Returns the comparisons of programs, in the order of the record.
    pub fn comparisons(&self) -> Vec<Comparison<'_>> {
        let is_compared = |g: &&Group| {
            let by_size = ["strong", "spacing"].contains(&g.setup.experiment.as_str());
            by_size && is_on_one_core(&g.setup) && g.cpu_s().is_some()
        };
        let of_case = |g: &Group| (g.setup.case.clone(), g.setup.layer_cells_min);
        let by_case = by_key(self.all.iter().filter(is_compared), of_case);
        let all = by_case.into_iter().map(|(_, groups)| self.comparison(groups));
        all.filter(|comparison| comparison.programs.len() > 1).collect()
    }

    fn comparison<'a>(&'a self, groups: Vec<&'a Group>) -> Comparison<'a> {
        let (case, layer_cells_min) = (&groups[0].setup.case, groups[0].setup.layer_cells_min);
        let mut programs = by_key(groups, |g| g.setup.engine.as_str());
        programs.iter_mut().for_each(|(_, groups)| groups.sort_by_key(|group| group.cells()));
        let left_out = self.left_out.iter().filter(|left| {
            let s = &left.setup;
            (&s.case, s.layer_cells_min) == (case, layer_cells_min) && is_on_one_core(s)
        });
        let left_out = left_out.map(|left| {
            let is_repeated = self.all.iter().any(|group| group.setup == left.setup);
            let what = if is_repeated { "A run is missing" } else { "No mesh" };
            format!("{what} at spacing {:.2e}: {}", left.setup.spacing_min, left.why)
        });
        let lacks = programs.iter().filter_map(|(name, _)| {
            let lacks = self.lacks.get(*name).filter(|lacks| !lacks.is_empty())?;
            Some(format!("{name} does not provide: {}", lacks.join(", ")))
        });
        let notes = left_out.chain(lacks).collect();
        Comparison { case, layer_cells_min, programs, notes }
    }
}
