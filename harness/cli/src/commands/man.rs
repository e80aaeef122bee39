//! `harness man`: manual pages from the definition of the command line.

use clap::{Args, Command};
use clap_mangen::{Man, generate_to};
use run::verify::report::{EXIT_HOLDS, EXIT_INPUT};
use std::path::PathBuf;

/// `harness man`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Directory for one page per command [default: print the main page]
    #[arg(value_name = "DIR")]
    directory: Option<PathBuf>,
}

/// Writes the pages of the command line `definition`; returns the exit code.
pub fn run(arguments: &Arguments, definition: Command) -> u8 {
    let written = match &arguments.directory {
        None => {
            let mut page = Vec::new();
            let rendered = Man::new(definition).render(&mut page);
            rendered.map(|()| print!("{}", String::from_utf8_lossy(&page)))
        }
        Some(directory) => {
            std::fs::create_dir_all(directory).and_then(|()| generate_to(definition, directory))
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
