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
    #[arg(required_unless_present = "shape", conflicts_with_all = ["shape", "facets", "size"])]
    case: Option<PathBuf>,
    /// Shape: cube, sphere, torus, nested_spheres, plate, pipe, uav, fighter, boxes_overlapping,
    /// box_in_box, three_spheres, pipes_crossing or car
    #[arg(long, requires = "facets")]
    shape: Option<String>,
    /// Number of facets: exact if even, otherwise one less
    #[arg(long)]
    facets: Option<usize>,
    /// Dimension of the shape, as in a [generator] table, for example radius=0.5; may be repeated
    #[arg(long, value_name = "KEY=VALUE")]
    size: Vec<String>,
    /// STL file to write, which must not exist
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
        Err(error) => {
            let path = arguments.out.display();
            fail(4, &format!("cannot write {path}: {error}; choose another path"))
        }
    }
}

fn fail(code: u8, message: &str) -> ExitCode {
    eprintln!("geometry: {message}");
    ExitCode::from(code)
}

/// The generator of the case file or of the options. The options are written as a `[generator]`
/// table and parsed like one, so that both accept the same keys.
fn generator(arguments: &Arguments) -> Result<Generator, String> {
    if let Some(case) = &arguments.case {
        return from_case(case);
    }
    let shape = arguments.shape.as_deref().unwrap_or_default();
    let facets = arguments.facets.unwrap_or_default();
    let mut table = format!("shape = \"{}\"\nfacets = {facets}\n", shape.escape_default());
    for size in &arguments.size {
        let (key, value) = size.split_once('=').ok_or("--size must have the form KEY=VALUE")?;
        table += &format!("{key} = {value}\n");
    }
    toml::from_str(&table).map_err(|error| error.message().to_owned())
}

fn from_case(path: &Path) -> Result<Generator, String> {
    let name = path.display();
    let text =
        std::fs::read_to_string(path).map_err(|error| format!("cannot read {name}: {error}"))?;
    let case: toml::Table = text.parse().map_err(|error| format!("{name}: {error}"))?;
    let table = case.get("generator").ok_or_else(|| {
        format!(
            "{name} has no [generator] table: give a case with one, or use --shape and --facets"
        )
    })?;
    table
        .clone()
        .try_into()
        .map_err(|error: toml::de::Error| format!("{name}: {}", error.message()))
}
