//! `harness verify`: verifies the selected cases and reports.

use crate::options::{EngineArguments, Output};
use crate::output::{put, put_forms};
use clap::Args;
use contract::failure::Failure;
use report::verification::{json, junit, markdown, table};
use run::verify::options::Options;
use run::verify::verify;

/// `harness verify`.
#[derive(Args, Debug)]
pub struct Arguments {
    #[command(flatten)]
    pub options: Options,
    /// Write the report as JUnit XML
    #[arg(long, value_name = "FILE")]
    junit: Option<Output>,
    /// Write the report as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<Output>,
    #[command(flatten)]
    engine: EngineArguments,
}

/// Verifies, prints and writes; returns the exit code.
///
/// # Errors
/// If the verification cannot begin, or a report cannot be written.
pub fn run(
    Arguments { options, junit: junit_file, json: json_file, engine }: &Arguments,
) -> Result<u8, Failure> {
    let report = verify(options, &engine.find()?)?;
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
        &[(junit_file, &|| junit(&report)), (json_file, &|| json(&report))],
        Some(&text),
    )
}
