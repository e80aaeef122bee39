//! Runs a program once and reads what it says of itself.

use super::entry::{Audited, Comm, Phase, Run, Setup, Spread};
use super::launcher::Launcher;
use super::machine;
use check::audit::record::AuditRecord;
use run::engine::memory::Scales;
use run::engine::process::{self, End, Finished, Watch};
use run::engine::programs::Programs;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

/// Most ranks between which messages are told pair by pair: there may be as many entries as pairs.
pub const MATRIX_RANKS_MAX: usize = 64;

/// What every run of a session has in common.
#[derive(Debug)]
pub struct Runner<'a> {
    /// Where programs are.
    pub programs: &'a Programs,
    /// How ranks are started.
    pub launcher: &'a Launcher,
    /// A run is killed after this.
    pub limit: Duration,
    /// Directory for the runs' files.
    pub place: &'a Path,
}

/// Why there is no result.
#[derive(Debug)]
pub enum Failed {
    /// The user asked the harness to end.
    Interrupted,
    /// The program did not do what it should, in a sentence.
    Because(String),
}

/// A program's `--json`, as far as it has it: the reference knows neither ranks nor phases.
#[derive(Debug, Default, Deserialize)]
pub(super) struct Told {
    #[serde(default)]
    facets: u64,
    cells: u64,
    digest: String,
    #[serde(default)]
    time_wall_s: Option<f64>,
    #[serde(default)]
    peak_rss_bytes: Option<OneOrMany>,
    #[serde(default)]
    pub(super) phases: Vec<PhaseTold>,
    #[serde(default)]
    counters: BTreeMap<String, Vec<f64>>,
    #[serde(default)]
    message_matrix: Vec<[u64; 4]>,
}

#[derive(Debug, Deserialize)]
#[serde(untagged)]
pub(super) enum OneOrMany {
    One(f64),
    Many(Vec<f64>),
}

impl Told {
    /// Reads `--json`.
    pub(super) fn read(json: &Path) -> Result<Self, String> {
        let text = std::fs::read_to_string(json).map_err(|error| error.to_string());
        text.and_then(|text| serde_json::from_str(&text).map_err(|error| error.to_string()))
            .map_err(|error| format!("its --json cannot be read: {error}"))
    }

    /// A program that told nothing but its mesh.
    pub(super) fn of_mesh(cells: u64, digest: String) -> Self {
        Self { cells, digest, ..Self::default() }
    }

    /// Adds what was seen from outside where the program does not tell it.
    pub(super) fn seen(&mut self, time_wall_s: f64, peak_rss_bytes: u64) {
        self.time_wall_s.get_or_insert(time_wall_s);
        self.peak_rss_bytes.get_or_insert(OneOrMany::One(peak_rss_bytes as f64));
    }
}

/// A phase; another program than the mesher may tell no more than its CPU time.
#[derive(Debug, Deserialize)]
pub(super) struct PhaseTold {
    name: String,
    #[serde(default)]
    time_wall_s: Vec<f64>,
    #[serde(default)]
    time_cpu_s: Vec<f64>,
    #[serde(default)]
    time_comm_wall_s: Vec<f64>,
    #[serde(default)]
    time_comm_cpu_s: Vec<f64>,
    #[serde(default)]
    messages: Vec<f64>,
    #[serde(default)]
    message_bytes: Vec<f64>,
}

impl PhaseTold {
    /// CPU time outside calls to other ranks, by rank. The clocks' ticks may make a difference negative.
    fn useful_s(&self) -> Vec<f64> {
        let comm = self.time_comm_cpu_s.iter().copied().chain(std::iter::repeat(0.0));
        self.time_cpu_s.iter().zip(comm).map(|(all, comm)| (all - comm).max(0.0)).collect()
    }
}

