//! Measurements: how long, why, and how it scales.
//!
//! [`bench()`] runs the studies of a [`plan`] and appends every result to a [`record`] at once. What is said
//! of them is computed from the record alone, by [`group`], [`pop`], [`cause`] and [`table`] here and by
//! [`report`](crate::report), so that it can be said again at any time, on any machine.
//!
//! Repetitions are the outer loop: what drifts on a machine drifts through all setups alike.

pub mod cause;
pub mod entry;
pub mod execute;
pub mod foreign;
pub mod group;
pub mod launcher;
pub mod machine;
pub mod network;
pub mod plan;
mod points;
pub mod pop;
pub mod record;
pub mod sizing;
pub mod stats;
pub mod table;
pub mod targets;
pub mod variant;

use crate::engine::programs::Programs;
use entry::{Comm, Failure, Line, Network, Run, Session, What};
use execute::{Failed, Runner};
use launcher::Launcher;
use plan::Study;
use points::{Point, in_catalogue, warmers};
use record::Record;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::time::Duration;
use variant::Base;

/// What is asked for.
#[derive(Debug)]
pub struct Options {
    /// The studies, in order.
    pub studies: Vec<Study>,
    /// `mesher`, `reference`, or what the record calls the engine of `Programs`.
    pub engine: String,
    /// How ranks are started.
    pub launcher: Launcher,
    /// Latency and bandwidth; measured if not given and the launcher is there.
    pub network: Option<Network>,
    /// The record.
    pub record: PathBuf,
    /// Time limit of a run.
    pub limit: Duration,
    /// The harness's command line, for the record.
    pub command: Vec<String>,
}

/// Why measuring ended early.
#[derive(Debug, thiserror::Error)]
pub enum BenchError {
    /// The user's input.
    #[error("{0}")]
    Input(String),
    /// Something is missing that was asked for.
    #[error("{0}")]
    Missing(String),
    /// Ctrl-C; what was measured is in the record.
    #[error("interrupted: what was measured so far is in the record")]
    Interrupted,
}

/// What a session gave.
#[derive(Debug)]
pub struct Outcome {
    /// Its lines in the record.
    pub lines: Vec<Line>,
    /// Number of failures among them.
    pub failures: usize,
}

/// Measures. `say` is told what is being done.
///
/// # Errors
/// Where the input is at fault, something is missing, or the user interrupts.
pub fn bench(
    options: &Options,
    programs: &Programs,
    say: &mut dyn FnMut(&str),
) -> Result<Outcome, BenchError> {
    let place = temporary_directory()?;
    let mut bench = Bench::open(options, programs, place.path(), say)?;
    if options.studies.iter().flat_map(|s| &s.layouts).any(|l| l.comm == Comm::Sim) {
        bench.measure_network()?;
    }
    for study in &options.studies {
        bench.study(study)?;
    }
    let failures = bench.lines.iter().filter(|l| matches!(l.what, What::Failure(_))).count();
    Ok(Outcome { lines: bench.lines, failures })
}

fn temporary_directory() -> Result<tempfile::TempDir, BenchError> {
    let place = tempfile::Builder::new().prefix("harness-bench-").tempdir();
    place.map_err(|error| BenchError::Input(format!("no temporary directory: {error}")))
}

/// What a mesh depends on, as text; its digest must depend on nothing else.
type Mesh = (String, String, u32);

/// A session under way.
struct Bench<'a> {
    options: &'a Options,
    runner: Runner<'a>,
    record: Record,
    say: &'a mut dyn FnMut(&str),
    lines: Vec<Line>,
    digests: HashMap<Mesh, String>,
}

impl<'a> Bench<'a> {
    /// Opens the record and begins a session; runs leave their files in `place`.
    fn open(
        options: &'a Options,
        programs: &'a Programs,
        place: &'a Path,
        say: &'a mut dyn FnMut(&str),
    ) -> Result<Self, BenchError> {
        let record = Record::open(&options.record)
            .map_err(|error| BenchError::Input(format!("{}: {error}", options.record.display())))?;
        let (launcher, limit) = (&options.launcher, options.limit);
        let runner = Runner { programs, launcher, limit, place };
        let (lines, digests) = (Vec::new(), HashMap::new());
        let mut bench = Self { options, runner, record, say, lines, digests };
        bench.begin()?;
        Ok(bench)
    }
}

