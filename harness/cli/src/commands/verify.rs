//! `harness verify`: verifies the selected cases and reports.

use crate::options::{EngineArguments, Output, examples};
use crate::output::put_forms;
use clap::Args;
use contract::failure::Result;
use report::pretty;
use report::verification::{junit, markdown, table};
use run::verify::options::Options;
use run::verify::verify;

/// `harness verify`.
#[derive(Args, Debug)]
#[command(after_help = examples(include_str!("../../../doc/verify.md")))]
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
pub fn run(arguments: &Arguments) -> Result<u8> {
    let report = verify(&arguments.options, &arguments.engine.find()?)?;
    let (shown, page) = (table(&report), markdown(&report));
    print!("{shown}");
    let out = |name| arguments.options.out.as_ref().map(|out| out.join(name));
    put_forms(
        report.exit_code(),
        &[
            (out("table.txt").as_deref(), &|| shown.clone()),
            (out("report.md").as_deref(), &|| page.clone()),
            (out("junit.xml").as_deref(), &|| junit(&report)),
            (out("report.json").as_deref(), &|| pretty(&report)),
            (arguments.junit.as_deref(), &|| junit(&report)),
            (arguments.json.as_deref(), &|| pretty(&report)),
        ],
        Some(&page),
    )
}
