//! `harness why`: explains the leaf at a point.

use crate::options::{MeshArguments, examples, point};
use check::why::{self, Mesh};
use clap::Args;
use contract::failure::{EXIT_HOLDS, Failure, Result};
use contract::mesh;
use run::engine::layout::SERIAL;

/// `harness why`.
#[derive(Args, Debug)]
#[command(after_help = examples(include_str!("../../../doc/why.md")))]
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
pub fn run(arguments: &Arguments) -> Result<u8> {
    let (made, case) = arguments.source.open(&SERIAL, false)?;
    let disk = mesh::Mesh::open(&made.dir)?;
    let tree = disk.tree()?;
    let (of, shown) = (&disk.manifest, made.dir.display());
    let why = format!("{shown} states no inputs or no sides, on which answers rest: give --case");
    let is_whole = !of.lacks_inputs && of.sides == contract::manifest::Sides::Known;
    Failure::unless(is_whole || case.is_some(), why)?;
    let body = case.as_ref().map(|case| why::body(case, &disk.manifest)).transpose();
    let body = body.map_err(|why| format!("{shown}: {why}"))?;
    print!("{}", Mesh::of(&disk.manifest, &tree, body.as_ref()).at(arguments.point)?);
    Ok(EXIT_HOLDS)
}
