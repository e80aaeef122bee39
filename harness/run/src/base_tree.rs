//! The base tree of a case at any surface level, made by an engine.

use crate::engine::failure::{End, Failure};
use crate::engine::layout::SERIAL;
use crate::engine::options::RunOptions;
use crate::engine::runner::Engine;
use contract::lattice::Root;
use contract::plain::{PlainCase, StlForm};
use std::fs;
use std::path::Path;
use std::time::Duration;
use tempfile::TempDir;
use toml::Value;

/// A case whose base tree is made at several surface levels. Files are in a temporary directory, which is removed with
/// it.
#[derive(Debug)]
pub struct BaseTrees<'a> {
    engine: &'a Engine,
    case: PlainCase,
    root: Root,
    place: TempDir,
    limit: Duration,
}

impl<'a> BaseTrees<'a> {
    /// The base trees of a case file. Each run of the engine is killed after `limit`.
    ///
    /// # Errors
    /// One sentence, if the case cannot be read or the temporary directory cannot be made.
    pub fn new(
        engine: &'a Engine,
        case: &Path,
        root: Root,
        limit: Duration,
    ) -> Result<Self, String> {
        let mut case = PlainCase::read(case)?;
        // The base tree does not depend on seeds, but one in a crossing leaf of a coarser tree would be refused.
        case.table.remove("seeds");
        let place = tempfile::Builder::new().prefix("harness-base-").tempdir();
        let place =
            place.map_err(|error| format!("no temporary directory can be made: {error}"))?;
        Ok(Self { engine, case, root, place, limit })
    }

    /// The sorted leaf words of the base tree whose crossing leaves have at least this level.
    ///
    /// # Errors
    /// If the engine fails, or its mesh cannot be read.
    pub fn at(&mut self, level: u8) -> Result<Vec<u64>, Failure> {
        let spacing = self.root.edge / f64::from(1u32 << level);
        self.case.table.insert("spacing_min".into(), Value::Float(spacing));
        let place = self.place.path();
        let case = self.case.write(place, StlForm::Any).map_err(|error| {
            Failure::new("the harness", End::Unusable(format!("cannot write a case: {error}")))
        })?;
        let mesh = place.join("mesh");
        let options =
            RunOptions { mesh: Some(&mesh), ungraded: true, ..RunOptions::new(place, self.limit) };
        let completed = self.engine.run(&case, &SERIAL, &options)?;
        let read = completed.read_mesh();
        let _ = fs::remove_dir_all(&mesh);
        let mesh = read.map_err(|why| {
            self.engine.unusable(format!("wrote a base tree that cannot be read: {why}"))
        })?;
        Ok(mesh.map(|mesh| mesh.words).unwrap_or_default())
    }
}
