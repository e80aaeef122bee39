//! `harness selftest`: corrupts correct meshes and prints which check detects each corruption.

use super::programs::ProgramArguments;
use super::values::cell_count;
use bench::experiments::execute::Failed;
use bench::selftest::source as made_by_mesher;
use check::selftest::scale::{self, Options, Source};
use check::selftest::{self, SelftestCase};
use clap::Args;
use contract::case::Case;
use contract::leafset;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use run::engine::failure::End;
use run::engine::interrupt;
use run::engine::layout::SERIAL;
use run::engine::options::RunOptions;
use run::engine::programs::Programs;
use run::verify::report::{EXIT_FAILED, EXIT_HOLDS, EXIT_INPUT, EXIT_INTERRUPTED, EXIT_MISSING};
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// `harness selftest`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Corrupt the meshes of this case file instead of the built-in ones; may be repeated
    #[arg(long, value_name = "CASE")]
    pub case: Vec<PathBuf>,
    /// Corrupt a mesh of any size and audit it: a leaf-set directory or a case file to mesh; may be repeated
    #[arg(long, value_name = "DIR|CASE", conflicts_with = "case")]
    pub at_scale: Vec<PathBuf>,
    /// Approximate number of cells of meshes from case files [default: from the spacing of the case]
    #[arg(long, value_name = "N", requires = "at_scale", value_parser = cell_count)]
    pub cells: Option<u64>,
    /// Concurrent trials at scale; each needs the memory of one audit
    #[arg(long, value_name = "N", requires = "at_scale", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=256))]
    pub jobs: u16,
    /// Seed of the positions of corruptions at scale
    #[arg(long, value_name = "N", requires = "at_scale", default_value_t = 1)]
    pub seed: u64,
    /// Directory for temporary files at scale: two to four times the size of a mesh [default: the temporary directory]
    #[arg(long, value_name = "DIR", requires = "at_scale")]
    pub scratch: Option<PathBuf>,
    /// Time limit of every run of reference or mesher
    #[arg(long, value_name = "SECONDS", default_value_t = 600)]
    pub timeout: u64,
    /// Paths of the programs.
    #[command(flatten)]
    pub programs: ProgramArguments,
}

/// Meshes the cases, corrupts the meshes and prints the table; returns the exit code.
pub fn run(arguments: &Arguments) -> u8 {
    match try_run(arguments) {
        Ok(code) => code,
        Err((code, why)) => {
            eprintln!("harness: {why}");
            code
        }
    }
}

/// An exit code and the message.
type Failure = (u8, String);

fn try_run(arguments: &Arguments) -> Result<u8, Failure> {
    if !arguments.at_scale.is_empty() {
        return at_scale(arguments);
    }
    let programs = find(arguments)?;
    if !programs.reference.program().is_file() {
        let path = programs.reference.program().display();
        return Err((
            EXIT_MISSING,
            format!(
                "the reference is missing: build {path}, or give another path with --reference"
            ),
        ));
    }
    let scratch = tempfile::tempdir().map_err(|error| (EXIT_INPUT, error.to_string()))?;
    let cases =
        if arguments.case.is_empty() { built_in(scratch.path())? } else { arguments.case.clone() };
    let limit = Duration::from_secs(arguments.timeout);
    let meshed = cases.iter().enumerate().map(|(index, case)| {
        let directory = scratch.path().join(format!("case-{index}"));
        mesh_case(&programs, case, &directory, limit)
    });
    let cases = meshed.collect::<Result<Vec<SelftestCase>, Failure>>()?;
    let mutants = scratch.path().join("mutants");
    let report = fs::create_dir(&mutants).and_then(|()| selftest::run(&cases, &mutants));
    let report = report.map_err(|error| (EXIT_INPUT, format!("{}: {error}", mutants.display())))?;
    println!("{report}");
    Ok(if report.holds() { EXIT_HOLDS } else { EXIT_FAILED })
}

