//! `harness gate`: compares a candidate with a baseline and reports.

use super::files::put_forms;
use super::programs::ProgramArguments;
use super::values::Output;
use bench::gate::report::End;
use bench::gate::{GateOptions, gate};
use clap::Args;
use contract::failure::Failure;
use contract::failure::{EXIT_FAILED, EXIT_HOLDS, EXIT_INTERRUPTED, EXIT_MISSING};
use report::gate::{junit, markdown, text};
use report::json::pretty;
use run::engine::programs::Programs;

/// `harness gate`.
#[derive(Args, Debug)]
pub struct Arguments {
    #[command(flatten)]
    options: GateOptions,
    /// Name in harness/engines or path of an engine description
    #[arg(long, default_value = "mesher")]
    engine: String,
    /// Write the exact measures of the candidate, for `harness track`
    #[arg(long, value_name = "FILE")]
    record: Option<Output>,
    /// Write the report as JUnit XML
    #[arg(long, value_name = "FILE")]
    junit: Option<Output>,
    /// Write the report as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<Output>,
    /// Write the report as Markdown
    #[arg(long, value_name = "FILE")]
    markdown: Option<Output>,
    #[command(flatten)]
    programs: ProgramArguments,
}

/// Compares, prints and writes; returns the exit code.
///
/// # Errors
/// If the gate cannot start, or a report cannot be written.
pub fn run(arguments: &Arguments) -> Result<u8, Failure> {
    let programs = Programs::find_with_engine(&arguments.engine, arguments.programs.given())?;
    let report = gate(&arguments.options, &programs)?;
    print!("{}", text(&report));
    let code = match report.end() {
        End::Holds(_) => EXIT_HOLDS,
        End::Interrupted => EXIT_INTERRUPTED,
        End::Regression => EXIT_FAILED,
        End::Incomplete(_) => EXIT_MISSING,
    };
    let summary = markdown(&report);
    put_forms(
        code,
        &[
            (&arguments.record, &|| report.candidate_measures.json()),
            (&arguments.junit, &|| junit(&report)),
            (&arguments.json, &|| pretty(&report)),
            (&arguments.markdown, &|| summary.clone()),
        ],
        Some(&summary),
    )
}
