//! `harness selftest`: corrupts correct meshes and prints what no check detects.

use crate::options::Input;
use check::selftest::{self, SelftestCase};
use clap::Args;
use contract::case::Case;
use contract::failure::{EXIT_FAILED, EXIT_HOLDS, Failure, Result};
use run::engine::failure::End;
use run::engine::layout::SERIAL;
use run::engine::paths::Paths;
use run::engine::runner::Engine;
use std::fs;
use std::time::Duration;

/// Time limit of every run of the reference.
const LIMIT: Duration = Duration::from_secs(600);

/// `harness selftest`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// The reference [default: next to the harness]
    #[arg(long, value_name = "PATH")]
    pub reference: Option<Input>,
}

/// Meshes the built-in cases, corrupts the meshes and prints what survives; returns the exit code.
///
/// # Errors
/// If a case cannot be meshed.
pub fn run(arguments: &Arguments) -> Result<u8> {
    let reference = Engine::find("reference", arguments.reference.as_deref(), &Paths::find())?;
    reference.require()?;
    let scratch = tempfile::tempdir()?;
    let meshed = selftest::cases().into_iter().map(|(name, text)| {
        let directory = scratch.path().join(name);
        let path = directory.with_extension("toml");
        fs::write(&path, text)?;
        // The mesh, and the base tree T0.
        let made = |name, ungraded| {
            let meshed = reference.mesh(&path, &SERIAL, ungraded, (&*directory.join(name), LIMIT));
            meshed.and_then(|mesh| reference.read_mesh(&mesh)).map_err(|ended| match &ended.end {
                End::Missing(_) | End::Interrupted => Failure::from(ended),
                _ => Failure { code: EXIT_FAILED, why: format!("{ended}, on {}", path.display()) },
            })
        };
        let case = Case::read(&path)?;
        Ok(SelftestCase { case, mesh: made("mesh", false)?, base: made("base", true)? })
    });
    let cases = meshed.collect::<Result<Vec<SelftestCase>>>()?;
    let mutants = scratch.path().join("mutants");
    let report = fs::create_dir(&mutants).and_then(|()| selftest::run(&cases, &mutants));
    let report = report.map_err(|error| Failure::at(&mutants, error))?;
    println!("{report}");
    Ok(if report.holds() { EXIT_HOLDS } else { EXIT_FAILED })
}
