//! `harness bench`: options in, a record and tables out, exit code.

use crate::cli::ProgramArguments;
use clap::Args;
use harness::bench::entry::{Network, What};
use harness::bench::foreign::{OWN, label};
use harness::bench::group::Groups;
use harness::bench::launcher::Launcher;
use harness::bench::plan::{self, Experiment, Preset, Wishes, studies};
use harness::bench::{BenchError, Options, bench, network, record, table};
use harness::engine::description::Templates;
use harness::engine::programs::{Given, Programs};
use harness::verify::report::{
    EXIT_FAILED, EXIT_HOLDS, EXIT_INPUT, EXIT_INTERRUPTED, EXIT_MISSING,
};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// `harness bench`.
#[derive(Args, Debug)]
pub struct BenchArguments {
    /// Names in geometries/catalogue.toml or paths of case files [default: those of the preset]
    pub cases: Vec<String>,
    /// Sizes and ranks to choose from
    #[arg(long, value_enum, default_value = "small")]
    pub preset: Preset,
    /// Which questions to ask [default: all]
    #[arg(long, value_enum, value_delimiter = ',')]
    pub experiment: Vec<Experiment>,
    /// Ranks of simulated runs, as in 1,2,7 or 1..64 for powers of two [default: those of the preset]
    #[arg(long, value_parser = rank_list)]
    pub ranks: Option<RankList>,
    /// Ranks of runs on MPI
    #[arg(long, value_parser = rank_list)]
    pub ranks_mpi: Option<RankList>,
    /// No runs on MPI
    #[arg(long, conflicts_with = "ranks_mpi")]
    pub no_mpi: bool,
    /// Cells of the mesh (strong, weights), per rank (weak), of the largest mesh (spacing), at the case's n (layers)
    #[arg(long, value_delimiter = ',', value_parser = cell_count)]
    pub cells: Vec<u64>,
    /// Values of n in the experiment `layers`
    #[arg(long, value_delimiter = ',')]
    pub layers: Vec<u32>,
    /// Weights of base leaves: unit, area, rehearsal, rebalance
    #[arg(long, value_delimiter = ',')]
    pub weights: Vec<String>,
    /// Partitioners: metis, morton
    #[arg(long, value_delimiter = ',')]
    pub partitioners: Vec<String>,
    /// Repetitions of every run; 95 % intervals of a median need six
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u16).range(1..))]
    pub repeat: Option<u16>,
    /// What starts ranks; {ranks} stands for their number
    #[arg(long, default_value = "mpirun -n {ranks}", value_parser = Launcher::parse)]
    pub launcher: Launcher,
    /// Latency and bandwidth of messages in the projection [default: measured by a ping-pong]
    #[arg(long, value_name = "SECONDS,BYTES/S", value_parser = network::given)]
    pub network: Option<Network>,
    /// What to measure: mesher, reference, or an engine's description (a name in harness/engines, or a TOML file)
    #[arg(long, value_name = "NAME|FILE", default_value = "mesher")]
    pub engine: String,
    /// File of JSON lines to append to [default: reports/out/bench.jsonl]
    #[arg(long, value_name = "FILE")]
    pub record: Option<PathBuf>,
    /// Time limit of every single run
    #[arg(long, value_name = "SECONDS", default_value_t = 1800, value_parser = clap::value_parser!(u64).range(1..))]
    pub timeout: u64,
    /// Make a report, too: DIR/record.jsonl is the record then, unless --record names one
    #[arg(long, value_name = "DIR")]
    pub report: Option<PathBuf>,
    /// Instead of experiments: make the runs that a table of targets needs, and say which targets are met
    #[arg(long, value_name = "FILE", conflicts_with_all = ["cases", "preset", "experiment", "ranks", "ranks_mpi",
        "cells", "layers", "weights", "partitioners", "engine"])]
    pub targets: Option<PathBuf>,
    /// Only these rows of it
    #[arg(long, value_name = "NAME", value_delimiter = ',', requires = "targets")]
    pub only: Vec<String>,
    /// Print the tables of an existing record and measure nothing
    #[arg(long)]
    pub show: bool,
    /// Where the programs are.
    #[command(flatten)]
    pub programs: ProgramArguments,
}

/// A list of rank counts, as one argument.
#[derive(Clone, Debug)]
pub struct RankList(Vec<usize>);

fn rank_list(text: &str) -> Result<RankList, String> {
    plan::ranks(text).map(RankList)
}

/// A number of cells, `1e9` allowed.
pub fn cell_count(text: &str) -> Result<u64, String> {
    let cells = text.trim().parse::<f64>().ok().filter(|c| (1e3..=1e12).contains(c));
    cells.map(|c| c as u64).ok_or_else(|| "give a number of cells from 1e3 to 1e12".to_owned())
}

/// Measures, prints; the exit code.
pub fn run(arguments: BenchArguments) -> u8 {
    let report = arguments.report.clone();
    let code = match arguments.targets.clone() {
        Some(file) => crate::cli_targets::run(&file, arguments),
        None => measure(arguments),
    };
    match report.map(|directory| crate::cli_report::write(&directory, &[], None)) {
        // A failed run stays the graver of the two.
        Some(Err(why)) => {
            eprintln!("harness: {why}");
            code.max(EXIT_INPUT)
        }
        _ => code,
    }
}

