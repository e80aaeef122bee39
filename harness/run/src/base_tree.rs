//! The base tree of a case at any surface level, made by an engine.

use crate::engine::failure::{End, Failure};
use crate::engine::layout::SERIAL;
use crate::engine::options::RunOptions;
use crate::engine::runner::Engine;
use contract::case::Case;
use contract::files::read_text;
use contract::lattice::Root;
use contract::leafset::LeafSet;
use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, absolute};
use std::time::Duration;
use tempfile::TempDir;
use toml::{Table, Value};

/// The link to the geometry file. Its own path need not be representable in a case file.
const BODY: &str = "body.stl";

/// A case whose base tree is made at several surface levels. Files are in a temporary directory, which is removed with
/// it.
#[derive(Debug)]
pub struct BaseTrees<'a> {
    engine: &'a Engine,
    /// The case file with an explicit root and without seeds.
    table: Table,
    seeds: Option<Value>,
    root: Root,
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
        if let Some(geometry) = &case.geometry {
            let linked = absolute(geometry).and_then(|stl| symlink(stl, place.path().join(BODY)));
            linked.map_err(|error| format!("{}: {error}", geometry.display()))?;
        }
        let mut table = table(path, case)?;
        // The base tree does not depend on seeds, but one in a crossing leaf of a coarser tree would be refused.
        let seeds = table.remove("seeds");
        Ok(Self { engine, table, seeds, root: case.root, place, limit })
    }

    /// The base tree of the case, with the sides that its seeds give to leaves.
    ///
    /// # Errors
    /// As [`Self::at`].
    pub fn with_seeds(&mut self, level: u8) -> Result<LeafSet, Failure> {
        if let Some(seeds) = self.seeds.clone() {
            self.table.insert("seeds".into(), seeds);
        }
        let tree = self.at(level);
        self.table.remove("seeds");
        tree
    }

    /// The base tree whose crossing leaves have at least this level.
    ///
    /// # Errors
    /// If the engine fails, or its mesh cannot be read.
    pub fn at(&mut self, level: u8) -> Result<LeafSet, Failure> {
        let spacing = self.root.edge / f64::from(1u32 << level);
        self.table.insert("spacing_min".into(), Value::Float(spacing));
        let place = self.place.path();
        let case = place.join("case.toml");
        fs::write(&case, self.table.to_string()).map_err(|error| {
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
        let read = completed.read_mesh();
        let _ = fs::remove_dir_all(&mesh);
        let mesh = read.map_err(|why| {
            self.engine.unusable(format!("wrote a base tree that cannot be read: {why}"))
        })?;
        mesh.ok_or_else(|| self.engine.unusable("wrote no base tree".to_owned()))
    }
}

/// The keys of a case file for a copy in another directory and with another spacing.
fn table(path: &Path, case: &Case) -> Result<Table, String> {
    let text = read_text(path).map_err(|error| error.to_string())?;
    let mut table: Table = text.parse().map_err(|error: toml::de::Error| error.to_string())?;
    table.remove("root_scale");
    let Root { origin, edge } = case.root;
    let origin = origin.map(Value::Float).to_vec();
    let root = [("origin", Value::Array(origin)), ("edge", Value::Float(edge))];
    let root: Table = root.map(|(key, value)| (key.to_owned(), value)).into_iter().collect();
    table.insert("root".into(), Value::Table(root));
    if case.geometry.is_some() {
        table.insert("geometry".into(), Value::String(BODY.into()));
    }
    Ok(table)
}
