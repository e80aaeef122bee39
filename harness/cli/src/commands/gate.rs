//! `harness gate`: compares a candidate with a baseline and reports.

use super::files::{prepare, put};
use super::programs::ProgramArguments;
use super::values::Output;
use bench::gate::report::{End, GateReport};
use bench::gate::{GateError, GateOptions, gate};
use clap::Args;
use report::gate::{json, junit, markdown, text};
use run::engine::programs::Programs;
use run::verify::report::{
    EXIT_FAILED, EXIT_HOLDS, EXIT_INPUT, EXIT_INTERRUPTED, EXIT_MISSING, exit_first,
};
use std::{env, fs, io};

/// `harness gate`.
#[derive(Args, Debug)]
pub struct Arguments {
    #[command(flatten)]
    options: GateOptions,
    /// Name in harness/engines or path of an engine description
    #[arg(long, default_value = "mesher")]
    engine: String,
    /// Write the exact measures of the candidate: a baseline for later and input of `harness track`
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
pub fn run(arguments: Arguments) -> u8 {
    let given = arguments.programs.given();
    let programs = match Programs::find_with_engine(&arguments.engine, given) {
        Ok(programs) => programs,
        Err(why) => {
            eprintln!("harness: {why}");
            return EXIT_INPUT;
        }
    };
    let Arguments { record, junit, json, markdown, .. } = &arguments;
    for file in [record, junit, json, markdown].into_iter().flatten() {
        if let Err(error) = prepare(file) {
            eprintln!("harness: {error}");
            return EXIT_INPUT;
        }
    }
    let report = match gate(&arguments.options, &programs) {
        Ok(report) => report,
        Err(error) => return refuse(&error),
    };
    print!("{}", text(&report));
    if let Err(error) = write(&report, &arguments) {
        eprintln!("harness: a report could not be written: {error}");
        return exit_first(exit_code(&report), EXIT_INPUT);
    }
    exit_code(&report)
}

fn refuse(error: &GateError) -> u8 {
    eprintln!("harness: {error}");
    match error {
        GateError::Input(_) => EXIT_INPUT,
        GateError::Missing(_) => EXIT_MISSING,
    }
}

fn exit_code(report: &GateReport) -> u8 {
    match report.end() {
        End::Holds(_) => EXIT_HOLDS,
        End::Interrupted => EXIT_INTERRUPTED,
        End::Regression => EXIT_FAILED,
        End::Incomplete(_) => EXIT_MISSING,
    }
}

fn write(report: &GateReport, arguments: &Arguments) -> io::Result<()> {
    let forms: [(&Option<Output>, &dyn Fn() -> String); 4] = [
        (&arguments.record, &|| report.candidate_measures.json()),
        (&arguments.junit, &|| junit(report)),
        (&arguments.json, &|| json(report)),
        (&arguments.markdown, &|| markdown(report)),
    ];
    for (file, form) in forms {
        if let Some(file) = file {
            put(file, &form())?;
        }
    }
    if let Some(summary) = env::var_os("GITHUB_STEP_SUMMARY").filter(|path| !path.is_empty()) {
        let mut file = fs::OpenOptions::new().create(true).append(true).open(summary)?;
        io::Write::write_all(&mut file, markdown(report).as_bytes())?;
    }
    Ok(())
}
