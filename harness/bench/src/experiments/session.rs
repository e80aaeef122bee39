//! A measurement session: makes runs, checks that equal meshes have equal digests, and appends to the record.

use super::entry::{Entry, Failure, LeftOut, Line, Network, Run, Session, Setup};
pub use super::execute::BenchError;
use super::execute::Runner;
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

/// Everything that a mesh, and so its digest, depends on: engine, case, spacing, n, and the partition unless the engine
/// promises independence of it.
type Mesh = [String; 5];

/// A running session.
pub(crate) struct Bench<'a> {
    pub(crate) options: &'a SessionOptions,
    pub(crate) runner: Runner<'a>,
    pub(crate) progress: &'a mut dyn FnMut(&str),
    pub(crate) lines: Vec<Line>,
    record: Record,
    digests: HashMap<Mesh, String>,
    /// Whether the cost of messages is known.
    network: bool,
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
        let (launcher, limit) = (&options.launcher, Duration::from_secs(options.timeout));
        let catalogue = programs.paths.catalogue.path();
        let repository = catalogue.parent().and_then(Path::parent).unwrap_or(Path::new("."));
        let lacks = |engine: String| {
            let lacks = programs.labelled(&engine).description().lacks();
            (engine, lacks)
        };
        let session = Session {
            command: std::env::args().collect(),
            machine: machine::describe(&launcher.program(), repository),
            load_average: machine::load_average(),
            lacks: engines.into_iter().map(lacks).collect(),
        };
        let mut bench = Self {
            options,
            runner: Runner { programs, launcher, limit, place },
            progress,
            lines: Vec::new(),
            record: Record::new(record),
            digests: HashMap::new(),
            network: false,
        };
        bench.append(Entry::Session(Box::new(session)))?;
        Ok(bench)
    }

    pub(crate) fn append(&mut self, entry: Entry) -> Result<(), BenchError> {
        let line = self.record.append(entry).map_err(|error| {
            BenchError::Input(format!("{}: {error}", self.record.path().display()))
        })?;
        self.lines.push(line);
        Ok(())
    }

    /// Records the cost of messages, once.
    pub(crate) fn measure_network(&mut self) -> Result<(), BenchError> {
        if std::mem::replace(&mut self.network, true) {
            return Ok(());
        }
        let measured = || self.runner.ping_pong().and_then(|text| network::parse(&text));
        let network = self.options.network.map_or_else(measured, Ok).unwrap_or_else(|why| {
            (self.progress)(&format!("latency 2 us and bandwidth 10 GB/s are assumed: {why}"));
            network::ASSUMED
        });
        self.append(Entry::Network(network))
    }

    /// Runs a point, or writes and audits its mesh, and records the result.
    pub(crate) fn run(
        &mut self,
        point: &mut Planned,
        repeat: usize,
        warm_up: bool,
    ) -> Result<(), BenchError> {
        let s = &point.setup;
        let repetition = match (point.audit, warm_up) {
            (true, _) => "audit on disk".to_owned(),
            (false, true) => "warm-up".to_owned(),
            (false, false) => format!("{}, repeat {}", s.division(), repeat + 1),
        };
        (self.progress)(&format!(
            "{} {} by {}: {} ranks ({}), spacing {:.3e}, n {}, {repetition}",
            s.experiment,
            s.case,
            s.engine,
            s.ranks,
            crate::name_of(&s.comm),
            s.spacing_min,
            s.layer_cells_min,
        ));
        let entry = match point.audit {
            true => self.audited(point),
            false => self.timed(point, repeat, warm_up),
        };
        match entry {
            Ok(entry) => self.append(entry),
            Err(BenchError::Interrupted) => Err(BenchError::Interrupted),
            Err(BenchError::Input(why)) => {
                (self.progress)(&format!("failed: {why}"));
                point.failed = true;
                let setup = point.setup.clone();
                let command = format!("{} on {} ranks", setup.engine, setup.ranks);
                self.append(Entry::Failure(Failure { setup, command, why }))
            }
        }
    }

    fn timed(
        &mut self,
        point: &Planned,
        repeat: usize,
        warm_up: bool,
    ) -> Result<Entry, BenchError> {
        let run = self.runner.run(&point.setup, &point.case, repeat, warm_up)?;
        self.check_mesh(point, &run)?;
        Ok(Entry::Run(Box::new(run)))
    }

    /// Writes a mesh to the record's file system and audits it.
    fn audited(&mut self, point: &Planned) -> Result<Entry, BenchError> {
        let disk = self.record.path().parent().filter(|p| !p.as_os_str().is_empty());
        let disk = disk.unwrap_or(Path::new("."));
        Ok(Entry::Audit(self.runner.audit(&point.setup, &point.case, disk)?))
    }

    /// Leaves a run out, with the reason.
    pub(crate) fn leave_out(&mut self, setup: Setup, why: String) -> Result<(), BenchError> {
        (self.progress)(&format!("left out, spacing {:.3e}: {why}", setup.spacing_min));
        self.append(Entry::LeftOut(LeftOut { setup, why }))
    }

    /// Requires runs that must have the same mesh to have the same digest: the time of a wrong mesh is not a result. The mesh of an
    /// engine that promises the definition must be that of the mesher, which is made once for each mesh.
    fn check_mesh(&mut self, point: &Planned, run: &Run) -> Result<(), String> {
        let engine = self.runner.programs.labelled(&point.setup.engine);
        let (promises, s) = (&engine.description().promises, &run.setup);
        if run.warm_up && engine.name() != "mesher" && promises.definition {
            let setup = Setup::serial(&s.case, s.spacing_min, s.layer_cells_min);
            // Whether the mesher can be run is not a property of this engine.
            let expected = self.runner.run(&setup, &point.case, 0, true);
            if let Some(expected) = expected.ok().filter(|other| other.digest != run.digest) {
                return Err(format!(
                    "the mesh has digest {}, but that of the definition has {}",
                    run.digest, expected.digest
                ));
            }
        }
        let ranks = !promises.is_independent_of(Independence::Ranks);
        let partitioner = !promises.is_independent_of(Independence::Partitioner);
        let partition =
            [ranks.then(|| s.ranks.to_string()), partitioner.then(|| s.partitioner.clone())];
        let partition = partition.into_iter().flatten().collect();
        let (spacing, n) = (format!("{:e}", s.spacing_min), s.layer_cells_min.to_string());
        let mesh = [s.engine.clone(), s.case.clone(), spacing, n, partition];
        let first = self.digests.entry(mesh).or_insert_with(|| run.digest.clone());
        match *first == run.digest || !promises.is_deterministic() {
            true => Ok(()),
            false => Err(format!(
                "the mesh has digest {}, but that of an earlier run has {first}",
                run.digest
            )),
        }
    }
}
