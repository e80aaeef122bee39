//! `harness diff`: prints the first difference between two leaf-set directories.

use super::values::Input;
use check::diff;
use clap::Args;
use contract::case::Case;
use contract::failure::Failure;
use contract::failure::{EXIT_FAILED, EXIT_HOLDS};

/// `harness diff`.
#[derive(Args, Debug)]
#[command(after_help = "\
Prints the inputs and counts that differ, the first leaf that differs, and the rule of reference/DEFINITION.md that decides \
which mesh is right.

Exit codes: 0 the meshes are the same; 1 their leaves or their roots differ; 2 invalid input.")]
pub struct Arguments {
    /// A leaf-set directory
    a: Input,
    /// The leaf-set directory to compare with
    b: Input,
    /// The case of both meshes: its facets help to find the deciding rule
    #[arg(long)]
    case: Option<Input>,
    /// Compare the leaves as octants, whatever the roots are
    #[arg(long)]
    ignore_root: bool,
}

/// Compares and prints; returns the exit code.
///
/// # Errors
/// If a mesh or the case cannot be read.
pub fn run(Arguments { a, b, case, ignore_root }: &Arguments) -> Result<u8, Failure> {
    let case = case.as_deref().map(Case::read).transpose()?;
    let report = diff::diff(a, b, case.as_ref()).map_err(Failure::input)?;
    println!("A {}\nB {}\n{report}", a.display(), b.display());
    let is_same = report.same_mesh() || *ignore_root && report.same_leaves();
    Ok(if is_same { EXIT_HOLDS } else { EXIT_FAILED })
}
