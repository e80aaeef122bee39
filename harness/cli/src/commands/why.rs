//! `harness why`: explains the leaf at a point, or finds splits that no rule requires.

use super::files::put;
use super::meshed::MeshArguments;
use super::values::{Output, Point};
use crate::failure::Failure;
use check::why::{Body, Mesh};
use clap::Args;
use contract::mesh;
use report::json::pretty;
use run::engine::layout::SERIAL;
use run::verify::report::{EXIT_FAILED, EXIT_HOLDS};
use serde::Serialize;
use std::fmt::Display;
use std::num::NonZero;
use std::path::Path;

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
    /// The mesh.
    #[command(flatten)]
    source: MeshArguments,
    /// The point to explain, in the user's units
    #[arg(value_name = "X,Y,Z", allow_hyphen_values = true, required_unless_present = "unneeded")]
    point: Option<Point>,
    /// Find all splits that no rule requires, instead of explaining a point
    #[arg(long, conflicts_with = "point")]
    unneeded: bool,
    /// Write the result as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<Output>,
    /// Octants to list with --unneeded
    #[arg(long, value_name = "N", default_value = "10")]
    limit: NonZero<usize>,
}

/// Explains or audits, prints and writes; returns the exit code.
///
/// # Errors
/// If the mesh cannot be made or read, or the question has no answer.
pub fn run(arguments: &Arguments) -> Result<u8, Failure> {
    let made = arguments.source.open(&SERIAL, false)?;
    let disk = mesh::Mesh::open(&made.dir)?;
    let tree = disk.tree()?;
    let body = made.case.as_ref().map(|case| Body::of(case, &disk.manifest)).transpose();
    let body = body.map_err(|why| format!("{}: {why}", made.dir.display()))?;
    let mesh = Mesh::of(&disk.manifest, &tree, body.as_ref());
    if let Some(Point(point)) = arguments.point {
        print(&mesh.at(point)?, arguments.json.as_deref())?;
        return Ok(EXIT_HOLDS);
    }
    let found = mesh.unneeded(arguments.limit.get())?;
    print(&found, arguments.json.as_deref())?;
    Ok(if found.unneeded == 0 { EXIT_HOLDS } else { EXIT_FAILED })
}

/// Prints a result and writes it as JSON.
fn print<T: Display + Serialize>(result: &T, json: Option<&Path>) -> Result<(), Failure> {
    println!("{result}");
    Ok(json.map_or(Ok(()), |path| put(path, &pretty(result)))?)
}
