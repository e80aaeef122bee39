//! `harness export`: writes a mesh, or part of it, in the format of other programs.

use crate::options::{Input, SelectionArguments, examples, read_case};
use clap::Args;
use contract::failure::{EXIT_HOLDS, Failure, Result, progress};
use contract::manifest;
use contract::mesh::Mesh;
use export::format::{self, FORMATS};
use export::options::{Export, Regions, Summary};
use run::engine::paths::Paths;
use run::python;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The script reads all of a mesh into memory, which limits its size long before its time.
const SCRIPT_LIMIT: Duration = Duration::from_secs(24 * 3600);

/// `harness export`.
#[derive(Args, Debug)]
#[command(after_help = after_help())]
pub struct Arguments {
    /// The mesh: a leaf-set directory of any size
    mesh: Input,
    /// The file to write; its name decides the format. An existing file is replaced, but no .stl, which may be a body, and no polyMesh
    file: PathBuf,
    /// The case that was meshed: its named solids become patches (polyMesh, .cgns); name in geometries/catalogue.toml or path of a case file
    #[arg(long, value_name = "CASE")]
    case: Option<String>,
    /// Regions of cells that no face connects, for OpenFOAM and CGNS [default: all]
    #[arg(long)]
    regions: Option<Regions>,
    /// Which cells are written.
    #[command(flatten)]
    selection: SelectionArguments,
}

fn after_help() -> String {
    let formats = FORMATS.iter().map(|f| format!("  {:<12}{}\n", f.ending, f.purpose));
    let examples = examples(include_str!("../../../doc/export.md"));
    format!("Formats:\n{}\n{examples}", formats.collect::<String>())
}

/// Writes; returns the exit code.
///
/// # Errors
/// If the mesh cannot be read, or the file cannot be written.
pub fn run(arguments: &Arguments) -> Result<u8> {
    let Arguments { mesh, file, case, regions, selection } = arguments;
    let format = format::of(file)?;
    let has_patches = ["/polyMesh", ".cgns"].contains(&format.ending);
    let why = format!("--case and --regions have no effect on {}: omit them", format.ending);
    Failure::unless(has_patches || case.is_none() && regions.is_none(), why)?;
    if format.ending != "/polyMesh" {
        files::check_writable(file).map_err(|error| Failure::at(file, error))?;
    }
    let case = case.as_deref().map(read_case).transpose()?;
    let is_of_mesh = file.parent().is_some_and(|dir| dir.join(manifest::FILE).exists());
    let is_part = format.ending == ".vtkhdf" && is_of_mesh;
    let why = "it would be a part of the mesh, in whose directory it is: name another one";
    Failure::unless(!is_part, format!("{}: {why}", file.display()))?;
    let mesh = Mesh::open(mesh)?;
    let selection = selection.of(&mesh)?;
    let export = Export {
        mesh: &mesh,
        selection: &selection,
        case: case.as_ref(),
        regions: regions.unwrap_or_default(),
        script,
    };
    let written = (format.write)(&export, file);
    progress("");
    let Summary { leaves, bytes, notes } = written?;
    let what = if [".vtp", ".stl"].contains(&format.ending) { "face" } else { "cell" };
    let per_cell = bytes as f64 / leaves as f64;
    println!("{}: {leaves} {what}s, {bytes} bytes ({per_cell:.2} per {what})", file.display());
    notes.iter().for_each(|note| println!("  {note}"));
    Ok(EXIT_HOLDS)
}

/// Makes a file of a format of what the format is made of, in a temporary directory.
fn script(format: &str, source: &Path, file: &Path) -> Result<()> {
    let place = source.parent().expect("the source is in a temporary directory");
    let (name, script) = (format.to_uppercase(), format!("export_{format}.py"));
    python::run(&name, &script, [source, file], &Paths::find(), SCRIPT_LIMIT, place)?;
    Ok(())
}
