//! `harness verify`: verifies the selected cases and reports.

use super::files::put;
use super::programs::ProgramArguments;
use super::values::Output;
use crate::failure::Failure;
use clap::Args;
use report::verification::json::json;
use report::verification::junit::junit;
use report::verification::markdown::markdown;
use report::verification::table::table;
use run::engine::programs::Programs;
use run::verify::options::Options;
use run::verify::report::{EXIT_INPUT, Report, exit_first};
use run::verify::verify;
use std::env;
use std::fs::OpenOptions;
use std::io::{self, Write};

/// `harness verify`.
#[derive(Args, Debug)]
pub struct Arguments {
    #[command(flatten)]
    pub options: Options,
    /// Write the report as JUnit XML
    #[arg(long, value_name = "FILE")]
    pub junit: Option<Output>,
    /// Write the report as JSON
    #[arg(long, value_name = "FILE")]
    pub json: Option<Output>,
    /// Verify another mesher: name in harness/engines or path of a description
    #[arg(long, value_name = "ENGINE", default_value = "mesher")]
    pub engine: String,
    /// Paths of the programs.
    #[command(flatten)]
    pub programs: ProgramArguments,
}

/// Verifies, prints and writes; returns the exit code.
///
/// # Errors
/// If the verification cannot begin, or a report cannot be written.
pub fn run(arguments: Arguments) -> Result<u8, Failure> {
    let Arguments { options, junit, json, engine, programs } = arguments;
    let programs = Programs::find_with_engine(&engine, programs.given())?;
    let report = verify(&options, &programs)?;
    print!("{}", table(&report));
    write(&report, &options, junit, json).map_err(|error| Failure {
        code: exit_first(report.exit_code(), EXIT_INPUT),
        why: format!("a report could not be written: {error}"),
    })?;
    Ok(report.exit_code())
}

/// Writes the requested forms of the report, and all forms into the directory of `--out`.
fn write(
    report: &Report,
    options: &Options,
    junit_file: Option<Output>,
    json_file: Option<Output>,
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
