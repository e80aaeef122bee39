//! `harness gate`: compares a candidate with a baseline and reports.

use crate::options::{EngineArguments, Output, examples};
use crate::output::put_forms;
use bench::gate::report::End;
use bench::gate::{GateOptions, gate};
use clap::Args;
use contract::failure::{EXIT_FAILED, EXIT_HOLDS, EXIT_INTERRUPTED, EXIT_MISSING, Result};
use report::gate::{junit, markdown, text};
use report::pretty;

/// `harness gate`.
#[derive(Args, Debug)]
#[command(after_help = examples(include_str!("../../../doc/gate.md")))]
pub struct Arguments {
    #[command(flatten)]
    options: GateOptions,
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
    engine: EngineArguments,
}

/// Compares, prints and writes; returns the exit code.
///
/// # Errors
/// If the gate cannot start, or a report cannot be written.
pub fn run(arguments: &Arguments) -> Result<u8> {
    let report = gate(&arguments.options, &arguments.engine.find()?)?;
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
            (arguments.record.as_deref(), &|| pretty(&report.candidate_measures)),
            (arguments.junit.as_deref(), &|| junit(&report)),
            (arguments.json.as_deref(), &|| pretty(&report)),
            (arguments.markdown.as_deref(), &|| summary.clone()),
        ],
        Some(&summary),
    )
}
