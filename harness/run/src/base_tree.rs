//! The base tree of a case at any surface level, made by an engine.

use crate::engine::failure::{End, Failure};
use crate::engine::layout::SERIAL;
use crate::engine::runner::Engine;
use contract::case::Case;
use contract::leafset::LeafSet;
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
    seeds: Option<Value>,
    edge: f64,
    place: TempDir,
    limit: Duration,
}

impl<'a> BaseTrees<'a> {
    /// The base trees of a case, which was read from `path`. Each run of the engine, one of our programs, is killed after `limit`.
    ///
    /// # Errors
    /// One sentence, if the case file cannot be read again or the temporary directory cannot be made.
    pub fn new(
        engine: &'a Engine,
        path: &Path,
        case: &Case,
        limit: Duration,
    ) -> Result<Self, String> {
        let place = tempfile::tempdir();
        let place =
            place.map_err(|error| format!("no temporary directory can be made: {error}"))?;
        let edge = case.root.edge;
        let mut case = PlainCase::read(path)?;
        // The base tree does not depend on seeds, but one in a crossing leaf of a coarser tree would be refused.
        let seeds = case.table.remove("seeds");
        Ok(Self { engine, case, seeds, edge, place, limit })
    }

    /// The base tree whose crossing leaves have at least this level, with the sides that the seeds of the case give to leaves if these
    /// are to be used.
    ///
    /// # Errors
    /// If the engine fails, or its mesh cannot be read.
    pub fn at(&mut self, level: u8, with_seeds: bool) -> Result<LeafSet, Failure> {
        let spacing = Value::Float(self.edge / f64::from(1u32 << level));
        let seeds = self.seeds.clone().filter(|_| with_seeds).map(|seeds| ("seeds".into(), seeds));
        let table = &mut self.case.table;
        table.remove("seeds");
        table.extend(seeds.into_iter().chain([("spacing_min".into(), spacing)]));
        let place = self.place.path();
        let case = self.case.write(place, StlForm::Binary).map_err(|error| {
            Failure::new("the harness", End::Unusable(format!("cannot write a case: {error}")))
        })?;
        let mesh = self.engine.mesh(&case, &SERIAL, true, (place, self.limit))?;
        let tree = self.engine.read_mesh(Some(&mesh));
        let _ = fs::remove_dir_all(&mesh);
        tree
    }
}