/// Runs the self test on meshes of any size.
fn at_scale(arguments: &Arguments) -> Result<u8, Failure> {
    let input = |error: std::io::Error| (EXIT_INPUT, error.to_string());
    let mut place = tempfile::Builder::new();
    place.prefix("harness-selftest-");
    let scratch = match &arguments.scratch {
        Some(directory) => place.tempdir_in(directory),
        None => place.tempdir(),
    };
    let scratch = scratch.map_err(input)?;
    let made = scratch.path().join("made");
    fs::create_dir(&made).map_err(input)?;
    let sources = arguments.at_scale.iter().map(|path| source(arguments, path, &made));
    let sources = sources.collect::<Result<Vec<Source>, Failure>>()?;
    let options = Options {
        seed: arguments.seed,
        jobs: usize::from(arguments.jobs),
        interrupted: interrupt::requested,
    };
    let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
    bar.set_style(
        ProgressStyle::with_template("{pos}/{len} trials [{elapsed}]")
            .unwrap_or_else(|_| ProgressStyle::default_bar()),
    );
    let progress = |done: usize, all: usize| {
        bar.set_length(all as u64);
        bar.set_position(done as u64);
    };
    let report = scale::run(&sources, &options, scratch.path(), &progress);
    bar.finish_and_clear();
    let report = report.map_err(|error| match error.kind() {
        ErrorKind::Interrupted => (EXIT_INTERRUPTED, "interrupted".to_owned()),
        _ => input(error),
    })?;
    println!("{report}");
    let (trials, found) = (report.kills.len(), report.found_by_audit());
    if trials == 0 {
        return Err((EXIT_MISSING, "left out: no corruption applies to these meshes".to_owned()));
    }
    let killed = report.kills.iter().filter(|kill| kill.killed()).count();
    println!(
        "the audit found {found} of {trials}; {} only by comparison with the untouched mesh",
        killed.saturating_sub(found)
    );
    Ok(if report.holds() { EXIT_HOLDS } else { EXIT_FAILED })
}

/// Returns the mesh in a leaf-set directory, or that of a case file, which the mesher writes into `made`.
fn source(arguments: &Arguments, path: &Path, made: &Path) -> Result<Source, Failure> {
    if path.is_dir() {
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        return Ok(Source { name, mesh: path.to_owned(), base: None });
    }
    let programs = find(arguments)?;
    if !programs.mesher.program().is_file() {
        let path = programs.mesher.program().display();
        return Err((
            EXIT_MISSING,
            format!("the mesher is missing: build {path}, or give another path with --mesher"),
        ));
    }
    let limit = Duration::from_secs(arguments.timeout);
    let place = made.join(format!("{}", fs::read_dir(made).map_or(0, Iterator::count)));
    fs::create_dir(&place).map_err(|error| (EXIT_INPUT, error.to_string()))?;
    made_by_mesher(&programs, path, arguments.cells, &place, limit).map_err(|why| match why {
        Failed::Interrupted => (EXIT_INTERRUPTED, "interrupted".to_owned()),
        Failed::Reason(why) => (EXIT_INPUT, format!("{}: {why}", path.display())),
    })
}

/// Writes the built-in cases; returns their paths.
fn built_in(scratch: &Path) -> Result<Vec<PathBuf>, Failure> {
    let write = |(name, text): (&str, &str)| {
        let path = scratch.join(format!("{name}.toml"));
        fs::write(&path, text).map(|()| path).map_err(|error| (EXIT_INPUT, error.to_string()))
    };
    selftest::CASES.into_iter().map(write).collect()
}

fn find(arguments: &Arguments) -> Result<Programs, Failure> {
    Programs::find(arguments.programs.given()).map_err(|why| (EXIT_INPUT, why))
}

/// Meshes a case with the reference in `directory`: the mesh, and the base tree T0.
fn mesh_case(
    programs: &Programs,
    path: &Path,
    directory: &Path,
    limit: Duration,
) -> Result<SelftestCase, Failure> {
    let case = Case::read(path).map_err(|error| (EXIT_INPUT, error.to_string()))?;
    let mut meshes = Vec::new();
    for (name, ungraded) in [("mesh", false), ("base", true)] {
        let logs = directory.join(format!("{name}-logs"));
        fs::create_dir_all(&logs).map_err(|error| (EXIT_INPUT, error.to_string()))?;
        let out = directory.join(name);
        let options = RunOptions {
            mesh: Some(&out),
            report: false,
            ungraded,
            ..RunOptions::new(&logs, limit)
        };
        programs.reference.run(path, &SERIAL, &options).map_err(|failure| match &failure.end {
            End::Missing(_) => (EXIT_MISSING, failure.to_string()),
            End::Interrupted => (EXIT_INTERRUPTED, "interrupted".to_owned()),
            End::Exited { code: 2, error } => (EXIT_INPUT, error.clone()),
            _ => (EXIT_FAILED, format!("{failure}, on {}", path.display())),
        })?;
        meshes.push(leafset::read(&out).map_err(|error| (EXIT_FAILED, error.to_string()))?);
    }
    let base = meshes.pop().expect("the loop reads two meshes");
    let mesh = meshes.pop().expect("the loop reads two meshes");
    Ok(SelftestCase { case, mesh, base })
}
