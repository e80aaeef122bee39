//! `harness verify`: verifies the selected cases and reports.

use super::programs::ProgramArguments;
use super::values::Output;
use clap::Args;
use contract::catalogue::Size;
use contract::files::{named, write_atomically};
use report::verification::json::json;
use report::verification::junit::junit;
use report::verification::markdown::markdown;
use report::verification::table::table;
use run::engine::programs::Programs;
use run::verify::options::Need;
use run::verify::options::Options;
use run::verify::report::{EXIT_INPUT, EXIT_MISSING, Report, exit_first};
use run::verify::{VerifyError, verify};
use std::env;
use std::fs::OpenOptions;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// `harness verify`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Names in geometries/catalogue.toml or paths of case files [default: all of --size]
    pub cases: Vec<String>,
    /// Sizes of the catalogue's cases
    #[arg(long, value_delimiter = ',', default_value = "small")]
    pub size: Vec<Size>,
    /// Rank counts of the runs on MPI
    ///
    /// Given, they require MPI: exit code 3 without it [default: 1,2,3,4,7,8,16,32,64]
    #[arg(long, value_delimiter = ',', value_parser = rank_count)]
    pub ranks: Option<Vec<usize>>,
    /// Partitioners, each at every rank count
    #[arg(long, value_delimiter = ',', default_value = "metis,morton")]
    pub partitioners: Vec<String>,
    /// Base depths, each with every partitioner
    #[arg(long, value_delimiter = ',', default_value = "auto,3")]
    pub level_bases: Vec<String>,
    /// Directory for reports and for results that are kept [default: a temporary one]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Also keep the results of passing cases
    #[arg(long)]
    pub keep: bool,
    /// Write the report as JUnit XML
    #[arg(long, value_name = "FILE")]
    pub junit: Option<Output>,
    /// Write the report as JSON
    #[arg(long, value_name = "FILE")]
    pub json: Option<Output>,
    /// Time limit of every single run
    #[arg(long, value_name = "SECONDS", default_value_t = 600, value_parser = super::values::whole_seconds)]
    pub timeout: u64,
    /// Leave out the runs on MPI
    #[arg(long)]
    pub no_mpi: bool,
    /// Leave out trimesh, open3d and pyvista
    #[arg(long)]
    pub no_oracles: bool,
    /// Leave out the comparison with p4est
    #[arg(long)]
    pub no_p4est: bool,
    /// Verify another mesher: name in harness/engines or path of a description [default: the mesher itself]
    #[arg(long, value_name = "ENGINE")]
    pub engine: Option<String>,
    /// Required components: exit code 3 if one is missing
    #[arg(long, value_delimiter = ',')]
    pub require: Vec<Need>,
    /// Maximum number of points for the oracles on cases that are not small
    #[arg(long, value_name = "N", default_value_t = 20_000)]
    pub oracle_points: usize,
    /// Seed of the choice of points
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Maximum number of cells for checks; larger meshes are only measured (see `harness audit`)
    #[arg(long, value_name = "CELLS", default_value_t = 100_000_000)]
    pub cells_max: u64,
    /// Maximum number of cells for the reference
    #[arg(long, value_name = "CELLS", default_value_t = 3_000_000)]
    pub reference_cells_max: u64,
    /// Paths of the programs.
    #[command(flatten)]
    pub programs: ProgramArguments,
}

/// Rank counts without `--ranks`.
const RANKS: [usize; 9] = [1, 2, 3, 4, 7, 8, 16, 32, 64];

/// Each rank count once: a run has one directory.
fn distinct(ranks: Vec<usize>) -> Vec<usize> {
    let mut kept = Vec::new();
    ranks.into_iter().for_each(|count| {
        if !kept.contains(&count) {
            kept.push(count)
        }
    });
    kept
}

fn rank_count(text: &str) -> Result<usize, String> {
    match text.trim().parse() {
        Ok(0) => Err("a run has at least one rank".to_owned()),
        Ok(ranks) => Ok(ranks),
        Err(error) => Err(error.to_string()),
    }
}

/// Verifies, prints and writes; returns the exit code.
pub fn run(arguments: Arguments) -> u8 {
    let engine = arguments.engine.as_deref().unwrap_or("mesher");
    let programs = match Programs::find_with_engine(engine, arguments.programs.given()) {
        Ok(programs) => programs,
        Err(why) => {
            eprintln!("harness: {why}");
            return EXIT_INPUT;
        }
    };
    let (junit, json) = (arguments.junit.clone(), arguments.json.clone());
    let options = options(arguments);
    let report = match verify(&options, &programs) {
        Ok(report) => report,
        Err(error) => {
            eprintln!("harness: {error}");
            return match error {
                VerifyError::Input(_) => EXIT_INPUT,
                VerifyError::Missing(_) => EXIT_MISSING,
            };
        }
    };
    print!("{}", table(&report));
    match write(&report, &options, junit, json) {
        Ok(()) => report.exit_code(),
        Err(error) => {
            eprintln!("harness: a report could not be written: {error}");
            exit_first(report.exit_code(), EXIT_INPUT)
        }
    }
}

fn options(arguments: Arguments) -> Options {
    Options {
        cases: arguments.cases,
        sizes: arguments.size,
        ranks_given: arguments.ranks.is_some(),
        ranks: distinct(arguments.ranks.unwrap_or_else(|| RANKS.to_vec())),
        partitioners: arguments.partitioners,
        level_bases: arguments.level_bases,
        out: arguments.out,
        keep: arguments.keep,
        limit: Duration::from_secs(arguments.timeout),
        mpi: !arguments.no_mpi,
        oracles: !arguments.no_oracles,
        p4est: !arguments.no_p4est,
        require: arguments.require,
        oracle_points: arguments.oracle_points,
        seed: arguments.seed,
        cells_max: arguments.cells_max,
        reference_cells_max: arguments.reference_cells_max,
    }
}

/// Writes the requested forms of the report, and all forms into the directory of `--out`.
fn write(
    report: &Report,
    options: &Options,
    junit_file: Option<Output>,
    json_file: Option<Output>,
) -> io::Result<()> {
    let forms = [
        ("table.txt", table(report)),
        ("report.md", markdown(report)),
        ("junit.xml", junit(report)),
        ("report.json", json(report)),
    ];
    if let Some(out) = &options.out {
        for (name, text) in &forms {
            put(&out.join(name), text)?;
        }
    }
    let [_, (_, markdown), (_, junit), (_, json)] = &forms;
    for (file, text) in [(junit_file, junit), (json_file, json)] {
        if let Some(file) = file {
            put(&file, text)?;
        }
    }
    if let Some(summary) = env::var_os("GITHUB_STEP_SUMMARY").filter(|path| !path.is_empty()) {
        OpenOptions::new()
            .create(true)
            .append(true)
            .open(summary)?
            .write_all(markdown.as_bytes())?;
    }
    Ok(())
}

/// Writes a file.
///
/// # Errors
/// The file's name and the reason.
fn put(path: &Path, text: &str) -> io::Result<()> {
    write_atomically(path, |out| out.write_all(text.as_bytes()))
        .map_err(|error| named(path, &error))
}
