//! How a run is distributed over ranks, on which its mesh does not depend, how ranks on MPI are started, and the files and limits of a run.
//!
//! Invariant: the shared memory of a run on one machine lies in a directory of its own, so that cleaning up after a
//! killed run cannot affect another run.

use super::paths::on_path;
use super::service::{Services, Start};
use contract::files::publications;
use serde::{Deserialize, Serialize};
use std::ffi::OsStr;
use std::fmt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;
use tempfile::TempDir;

/// The number of ranks and their kind.
///
/// The JSON form of ranks on MPI is the number alone; no others are recorded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Ranks {
    /// One rank, without messages.
    Serial,
    /// Ranks within one process, scheduled in an order that the seed determines.
    Simulated {
        /// Number of ranks.
        ranks: usize,
        /// Seed of the schedule.
        seed: u64,
    },
    /// Processes on MPI.
    Mpi(usize),
}

impl Ranks {
    /// Number of ranks.
    pub fn count(self) -> usize {
        match self {
            Self::Serial => 1,
            Self::Simulated { ranks, .. } | Self::Mpi(ranks) => ranks,
        }
    }
}

impl fmt::Display for Ranks {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Serial => f.write_str("serial"),
            Self::Simulated { ranks, seed } => write!(f, "{ranks} simulated ranks, seed {seed}"),
            Self::Mpi(1) => f.write_str("1 rank"),
            Self::Mpi(ranks) => write!(f, "{ranks} ranks"),
        }
    }
}

/// Ranks, and the choices that determine which rank owns which part of the mesh. A choice that is `None` is left to
/// the engine, and an engine that does not offer a choice ignores it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Layout {
    /// The ranks.
    pub ranks: Ranks,
    /// `metis` or `morton`.
    pub partitioner: Option<String>,
    /// `auto` or the level of the partition.
    pub level_base: Option<String>,
    /// The weights of base leaves in the partition.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weights: Option<String>,
}

impl Layout {
    /// These ranks, with every choice left to the engine.
    pub const fn on(ranks: Ranks) -> Self {
        Self { ranks, partitioner: None, level_base: None, weights: None }
    }

    /// The number of ranks of a run on several; `None` for a serial run.
    pub fn rank_count(&self) -> Option<usize> {
        (self.ranks != Ranks::Serial).then(|| self.ranks.count())
    }
}

/// The layout of a serial run.
pub static SERIAL: Layout = Layout::on(Ranks::Serial);

impl fmt::Display for Layout {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}", self.ranks)?;
        let choices =
            [("", &self.partitioner), ("base ", &self.level_base), ("weights ", &self.weights)];
        let mut chosen = choices.iter().filter_map(|(label, of)| Some((label, of.as_ref()?)));
        chosen.try_for_each(|(label, choice)| write!(f, ", {label}{choice}"))
    }
}

/// Files, choices and limits of a run.
pub struct RunOptions<'a> {
    /// Directory for the run report, the status and the logs, which is made; no other run may use it at the same time.
    pub place: &'a Path,
    /// Time after which the run is killed.
    pub limit: Duration,
    /// Leaf-set directory to write. An engine without a run report writes its mesh even if this is `None`, to `mesh`
    /// in `place`.
    pub mesh: Option<&'a Path>,
    /// Write a run report. Without one, cells and digest are read from the mesh.
    pub report: bool,
    /// Stop at the base tree.
    pub ungraded: bool,
    /// Time each simulated rank alone, if the engine can.
    pub time_alone: bool,
    /// Where runs on MPI use the engine's service, if it has one. Any such run keeps the ranks' activity on disk, to report it if it hangs.
    pub services: Option<&'a Services>,
}

impl<'a> RunOptions<'a> {
    /// A run that writes a run report and nothing else.
    pub fn new(place: &'a Path, limit: Duration) -> Self {
        let (ungraded, time_alone) = (false, false);
        Self { place, limit, mesh: None, report: true, ungraded, time_alone, services: None }
    }

    pub(super) fn report_path(&self) -> PathBuf {
        self.place.join("run.json")
    }

    /// Where the ranks' activity is kept, if it is.
    pub(super) fn status_path(&self) -> Option<PathBuf> {
        self.services.map(|_| self.place.join("status"))
    }
}

/// The placeholder for the number of ranks.
const RANKS: &str = "{ranks}";

/// A launcher's command template, such as `srun -n {ranks} --cpu-bind=cores`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Launcher {
    words: Vec<String>,
}

impl Launcher {
    /// Parses a template: words separated by blanks, with `{ranks}` at least once.
    ///
    /// # Errors
    /// One sentence, if `{ranks}` is missing.
    pub fn parse(text: &str) -> Result<Self, String> {
        let words: Vec<String> = text.split_whitespace().map(str::to_owned).collect();
        let why = "has no place for the number of ranks";
        let why = || format!("the launcher `{text}` {why}: write {RANKS} there");
        text.contains(RANKS).then_some(Self { words }).ok_or_else(why)
    }

