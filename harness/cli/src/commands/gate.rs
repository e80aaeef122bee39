//! `harness gate`: compares a candidate with a baseline and reports.

use super::files::{prepare, put};
use super::programs::ProgramArguments;
use super::values::{Input, Output, seconds};
use bench::gate::build::top_level;
use bench::gate::report::{End, LayerName, Report};
use bench::gate::{GateError, Options, gate};
use clap::Args;
use report::gate::{json, junit, markdown, text};
use run::engine::programs::Programs;
use run::verify::report::{
    EXIT_FAILED, EXIT_HOLDS, EXIT_INPUT, EXIT_INTERRUPTED, EXIT_MISSING, exit_first,
};
use std::path::{Path, PathBuf};
use std::time::Duration;
use std::{env, fs, io};

/// `harness gate`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// A revision (built and kept), a program, or a record of --record [default: none; the candidate is only measured]
    #[arg(long, value_name = "REVISION|FILE")]
    baseline: Option<String>,
    /// A revision, a program, or `.` for the working tree [default: `.` against a revision, else --mesher]
    #[arg(long, value_name = "REVISION|FILE")]
    candidate: Option<String>,
    /// Name in harness/engines or path of an engine description
    #[arg(long, default_value = "mesher")]
    engine: String,
    /// Cases, tolerances, rounds [default: harness/engines/gate.toml]
    #[arg(long, value_name = "FILE")]
    rules: Option<Input>,
    /// Only these cases of the rules
    #[arg(long, value_delimiter = ',')]
    case: Vec<String>,
    /// Only these layers [default: those for which the rules have a case]
    #[arg(long, value_delimiter = ',')]
    layers: Vec<LayerName>,
    /// Time for one case in the layer of time [default: from the rules]
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    budget: Option<f64>,
    /// Seed of the order of runs and of the permutation tests
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Time limit of every single run
    #[arg(long, value_name = "SECONDS", default_value_t = 600, value_parser = super::values::whole_seconds)]
    timeout: u64,
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
    /// Exit code 3 if a layer or a case of it was left out
    #[arg(long)]
    require_layers: bool,
    /// The repository of the revisions and of the working tree [default: that of the current directory]
    #[arg(long, value_name = "DIR")]
    repository: Option<PathBuf>,
    /// Where revisions are built and kept [default: target/gate in the repository]
    #[arg(long, value_name = "DIR")]
    cache: Option<PathBuf>,
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
    let repository = top_level(arguments.repository.as_deref().unwrap_or(Path::new(".")));
    let options = Options {
        baseline: arguments.baseline.clone(),
        candidate: arguments.candidate.clone(),
        rules: arguments.rules.as_deref().map(Path::to_owned),
        cases: arguments.case.clone(),
        layers: arguments.layers.clone(),
        require_layers: arguments.require_layers,
        seed: arguments.seed,
        limit: Duration::from_secs(arguments.timeout),
        budget_s: arguments.budget,
        cache: arguments.cache.clone().unwrap_or_else(|| repository.join("target/gate")),
        repository,
    };
    let report = match gate(&options, &programs) {
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

fn exit_code(report: &Report) -> u8 {
    match report.end() {
        End::Holds(_) => EXIT_HOLDS,
        End::Interrupted => EXIT_INTERRUPTED,
        End::Regression => EXIT_FAILED,
        End::Incomplete(_) => EXIT_MISSING,
    }
}

fn write(report: &Report, arguments: &Arguments) -> io::Result<()> {
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
