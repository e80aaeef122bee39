//! `harness planted`: the program that `harness gate --selftest` compares with itself.

use bench::gate::planted::{self, Kind, PHASES, SlowDown};
use clap::Args;
use run::verify::report::{EXIT_HOLDS, EXIT_INPUT};
use std::path::PathBuf;

/// `harness planted`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// A case file, which is not read
    case: PathBuf,
    /// How the program is slowed down
    #[arg(long, default_value = "counted")]
    kind: Kind,
    /// The phase that is slowed down, from 0
    #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u8).range(0..PHASES.len() as i64))]
    phase: u8,
    /// Additional time in percent
    #[arg(long, default_value_t = 0.0)]
    percent: f64,
    /// Write the run report
    #[arg(long)]
    json: Option<PathBuf>,
}

/// Does the work; returns the exit code.
pub fn run(arguments: &Arguments) -> u8 {
    let slow = SlowDown {
        kind: arguments.kind,
        phase: usize::from(arguments.phase),
        percent: arguments.percent,
    };
    match planted::run(arguments.json.as_deref(), slow) {
        Ok(()) => EXIT_HOLDS,
        Err(error) => {
            eprintln!("harness: the run report could not be written: {error}");
            EXIT_INPUT
        }
    }
}
