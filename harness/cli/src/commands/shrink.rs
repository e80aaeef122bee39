//! `harness shrink`: reduces a failing case and writes it as a directory.

use crate::options::{EngineArguments, whole_seconds};
use bench::shrink::probe::{Probe, Trial};
use bench::shrink::{fault, shrink, write};
use clap::Args;
use contract::case::Case;
use contract::failure::{EXIT_FAILED, EXIT_HOLDS, Failure, Result};
use contract::files::{Staging, nearest_directory};
use contract::plain::PlainCase;
use run::engine::layout::Ranks;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// `harness shrink`. Exit codes: 1 the case fails (and was shrunk); 0 it does not fail; 3 the engine does not support it.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Name in geometries/catalogue.toml or path of a case file
    case: String,
    /// Compare a run on N ranks with the serial run [default: the serial run with the reference]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..))]
    ranks: Option<u32>,
    /// Ranks on MPI instead of simulated ones
    #[arg(long, requires = "ranks")]
    mpi: bool,
    /// Seed of the schedule of simulated ranks
    #[arg(long, default_value_t = 1, requires = "ranks", conflicts_with = "mpi")]
    seed: u64,
    /// The check that must keep failing, by its name in `harness verify` [default: the one that fails first]
    #[arg(long, value_name = "NAME")]
    check: Option<String>,
    /// Only test whether the case fails
    #[arg(long, conflicts_with_all = ["out", "budget"])]
    test_only: bool,
    /// Directory for the reduced case [default: shrunk-CASE]
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Maximum time
    #[arg(long, value_name = "SECONDS", default_value_t = 900)]
    budget: u64,
    /// Time limit of every single run
    #[arg(long, value_name = "SECONDS", default_value = "60", value_parser = whole_seconds)]
    timeout: Duration,
    #[command(flatten)]
    engine: EngineArguments,
}

/// Shrinks, prints and writes; returns the exit code.
///
/// # Errors
/// If the engine does not support the case, or a program cannot be run.
pub fn run(arguments: &Arguments) -> Result<u8> {
    let EngineArguments { engine, programs: given } = &arguments.engine;
    let programs = arguments.engine.find()?;
    programs.require()?;
    let ranks = match arguments.ranks {
        None => Ranks::Serial,
        Some(ranks) if arguments.mpi => Ranks::Mpi(ranks as usize),
        Some(ranks) => Ranks::Simulated { ranks: ranks as usize, seed: arguments.seed },
    };
    let path = programs.paths.catalogue.case_file(&arguments.case, Path::new(""))?;
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let out = arguments.out.clone().unwrap_or_else(|| PathBuf::from(format!("shrunk-{name}")));
    let why = "is there already: remove it, or give another directory with --out";
    Failure::unless(arguments.test_only || !out.exists(), Failure::about(&out, why))?;
    let named = |error| Failure::at(&out, error);
    let staging = || Staging::inside(nearest_directory(&out)).map_err(named);
    let staging = (!arguments.test_only).then(staging).transpose()?;
    let probe = Probe::new(programs.engine, programs.reference, arguments.timeout)?;
    let trial = Trial { case: PlainCase::of(&Case::read(&path)?), ranks };
    let Some(first) = fault(&probe.judge(&trial)?, arguments.check.as_deref())? else {
        println!("the case does not fail {}", arguments.check.as_deref().unwrap_or("any check"));
        return Ok(EXIT_HOLDS);
    };
    let Some(staging) = staging else {
        println!("{first}");
        return Ok(EXIT_FAILED);
    };
    eprintln!("harness shrink: the case fails {first}");
    let limit = Duration::from_secs(arguments.budget);
    let shrunk = shrink(trial, &first, limit, |trial| probe.judge(trial))?;
    let timeout = arguments.timeout.as_secs().to_string();
    let mut options = vec!["--engine", engine, "--timeout", &timeout];
    let given = [("--mesher", &given.mesher), ("--reference", &given.reference)];
    let given = given.map(|(option, path)| Some((option, path.as_deref()?.to_string_lossy())));
    options.extend(given.iter().flatten().flat_map(|(option, path)| [*option, &**path]));
    let readme = write(&shrunk, &options, &staging, &out).map_err(named)?;
    println!("{readme}\nThe case is in {}", out.display());
    Ok(EXIT_FAILED)
}
