//! `harness import`: makes a leaf-set directory from a mesh in another program's format.

use crate::options::{Input, Meshed, examples, read_case, root, whole_seconds};
use clap::Args;
use contract::case::Case;
use contract::failure::{EXIT_HOLDS, Failure, Result};
use contract::import::forest::{self, Forest};
use contract::import::{Format, Position, Request, guess};
use contract::lattice::Root;
use contract::manifest::{self, Manifest};
use run::import::{Imported, import};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// `harness import`.
#[derive(Args, Debug)]
#[command(after_help = examples(include_str!("../../../doc/import.md")))]
pub struct Arguments {
    /// The mesh: a file, or an OpenFOAM case or polyMesh
    mesh: Input,
    /// The directory to make
    #[arg(short, long, value_name = "DIR")]
    out: PathBuf,
    /// How to read the mesh.
    #[command(flatten)]
    source: Source,
}

/// How to read a mesh in another program's format.
#[derive(Args, Debug)]
pub struct Source {
    /// The format [default: recognised by content]
    #[arg(long)]
    format: Option<Format>,
    /// Minimum corner and edge length of the root [default: that of the case, of the file, or derived from the cells]
    #[arg(long, value_name = "X,Y,Z,EDGE", value_parser = root, allow_hyphen_values = true)]
    root: Option<Root>,
    /// The case that was meshed, for its root and requirements: name in geometries/catalogue.toml or path of a case file
    #[arg(long, value_name = "CASE", conflicts_with = "root")]
    case: Option<String>,
    /// Cell array or column with the sides: 0 outside, 1 inside, 2 crossing [default: `side` in a file that the harness or the mesher wrote for VTK, or else unknown]
    #[arg(long, value_name = "NAME")]
    sides: Option<String>,
    /// What x, y and z are in a table
    #[arg(long, value_enum, default_value_t)]
    position: Position,
    /// Time limit of a reader in Python [default: 3600]
    #[arg(long, value_name = "SECONDS", value_parser = whole_seconds)]
    timeout: Option<Duration>,
}

impl Source {
    /// Whether an option states the place of cells or their sides.
    fn describes_cells(&self) -> bool {
        self.root.is_some() || self.sides.is_some() || self.position != Position::default()
    }

    /// Refuses options that have no effect, because each of the meshes is a leaf-set directory.
    ///
    /// # Errors
    /// If any is given.
    pub fn refuse_unused(&self, meshes: &[&Path]) -> Result<()> {
        let is_given = self.format.is_some() || self.timeout.is_some() || self.describes_cells();
        let is_used = !is_given || !meshes.iter().all(|mesh| has_manifest(mesh));
        let why = "has a manifest, which states root and sides: omit the options for reading it";
        Failure::unless(is_used, format!("{} {why}", meshes[0].display()))
    }

    /// The trees of a file of p4est, unless options ask for one mesh in a root.
    ///
    /// # Errors
    /// If the file is damaged.
    pub fn forest(&self, mesh: &Path) -> Result<Option<Forest>> {
        let is_one_mesh = self.case.is_some() || self.describes_cells();
        if is_one_mesh || self.format.or_else(|| guess(mesh).ok()) != Some(Format::P4est) {
            return Ok(None);
        }
        Ok(Some(forest::read(mesh).map_err(|error| error.of_file(mesh))?))
    }

    /// Reads the case, if one is given.
    ///
    /// # Errors
    /// If it is not in the catalogue, or is invalid.
    pub fn read_case(&self) -> Result<Option<Case>> {
        self.case.as_deref().map(read_case).transpose()
    }

    /// Reads the mesh.
    fn read(&self, mesh: &Path, case: Option<&Case>) -> Result<Imported> {
        let Self { format, root, position, timeout, .. } = *self;
        let request = Request { sides: self.sides.clone(), root, position, ..Request::default() };
        let program = format!("harness {} import", env!("CARGO_PKG_VERSION"));
        let limit = timeout.unwrap_or(Duration::from_secs(3600));
        let mut imported = import(mesh, format, &request, case, program, limit)?;
        if matches!(imported, Imported::Words { is_root_derived: true, .. }) {
            let Root { origin: [x, y, z], edge } = imported.manifest().root;
            eprintln!(
                "harness: the root {x},{y},{z},{edge} is the least that holds the cells; --root gives another"
            );
        }
        Ok(imported)
    }

    /// The directory of a mesh, which is imported if it is no leaf set.
    ///
    /// # Errors
    /// If it is not a usable mesh, or if Python or VTK is missing.
    pub fn open(&self, mesh: &Path, case: Option<&Case>) -> Result<Meshed> {
        if has_manifest(mesh) {
            return Ok(Meshed { dir: mesh.to_owned(), made: None });
        }
        let made = tempfile::tempdir()?;
        self.read(mesh, case)?.create(made.path(), true)?;
        Ok(Meshed { dir: made.path().to_owned(), made: Some(made) })
    }
}

fn has_manifest(mesh: &Path) -> bool {
    mesh.join(manifest::FILE).exists()
}

/// Reads and writes; returns the exit code.
///
/// # Errors
/// If the mesh cannot be read or written.
pub fn run(Arguments { mesh, out, source }: &Arguments) -> Result<u8> {
    let mut imported = source.read(mesh, source.read_case()?.as_ref())?;
    imported.create(out, false)?;
    let Manifest { leaves, sides, .. } = imported.manifest();
    let known = if *sides == manifest::Sides::Known { "known" } else { "unknown" };
    println!("{}: {leaves} cells, sides {known}", out.display());
    Ok(EXIT_HOLDS)
}
