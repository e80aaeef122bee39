//! A measurement session: makes runs, checks that equal meshes have equal digests, and appends to the record.

use super::entry::{Comm, Entry, Failure, LeftOut, Line, Network, Run, Session, Setup};
use super::execute::{Failed, Runner};
use super::record::Record;
use super::{machine, network};
use check::promises::Independence;
use clap::Args;
use run::engine::launcher::Launcher;
use run::engine::programs::Programs;
use run::verify::options::whole_seconds;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The options of a session, as on the command line.
#[derive(Args, Clone, Debug)]
pub struct SessionOptions {
    /// No runs on MPI
    #[arg(long)]
    pub no_mpi: bool,
    /// Repetitions of every run; 95 % intervals of a median need six
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u16).range(1..))]
    pub repeat: Option<u16>,
    /// Command that starts ranks; {ranks} is replaced by their number
    #[arg(long, default_value = "mpirun -n {ranks}", value_parser = Launcher::parse)]
    pub launcher: Launcher,
    /// Latency and bandwidth of messages in the projection [default: measured by a ping-pong]
    #[arg(long, value_name = "SECONDS,BYTES/S", value_parser = network::given)]
    pub network: Option<Network>,
    /// Time limit of every single run
    #[arg(long, value_name = "SECONDS", default_value_t = 1800, value_parser = whole_seconds)]
    pub timeout: u64,
}

impl SessionOptions {
    /// Returns how often a run is repeated that the file repeats so often.
    pub(crate) fn repeats(&self, of_file: usize) -> usize {
        self.repeat.map_or(of_file, usize::from)
    }
}

/// Why a session ended early.
#[derive(Debug, thiserror::Error)]
pub enum BenchError {
    /// Invalid input.
    #[error("{0}")]
    Input(String),
    /// Ctrl-C; the record contains all results so far.
    #[error("interrupted: the record contains all results so far")]
    Interrupted,
}

/// A run to be repeated.
pub(crate) struct Planned {
    pub setup: Setup,
    pub case: PathBuf,
    pub repeats: usize,
    /// Whether an uncounted run of its mesh comes first.
    pub warm_up: bool,
    /// Whether the mesh is written and audited, instead of timing the program.
    pub audit: bool,
    /// Whether a run failed, or none is possible.
    pub failed: bool,
}

impl Planned {
    /// The program and the case.
    pub fn mesh(&self) -> (String, PathBuf) {
        (self.setup.engine.clone(), self.case.clone())
    }
}

/// Creates a directory for the files of runs.
pub(crate) fn temporary_directory() -> Result<tempfile::TempDir, BenchError> {
    let place = tempfile::Builder::new().prefix("harness-bench-").tempdir();
    place.map_err(|error| BenchError::Input(format!("no temporary directory: {error}")))
}

/// Everything that a mesh, and so its digest, depends on: engine, case, spacing, n, and the partition unless the engine
/// promises independence of it.
type Mesh = [String; 5];

/// A running session.
pub(crate) struct Bench<'a> {
    pub(crate) options: &'a SessionOptions,
    pub(crate) runner: Runner<'a>,
    pub(crate) record: Record,
    pub(crate) progress: &'a mut dyn FnMut(&str),
    pub(crate) lines: Vec<Line>,
    digests: HashMap<Mesh, String>,
}

impl<'a> Bench<'a> {
    /// Opens the record and begins a session; runs leave their files in `place`.
    pub(crate) fn open(
        options: &'a SessionOptions,
        record: &Path,
        engines: Vec<String>,
        programs: &'a Programs,
        place: &'a Path,
        progress: &'a mut dyn FnMut(&str),
    ) -> Result<Self, BenchError> {
        let record = Record::new(record);
        let (launcher, limit) = (&options.launcher, Duration::from_secs(options.timeout));
        let runner = Runner { programs, launcher, limit, place };
        let (lines, digests) = (Vec::new(), HashMap::new());
        let mut bench = Self { options, runner, record, progress, lines, digests };
        bench.begin(engines)?;
        Ok(bench)
    }
}