    /// `mpirun -n {ranks}`, with the program at this path.
    pub fn mpirun(program: &Path) -> Self {
        Self { words: vec![program.to_string_lossy().into_owned(), "-n".into(), RANKS.into()] }
    }

    /// The launcher's own program.
    pub fn program(&self) -> PathBuf {
        PathBuf::from(&self.words[0])
    }

    /// Whether that program exists, at its path or on the `PATH`.
    pub fn is_found(&self) -> bool {
        self.program().is_file() || on_path(&self.words[0]).is_some()
    }

    /// The words that start a program on `ranks` ranks.
    pub fn words(&self, ranks: usize) -> impl Iterator<Item = String> {
        self.words.iter().map(move |word| word.replace(RANKS, &ranks.to_string()))
    }

    /// The command that runs `program` on `ranks` ranks, prepared as by [`Self::prepare`]; the caller adds the arguments.
    pub fn command(&self, ranks: usize, program: impl AsRef<OsStr>) -> Start {
        let mut words = self.words(ranks);
        let mut command = Command::new(words.next().expect("a template has a word with {ranks}"));
        command.args(words).arg(program);
        let shared = self.prepare(&mut command);
        (command, shared)
    }

    /// Prepares the environment of a run, and makes a directory for its shared memory. `None` if the launcher may start ranks on other
    /// machines, where the directory would not exist, or if this machine has no `/dev/shm`; OpenMPI then uses its own default.
    pub fn prepare(&self, command: &mut Command) -> Option<TempDir> {
        set_environment(command);
        let is_mpirun = self.program().file_name() == Some(OsStr::new("mpirun"));
        // In a job of Slurm, mpirun starts ranks on all of its nodes.
        let is_local = is_mpirun && self.words[1..] == ["-n", RANKS] && node_count() == 1;
        if is_local { own_directory(command) } else { None }
    }
}

/// Returns the number of machines on which ranks run: that of Slurm's job, else 1.
pub fn node_count() -> usize {
    std::env::var("SLURM_JOB_NUM_NODES").ok().and_then(|n| n.parse().ok()).unwrap_or(1)
}

/// Makes a directory for the files of OpenMPI, which leaves them if its ranks or daemon are killed. `None` if this machine has no
/// `/dev/shm`.
pub fn own_directory(command: &mut Command) -> Option<TempDir> {
    let made = tempfile::Builder::new().prefix("harness-").tempdir_in("/dev/shm").ok()?;
    publications().push(made.path().to_owned());
    command.env("OMPI_MCA_btl_vader_backing_directory", made.path());
    command.env("OMPI_MCA_orte_tmpdir_base", made.path());
    Some(made)
}

/// Sets the environment that OpenMPI needs to run as root and with more ranks than cores, also for a program that
/// initialises MPI without `mpirun`.
pub fn set_environment(command: &mut Command) {
    command
        .env("OMPI_ALLOW_RUN_AS_ROOT", "1")
        .env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")
        .env("OMPI_MCA_rmaps_base_oversubscribe", "1")
        // In a job of Slurm, several jobs of ranks share the allocation; without this, each would wait for the one before it.
        .env("SLURM_OVERLAP", "1")
        // On a shared machine, other work may occupy the cores that ranks would be bound to.
        .env("OMPI_MCA_hwloc_base_binding_policy", "none");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_layout_on_mpi_has_a_label_and_a_json_form() {
        let layout = Layout {
            partitioner: Some("metis".into()),
            level_base: Some("auto".into()),
            ..Layout::on(Ranks::Mpi(3))
        };
        assert_eq!(layout.to_string(), "3 ranks, metis, base auto");
        let json = serde_json::to_string(&layout).unwrap();
        assert_eq!(json, r#"{"ranks":3,"partitioner":"metis","level_base":"auto"}"#);
        assert_eq!(serde_json::from_str::<Layout>(&json).unwrap(), layout);
    }

    #[test]
    fn a_template_is_filled_in() {
        let launcher = Launcher::parse("srun -n {ranks} --tasks={ranks}").unwrap();
        let (command, _) = launcher.command(16, "mesher");
        let words: Vec<_> = command.get_args().map(|w| w.to_string_lossy().into_owned()).collect();
        assert_eq!(words, ["-n", "16", "--tasks=16", "mesher"]);
        assert_eq!(command.get_program(), "srun");
        assert!(Launcher::parse("mpirun -n 4").unwrap_err().contains("{ranks}"));
    }

    #[test]
    fn only_a_run_on_this_machine_has_its_own_shared_memory() {
        let cluster = Launcher::parse("mpirun --hostfile hosts -n {ranks}").unwrap();
        let mut command = Command::new("true");
        assert!(cluster.prepare(&mut command).is_none());
        let local = Launcher::mpirun(Path::new("/usr/bin/mpirun"));
        assert_eq!(local.prepare(&mut command).is_some(), Path::new("/dev/shm").is_dir());
    }
}