fn measure(arguments: BenchArguments) -> u8 {
    if arguments.show {
        return show(&arguments);
    }
    let programs = match programs(&arguments) {
        Ok(programs) => programs,
        Err(code) => return code,
    };
    let options = options(arguments, &programs);
    match bench(&options, &programs, &mut teller()) {
        Ok(outcome) => {
            print!("{}", table::tables(&Groups::of(&outcome.lines)));
            for line in &outcome.lines {
                if let What::Failure(f) = &line.what {
                    println!("failed: {} on {} ranks: {}", f.setup.case, f.setup.ranks, f.why);
                }
            }
            println!("record: {}", options.record.display());
            let measured = outcome.lines.iter().any(|line| matches!(line.what, What::Run(_)));
            match (outcome.failures, measured) {
                (0, true) => EXIT_HOLDS,
                (0, false) => {
                    eprintln!(
                        "harness: nothing was measured: ask for fewer cells, or for another experiment"
                    );
                    EXIT_MISSING
                }
                _ => EXIT_FAILED,
            }
        }
        Err(error) => refuse(&error),
    }
}

/// Where the programs are; an exit code where the one to be measured is not.
pub fn programs(arguments: &BenchArguments) -> Result<Programs, u8> {
    let given = Given {
        mesher: arguments.programs.mesher.clone(),
        reference: arguments.programs.reference.clone(),
    };
    let mut programs = Programs::find(given);
    if !OWN.contains(&arguments.engine.as_str()) {
        if !arguments.weights.is_empty() || !arguments.partitioners.is_empty() {
            eprintln!(
                "harness: --weights and --partitioners are the mesher's: leave them out with another --engine"
            );
            return Err(EXIT_INPUT);
        }
        let limit = Duration::from_secs(arguments.timeout);
        programs = programs.and_engine(&arguments.engine, limit).map_err(|why| {
            eprintln!("harness: {why}");
            EXIT_INPUT
        })?;
    }
    let program =
        if arguments.engine == "reference" { &programs.reference } else { &programs.mesher };
    if !program.is_file() {
        eprintln!("harness: {} is not there; build it or name it", program.display());
        return Err(EXIT_MISSING);
    }
    Ok(programs)
}

/// Tells on standard error what is being done, with the seconds since now.
pub fn teller() -> impl FnMut(&str) {
    let start = Instant::now();
    move |what| eprintln!("[{:>5} s] {what}", start.elapsed().as_secs())
}

/// Says why nothing more was measured; the exit code.
pub fn refuse(error: &BenchError) -> u8 {
    eprintln!("harness: {error}");
    match error {
        BenchError::Input(_) => EXIT_INPUT,
        BenchError::Missing(_) => EXIT_MISSING,
        BenchError::Interrupted => EXIT_INTERRUPTED,
    }
}

fn show(arguments: &BenchArguments) -> u8 {
    let path = record_path(arguments);
    match record::read(&path) {
        Ok(content) => {
            for (line, why) in &content.broken {
                eprintln!("harness: line {line} is passed over: {why}");
            }
            print!("{}", table::tables(&Groups::of(&content.lines)));
            EXIT_HOLDS
        }
        Err(error) => {
            eprintln!("harness: {}: {error}", path.display());
            EXIT_INPUT
        }
    }
}

/// Where results go.
pub fn record_path(arguments: &BenchArguments) -> PathBuf {
    let in_report = arguments.report.as_ref().map(|directory| directory.join("record.jsonl"));
    let given = arguments.record.clone().or(in_report);
    given.unwrap_or_else(|| PathBuf::from("reports/out/bench.jsonl"))
}

/// What is asked for, in the library's words.
pub fn options(arguments: BenchArguments, programs: &Programs) -> Options {
    let does = programs.engine.as_ref().map(|engine| engine.description().run.clone());
    let can = |has: fn(&Templates) -> bool| does.as_ref().is_none_or(has);
    let (sim, mpi) = (can(|t| t.simulated.is_some()), can(|t| t.parallel.is_some()));
    let record = record_path(&arguments);
    let list = |ranks: &Option<RankList>| ranks.as_ref().map_or(Vec::new(), |r| r.0.clone());
    let wishes = Wishes {
        cases: arguments.cases,
        experiments: arguments.experiment,
        ranks: list(&arguments.ranks),
        ranks_mpi: list(&arguments.ranks_mpi),
        cells: arguments.cells,
        layers: arguments.layers,
        weights: arguments.weights,
        partitioners: arguments.partitioners,
        repeats: arguments.repeat.map(usize::from),
        no_mpi: arguments.no_mpi || !arguments.launcher.is_found() || !mpi,
        no_sim: !sim,
        serial: arguments.engine == "reference" || !sim && !mpi,
        no_choice: does.is_some(),
    };
    Options {
        studies: studies(arguments.preset, &wishes),
        engine: label(&arguments.engine),
        launcher: arguments.launcher,
        network: arguments.network,
        record,
        limit: Duration::from_secs(arguments.timeout),
        command: std::env::args().collect(),
    }
}

#[cfg(test)]
mod tests {
    use crate::cli::{Arguments, Command};
    use clap::Parser;

    #[test]
    fn ranks_launcher_and_cells_are_read() {
        let words = [
            "harness",
            "bench",
            "uav-small",
            "--ranks",
            "1..8",
            "--cells",
            "1e6,2e6",
            "--launcher",
            "srun -n {ranks}",
        ];
        let Command::Bench(bench) = Arguments::try_parse_from(words).unwrap().command else {
            panic!()
        };
        assert_eq!(bench.ranks.unwrap().0, [1, 2, 4, 8]);
        assert_eq!(bench.cells, [1_000_000, 2_000_000]);
        assert!(Arguments::try_parse_from(["harness", "bench", "--launcher", "mpirun"]).is_err());
        assert!(Arguments::try_parse_from(["harness", "bench", "--cells", "5"]).is_err());
    }
}
