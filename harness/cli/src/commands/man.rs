//! `harness man`: manual pages from the definition of the command line.

use crate::cli;
use clap::{Args, CommandFactory};
use clap_mangen::{Man, generate_to};
use run::verify::report::{EXIT_HOLDS, EXIT_INPUT};
use std::io;
use std::path::PathBuf;

/// `harness man`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Directory for one page per command [default: print the main page]
    #[arg(value_name = "DIR")]
    directory: Option<PathBuf>,
}

/// Writes the pages; returns the exit code.
pub fn run(arguments: &Arguments) -> u8 {
    let command = cli::Arguments::command();
    let written = match &arguments.directory {
        None => Man::new(command).render(&mut io::stdout()),
        Some(directory) => {
            std::fs::create_dir_all(directory).and_then(|()| generate_to(command, directory))
        }
    };
    match written {
        Ok(()) => EXIT_HOLDS,
        Err(error) => {
            eprintln!("harness: the manual pages cannot be written: {error}");
            EXIT_INPUT
        }
    }
}
