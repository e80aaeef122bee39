//! `harness verify`: options in, reports out, exit code.

use crate::cli::VerifyArguments;
use harness::engine::programs::{Given, Programs};
use harness::out::json::json;
use harness::out::junit::junit;
use harness::out::markdown::markdown;
use harness::out::table::table;
use harness::verify::options::Options;
use harness::verify::report::{EXIT_INPUT, EXIT_MISSING, Report};
use harness::verify::{VerifyError, verify};
use std::env;
use std::fs::{self, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Verifies, prints, writes; the exit code.
pub fn run(arguments: VerifyArguments) -> u8 {
    let given = Given {
        mesher: arguments.programs.mesher.clone(),
        reference: arguments.programs.reference.clone(),
    };
    let mut programs = Programs::find(given);
    if let Some(name) = &arguments.engine {
        programs = match programs.with_engine(name, Duration::from_secs(arguments.timeout)) {
            Ok(programs) => programs,
            Err(why) => {
                eprintln!("harness: {why}");
                return EXIT_INPUT;
            }
        };
    }
    let (junit, json) = (arguments.junit.clone(), arguments.json.clone());
    let options = options(arguments);
    let report = match verify(&options, &programs) {
        Ok(report) => report,
        Err(error) => {
            eprintln!("harness: {error}");
            return match error {
                VerifyError::Input(_) => EXIT_INPUT,
                VerifyError::Missing(_) => EXIT_MISSING,
            };
        }
    };
    print!("{}", table(&report));
    match write(&report, &options, junit, json) {
        Ok(()) => report.exit_code(),
        Err(error) => {
            eprintln!("harness: a report could not be written: {error}");
            // A failed check stays the graver of the two.
            report.exit_code().max(EXIT_INPUT)
        }
    }
}

fn options(arguments: VerifyArguments) -> Options {
    Options {
        cases: arguments.cases,
        sizes: arguments.size,
        ranks: arguments.ranks,
        partitioners: arguments.partitioners,
        level_bases: arguments.level_bases,
        out: arguments.out,
        keep: arguments.keep,
        limit: Duration::from_secs(arguments.timeout),
        mpi: !arguments.no_mpi,
        oracles: !arguments.no_oracles,
        p4est: !arguments.no_p4est,
        require: arguments.require,
        oracle_points: arguments.oracle_points,
        seed: arguments.seed,
        cells_max: arguments.cells_max,
        reference_cells_max: arguments.reference_cells_max,
    }
}

/// Every form of the report that was asked for; with `--out` all of them, there.
fn write(
    report: &Report,
    options: &Options,
    junit_file: Option<PathBuf>,
    json_file: Option<PathBuf>,
) -> io::Result<()> {
    let forms = [
        ("table.txt", table(report)),
        ("report.md", markdown(report)),
        ("junit.xml", junit(report)),
        ("report.json", json(report)),
    ];
    if let Some(out) = &options.out {
        for (name, text) in &forms {
            put(&out.join(name), text)?;
        }
    }
    let [_, (_, markdown), (_, junit), (_, json)] = &forms;
    for (file, text) in [(junit_file, junit), (json_file, json)] {
        if let Some(file) = file {
            put(&file, text)?;
        }
    }
    if let Some(summary) = env::var_os("GITHUB_STEP_SUMMARY").filter(|path| !path.is_empty()) {
        OpenOptions::new()
            .create(true)
            .append(true)
            .open(summary)?
            .write_all(markdown.as_bytes())?;
    }
    Ok(())
}

/// Writes a file, naming it where that fails.
fn put(path: &Path, text: &str) -> io::Result<()> {
    fs::write(path, text)
        .map_err(|error| io::Error::new(error.kind(), format!("{}: {error}", path.display())))
}
