//! `harness selftest`: corrupts correct meshes and prints which check detects each corruption.

use super::programs::ProgramArguments;
use check::selftest::{self, SelftestCase};
use clap::Args;
use contract::case::Case;
use contract::failure::Failure;
use contract::failure::{EXIT_FAILED, EXIT_HOLDS};
use contract::files::named;
use contract::leafset;
use run::engine::failure::End;
use run::engine::layout::SERIAL;
use run::engine::options::RunOptions;
use run::engine::programs::Programs;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// `harness selftest`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Corrupt the meshes of this case file instead of the built-in ones; may be repeated. Not all corruptions need apply to them
    #[arg(long, value_name = "CASE")]
    pub case: Vec<PathBuf>,
    /// Time limit of every run of reference or mesher
    #[arg(long, value_name = "SECONDS", default_value_t = 600)]
    pub timeout: u64,
    /// Paths of the programs.
    #[command(flatten)]
    pub programs: ProgramArguments,
}

/// Meshes the cases, corrupts the meshes and prints the table; returns the exit code.
///
/// # Errors
/// If a case cannot be meshed.
pub fn run(arguments: &Arguments) -> Result<u8, Failure> {
    let programs = Programs::find(arguments.programs.given())?;
    if !programs.reference.program().is_file() {
        let path = programs.reference.program().display();
        return Err(Failure::missing(format!(
            "the reference is missing: build {path}, or give another path with --reference"
        )));
    }
    let scratch = tempfile::tempdir()?;
    let cases =
        if arguments.case.is_empty() { built_in(scratch.path())? } else { arguments.case.clone() };
    let limit = Duration::from_secs(arguments.timeout);
    let meshed = cases.iter().enumerate().map(|(index, case)| {
        let directory = scratch.path().join(format!("case-{index}"));
        mesh_case(&programs, case, &directory, limit)
    });
    let cases = meshed.collect::<Result<Vec<SelftestCase>, Failure>>()?;
    let mutants = scratch.path().join("mutants");
    let report = fs::create_dir(&mutants).and_then(|()| selftest::run(&cases, &mutants));
    let report = report.map_err(|error| named(&mutants, &error))?;
    println!("{report}");
    // Each corruption applies to one of the built-in cases.
    Ok(if report.holds(arguments.case.is_empty()) { EXIT_HOLDS } else { EXIT_FAILED })
}

/// Writes the built-in cases; returns their paths.
fn built_in(scratch: &Path) -> Result<Vec<PathBuf>, Failure> {
    let write = |(name, text): (&str, &str)| {
        let path = scratch.join(format!("{name}.toml"));
        fs::write(&path, text)?;
        Ok(path)
    };
    selftest::CASES.into_iter().map(write).collect()
}

/// Meshes a case with the reference in `directory`: the mesh, and the base tree T0.
fn mesh_case(
    programs: &Programs,
    path: &Path,
    directory: &Path,
    limit: Duration,
) -> Result<SelftestCase, Failure> {
    let case = Case::read(path)?;
    let failed = |why| Failure { code: EXIT_FAILED, why };
    let mut meshes = Vec::new();
    for (name, ungraded) in [("mesh", false), ("base", true)] {
        let logs = directory.join(format!("{name}-logs"));
        fs::create_dir_all(&logs)?;
        let out = directory.join(name);
        let options = RunOptions {
            mesh: Some(&out),
            report: false,
            ungraded,
            ..RunOptions::new(&logs, limit)
        };
        programs.reference.run(path, &SERIAL, &options).map_err(|failure| match &failure.end {
            End::Missing(_) | End::Interrupted => Failure::from(failure),
            End::Exited { code: 2, error } => Failure::input(error),
            _ => failed(format!("{failure}, on {}", path.display())),
        })?;
        meshes.push(leafset::read(&out).map_err(|error| failed(error.to_string()))?);
    }
    if meshes.iter().any(|mesh| mesh.words.is_empty()) {
        let shown = path.display();
        return Err(Failure::input(format!(
            "{shown}: its mesh has no leaves that could be corrupted"
        )));
    }
    let base = meshes.pop().expect("the loop reads two meshes");
    let mesh = meshes.pop().expect("the loop reads two meshes");
    Ok(SelftestCase { case, mesh, base })
}
