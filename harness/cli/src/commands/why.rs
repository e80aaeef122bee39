//! `harness why`: explains the leaf at a point.

use super::meshed::MeshArguments;
use crate::options::point;
use check::why::{self, Mesh};
use clap::Args;
use contract::failure::{EXIT_HOLDS, Failure};
use contract::mesh;
use run::engine::layout::SERIAL;

const EXAMPLES: &str = "Examples:
  harness why uav-small 0.1,0,0.2                mesh a case of the catalogue and explain the leaf at a point
  harness why body.toml -1.5,2,0                 mesh a case file
  harness why mesh 0.1,0,0.2 --case body.toml    a mesh on disk; without --case, facets are not known

Sections are those of reference/DEFINITION.md. Facets, boxes and seeds are counted from 0.

Exit codes: 0 answered; 2 invalid input; 3 the mesher is missing.";

/// `harness why`.
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct Arguments {
    /// The mesh.
    #[command(flatten)]
    source: MeshArguments,
    /// The point to explain, in the user's units
    #[arg(value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    point: [f64; 3],
}

/// Explains and prints; returns the exit code.
///
/// # Errors
/// If the mesh cannot be made or read, or the point is outside its root.
pub fn run(arguments: &Arguments) -> Result<u8, Failure> {
    let (made, case) = arguments.source.open(&SERIAL, false)?;
    let disk = mesh::Mesh::open(&made.dir)?;
    let tree = disk.tree()?;
    let body = case.as_ref().map(|case| why::body(case, &disk.manifest)).transpose();
    let body = body.map_err(|why| format!("{}: {why}", made.dir.display()))?;
    let mesh = Mesh::of(&disk.manifest, &tree, body.as_ref());
    print!("{}", mesh.at(arguments.point)?);
    Ok(EXIT_HOLDS)
}
