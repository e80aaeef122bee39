//! One run of any engine on a case: command line made from its description, watched, its results read.

use super::description::{Description, Values, fill};
use super::mpi::{self, SharedMemory};
use super::paths::Paths;
use super::process::{self, End, Watch};
use contract::leafset::{self, LeafSet};
use contract::plain::PlainCase;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

/// How many ranks, and of what kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ranks {
    /// No other ranks.
    Serial,
    /// Ranks within one process, under a schedule chosen by the seed.
    Simulated {
        /// How many.
        ranks: usize,
        /// Chooses the schedule.
        seed: u64,
    },
    /// Processes on MPI.
    Mpi(usize),
}

impl fmt::Display for Ranks {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Serial => f.write_str("serial"),
            Self::Simulated { ranks, seed } => write!(f, "{ranks} simulated ranks, seed {seed}"),
            Self::Mpi(ranks) => write!(f, "{ranks} ranks on MPI"),
        }
    }
}

/// An engine, ready to be run.
#[derive(Clone, Debug)]
pub struct Engine {
    description: Description,
    program: PathBuf,
    places: Values<'static>,
    limit: Duration,
}

/// What a run told of itself.
#[derive(Clone, Debug, Default)]
pub struct Told {
    /// Cells of the mesh.
    pub cells: u64,
    /// The mesh's digest.
    pub digest: String,
    /// Counters, summed over ranks.
    pub counters: BTreeMap<String, u64>,
    /// CPU time of all ranks' phases, where it is told.
    pub time_cpu_s: Option<f64>,
    /// CPU time by phase, summed over ranks.
    pub phases_cpu_s: Vec<(String, f64)>,
    /// Start to end of the process.
    pub time_process_s: f64,
}

/// Why there is no result.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NoResult {
    /// The engine cannot do this, or cannot be started.
    Missing(String),
    /// It failed: the kind of failure, and in its own words.
    Failed(String),
    /// It did not end in time.
    Hung(String),
    /// The user asked to end.
    Interrupted,
}

impl fmt::Display for NoResult {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Missing(why) | Self::Failed(why) | Self::Hung(why) => f.write_str(why),
            Self::Interrupted => f.write_str("interrupted"),
        }
    }
}

/// The parts of `--json` that are looked at here; all but the first two may be missing.
#[derive(Debug, Deserialize)]
struct RunRecord {
    cells: u64,
    digest: String,
    #[serde(default)]
    counters: BTreeMap<String, Vec<u64>>,
    #[serde(default)]
    phases: Vec<PhaseRecord>,
}

#[derive(Debug, Deserialize)]
struct PhaseRecord {
    name: String,
    #[serde(default)]
    time_cpu_s: Vec<f64>,
}

impl Engine {
    /// An engine as described, with the program that the command line gave or that the file names.
    pub fn new(description: Description, paths: &Paths, limit: Duration) -> Self {
        let program = description.program(paths);
        let places = description.places(paths);
        Self { description, program, places, limit }
    }

    /// The same engine with another program: another revision of it.
    pub fn with_program(&self, program: PathBuf) -> Self {
        Self { program, ..self.clone() }
    }

    /// The description.
    pub fn description(&self) -> &Description {
        &self.description
    }

    /// The program.
    pub fn program(&self) -> &Path {
        &self.program
    }

    /// Time limit of a run.
    pub fn limit(&self) -> Duration {
        self.limit
    }

    /// A case file that the engine can read and that means what the given one does: that one itself, or
    /// a plain one in `directory`.
    ///
    /// # Errors
    /// Where the case cannot be read or the plain one not be written.
    pub fn prepare(&self, case: &Path, directory: &Path) -> Result<PathBuf, String> {
        if self.description.takes.generator {
            return Ok(case.to_owned());
        }
        std::fs::create_dir_all(directory).map_err(|error| error.to_string())?;
        PlainCase::read(case)?.write(directory).map_err(|error| error.to_string())
    }

    /// The command of a run. Collects templates and fills them.
    ///
    /// # Errors
    /// Where the description does not say how this is done.
    pub fn command(&self, case: &Path, ranks: Ranks, wanted: &Wanted) -> Result<Command, NoResult> {
        let templates = &self.description.run;
        let cannot = |what: &str| {
            NoResult::Missing(format!("{} does not say how it is {what}", self.description.name))
        };
        let mut values = self.places.clone();
        let told = |path: &Path| path.to_string_lossy().into_owned();
        values.extend([
            ("program", told(&self.program)),
            ("case", told(case)),
            ("partitioner", wanted.partitioner.to_owned()),
            ("level_base", wanted.level_base.to_owned()),
        ]);
        let mut words = match ranks {
            Ranks::Serial => templates.serial.clone(),
            Ranks::Simulated { ranks, seed } => {
                values.extend([("ranks", ranks.to_string()), ("seed", seed.to_string())]);
                templates.simulated.clone().ok_or_else(|| cannot("run on simulated ranks"))?
            }
            Ranks::Mpi(ranks) => {
                values.insert("ranks", ranks.to_string());
                templates.parallel.clone().ok_or_else(|| cannot("run on MPI"))?
            }
        };
        if let Some(out) = wanted.out {
            values.insert("out", told(out));
            words.extend(templates.out.clone());
        }
        // A record or a status that an engine cannot write is done without.
        for (name, path, template) in
            [("json", wanted.json, &templates.json), ("status", wanted.status, &templates.status)]
        {
            if let (Some(path), Some(template)) = (path, template) {
                values.insert(name, told(path));
                words.extend(template.clone());
            }
        }
        if wanted.ungraded {
            words.extend(
                templates.ungraded.clone().ok_or_else(|| cannot("stopped at the base tree"))?,
            );
        }
        let mut words = words.iter().map(|word| fill(word, &values));
        let program = words.next().ok_or_else(|| cannot("run"))?;
        let mut command = Command::new(program);
        command.args(words);
        for (name, value) in &templates.environment {
            command.env(name, fill(value, &values));
        }
        Ok(command)
    }

