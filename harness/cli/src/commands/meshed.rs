//! A mesh on disk, or one that is made from a case first.

use crate::options::{EngineArguments, Input, whole_seconds};
use clap::Args;
use contract::case::Case;
use contract::failure::Failure;
use run::engine::layout::Layout;
use run::engine::programs::Programs;
use std::path::{Path, PathBuf};
use std::time::Duration;
use tempfile::TempDir;

/// A mesh on disk or a case, and how a case is meshed.
#[derive(Args, Debug)]
pub struct MeshArguments {
    /// A leaf-set directory, a case file (.toml) or a name in geometries/catalogue.toml
    #[arg(value_name = "CASE|DIR")]
    pub mesh: String,
    /// The case file of a leaf-set directory, which provides the geometry
    #[arg(long, value_name = "CASE")]
    pub case: Option<Input>,
    /// Time limit for meshing a case
    #[arg(long, value_name = "SECONDS", default_value = "600", value_parser = whole_seconds)]
    timeout: Duration,
    /// The program that meshes a case.
    #[command(flatten)]
    engine: EngineArguments,
}

/// A leaf-set directory. One that was made is deleted with this value.
#[derive(Debug)]
pub struct Meshed {
    /// The directory.
    pub dir: PathBuf,
    /// The temporary directory in which it was made.
    pub made: Option<TempDir>,
}

impl MeshArguments {
    /// The mesh, and its case if that is known. A case is meshed in a temporary directory, by ranks of this layout, as far as the base tree or to its end.
    ///
    /// # Errors
    /// If the case cannot be read or meshed.
    pub fn open(&self, layout: &Layout, ungraded: bool) -> Result<(Meshed, Option<Case>), Failure> {
        let given = Path::new(&self.mesh);
        if given.is_dir() {
            let case = self.case.as_deref().map(Case::read).transpose()?;
            return Ok((Meshed { dir: given.to_owned(), made: None }, case));
        }
        if self.case.is_some() {
            let why = "is not a leaf-set directory, which --case requires";
            return Err(Failure::input(format!("{} {why}", given.display())));
        }
        let Programs { engine, paths, .. } = self.engine.find()?;
        let path = paths.catalogue.case_file(&self.mesh, Path::new(""))?;
        let case = Case::read(&path)?;
        let made = tempfile::Builder::new().prefix("harness-mesh-").tempdir()?;
        let prepared = engine.prepare(&path, &made.path().join("case"))?;
        let place = (made.path(), self.timeout);
        let dir = engine.mesh(&prepared, layout, ungraded, place)?;
        Ok((Meshed { dir, made: Some(made) }, Some(case)))
    }
}
