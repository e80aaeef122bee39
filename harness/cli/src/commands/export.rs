//! `harness export`: writes a leaf-set directory as a VTK file.

use clap::Args;
use contract::leafset;
use report::vtu::vtu;
use run::verify::report::{EXIT_HOLDS, EXIT_INPUT};
use std::path::PathBuf;

/// `harness export`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// The leaf-set directory
    mesh: PathBuf,
    /// The file to write, .vtu
    #[arg(value_name = "FILE")]
    to: PathBuf,
}

/// Reads and writes; returns the exit code.
pub fn run(Arguments { mesh, to }: &Arguments) -> u8 {
    let exported = leafset::read(mesh).map_err(|e| e.to_string());
    match exported.and_then(|mesh| vtu(&mesh, to).map_err(|e| e.to_string())) {
        Ok(()) => EXIT_HOLDS,
        Err(error) => {
            eprintln!("harness: {error}");
            EXIT_INPUT
        }
    }
}
