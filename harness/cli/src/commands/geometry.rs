//! `harness geometry`: prints the defects of an STL file or a case, and their effect on the mesh.

use crate::options::{self, Output, examples, root};
use crate::output::put_forms;
use clap::Args;
use contract::failure::{EXIT_FAILED, EXIT_HOLDS, EXIT_MISSING, Result};
use contract::lattice::Root;
use geometry::diagnose;
use geometry::input::{Input, Requested};
use report::pretty;
use std::num::NonZero;

/// `harness geometry`.
#[derive(Args, Debug)]
#[command(after_help = examples(include_str!("../../../doc/geometry.md")))]
pub struct Arguments {
    /// An STL file, or a case file (.toml), which provides root and spacing
    file: options::Input,
    /// Upper bound on the edge length of the cells at the surface, in the units of the file
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    spacing_min: Option<f64>,
    /// Minimum corner and edge length of the root
    #[arg(long, value_name = "X,Y,Z,EDGE", value_parser = root, allow_hyphen_values = true, conflicts_with = "root_scale")]
    root: Option<Root>,
    /// Edge length of the root in longest edges of the bounding box, on which it is centred [default: 10]
    #[arg(long, value_name = "X", allow_negative_numbers = true)]
    root_scale: Option<f64>,
    /// Write the result as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<Output>,
    /// Places to list for each kind of finding
    #[arg(long, value_name = "N", default_value = "5")]
    limit: NonZero<usize>,
}

/// Diagnoses, prints and writes; returns the exit code.
///
/// # Errors
/// If the geometry cannot be meshed, or the file cannot be written.
pub fn run(arguments: &Arguments) -> Result<u8> {
    let Arguments { spacing_min, root, root_scale, .. } = *arguments;
    let requested = Requested { spacing_min, root, root_scale };
    let diagnosis = diagnose(&Input::read(&arguments.file, requested)?, arguments.limit.get());
    println!("{}\n{diagnosis}", arguments.file.display());
    let code = match () {
        () if diagnosis.changes_region => EXIT_FAILED,
        () if diagnosis.is_incomplete() => EXIT_MISSING,
        () => EXIT_HOLDS,
    };
    put_forms(code, &[(arguments.json.as_deref(), &|| pretty(&diagnosis))], None)
}
