//! `harness selftest`: correct meshes from the reference, corrupted; the table of kills, exit code.

use crate::cli::SelftestArguments;
use harness::case::Case;
use harness::engine::mesher::{self, Files};
use harness::engine::process::{self, End, Watch};
use harness::engine::programs::{Given, Programs};
use harness::leafset;
use harness::selftest::{self, Specimen};
use harness::verify::report::{
    EXIT_FAILED, EXIT_HOLDS, EXIT_INPUT, EXIT_INTERRUPTED, EXIT_MISSING,
};
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The built-in cases: between them every corruption applies.
const SPECIMENS: [(&str, &str); 4] = [
    ("outside", include_str!("../specimens/outside.toml")),
    ("inside", include_str!("../specimens/inside.toml")),
    ("all", include_str!("../specimens/all.toml")),
    ("boxes", include_str!("../specimens/boxes.toml")),
];

/// Makes specimens, corrupts them, prints the table of kills; the exit code.
pub fn run(arguments: &SelftestArguments) -> u8 {
    match try_run(arguments) {
        Ok(code) => code,
        Err((code, why)) => {
            eprintln!("harness: {why}");
            code
        }
    }
}

/// An exit code and its sentence.
type Failure = (u8, String);

fn try_run(arguments: &SelftestArguments) -> Result<u8, Failure> {
    let given = Given { mesher: None, reference: arguments.programs.reference.clone() };
    let programs = Programs::find(given);
    if !programs.reference.is_file() {
        let path = programs.reference.display();
        return Err((
            EXIT_MISSING,
            format!("there is no reference at {path}: build it, or say where it is"),
        ));
    }
    let scratch = tempfile::tempdir().map_err(|error| (EXIT_INPUT, error.to_string()))?;
    let cases =
        if arguments.case.is_empty() { built_in(scratch.path())? } else { arguments.case.clone() };
    let limit = Duration::from_secs(arguments.timeout);
    let made = cases.iter().enumerate().map(|(index, case)| {
        let place = scratch.path().join(format!("specimen-{index}"));
        specimen(&programs, case, &place, limit)
    });
    let specimens = made.collect::<Result<Vec<Specimen>, Failure>>()?;
    let mutants = scratch.path().join("mutants");
    let report = fs::create_dir(&mutants).and_then(|()| selftest::run(&specimens, &mutants));
    let report = report.map_err(|error| (EXIT_INPUT, format!("{}: {error}", mutants.display())))?;
    println!("{report}");
    Ok(if report.holds() { EXIT_HOLDS } else { EXIT_FAILED })
}

fn built_in(scratch: &Path) -> Result<Vec<PathBuf>, Failure> {
    let write = |(name, text): (&str, &str)| {
        let path = scratch.join(format!("{name}.toml"));
        fs::write(&path, text).map(|()| path).map_err(|error| (EXIT_INPUT, error.to_string()))
    };
    SPECIMENS.into_iter().map(write).collect()
}

/// The reference's meshes of a case.
fn specimen(
    programs: &Programs,
    path: &Path,
    place: &Path,
    limit: Duration,
) -> Result<Specimen, Failure> {
    let case = Case::read(path).map_err(|error| (EXIT_INPUT, error.to_string()))?;
    let mut meshes = Vec::new();
    for (name, ungraded) in [("mesh", false), ("base", true)] {
        let logs = place.join(format!("{name}-logs"));
        fs::create_dir_all(&logs).map_err(|error| (EXIT_INPUT, error.to_string()))?;
        let out = place.join(name);
        let files = Files { case: path, out: Some(&out), json: None, status: None, ungraded };
        let watch = Watch { limit, logs: &logs, name: "reference", status: None };
        let done = process::run(&mut mesher::reference(programs, &files), &watch)
            .map_err(|error| (EXIT_MISSING, format!("the reference cannot be started: {error}")))?;
        let shown = path.display();
        match done.end {
            End::Exited(0) => {}
            End::Interrupted => return Err((EXIT_INTERRUPTED, "ended by the user".to_owned())),
            End::Exited(2) => return Err((EXIT_INPUT, done.first_error_line())),
            end => {
                return Err((
                    EXIT_FAILED,
                    format!("the reference fails on {shown}: {end:?}, {}", done.first_error_line()),
                ));
            }
        }
        meshes.push(leafset::read(&out).map_err(|error| (EXIT_FAILED, error.to_string()))?);
    }
    let base = meshes.pop().expect("two were made");
    let mesh = meshes.pop().expect("two were made");
    Ok(Specimen { case, mesh, base })
}
