//! `harness completions`: a completion script from the definition of the command line.

use clap::{Args, Command};
use clap_complete::{Shell, generate};
use contract::failure::EXIT_HOLDS;

/// `harness completions`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// The shell to generate completions for
    shell: Shell,
}

/// Prints the script for the command line `definition`; returns the exit code.
pub fn run(arguments: &Arguments, definition: &mut Command) -> u8 {
    let mut script = Vec::new();
    generate(arguments.shell, definition, "harness", &mut script);
    print!("{}", String::from_utf8_lossy(&script));
    EXIT_HOLDS
}
