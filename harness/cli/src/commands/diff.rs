//! `harness diff`: prints the first difference between two meshes.

use super::import::Source;
use crate::options::{Input, examples};
use check::checks::CheckResult;
use check::{diff, forest};
use clap::Args;
use contract::failure::{EXIT_FAILED, EXIT_HOLDS, Failure, Result};

/// `harness diff`.
#[derive(Args, Debug)]
#[command(after_help = examples(include_str!("../../../doc/diff.md")))]
pub struct Arguments {
    /// A leaf-set directory, or a mesh in any format of harness import
    a: Input,
    /// The mesh to compare with
    b: Input,
    /// Compare the leaves as octants, whatever the roots are
    #[arg(long)]
    ignore_root: bool,
    /// How to read a mesh without a manifest; the facets of the case also help to find the deciding rule.
    #[command(flatten)]
    source: Source,
}

/// Compares and prints; returns the exit code.
///
/// # Errors
/// If a mesh or the case cannot be read.
pub fn run(Arguments { a, b, ignore_root, source }: &Arguments) -> Result<u8> {
    source.refuse_unused(&[a, b])?;
    if let [Some(a), Some(b)] = [source.forest(a)?, source.forest(b)?]
        && !(*ignore_root || a.is_one_cube() && b.is_one_cube())
    {
        let results = forest::diff(&a, &b);
        results.iter().for_each(|result| println!("{result}"));
        return Ok(if results.iter().all(CheckResult::holds) { EXIT_HOLDS } else { EXIT_FAILED });
    }
    let case = source.read_case()?;
    let [of_a, of_b] = [source.open(a, case.as_ref())?, source.open(b, case.as_ref())?];
    let report = diff::diff(&of_a.dir, &of_b.dir, case.as_ref()).map_err(Failure::input)?;
    Failure::unless(report.leaves > 0 || !report.same_leaves(), "neither mesh has a leaf")?;
    println!("A {}\nB {}\n{report}", a.display(), b.display());
    let is_same = report.same_mesh() || *ignore_root && report.same_leaves();
    Ok(if is_same { EXIT_HOLDS } else { EXIT_FAILED })
}
