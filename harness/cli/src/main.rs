//! The command `harness`; see `harness --help`.

#[macro_use]
mod output;

mod cli;
mod commands;

use clap::{CommandFactory, Parser};
use cli::{Arguments, Command};
use run::engine::interrupt;
use run::verify::report::{EXIT_HOLDS, EXIT_INTERRUPTED};
use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    interrupt::install();
    let code = match arguments.command {
        Command::Verify(arguments) => commands::verify::run(*arguments),
        Command::Selftest(arguments) => commands::selftest::run(&arguments),
        Command::Gate(arguments) => commands::gate::run(*arguments),
        Command::Bench(arguments) => commands::bench::run(*arguments),
        Command::Targets(arguments) => commands::targets::run(*arguments),
        Command::Report(arguments) => commands::report::run(&arguments),
        Command::Track(arguments) => commands::track::run(&arguments),
        Command::Shrink(arguments) => commands::shrink::run(&arguments),
        Command::Audit(arguments) => commands::audit::run(&arguments),
        Command::Geometry(arguments) => commands::geometry::run(&arguments),
        Command::Leak(arguments) => commands::leak::run(&arguments),
        Command::Export(arguments) => commands::export::run(&arguments),
        Command::NearBody(arguments) => commands::near_body::run(&arguments),
        Command::Picture(arguments) => commands::picture::run(&arguments),
        Command::Import(arguments) => commands::import::run(&arguments),
        Command::Diff(arguments) => commands::diff::run(&arguments),
        Command::Why(arguments) => commands::why::run(&arguments),
        Command::Completions(arguments) => {
            commands::completions::run(&arguments, &mut Arguments::command())
        }
        Command::Man(arguments) => commands::man::run(&arguments, Arguments::command()),
    };
    let code = output::finish(code);
    interrupt::uninstall();
    // A command that fails because its programs were ended has been interrupted.
    let is_interrupted = code != EXIT_HOLDS && interrupt::requested();
    ExitCode::from(if is_interrupted { EXIT_INTERRUPTED } else { code })
}
