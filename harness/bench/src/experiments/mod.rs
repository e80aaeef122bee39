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
pub mod foreign;
pub mod group;
pub mod machine;
pub mod network;
pub mod plan;
mod points;
pub mod pop;
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
    for study in &options.studies {
        bench.study(study)?;
    }
    let failures = bench.lines.iter().filter(|l| matches!(l.entry, Entry::Failure(_))).count();
    Ok(Outcome { lines: bench.lines, failures })
}

impl Bench<'_> {
    /// Runs a study.
    fn study(&mut self, study: &Study) -> Result<(), BenchError> {
        let base = self.base(&study.case)?;
        (self.progress)(&format!(
            "{} scaling of {}: choosing spacings",
            study.experiment, base.name
        ));
        let mut points = self.points(study, &base)?;
        self.warm_up(&mut points)?;
        for repeat in 0..study.repeats {
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

    /// Meshes every case once, excluded from statistics, to fill the file cache.
    fn warm_up(&mut self, points: &mut [Point]) -> Result<(), BenchError> {
        for index in warmers(points) {
            self.run(&mut points[index], 0, true)?;
        }
        Ok(())
    }
}
