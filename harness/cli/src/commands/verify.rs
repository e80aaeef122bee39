//! `harness verify`: verifies the selected cases and reports.

use super::files::{put, put_forms};
use super::programs::ProgramArguments;
use super::values::Output;
use clap::Args;
use contract::failure::Failure;
use report::verification::machine::{json, junit};
use report::verification::{markdown, table};
use run::engine::programs::Programs;
use run::verify::options::Options;
use run::verify::verify;

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
    let Arguments { options, junit: junit_file, json: json_file, engine, programs } = arguments;
    let programs = Programs::find_with_engine(&engine, programs.given())?;
    let report = verify(&options, &programs)?;
    print!("{}", table(&report));
    let text = markdown(&report);
    // All forms go into the directory of `--out`.
    if let Some(out) = &options.out {
        for (name, text) in [
            ("table.txt", &table(&report)),
            ("report.md", &text),
            ("junit.xml", &junit(&report)),
            ("report.json", &json(&report)),
        ] {
            put(&out.join(name), text)?;
        }
    }
    put_forms(
        report.exit_code(),
        &[(&junit_file, &|| junit(&report)), (&json_file, &|| json(&report))],
        Some(&text),
    )
}