impl Runner<'_> {
    /// Runs `setup` on the case file `case`.
    ///
    /// # Errors
    /// Where that gives no result.
    pub fn run(
        &self,
        setup: &Setup,
        case: &Path,
        repeat: usize,
        warm_up: bool,
    ) -> Result<Run, Failed> {
        let _ = std::fs::remove_file(self.place.join("run.json"));
        let (told, shown, finished) = match self.foreign(setup) {
            Some(engine) => self.told_by_engine(engine, setup, case)?,
            None => self.told_by_own(setup, case, warm_up)?,
        };
        let mut run = of_told(setup.clone(), &told);
        (run.repeat, run.warm_up, run.command) = (repeat, warm_up, shown);
        run.time_launch_s = finished.time_wall_s;
        run.oversubscribed = setup.comm == Comm::Mpi && setup.ranks > machine::cores();
        Ok(run)
    }

    /// Runs the mesher or the reference; what it tells, its command line, how it ended.
    fn told_by_own(
        &self,
        setup: &Setup,
        case: &Path,
        warm_up: bool,
    ) -> Result<(Told, String, Finished), Failed> {
        let json = self.place.join("run.json");
        let mut command = self.command(setup, case);
        command.arg("--json").arg(&json);
        // The counts of one run are those of all, and gathering them should disturb none that is timed.
        if warm_up && tells_matrix(setup) {
            command.arg("--message-matrix");
        }
        let shown = shown(&command, self.place);
        let finished = self.watched(&mut command, &[0], None)?;
        let mut told = Told::read(&json).map_err(Failed::Because)?;
        told.seen(finished.time_wall_s, 0);
        Ok((told, shown, finished))
    }

    /// Has the mesh of `setup` written into a directory of its own in `disk`, and `harness audit` read it; the
    /// directory is removed.
    ///
    /// # Errors
    /// Where that gives no verdict; a mesh at fault is one.
    pub fn audit(&self, setup: &Setup, case: &Path, disk: &Path) -> Result<Audited, Failed> {
        let because = |error: std::io::Error| Failed::Because(error.to_string());
        let place = tempfile::Builder::new().prefix("harness-audit-").tempdir_in(disk);
        let place = place.map_err(because)?;
        let mesh = place.path().join("mesh");
        let mut command = self.command(setup, case);
        command.arg("--out").arg(&mesh);
        self.watched(&mut command, &[0], None)?;
        let json = self.place.join("audit.json");
        let _ = std::fs::remove_file(&json);
        let mut command = Command::new(&self.programs.paths.harness);
        command.arg("audit").arg(&mesh).arg("--json").arg(&json);
        let shown = shown(&command, self.place);
        // 1: a check failed, which the record tells.
        self.watched(&mut command, &[0, 1], None)?;
        let told = AuditRecord::read(&json).map_err(Failed::Because)?;
        let found = told.checks.iter().filter(|c| c.findings > 0).map(|c| c.name.clone());
        Ok(Audited {
            setup: setup.clone(),
            command: shown,
            cells: told.leaves,
            holds: told.holds,
            found: found.collect(),
            time_cpu_s: told.time_cpu_s,
            time_wall_s: told.time_wall_s,
            peak_rss_bytes: told.peak_rss_bytes,
        })
    }

    /// Runs a command to its end, which must be one of these exit codes, and weighs it where there are scales.
    pub(super) fn watched(
        &self,
        command: &mut Command,
        codes: &[i32],
        scales: Option<&mut Scales>,
    ) -> Result<Finished, Failed> {
        let watch = Watch { limit: self.limit, logs: self.place, name: "run", status: None };
        let finished = match scales {
            Some(scales) => process::run_weighed(command, &watch, scales),
            None => process::run(command, &watch),
        };
        let finished = finished
            .map_err(|error| Failed::Because(format!("it could not be started: {error}")))?;
        let why = match finished.end {
            End::Exited(code) if codes.contains(&code) => return Ok(finished),
            End::Interrupted => return Err(Failed::Interrupted),
            End::TimedOut => format!("killed after {} s", self.limit.as_secs()),
            End::Exited(code) => {
                format!("it ended with code {code}: {}", finished.first_error_line())
            }
            End::Signalled(signal) => format!("it was ended by signal {signal}"),
        };
        Err(Failed::Because(why))
    }

    fn command(&self, setup: &Setup, case: &Path) -> Command {
        if setup.engine == "reference" {
            let mut command = Command::new(&self.programs.paths.reference);
            command.arg(case);
            return command;
        }
        let mesher = &self.programs.paths.mesher;
        let (mut command, comm) = match setup.comm {
            Comm::Solo => (Command::new(mesher), "solo".to_owned()),
            Comm::Sim => (Command::new(mesher), format!("sim:{}", setup.ranks)),
            Comm::Mpi => (self.launcher.command(setup.ranks, mesher), "mpi".to_owned()),
        };
        command.arg(case).args(["--quiet", "--comm", &comm]);
        for (option, value) in
            [("--partitioner", &setup.partitioner), ("--weights", &setup.weights)]
        {
            if !value.is_empty() {
                command.args([option, value]);
            }
        }
        command
    }

    /// Runs the ping-pong on two ranks; what it prints.
    ///
    /// # Errors
    /// One sentence, where it is not there or does not run.
    pub fn ping_pong(&self) -> Result<String, String> {
        let program = self.programs.paths.mesher.with_file_name("pingpong");
        if !program.is_file() {
            return Err(format!(
                "{} is not there: build the mesher with --features mpi",
                program.display()
            ));
        }
        let mut command = self.launcher.command(2, &program);
        let watch = Watch {
            limit: Duration::from_secs(120),
            logs: self.place,
            name: "pingpong",
            status: None,
        };
        let finished = process::run(&mut command, &watch).map_err(|error| error.to_string())?;
        match finished.end {
            End::Exited(0) => {
                std::fs::read_to_string(&finished.stdout).map_err(|error| error.to_string())
            }
            _ => Err(format!("the ping-pong failed: {}", finished.first_error_line())),
        }
    }
}

/// Whether messages between pairs of ranks are wanted of a setup: in strong scaling of the mesher.
pub fn tells_matrix(setup: &Setup) -> bool {
    let ranks = (2..=MATRIX_RANKS_MAX).contains(&setup.ranks);
    setup.experiment == "strong" && setup.engine == "mesher" && setup.comm == Comm::Sim && ranks
}

