//! Writes a generated shape as binary STL: from a case file's `[generator]` table, or from flags.

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
    /// A case file with a [generator] table
    #[arg(required_unless_present = "shape", conflicts_with_all = ["shape", "facets", "size"])]
    case: Option<PathBuf>,
    /// cube, sphere, torus, nested_spheres, plate, pipe, uav or fighter
    #[arg(long, requires = "facets")]
    shape: Option<String>,
    /// How many facets: met exactly if even
    #[arg(long)]
    facets: Option<usize>,
    /// One of the shape's own sizes, as in the table: radius=0.5
    #[arg(long, value_name = "KEY=VALUE")]
    size: Vec<String>,
    /// The STL file to write; it must not exist yet
    #[arg(short, long)]
    out: PathBuf,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let generator = match generator(&arguments) {
        Ok(generator) => generator,
        Err(message) => return fail(2, &message),
    };
    let facets = match generator.facets() {
        Ok(facets) => facets,
        Err(error) => return fail(2, &error.to_string()),
    };
    let written = File::create_new(&arguments.out)
        .and_then(|file| write_stl_binary(&facets, BufWriter::new(file)));
    match written {
        Ok(()) => {
            println!("{}: {} facets", arguments.out.display(), facets.len());
            ExitCode::SUCCESS
        }
        Err(error) => fail(4, &format!("{}: {error}", arguments.out.display())),
    }
}

fn fail(code: u8, message: &str) -> ExitCode {
    eprintln!("geometry: {message}");
    ExitCode::from(code)
}

/// The flags are put as a table and read as a case file's would be, so that both know the same keys.
fn generator(arguments: &Arguments) -> Result<Generator, String> {
    if let Some(case) = &arguments.case {
        return from_case(case);
    }
    let shape = arguments.shape.as_deref().unwrap_or_default();
    let facets = arguments.facets.unwrap_or_default();
    let mut table = format!("shape = \"{}\"\nfacets = {facets}\n", shape.escape_default());
    for size in &arguments.size {
        let (key, value) = size.split_once('=').ok_or("--size takes KEY=VALUE")?;
        table += &format!("{key} = {value}\n");
    }
    toml::from_str(&table).map_err(|error| error.message().to_owned())
}

fn from_case(path: &Path) -> Result<Generator, String> {
    let place = path.display();
    let text = std::fs::read_to_string(path).map_err(|error| format!("{place}: {error}"))?;
    let case: toml::Table = text.parse().map_err(|error| format!("{place}: {error}"))?;
    let table = case.get("generator").ok_or_else(|| {
        format!("{place}: no [generator] table; a case with a geometry file needs no generation")
    })?;
    table
        .clone()
        .try_into()
        .map_err(|error: toml::de::Error| format!("{place}: {}", error.message()))
}