impl Bench<'_> {
    pub(crate) fn append(&mut self, entry: Entry) -> Result<(), BenchError> {
        let line = self.record.append(entry).map_err(|error| {
            BenchError::Input(format!("{}: {error}", self.record.path().display()))
        })?;
        self.lines.push(line);
        Ok(())
    }

    fn begin(&mut self, engines: Vec<String>) -> Result<(), BenchError> {
        let catalogue = &self.runner.programs.paths.catalogue;
        let repository = catalogue.path().parent().and_then(Path::parent).unwrap_or(Path::new("."));
        let lacks = |engine: String| {
            let lacks = self.runner.programs.labelled(&engine).description().lacks();
            (engine, lacks)
        };
        let session = Session {
            command: std::env::args().collect(),
            machine: machine::describe(&self.options.launcher.program(), repository),
            load_average: machine::load_average(),
            lacks: engines.into_iter().map(lacks).collect(),
        };
        self.append(Entry::Session(Box::new(session)))
    }

    pub(crate) fn measure_network(&mut self) -> Result<(), BenchError> {
        let network = match self.options.network {
            Some(given) => given,
            None => match self.runner.ping_pong().and_then(|text| network::parse(&text)) {
                Ok(measured) => measured,
                Err(why) => {
                    (self.progress)(&format!(
                        "latency 2 us and bandwidth 10 GB/s are assumed: {why}"
                    ));
                    network::ASSUMED
                }
            },
        };
        self.append(Entry::Network(network))
    }

    pub(crate) fn run(
        &mut self,
        point: &mut Planned,
        repeat: usize,
        warm_up: bool,
    ) -> Result<(), BenchError> {
        let s = &point.setup;
        (self.progress)(&format!(
            "{} {} by {}: {} {} ranks, spacing {:.3e}, n {}{}",
            s.experiment,
            s.case,
            s.engine,
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
                format!(", {}, repeat {}", s.division(), repeat + 1)
            }
        ));
        let why = match self.runner.run(&point.setup, &point.case, repeat, warm_up) {
            Err(Failed::Interrupted) => return Err(BenchError::Interrupted),
            Err(Failed::Reason(why)) => why,
            Ok(run) => match self.right_mesh(point, &run).and_then(|()| self.same_mesh(&run)) {
                Ok(()) => return self.append(Entry::Run(Box::new(run))),
                Err(why) => why,
            },
        };
        self.failed(point, why)
    }

    fn failed(&mut self, point: &mut Planned, why: String) -> Result<(), BenchError> {
        (self.progress)(&format!("failed: {why}"));
        point.failed = true;
        let command = format!("{} on {} ranks", point.setup.engine, point.setup.ranks);
        self.append(Entry::Failure(Failure { setup: point.setup.clone(), command, why }))
    }

    /// Leaves a run out, with the reason.
    pub(crate) fn leave_out(&mut self, setup: Setup, why: String) -> Result<(), BenchError> {
        (self.progress)(&format!("left out, spacing {:.3e}: {why}", setup.spacing_min));
        self.append(Entry::LeftOut(LeftOut { setup, why }))
    }

    /// Writes a mesh to the record's file system and audits it.
    pub(crate) fn audit(&mut self, point: &mut Planned) -> Result<(), BenchError> {
        let s = &point.setup;
        (self.progress)(&format!("audit of {}, spacing {:.3e}, on disk", s.case, s.spacing_min));
        let disk = self.record.path().parent().filter(|p| !p.as_os_str().is_empty());
        let disk = disk.unwrap_or(Path::new("."));
        match self.runner.audit(s, &point.case, disk) {
            Ok(audited) => self.append(Entry::Audit(audited)),
            Err(Failed::Interrupted) => Err(BenchError::Interrupted),
            Err(Failed::Reason(why)) => self.failed(point, why),
        }
    }

    /// Requires the mesh of an engine that promises the definition to be that of the mesher, once for each mesh.
    fn right_mesh(&self, point: &Planned, run: &Run) -> Result<(), String> {
        let engine = self.runner.programs.labelled(&point.setup.engine);
        if !run.warm_up || engine.name() == "mesher" || !engine.description().promises.definition {
            return Ok(());
        }
        let s = &point.setup;
        let setup = Setup::serial(&s.case, s.spacing_min, s.layer_cells_min);
        let expected = match self.runner.run(&setup, &point.case, 0, true) {
            Ok(run) => run.digest,
            // Whether the mesher can be run is not a property of this engine.
            Err(_) => return Ok(()),
        };
        match expected == run.digest {
            true => Ok(()),
            false => Err(format!(
                "the mesh has digest {}, but that of the definition has {expected}",
                run.digest
            )),
        }
    }

    /// Requires runs that must have the same mesh to have the same digest: the time of a wrong mesh is not a result.
    fn same_mesh(&mut self, run: &Run) -> Result<(), String> {
        let promises = &self.runner.programs.labelled(&run.setup.engine).description().promises;
        if !promises.is_deterministic() {
            return Ok(());
        }
        let s = &run.setup;
        let mut partition = String::new();
        if !promises.is_independent_of(Independence::Ranks) {
            partition.push_str(&s.ranks.to_string());
        }
        if !promises.is_independent_of(Independence::Partitioner) {
            partition.push_str(&s.partitioner);
        }
        let (spacing, n) = (format!("{:e}", s.spacing_min), s.layer_cells_min.to_string());
        let mesh = [s.engine.clone(), s.case.clone(), spacing, n, partition];
        let first = self.digests.entry(mesh).or_insert_with(|| run.digest.clone());
        if *first == run.digest {
            return Ok(());
        }
        Err(format!("the mesh has digest {}, but that of an earlier run has {first}", run.digest))
    }
}