/// A run as a program tells it; what the harness knows of it is the caller's to add.
fn of_told(setup: Setup, told: &Told) -> Run {
    let mut useful_s = vec![0.0; setup.ranks];
    for phase in &told.phases {
        useful_s.iter_mut().zip(phase.useful_s()).for_each(|(sum, u)| *sum += u);
    }
    let time_wall_s = told.time_wall_s.unwrap_or(0.0);
    if told.phases.is_empty() {
        useful_s = vec![time_wall_s; setup.ranks];
    }
    let phase = |p: &PhaseTold| Phase {
        name: p.name.clone(),
        useful_s: Spread::of(&p.useful_s()),
        wall_s: Spread::brief(&p.time_wall_s),
        comm_s: Spread::brief(&p.time_comm_wall_s),
        messages: Spread::brief(&p.messages),
        message_bytes: Spread::brief(&p.message_bytes),
    };
    let peak = match &told.peak_rss_bytes {
        None => Vec::new(),
        Some(OneOrMany::One(bytes)) => vec![*bytes],
        // One process holds all simulated ranks, and each tells its peak.
        Some(OneOrMany::Many(bytes)) if setup.comm == Comm::Sim => {
            vec![bytes.iter().copied().fold(0.0, f64::max)]
        }
        Some(OneOrMany::Many(bytes)) => bytes.clone(),
    };
    Run {
        repeat: 0,
        warm_up: false,
        oversubscribed: false,
        command: String::new(),
        facets: told.facets,
        cells: told.cells,
        digest: told.digest.clone(),
        time_wall_s,
        time_launch_s: 0.0,
        peak_rss_bytes: Spread::brief(&peak),
        useful_s: Spread::of(&useful_s),
        phases: told.phases.iter().map(phase).collect(),
        counters: told.counters.iter().map(|(name, v)| (name.clone(), Spread::brief(v))).collect(),
        message_matrix: told.message_matrix.clone(),
        setup,
    }
}

/// A command line for people, with the directories of programs and of this session's files left out.
pub(super) fn shown(command: &Command, place: &Path) -> String {
    let word = |w: &std::ffi::OsStr| {
        let path = Path::new(w);
        let local = path
            .strip_prefix(place)
            .ok()
            .or_else(|| path.is_absolute().then(|| Path::new(path.file_name().unwrap_or(w))));
        local.unwrap_or(path).to_string_lossy().into_owned()
    };
    std::iter::once(command.get_program())
        .chain(command.get_args())
        .map(word)
        .collect::<Vec<_>>()
        .join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOLD: &str = r#"{"schema": "octree-mesher-run/1", "facets": 12, "cells": 80, "digest": "00", "ranks": 2,
        "message_matrix": [[0, 1, 3, 96]], "time_wall_s": 9.0, "peak_rss_bytes": [70, 70], "counters": {"leaves": [30, 50]},
        "phases": [{"name": "read", "time_wall_s": [4.0, 4.5], "time_cpu_s": [2.0, 1.0], "time_comm_wall_s": [1.0, 1.0],
          "time_comm_cpu_s": [0.5, 1.1], "messages": [1, 1], "message_bytes": [8, 16]}]}"#;

    fn setup(comm: Comm, ranks: usize) -> Setup {
        Setup { ranks, comm, ..crate::testing::run(comm, 1, &[("a", &[0.0])]).setup }
    }

    #[test]
    fn useful_time_is_cpu_time_outside_calls() {
        let told: Told = serde_json::from_str(TOLD).unwrap();
        let run = of_told(setup(Comm::Mpi, 2), &told);
        assert_eq!((run.phases[0].useful_s.max, run.phases[0].useful_s.at), (1.5, 0));
        assert_eq!(run.useful_s.by_rank, [1.5, 0.0]);
        assert_eq!(run.phases[0].useful_s.by_rank, [1.5, 0.0]);
        assert_eq!(run.message_matrix, [[0, 1, 3, 96]]);
        assert_eq!((run.useful_s.sum, run.useful_s.max), (1.5, 1.5));
        assert_eq!((run.peak_rss_bytes.sum, run.counters["leaves"].max), (140.0, 50.0));
        // All simulated ranks live in one process.
        assert_eq!(of_told(setup(Comm::Sim, 2), &told).peak_rss_bytes.sum, 70.0);
    }

    #[test]
    fn a_program_without_phases_has_its_wall_time() {
        let text = r#"{"cells": 8, "digest": "00", "time_wall_s": 0.5, "peak_rss_bytes": 9}"#;
        let run = of_told(setup(Comm::Solo, 1), &serde_json::from_str(text).unwrap());
        assert_eq!((run.useful_s.sum, run.peak_rss_bytes.sum), (0.5, 9.0));
    }

    #[test]
    fn a_shown_command_names_no_place_of_the_machine() {
        let mut command = Command::new("/opt/bin/mpirun");
        command.args(["-n", "2", "/opt/bin/mesher", "/tmp/x/uav.toml"]);
        assert_eq!(shown(&command, Path::new("/tmp/x")), "mpirun -n 2 mesher uav.toml");
    }
}
