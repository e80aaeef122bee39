//! A session of measurements: the options that `harness bench` and `harness targets` share, and its end.

use super::files::prepare;
use super::programs::ProgramArguments;
use bench::experiments::entry::Network;
use bench::experiments::network;
use bench::experiments::plan::Study;
use bench::experiments::record::{self, Content};
use bench::experiments::session::{BenchError, Options};
use clap::Args;
use run::engine::launcher::Launcher;
use run::verify::report::{EXIT_INPUT, EXIT_INTERRUPTED, EXIT_MISSING, exit_first};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Options for the measurements and for their results.
#[derive(Args, Debug)]
pub struct SessionArguments {
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
    /// File of JSON lines to append to [default: reports/out/bench.jsonl]
    #[arg(long, value_name = "FILE")]
    pub record: Option<PathBuf>,
    /// Time limit of every single run
    #[arg(long, value_name = "SECONDS", default_value_t = 1800, value_parser = super::values::whole_seconds)]
    pub timeout: u64,
    /// Also write a report; the record is then DIR/record.jsonl unless --record is given
    #[arg(long, value_name = "DIR")]
    pub report: Option<PathBuf>,
    /// Paths of the programs.
    #[command(flatten)]
    pub programs: ProgramArguments,
}

impl SessionArguments {
    /// Checks that the report can be written, before anything is measured.
    ///
    /// # Errors
    /// The exit code, if its directory cannot be created or written.
    pub fn prepare(&self) -> Result<(), u8> {
        let page = self.report.as_ref().map(|directory| directory.join("index.html"));
        page.iter().try_for_each(|page| prepare(page)).map_err(|error| {
            eprintln!("harness: {error}");
            EXIT_INPUT
        })
    }

    /// Returns the record to append to.
    pub fn record_path(&self) -> PathBuf {
        let in_report = self.report.as_ref().map(|directory| directory.join("record.jsonl"));
        let given = self.record.clone().or(in_report);
        given.unwrap_or_else(|| PathBuf::from("reports/out/bench.jsonl"))
    }

    /// Returns the time limit of a run.
    pub fn limit(&self) -> Duration {
        Duration::from_secs(self.timeout)
    }

    /// Returns the options of a session with these studies.
    pub fn options(&self, studies: Vec<Study>) -> Options {
        Options {
            studies,
            launcher: self.launcher.clone(),
            network: self.network,
            record: self.record_path(),
            limit: self.limit(),
            command: std::env::args().collect(),
        }
    }

    /// Reads the existing record.
    ///
    /// # Errors
    /// The exit code, if it cannot be read.
    pub fn read_record(&self) -> Result<Content, u8> {
        let path = self.record_path();
        let content = record::read(&path).map_err(|error| {
            eprintln!("harness: {}: {error}", path.display());
            EXIT_INPUT
        })?;
        for (line, why) in &content.broken {
            eprintln!("harness: line {line} is skipped: {why}");
        }
        Ok(content)
    }

    /// Writes the report if `--report` is given; returns the greater of its exit code and `code`.
    pub fn write_report(&self, code: u8) -> u8 {
        let Some(directory) = &self.report else { return code };
        match super::report::write(directory, &[], None) {
            Ok(()) => code,
            Err(why) => {
                eprintln!("harness: {why}");
                exit_first(code, EXIT_INPUT)
            }
        }
    }
}

/// Checks that a program to be measured exists.
///
/// # Errors
/// The exit code, if it is missing.
pub fn require(program: &Path) -> Result<(), u8> {
    if program.is_file() {
        return Ok(());
    }
    eprintln!("harness: {} is missing: build it or give its path", program.display());
    Err(EXIT_MISSING)
}

/// Returns a function that prints progress to standard error with the elapsed seconds.
pub fn progress() -> impl FnMut(&str) {
    let start = Instant::now();
    move |what| eprintln!("[{:>5} s] {what}", start.elapsed().as_secs())
}

/// Prints why the session ended early; returns the exit code.
pub fn refuse(error: &BenchError) -> u8 {
    eprintln!("harness: {error}");
    match error {
        BenchError::Input(_) => EXIT_INPUT,
        BenchError::Missing(_) => EXIT_MISSING,
        BenchError::Interrupted => EXIT_INTERRUPTED,
    }
}