impl Bench<'_> {
    fn append(&mut self, what: What) -> Result<(), BenchError> {
        let line = self.record.append(what).map_err(|error| {
            BenchError::Input(format!("{}: {error}", self.record.path().display()))
        })?;
        self.lines.push(line);
        Ok(())
    }

    fn begin(&mut self) -> Result<(), BenchError> {
        let catalogue = &self.runner.programs.catalogue;
        let repository = catalogue.parent().and_then(Path::parent).unwrap_or(Path::new("."));
        let session = Session {
            command: self.options.command.clone(),
            machine: machine::describe(&self.options.launcher.program(), repository),
            load_average: machine::load_average(),
        };
        self.append(What::Session(Box::new(session)))
    }

    fn measure_network(&mut self) -> Result<(), BenchError> {
        let network = match self.options.network {
            Some(given) => given,
            None => match self.runner.ping_pong().and_then(|text| network::parse(&text)) {
                Ok(measured) => measured,
                Err(why) => {
                    (self.say)(&format!("messages are assumed to cost 2 us and 10 GB/s: {why}"));
                    network::ASSUMED
                }
            },
        };
        self.append(What::Network(network))
    }

    /// Runs an experiment.
    fn study(&mut self, study: &Study) -> Result<(), BenchError> {
        let base = self.base(&study.case)?;
        (self.say)(&format!("{} scaling of {}: choosing spacings", study.experiment, base.name));
        let mut points = self.points(study, &base)?;
        self.warm_up(&mut points)?;
        for repeat in 0..study.repeats {
            for point in points.iter_mut().filter(|p| !p.failed) {
                self.run(point, repeat, false)?;
            }
        }
        Ok(())
    }

    /// The case by its name in the catalogue or its path, with its geometry written out.
    fn base(&self, case: &str) -> Result<Base, BenchError> {
        let path = match case.ends_with(".toml") {
            true => PathBuf::from(case),
            false => {
                in_catalogue(case, &self.runner.programs.catalogue).map_err(BenchError::Input)?
            }
        };
        Base::read(&path, self.runner.place).map_err(BenchError::Input)
    }

    /// Every mesh once, unrecorded in statistics: it brings files into memory.
    fn warm_up(&mut self, points: &mut [Point]) -> Result<(), BenchError> {
        for at in warmers(points) {
            self.run(&mut points[at], 0, true)?;
        }
        Ok(())
    }

    fn run(&mut self, point: &mut Point, repeat: usize, warm_up: bool) -> Result<(), BenchError> {
        let s = &point.setup;
        (self.say)(&format!(
            "{} {}: {} {} ranks, spacing {:.3e}, n {}{}",
            s.experiment,
            s.case,
            match s.comm {
                Comm::Sim => "simulated",
                Comm::Mpi => "MPI",
                Comm::Solo => "serial",
            },
            s.ranks,
            s.spacing_min,
            s.layer_cells_min,
            if warm_up {
                ", warm-up".to_owned()
            } else {
                format!(", {}, repeat {}", table::division(s), repeat + 1)
            }
        ));
        let why = match self.runner.run(&point.setup, &point.case, repeat, warm_up) {
            Err(Failed::Interrupted) => return Err(BenchError::Interrupted),
            Err(Failed::Because(why)) => why,
            Ok(run) => match self.same_mesh(&run) {
                Ok(()) => return self.append(What::Run(Box::new(run))),
                Err(why) => why,
            },
        };
        self.failed(point, why)
    }

    fn failed(&mut self, point: &mut Point, why: String) -> Result<(), BenchError> {
        (self.say)(&format!("failed: {why}"));
        point.failed = true;
        let command = format!("{} on {} ranks", self.options.engine, point.setup.ranks);
        self.append(What::Failure(Failure { setup: point.setup.clone(), command, why }))
    }

    /// Has a mesh written beside the record and audited.
    fn audit(&mut self, point: &mut Point) -> Result<(), BenchError> {
        let s = &point.setup;
        (self.say)(&format!("audit of {}, spacing {:.3e}, on disk", s.case, s.spacing_min));
        let disk = self.record.path().parent().filter(|p| !p.as_os_str().is_empty());
        let disk = disk.unwrap_or(Path::new("."));
        match self.runner.audit(s, &point.case, disk) {
            Ok(audited) => self.append(What::Audit(audited)),
            Err(Failed::Interrupted) => Err(BenchError::Interrupted),
            Err(Failed::Because(why)) => self.failed(point, why),
        }
    }

    /// The time of a wrong mesh is no result: all runs of a mesh have one digest.
    fn same_mesh(&mut self, run: &Run) -> Result<(), String> {
        let s = &run.setup;
        let mesh = (s.case.clone(), format!("{:e}", s.spacing_min), s.layer_cells_min);
        let first = self.digests.entry(mesh).or_insert_with(|| run.digest.clone());
        if *first == run.digest {
            return Ok(());
        }
        Err(format!("its mesh has the digest {}, where another run of it had {first}", run.digest))
    }
}
