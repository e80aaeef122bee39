//! `harness man`: manual pages from the definition of the command line.

use clap::{Args, Command};
use clap_mangen::{Man, generate_to};
use contract::failure::EXIT_HOLDS;
use contract::failure::Failure;
use contract::files::named;
use std::fs;
use std::path::PathBuf;

/// `harness man`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Directory for one page per command [default: print the main page]
    #[arg(value_name = "DIR")]
    directory: Option<PathBuf>,
}

/// Writes the pages of the command line `definition`; returns the exit code.
///
/// # Errors
/// If the pages cannot be written.
pub fn run(arguments: &Arguments, definition: Command) -> Result<u8, Failure> {
    match &arguments.directory {
        None => {
            let mut page = Vec::new();
            Man::new(definition).render(&mut page)?;
            print!("{}", String::from_utf8_lossy(&page));
        }
        Some(directory) => {
            let written = fs::create_dir_all(directory);
            let written = written.and_then(|()| generate_to(definition, directory));
            written.map_err(|error| named(directory, &error))?;
        }
    }
    Ok(EXIT_HOLDS)
}
