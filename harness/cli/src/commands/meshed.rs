//! A mesh on disk, or one that is made from a case first.

use super::programs::ProgramArguments;
use super::values::Input;
use clap::Args;
use contract::case::Case;
use contract::failure::Failure;
use contract::files::named;
use run::engine::layout::Layout;
use run::engine::options::RunOptions;
use run::engine::programs::Programs;
use run::engine::runner::Engine;
use std::fs;
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
    /// How a case is meshed.
    #[command(flatten)]
    pub engine: EngineArguments,
}

/// The program that meshes a case.
#[derive(Args, Debug)]
pub struct EngineArguments {
    /// The program that meshes a case: name in harness/engines or path of an engine description
    #[arg(long, default_value = "mesher")]
    engine: String,
    /// Time limit for meshing a case
    #[arg(long, value_name = "SECONDS", default_value_t = 600, value_parser = super::values::whole_seconds)]
    timeout: u64,
    /// Paths of the programs.
    #[command(flatten)]
    programs: ProgramArguments,
}

/// A leaf-set directory and the case of its mesh, if that is known. A directory that was made is deleted with it.
#[derive(Debug)]
pub struct Meshed {
    /// The directory.
    pub dir: PathBuf,
    /// The case.
    pub case: Option<Case>,
    _made: Option<TempDir>,
}

impl MeshArguments {
    /// The mesh. A case is meshed in a temporary directory, by ranks of this layout, as far as the base tree or to its end.
    ///
    /// # Errors
    /// If the case cannot be read or meshed.
    pub fn open(&self, layout: &Layout, ungraded: bool) -> Result<Meshed, Failure> {
        let given = Path::new(&self.mesh);
        if given.is_dir() {
            let case = self.case.as_deref().map(Case::read).transpose()?;
            return Ok(Meshed { dir: given.to_owned(), case, _made: None });
        }
        if self.case.is_some() {
            let shown = given.display();
            return Err(Failure::input(format!(
                "{shown} is not a leaf-set directory, which --case requires"
            )));
        }
        let Programs { engine, paths, .. } = self.engine.find()?;
        let path = paths.catalogue.case_file(&self.mesh, Path::new(""))?;
        self.engine.mesh(&engine, &path, layout, ungraded)
    }
}

impl EngineArguments {
    /// The programs.
    ///
    /// # Errors
    /// If the engine is not known.
    pub fn find(&self) -> Result<Programs, String> {
        Programs::find_with_engine(&self.engine, self.programs.given())
    }

    /// Time limit of a run.
    pub fn limit(&self) -> Duration {
        Duration::from_secs(self.timeout)
    }

    /// Meshes a case file in a temporary directory.
    ///
    /// # Errors
    /// If the case cannot be read or meshed.
    pub fn mesh(
        &self,
        engine: &Engine,
        path: &Path,
        layout: &Layout,
        ungraded: bool,
    ) -> Result<Meshed, Failure> {
        let case = Case::read(path)?;
        let made = tempfile::Builder::new().prefix("harness-mesh-").tempdir()?;
        let (dir, logs) = (made.path().join("mesh"), made.path().join("logs"));
        fs::create_dir(&logs).map_err(|error| named(&logs, &error))?;
        let prepared = engine.prepare(path, &made.path().join("case"))?;
        let options = RunOptions {
            mesh: Some(&dir),
            report: false,
            ungraded,
            ..RunOptions::new(&logs, self.limit())
        };
        engine.run(&prepared, layout, &options)?;
        Ok(Meshed { dir, case: Some(case), _made: Some(made) })
    }
}
