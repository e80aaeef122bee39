//! The base tree of a case at any surface level, made by an engine.

use crate::engine::failure::{End, Failure};
use crate::engine::layout::{RunOptions, SERIAL};
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
    /// The case without seeds.
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
        let place = tempfile::Builder::new().prefix("harness-base-").tempdir();
        let place =
            place.map_err(|error| format!("no temporary directory can be made: {error}"))?;
        let edge = case.root.edge;
        let mut case = PlainCase::read(path)?;
        // The base tree does not depend on seeds, but one in a crossing leaf of a coarser tree would be refused.
        let seeds = case.table.remove("seeds");
        Ok(Self { engine, case, seeds, edge, place, limit })
    }

    /// The base tree of the case, with the sides that its seeds give to leaves.
    ///
    /// # Errors
    /// As [`Self::at`].
    pub fn with_seeds(&mut self, level: u8) -> Result<LeafSet, Failure> {
        self.case.table.extend(self.seeds.clone().map(|seeds| ("seeds".to_owned(), seeds)));
        let tree = self.at(level);
        self.case.table.remove("seeds");
        tree
    }

    /// The base tree whose crossing leaves have at least this level.
    ///
    /// # Errors
    /// If the engine fails, or its mesh cannot be read.
    pub fn at(&mut self, level: u8) -> Result<LeafSet, Failure> {
        let spacing = self.edge / f64::from(1u32 << level);
        self.case.table.insert("spacing_min".into(), Value::Float(spacing));
        let place = self.place.path();
        let case = self.case.write(place, StlForm::Binary).map_err(|error| {
            Failure::new("the harness", End::Unusable(format!("cannot write a case: {error}")))
        })?;
        let mesh = place.join("mesh");
        let options = RunOptions {
            mesh: Some(&mesh),
            report: false,
            ungraded: true,
            ..RunOptions::new(place, self.limit)
        };
        let completed = self.engine.run(&case, &SERIAL, &options)?;
        let tree = self.engine.read_mesh(&completed);
        let _ = fs::remove_dir_all(&mesh);
        tree
    }
}
