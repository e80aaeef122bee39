//! `harness why`: explains the leaf at a point, or finds splits that no rule requires.

use std::fmt::Display;
use std::fs;
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::time::Duration;

use super::programs::ProgramArguments;
use check::why::Mesh;
use clap::Args;
use contract::case::Case;
use contract::files::write_atomically;
use report::json::pretty;
use run::engine::failure::End;
use run::engine::layout::SERIAL;
use run::engine::options::RunOptions;
use run::engine::programs::Programs;
use run::verify::report::{EXIT_FAILED, EXIT_HOLDS, EXIT_INPUT, EXIT_INTERRUPTED, EXIT_MISSING};
use serde::Serialize;
use tempfile::TempDir;

const EXAMPLES: &str = "Examples:
  harness why uav-small 0.1,0,0.2                mesh a case of the catalogue and explain the leaf at a point
  harness why body.toml -1.5,2,0                 mesh a case file
  harness why mesh 0.1,0,0.2 --case body.toml    a mesh on disk; without --case, facets are not known
  harness why --unneeded mesh --case body.toml   every split of the mesh that no rule requires

Sections are those of reference/DEFINITION.md. Facets, boxes and seeds are counted from 0.

Exit codes: 0 answered, or every split has a cause; 1 splits without a cause; 2 invalid input; 3 the mesher is missing.";

/// `harness why`.
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct Arguments {
    /// A leaf-set directory, a case file (.toml) or a name in geometries/catalogue.toml
    #[arg(value_name = "CASE|DIR")]
    mesh: String,
    /// The point to explain, in the user's units
    #[arg(value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true, required_unless_present = "unneeded")]
    point: Option<Point>,
    /// Find all splits that no rule requires, instead of explaining a point
    #[arg(long, conflicts_with = "point")]
    unneeded: bool,
    /// The case file of a leaf-set directory: its facets explain splits at the surface and sides
    #[arg(long, value_name = "CASE")]
    case: Option<PathBuf>,
    /// Write the result as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Octants to list with --unneeded
    #[arg(long, value_name = "N", default_value = "10")]
    first: NonZero<usize>,
    /// The program that meshes a case: name in harness/engines or path of an engine description
    #[arg(long, default_value = "mesher")]
    engine: String,
    /// Time limit for meshing a case
    #[arg(long, value_name = "SECONDS", default_value_t = 600, value_parser = clap::value_parser!(u64).range(1..))]
    timeout: u64,
    /// Paths of the programs.
    #[command(flatten)]
    programs: ProgramArguments,
}

/// A point in the user's units.
#[derive(Clone, Copy, Debug)]
struct Point([f64; 3]);

/// An exit code and the message.
type Failure = (u8, String);

/// Explains or audits, prints and writes; returns the exit code.
pub fn run(arguments: &Arguments) -> u8 {
    try_run(arguments).unwrap_or_else(|(code, why)| {
        eprintln!("harness: {why}");
        code
    })
}

fn try_run(arguments: &Arguments) -> Result<u8, Failure> {
    let input = |why: String| (EXIT_INPUT, why);
    let given = Path::new(&arguments.mesh);
    let (dir, case, _made) = if given.is_dir() {
        let case = arguments.case.as_deref().map(Case::read).transpose();
        (given.to_owned(), case.map_err(|error| input(error.to_string()))?, None)
    } else if arguments.case.is_some() {
        let what =
            format!("{} is not a leaf-set directory, which --case requires", given.display());
        return Err(input(what));
    } else {
        let (made, case) = mesh(arguments)?;
        (made.path().join("mesh"), Some(case), Some(made))
    };
    let mesh = Mesh::open(&dir, case.as_ref()).map_err(input)?;
    if let Some(Point(point)) = arguments.point {
        print(&mesh.at(point).map_err(input)?, arguments.json.as_deref())?;
        return Ok(EXIT_HOLDS);
    }
    let found = mesh.unneeded(arguments.first.get()).map_err(input)?;
    print(&found, arguments.json.as_deref())?;
    Ok(if found.unneeded == 0 { EXIT_HOLDS } else { EXIT_FAILED })
}

/// Prints a result and writes it as JSON.
fn print<T: Display + Serialize>(result: &T, json: Option<&Path>) -> Result<(), Failure> {
    println!("{result}");
    let Some(path) = json else { return Ok(()) };
    let written = write_atomically(path, |out| out.write_all(pretty(result).as_bytes()));
    written.map_err(|error| (EXIT_INPUT, format!("{}: {error}", path.display())))
}

/// Meshes a case in a temporary directory, below which the mesh is in `mesh`.
fn mesh(arguments: &Arguments) -> Result<(TempDir, Case), Failure> {
    let input = |why: String| (EXIT_INPUT, why);
    let find = Programs::find_with_engine(&arguments.engine, arguments.programs.given());
    let Programs { engine, paths, .. } = find.map_err(input)?;
    let path = paths.catalogue.case_file(&arguments.mesh, Path::new("")).map_err(input)?;
    let case = Case::read(&path).map_err(|error| input(error.to_string()))?;
    let made = tempfile::Builder::new().prefix("harness-why-").tempdir();
    let made = made.map_err(|error| input(error.to_string()))?;
    let (out, logs) = (made.path().join("mesh"), made.path().join("logs"));
    fs::create_dir(&logs).map_err(|error| input(format!("{}: {error}", logs.display())))?;
    let prepared = engine.prepare(&path, &made.path().join("case")).map_err(input)?;
    let limit = Duration::from_secs(arguments.timeout);
    let options = RunOptions { mesh: Some(&out), report: false, ..RunOptions::new(&logs, limit) };
    engine.run(&prepared, &SERIAL, &options).map_err(|failure| {
        let code = match &failure.end {
            End::Missing(_) => EXIT_MISSING,
            End::Interrupted => EXIT_INTERRUPTED,
            _ => EXIT_INPUT,
        };
        (code, failure.to_string())
    })?;
    Ok((made, case))
}

/// Parses a point from three numbers.
fn point(text: &str) -> Result<Point, String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|n| n.trim().parse()).collect();
    match numbers.ok().and_then(|numbers| <[f64; 3]>::try_from(numbers).ok()) {
        Some(point) => Ok(Point(point)),
        None => Err("give three numbers: X,Y,Z".to_owned()),
    }
}