    /// Runs the engine in an existing directory that nothing else uses. Writes the mesh only if it is
    /// wanted, or if there is no other way to learn its digest.
    ///
    /// # Errors
    /// Where it fails, hangs, or does not say what it should.
    pub fn run(
        &self,
        case: &Path,
        ranks: Ranks,
        place: &Path,
        write: bool,
    ) -> Result<(Told, Option<LeafSet>), NoResult> {
        let (mesh, json) = (place.join("mesh"), place.join("run.json"));
        let silent = self.description.run.json.is_none();
        let wanted = Wanted {
            out: (write || silent).then_some(mesh.as_path()),
            json: Some(&json),
            ..Wanted::default()
        };
        let time_process_s = self.execute(case, ranks, &wanted, place)?;
        let failed = NoResult::Failed;
        let set = match wanted.out {
            Some(out) => Some(
                leafset::read(out).map_err(|error| failed(format!("unreadable mesh: {error}")))?,
            ),
            None => None,
        };
        let told = match (silent, &set) {
            (true, Some(set)) => Told {
                cells: set.words.len() as u64,
                digest: set.manifest.digest.to_string(),
                ..Told::default()
            },
            _ => read_record(&json).map_err(failed)?,
        };
        Ok((Told { time_process_s, ..told }, set))
    }

    /// Starts, watches, judges; the process's wall time.
    fn execute(
        &self,
        case: &Path,
        ranks: Ranks,
        wanted: &Wanted,
        place: &Path,
    ) -> Result<f64, NoResult> {
        let mut command = self.command(case, ranks, wanted)?;
        let shared = SharedMemory::new();
        if matches!(ranks, Ranks::Mpi(_)) {
            mpi::set_environment(&mut command);
            shared.add_to(&mut command);
        }
        let watch = Watch { limit: self.limit, logs: place, name: "run", status: None };
        let finished = process::run(&mut command, &watch).map_err(|error| {
            NoResult::Missing(format!("{:?} cannot be started: {error}", command.get_program()))
        })?;
        match finished.end {
            End::Exited(0) => Ok(finished.time_wall_s),
            End::Exited(code) => {
                Err(NoResult::Failed(format!("exit {code}: {}", finished.first_error_line())))
            }
            End::Signalled(signal) => Err(NoResult::Failed(format!("died of signal {signal}"))),
            End::TimedOut => {
                Err(NoResult::Hung(format!("did not end within {} s", self.limit.as_secs())))
            }
            End::Interrupted => Err(NoResult::Interrupted),
        }
    }
}

/// Files and choices of a run.
#[derive(Clone, Copy, Debug)]
pub struct Wanted<'a> {
    /// Leaf-set directory to be made.
    pub out: Option<&'a Path>,
    /// Record of the run.
    pub json: Option<&'a Path>,
    /// Directory for the ranks' status files.
    pub status: Option<&'a Path>,
    /// Stop at the base tree.
    pub ungraded: bool,
    /// For engines that can choose.
    pub partitioner: &'a str,
    /// For engines that can choose.
    pub level_base: &'a str,
}

impl Default for Wanted<'_> {
    fn default() -> Self {
        Self {
            out: None,
            json: None,
            status: None,
            ungraded: false,
            partitioner: "morton",
            level_base: "auto",
        }
    }
}

fn read_record(path: &Path) -> Result<Told, String> {
    let wrong = |why: String| format!("{}: {why}", path.display());
    let text = std::fs::read_to_string(path).map_err(|error| wrong(error.to_string()))?;
    let record: RunRecord =
        serde_json::from_str(&text).map_err(|error| wrong(error.to_string()))?;
    let counters = record.counters.into_iter();
    let phases = record.phases.into_iter();
    let phases_cpu_s: Vec<(String, f64)> =
        phases.map(|phase| (phase.name, phase.time_cpu_s.iter().sum())).collect();
    let time_cpu_s = phases_cpu_s.iter().map(|(_, time)| time).sum::<f64>();
    Ok(Told {
        cells: record.cells,
        digest: record.digest,
        counters: counters.map(|(name, ranks)| (name, ranks.iter().sum())).collect(),
        time_cpu_s: (time_cpu_s > 0.0).then_some(time_cpu_s),
        phases_cpu_s,
        time_process_s: 0.0,
    })
}
