//! `harness planted`: the program that `harness gate --selftest` compares with itself.

use bench::gate::planted::{self, Kind, PHASES, SlowDown};
use clap::{Args, ValueEnum};
use run::verify::report::{EXIT_HOLDS, EXIT_INPUT};
use std::hint::black_box;
use std::path::PathBuf;
use std::thread;

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
    /// End with a fault of the harness itself instead
    #[arg(long)]
    fault: Option<Fault>,
}

/// A fault of the harness.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Fault {
    /// A panic on the main thread.
    Panic,
    /// A panic on another thread, for which the main thread waits.
    Thread,
    /// A request for more memory than there is.
    Memory,
}

impl Fault {
    fn occur(self) {
        match self {
            Self::Panic => panic!("planted"),
            Self::Thread => thread::scope(|scope| _ = scope.spawn(|| panic!("planted"))),
            Self::Memory => drop(black_box(vec![0_u8; 1 << 62])),
        }
    }
}

/// Does the work; returns the exit code.
pub fn run(arguments: &Arguments) -> u8 {
    if let Some(fault) = arguments.fault {
        let _place = tempfile::tempdir();
        fault.occur();
    }
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
