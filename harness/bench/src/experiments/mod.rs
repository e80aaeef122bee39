//! Performance experiments: run times, their causes and their scaling.
//!
//! [`bench()`] runs the studies of a [`plan`] and appends every result to a [`record`] immediately. All tables and figures are
//! computed from the record alone, by [`group`], [`pop`], [`cause`] and [`table`] here and by the crate `report`. They can
//! therefore be reproduced at any time on any machine.
//!
//! Repetitions are the outer loop, so that a drift of the machine affects all setups equally.

pub mod cause;
pub mod entry;
pub mod execute;
mod feasible;
#[cfg(test)]
mod foreign;
pub mod group;
pub mod machine;
pub mod network;
pub mod number;
pub mod plan;
mod points;
pub mod pop;
pub mod programs;
pub mod record;
pub mod session;
pub mod sizing;
pub mod table;
pub mod variant;

use entry::{Comm, Entry, Line};
use plan::Study;
use points::warmers;
use run::engine::programs::Programs;
use session::{Bench, BenchError, Options, Point};
use std::collections::BTreeMap;
use std::path::Path;
use variant::Base;

/// The result of a session.
#[derive(Debug)]
pub struct Outcome {
    /// The lines it appended to the record.
    pub lines: Vec<Line>,
    /// Number of failures among them.
    pub failures: usize,
}

/// Runs a session. `progress` receives messages for the user.
///
/// # Errors
/// If the input is invalid, a program is missing, or the user interrupts.
pub fn bench(
    options: &Options,
    programs: &Programs,
    progress: &mut dyn FnMut(&str),
) -> Result<Outcome, BenchError> {
    let place = session::temporary_directory()?;
    let mut bench = Bench::open(options, programs, place.path(), progress)?;
    if options.studies.iter().flat_map(|s| &s.layouts).any(|l| l.comm == Comm::Sim) {
        bench.measure_network()?;
    }
    for studies in options.studies.chunk_by(Study::has_meshes_of) {
        bench.studies(studies)?;
    }
    let failures = bench.lines.iter().filter(|l| matches!(l.entry, Entry::Failure(_))).count();
    Ok(Outcome { lines: bench.lines, failures })
}

impl Bench<'_> {
    /// Runs the studies of the same meshes by several programs, which take turns.
    fn studies(&mut self, studies: &[Study]) -> Result<(), BenchError> {
        let first = &studies[0];
        let base = self.base(&first.case)?;
        (self.progress)(&format!(
            "{} scaling of {}: choosing spacings",
            first.experiment, base.name
        ));
        let (mut sizes, mut points) = (BTreeMap::new(), Vec::new());
        for study in studies {
            points.extend(self.points(study, &base, &mut sizes)?);
        }
        self.warm_up(&mut points)?;
        for repeat in 0..first.repeats {
            for point in points.iter_mut().filter(|p| !p.failed) {
                self.run(point, repeat, false)?;
            }
        }
        Ok(())
    }

    /// Reads a case by its name in the catalogue or its path, and writes its geometry as an STL file.
    fn base(&self, case: &str) -> Result<Base, BenchError> {
        let catalogue = &self.runner.programs.paths.catalogue;
        let path = catalogue.case_file(case, Path::new("")).map_err(BenchError::Input)?;
        Base::read(&path, self.runner.place).map_err(BenchError::Input)
    }

    /// Meshes every case once, excluded from statistics, to fill the file cache. A program that would exceed the time or
    /// the memory is not run on that mesh.
    fn warm_up(&mut self, points: &mut [Point]) -> Result<(), BenchError> {
        for index in warmers(points) {
            let setup = points[index].setup.clone();
            let Some(why) = feasible::excess(&self.lines, &setup, self.runner.limit) else {
                self.run(&mut points[index], 0, true)?;
                continue;
            };
            let case = points[index].case.clone();
            let of_mesh = |p: &&mut Point| p.case == case && p.setup.engine == setup.engine;
            points.iter_mut().filter(of_mesh).for_each(|point| point.failed = true);
            self.leave_out(setup, why)?;
        }
        Ok(())
    }
}
