//! harness: verifies meshes and the programs that make them. `harness --help` says how.

mod cli;
mod cli_bench;
mod cli_gate;
mod cli_report;
mod cli_selftest;
mod cli_shrink;
mod cli_targets;
mod cli_track;
mod cli_verify;

use clap::Parser;
use cli::{Arguments, Command};
use harness::audit::record::AuditRecord;
use harness::audit::{self, AuditOptions};
use harness::case::Case;
use harness::diff;
use harness::engine::interrupt;
use harness::export;
use harness::leafset;
use harness::verify::report::{EXIT_FAILED, EXIT_HOLDS, EXIT_INPUT};
use std::path::Path;
use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    interrupt::install();
    let code = match arguments.command {
        Command::Verify(arguments) => cli_verify::run(*arguments),
        Command::Gate(arguments) => cli_gate::run(*arguments),
        Command::Bench(arguments) => cli_bench::run(*arguments),
        Command::Shrink(arguments) => cli_shrink::run(&arguments),
        Command::Report(arguments) => cli_report::run(&arguments),
        Command::Track(arguments) => cli_track::run(&arguments),
        Command::Selftest(arguments) => cli_selftest::run(&arguments),
        Command::Audit { mesh, nodes_max, json } => run_audit(&mesh, nodes_max, json.as_deref()),
        Command::Export { mesh, to } => run_export(&mesh, &to),
        Command::Diff { a, b, case } => run_diff(&a, &b, case.as_deref()),
    };
    ExitCode::from(code)
}

fn run_audit(mesh: &Path, nodes_max: Option<usize>, json: Option<&Path>) -> u8 {
    if !mesh.is_dir() {
        eprintln!("harness: {} is no directory", mesh.display());
        return EXIT_INPUT;
    }
    let default = AuditOptions::default();
    let options = AuditOptions { nodes_max: nodes_max.unwrap_or(default.nodes_max) };
    let report = audit::audit(mesh, &options);
    println!("{report}");
    if let Some(path) = json
        && let Err(error) = AuditRecord::of(&report).write(path)
    {
        eprintln!("harness: {}: {error}", path.display());
        return EXIT_INPUT;
    }
    if report.holds() { EXIT_HOLDS } else { EXIT_FAILED }
}

fn run_export(mesh: &Path, to: &Path) -> u8 {
    let exported = leafset::read(mesh).map_err(|e| e.to_string());
    match exported.and_then(|mesh| export::vtu(&mesh, to).map_err(|e| e.to_string())) {
        Ok(()) => EXIT_HOLDS,
        Err(error) => {
            eprintln!("harness: {error}");
            EXIT_INPUT
        }
    }
}

fn run_diff(a: &Path, b: &Path, case: Option<&Path>) -> u8 {
    let compared = case.map(Case::read).transpose().map_err(|error| error.to_string());
    match compared
        .and_then(|case| diff::diff(a, b, case.as_ref()).map_err(|error| error.to_string()))
    {
        Ok(report) => {
            println!("{report}");
            if report.same_leaves() { EXIT_HOLDS } else { EXIT_FAILED }
        }
        Err(error) => {
            eprintln!("harness: {error}");
            EXIT_INPUT
        }
    }
}
