//! `harness shrink`: options in, a tiny case directory out, exit code.

use crate::cli::ProgramArguments;
use clap::Args;
use harness::engine::description::Description;
use harness::engine::plain::PlainCase;
use harness::engine::programs::{Given, Programs};
use harness::engine::runner::{Engine, Ranks};
use harness::shrink::leave::{Repeat, leave};
use harness::shrink::probe::{Probe, Trial};
use harness::shrink::{Budget, shrink};
use harness::verify::catalogue;
use harness::verify::report::{EXIT_FAILED, EXIT_HOLDS, EXIT_INPUT};
use std::path::PathBuf;
use std::time::Duration;

/// `harness shrink`. Exit codes: 1 the case fails (and was shrunk); 0 it does not fail.
#[derive(Args, Debug)]
pub struct ShrinkArguments {
    /// Name in geometries/catalogue.toml or path of a case file
    case: String,
    /// Name in harness/engines or path of an engine description
    #[arg(long, default_value = "mesher")]
    engine: String,
    /// Compare a run on so many ranks with the serial run [default: the serial run with the reference]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..))]
    ranks: Option<u32>,
    /// Ranks on MPI instead of simulated ones
    #[arg(long, requires = "ranks")]
    mpi: bool,
    /// Chooses the schedule of simulated ranks
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Only say whether the case fails
    #[arg(long)]
    check: bool,
    /// Where the tiny case goes [default: shrunk-CASE]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Trials at most
    #[arg(long, value_name = "N", default_value_t = 5000)]
    trials: usize,
    /// Seconds at most
    #[arg(long, value_name = "SECONDS", default_value_t = 900)]
    budget: u64,
    /// Time limit of every single run
    #[arg(long, value_name = "SECONDS", default_value_t = 60, value_parser = clap::value_parser!(u64).range(1..))]
    timeout: u64,
    #[command(flatten)]
    programs: ProgramArguments,
}

/// Shrinks, prints, writes; the exit code.
pub fn run(arguments: &ShrinkArguments) -> u8 {
    run_or_why(arguments).unwrap_or_else(|why| {
        eprintln!("harness: {why}");
        EXIT_INPUT
    })
}

fn run_or_why(arguments: &ShrinkArguments) -> Result<u8, String> {
    let given = Given {
        mesher: arguments.programs.mesher.clone(),
        reference: arguments.programs.reference.clone(),
    };
    let programs = Programs::find(given);
    let limit = Duration::from_secs(arguments.timeout);
    let engine = Engine::new(Description::find(&arguments.engine, &programs)?, &programs, limit);
    let reference = Engine::new(Description::find("reference", &programs)?, &programs, limit);
    let reference = reference.with_program(programs.reference.clone());
    let ranks = match arguments.ranks {
        None => Ranks::Serial,
        Some(ranks) if arguments.mpi => Ranks::Mpi(ranks as usize),
        Some(ranks) => Ranks::Simulated { ranks: ranks as usize, seed: arguments.seed },
    };
    let case = match arguments.case.ends_with(".toml") {
        true => PathBuf::from(&arguments.case),
        false => {
            catalogue::named(&arguments.case, &programs).map_err(|error| error.to_string())?.path
        }
    };
    let probe = Probe::new(engine, reference, ranks)?;
    if arguments.check {
        let failure = probe.failure(&Trial { case: PlainCase::read(&case)?, ranks })?;
        println!("{}", failure.as_ref().map_or("it does not fail".to_owned(), ToString::to_string));
        return Ok(if failure.is_some() { EXIT_FAILED } else { EXIT_HOLDS });
    }
    let budget = Budget { trials: arguments.trials, time: Duration::from_secs(arguments.budget) };
    let Some(shrunk) = shrink(&case, &probe, &budget)? else {
        println!("it does not fail: there is nothing to shrink");
        return Ok(EXIT_HOLDS);
    };
    let name = case.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let out = arguments.out.clone().unwrap_or_else(|| PathBuf::from(format!("shrunk-{name}")));
    let program = programs.mesher_given.as_ref().map(|path| path.to_string_lossy().into_owned());
    let repeat = Repeat { engine: arguments.engine.clone(), program };
    let told = leave(&shrunk, &probe, &repeat, &out)
        .map_err(|error| format!("{}: {error}", out.display()))?;
    println!("{told}\nThe case is in {}", out.display());
    Ok(EXIT_FAILED)
}
