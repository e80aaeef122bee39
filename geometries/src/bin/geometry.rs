//! The program `geometry`: writes a generated shape as binary STL.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;
use geometries::{Generator, write_stl_binary};

/// Write a generated shape as binary STL.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// Case file with a [generator] table
    case: PathBuf,
    /// STL file to write, which must not exist
    #[arg(short, long)]
    out: PathBuf,
}

fn main() -> ExitCode {
    let Arguments { case, out } = Arguments::parse();
    let made = generator(&case).and_then(|made| made.facets().map_err(|error| error.to_string()));
    let facets = match made {
        Ok(facets) => facets,
        Err(message) => return fail(2, &message),
    };
    let written =
        File::create_new(&out).and_then(|file| write_stl_binary(&facets, BufWriter::new(file)));
    match written {
        Ok(()) => {
            println!("{}: {} facets", out.display(), facets.len());
            ExitCode::SUCCESS
        }
        Err(error) => {
            fail(4, &format!("cannot write {}: {error}; choose another path", out.display()))
        }
    }
}

fn fail(code: u8, message: &str) -> ExitCode {
    eprintln!("geometry: {message}");
    ExitCode::from(code)
}

fn generator(path: &Path) -> Result<Generator, String> {
    let name = path.display();
    let text =
        std::fs::read_to_string(path).map_err(|error| format!("cannot read {name}: {error}"))?;
    let case: toml::Table = text.parse().map_err(|error| format!("{name}: {error}"))?;
    let table = case
        .get("generator")
        .ok_or_else(|| format!("{name} has no [generator] table: give a case with one"))?;
    table
        .clone()
        .try_into()
        .map_err(|error: toml::de::Error| format!("{name}: {}", error.message()))
}
