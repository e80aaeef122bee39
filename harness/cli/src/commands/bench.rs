//! `harness bench`: runs experiments, appends to the record and prints tables.

use super::session::{SessionArguments, progress, refuse, require};
use super::values::cell_count;
use bench::experiments::entry::Entry;
use bench::experiments::foreign::{OWN, label};
use bench::experiments::group::Groups;
use bench::experiments::plan::{self, Experiment, Overrides, Preset, studies};
use bench::experiments::session::Options;
use bench::experiments::{bench, table};
use clap::Args;
use run::engine::programs::Programs;
use run::verify::report::{EXIT_FAILED, EXIT_HOLDS, EXIT_INPUT, EXIT_MISSING};

/// `harness bench`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Names in geometries/catalogue.toml or paths of case files [default: those of the preset]
    pub cases: Vec<String>,
    /// Sizes and rank counts
    #[arg(long, value_enum, default_value = "small")]
    pub preset: Preset,
    /// Experiments to run [default: all]
    #[arg(long, value_enum, value_delimiter = ',')]
    pub experiment: Vec<Experiment>,
    /// Ranks of simulated runs, as in 1,2,7 or 1..64 for powers of two [default: those of the preset]
    #[arg(long, value_parser = rank_list)]
    pub ranks: Option<RankList>,
    /// Ranks of runs on MPI
    #[arg(long, value_parser = rank_list, conflicts_with = "no_mpi")]
    pub ranks_mpi: Option<RankList>,
    /// Cells of the mesh (strong, weights), per rank (weak), of the largest mesh (spacing), at the case's n (layers)
    #[arg(long, value_delimiter = ',', value_parser = cell_count)]
    pub cells: Vec<u64>,
    /// Values of n in the experiment `layers`
    #[arg(long, value_delimiter = ',')]
    pub layers: Vec<u32>,
    /// Weights of base leaves: unit, area, rebalance
    #[arg(long, value_delimiter = ',')]
    pub weights: Vec<String>,
    /// Partitioners: metis, morton
    #[arg(long, value_delimiter = ',')]
    pub partitioners: Vec<String>,
    /// Program to measure: mesher, reference, or an engine description (a name in harness/engines or a TOML file)
    #[arg(long, value_name = "NAME|FILE", default_value = "mesher")]
    pub engine: String,
    /// Print the tables of an existing record without measuring
    #[arg(long)]
    pub show: bool,
    /// Options of the session.
    #[command(flatten)]
    pub session: SessionArguments,
}

/// A list of rank counts, as one argument.
#[derive(Clone, Debug)]
pub struct RankList(pub Vec<usize>);

fn rank_list(text: &str) -> Result<RankList, String> {
    plan::ranks(text).map(RankList)
}

/// Measures and prints; returns the exit code.
pub fn run(arguments: Arguments) -> u8 {
    let code = match arguments.show {
        true => show(&arguments),
        false => measure(&arguments).unwrap_or_else(|code| code),
    };
    arguments.session.write_report(code)
}

fn measure(arguments: &Arguments) -> Result<u8, u8> {
    let programs = programs(arguments)?;
    let options = options(arguments, &programs);
    let outcome = bench(&options, &programs, &mut progress()).map_err(|error| refuse(&error))?;
    print!("{}", table::tables(&Groups::of(&outcome.lines)));
    for line in &outcome.lines {
        if let Entry::Failure(f) = &line.entry {
            println!("failed: {} on {} ranks: {}", f.setup.case, f.setup.ranks, f.why);
        }
    }
    println!("record: {}", options.record.display());
    let measured = outcome.lines.iter().any(|line| matches!(line.entry, Entry::Run(_)));
    Ok(match (outcome.failures, measured) {
        (0, true) => EXIT_HOLDS,
        (0, false) => {
            eprintln!("harness: nothing was measured: request fewer cells or another experiment");
            EXIT_MISSING
        }
        _ => EXIT_FAILED,
    })
}

/// Finds the programs.
///
/// # Errors
/// The exit code, if the options contradict each other or the program to be measured is missing.
fn programs(arguments: &Arguments) -> Result<Programs, u8> {
    let own = OWN.contains(&arguments.engine.as_str());
    if !own && (!arguments.weights.is_empty() || !arguments.partitioners.is_empty()) {
        eprintln!(
            "harness: --weights and --partitioners apply to the mesher only: remove them or --engine"
        );
        return Err(EXIT_INPUT);
    }
    let engine = if own { "mesher" } else { arguments.engine.as_str() };
    let given = arguments.session.programs.given();
    let programs = Programs::find_with_engine(engine, given).map_err(|why| {
        eprintln!("harness: {why}");
        EXIT_INPUT
    })?;
    // Our mesher chooses the spacings, also for other engines.
    match arguments.engine.as_str() {
        "reference" => require(programs.reference.program())?,
        _ => require(programs.mesher.program())?,
    }
    Ok(programs)
}

fn show(arguments: &Arguments) -> u8 {
    match arguments.session.read_record() {
        Ok(content) => {
            print!("{}", table::tables(&Groups::of(&content.lines)));
            EXIT_HOLDS
        }
        Err(code) => code,
    }
}

/// Returns the options of the library.
fn options(arguments: &Arguments, programs: &Programs) -> Options {
    let session = &arguments.session;
    let templates = &programs.engine.description().run;
    let (sim, mpi) = (templates.simulated.is_some(), templates.parallel.is_some());
    let list = |ranks: &Option<RankList>| ranks.as_ref().map_or(Vec::new(), |r| r.0.clone());
    let overrides = Overrides {
        cases: arguments.cases.clone(),
        experiments: arguments.experiment.clone(),
        ranks: list(&arguments.ranks),
        ranks_mpi: list(&arguments.ranks_mpi),
        cells: arguments.cells.clone(),
        layers: arguments.layers.clone(),
        weights: arguments.weights.clone(),
        partitioners: arguments.partitioners.clone(),
        repeats: session.repeat.map(usize::from),
        no_mpi: session.no_mpi || !session.launcher.is_found() || !mpi,
        no_sim: !sim,
        serial: arguments.engine == "reference" || !sim && !mpi,
        no_choice: !OWN.contains(&arguments.engine.as_str()),
    };
    session.options(studies(arguments.preset, &overrides), label(&arguments.engine))
}
