//! `harness completions`: a completion script from the definition of the command line.

use crate::cli;
use clap::{Args, CommandFactory};
use clap_complete::{Shell, generate};
use run::verify::report::EXIT_HOLDS;

/// `harness completions`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// The shell to generate completions for
    shell: Shell,
}

/// Prints the script; returns the exit code.
pub fn run(arguments: &Arguments) -> u8 {
    generate(arguments.shell, &mut cli::Arguments::command(), "harness", &mut std::io::stdout());
    EXIT_HOLDS
}
