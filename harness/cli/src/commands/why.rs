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
    let (dir, case_file, _made) = match given.is_dir() {
        true => (given.to_owned(), arguments.case.clone(), None),
        false if arguments.case.is_some() => {
            return Err(input(format!(
                "{} is not a leaf-set directory, which --case requires",
                given.display()
            )));
        }
        false => {
            let (made, case) = mesh(arguments)?;
            (made.path().join("mesh"), Some(case), Some(made))
        }
    };
    let case = case_file.as_deref().map(Case::read).transpose();
    let case = case.map_err(|error| input(error.to_string()))?;
    let mesh = Mesh::open(&dir, case.as_ref()).map_err(input)?;
    if let Some(Point(point)) = arguments.point {
        report(&mesh.at(point).map_err(input)?, arguments.json.as_deref())?;
        return Ok(EXIT_HOLDS);
    }
    let found = mesh.unneeded(arguments.first.get()).map_err(input)?;
    report(&found, arguments.json.as_deref())?;
    Ok(if found.unneeded == 0 { EXIT_HOLDS } else { EXIT_FAILED })
}

/// Prints a result and writes it as JSON.
fn report<T: Display + Serialize>(result: &T, json: Option<&Path>) -> Result<(), Failure> {
    println!("{result}");
    let Some(path) = json else { return Ok(()) };
    let write = write_atomically(path, |out| {
        serde_json::to_writer_pretty(&mut *out, result)?;
        out.write_all(b"\n")
    });
    write.map_err(|error| (EXIT_INPUT, format!("{}: {error}", path.display())))
}

/// Meshes a case in a temporary directory, below which the mesh is in `mesh`. Returns it with the case file.
fn mesh(arguments: &Arguments) -> Result<(TempDir, PathBuf), Failure> {
    let input = |why: String| (EXIT_INPUT, why);
    let find = Programs::find_with_engine(&arguments.engine, arguments.programs.given());
    let Programs { engine, paths, .. } = find.map_err(input)?;
    let case = paths.catalogue.case_file(&arguments.mesh, Path::new("")).map_err(input)?;
    let made = tempfile::Builder::new().prefix("harness-why-").tempdir();
    let made = made.map_err(|error| input(error.to_string()))?;
    let (out, logs) = (made.path().join("mesh"), made.path().join("logs"));
    fs::create_dir(&logs).map_err(|error| input(format!("{}: {error}", logs.display())))?;
    // An invalid case is reported by the harness itself, in its own words.
    Case::read(&case).map_err(|error| input(error.to_string()))?;
    let prepared = engine.prepare(&case, &made.path().join("case")).map_err(input)?;
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
