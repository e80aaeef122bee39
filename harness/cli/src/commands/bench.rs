//! `harness bench`: runs experiments, appends to the record and prints tables.

use super::session::{SessionArguments, progress, refuse, require};
use super::values::cell_count;
use bench::experiments::entry::Entry;
use bench::experiments::group::Groups;
use bench::experiments::plan::{self, Experiment, Overrides, Preset, comparison};
use bench::experiments::session::Options;
use bench::experiments::{bench, table};
use clap::Args;
use run::engine::description::is_own;
use run::engine::programs::Programs;
use run::engine::runner::Engine;
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
    /// Ranks of simulated runs, or on MPI if several programs are compared or the program does not simulate ranks; as in 1,2,7 or 1..64 for powers of two [default: those of the preset]
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
    /// Programs to measure: mesher, reference, or engine descriptions (names in harness/engines or TOML files). Several
    /// programs mesh the same cases in turn and are compared
    #[arg(long, value_name = "NAME|FILE", value_delimiter = ',', default_value = "mesher")]
    pub engine: Vec<String>,
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
    arguments.session.prepare()?;
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
    let wrong = |why: String| {
        eprintln!("harness: {why}");
        EXIT_INPUT
    };
    let foreign: Vec<&String> = arguments.engine.iter().filter(|name| !is_own(name)).collect();
    let chooses = !arguments.weights.is_empty() || !arguments.partitioners.is_empty();
    if chooses && !foreign.is_empty() {
        let why = "--weights and --partitioners apply to the mesher only: remove them or --engine";
        return Err(wrong(why.to_owned()));
    }
    let given = arguments.session.programs.given();
    if arguments.engine.len() > 1 && given.mesher.is_some() {
        return Err(wrong("--mesher replaces the program of one engine: name one".to_owned()));
    }
    let first = foreign.first().map_or("mesher", |name| name.as_str());
    let mut programs = Programs::find_with_engine(first, given).map_err(wrong)?;
    for name in foreign.iter().skip(1) {
        let engine = Engine::find(name, None, &programs.paths).map_err(wrong)?;
        programs.others.push(engine);
    }
    let engines = engines(arguments, &programs);
    if engines.len() < arguments.engine.len() {
        return Err(wrong("--engine has two programs of one name: rename a file".to_owned()));
    }
    // Our mesher chooses the spacings, also for other engines.
    if arguments.engine.iter().any(|name| name != "reference") {
        require(programs.mesher.program())?;
    }
    for engine in engines {
        require(engine.program())?;
    }
    Ok(programs)
}

/// The engines that are measured, each once, in the order of the command line.
fn engines<'a>(arguments: &Arguments, programs: &'a Programs) -> Vec<&'a Engine> {
    let known = [&programs.mesher, &programs.reference, &programs.engine];
    let named = |name: &String| {
        let mut known = known.into_iter().chain(&programs.others);
        known.find(|engine| engine.name() == name)
    };
    let mut engines: Vec<&Engine> = Vec::new();
    for engine in arguments.engine.iter().filter_map(named) {
        if engines.iter().all(|other| other.label() != engine.label()) {
            engines.push(engine);
        }
    }
    engines
}

fn show(arguments: &Arguments) -> u8 {
    match arguments.session.read_record() {
        Ok(content) => {
            let groups = Groups::of(&content.lines);
            print!("{}", table::tables(&groups));
            if groups.all.is_empty() {
                eprintln!("harness: the record has no runs");
                return EXIT_MISSING;
            }
            EXIT_HOLDS
        }
        Err(code) => code,
    }
}

/// Returns the options of the library.
fn options(arguments: &Arguments, programs: &Programs) -> Options {
    let all = engines(arguments, programs);
    let overrides: Vec<Overrides> =
        all.iter().map(|engine| overrides(arguments, engine, all.len() > 1)).collect();
    arguments.session.options(comparison(arguments.preset, &overrides))
}

/// Returns the changes of the preset for one engine.
fn overrides(arguments: &Arguments, engine: &Engine, compared: bool) -> Overrides {
    let session = &arguments.session;
    let templates = &engine.description().run;
    let (sim, mpi) = (templates.simulated.is_some(), templates.parallel.is_some());
    let list = |ranks: &Option<RankList>| ranks.as_ref().map_or(Vec::new(), |r| r.0.clone());
    Overrides {
        engine: engine.label(),
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
        // Only some programs have simulated ranks.
        no_sim: !sim || compared,
        serial: !sim && !mpi,
        no_choice: !is_own(engine.name()),
    }
}
