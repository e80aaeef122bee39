//! Whether a case fails, and how: the engine against the reference, or on ranks against itself on one.

use contract::plain::PlainCase;
use run::engine::runner::{Engine, NoResult, Ranks, Told};
use std::fmt;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A case and the number of ranks that it is run on.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// The case.
    pub case: PlainCase,
    /// How it is run.
    pub ranks: Ranks,
}

/// Kinds of failures. A smaller case must fail in the same way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The mesh is not the one that was wanted.
    Differs,
    /// The engine fails.
    Fails,
    /// The engine does not end.
    Hangs,
}

/// How a case fails.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// What kind.
    pub kind: Kind,
    /// In a sentence.
    pub told: String,
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&self.told)
    }
}

/// Tries cases out.
#[derive(Debug)]
pub struct Probe {
    engine: Engine,
    truth: Engine,
    ranks: Ranks,
    place: TempDir,
}

impl Probe {
    /// A serial engine is held against the reference, one on ranks against its own serial run: where
    /// both are wrong alike, the serial case is the simpler one to look at.
    ///
    /// # Errors
    /// Where there is no place for runs.
    pub fn new(engine: Engine, reference: Engine, ranks: Ranks) -> Result<Self, String> {
        let truth = if ranks == Ranks::Serial { reference } else { engine.clone() };
        let place = tempfile::Builder::new().prefix("harness-shrink-").tempdir();
        Ok(Self { engine, truth, ranks, place: place.map_err(|error| error.to_string())? })
    }

    /// The ranks of the first trial.
    pub fn ranks(&self) -> Ranks {
        self.ranks
    }

    /// How a trial fails, if it does. A case that the programs refuse does not fail.
    ///
    /// # Errors
    /// Where nothing can be run, or there is nothing to compare with.
    pub fn failure(&self, trial: &Trial) -> Result<Option<Failure>, String> {
        let case = self.write(&trial.case)?;
        let truth = self.run(&self.truth, &case, Ranks::Serial, "truth", false);
        let wanted = truth
            .map_err(|why| format!("nothing to compare with: {}: {why}", self.truth_name()))?;
        match self.run(&self.engine, &case, trial.ranks, "engine", false) {
            Ok(told) if told.digest == wanted.digest => Ok(None),
            Ok(told) => Ok(Some(Failure {
                kind: Kind::Differs,
                told: format!(
                    "{}: {} cells, digest {}; {}: {} cells, digest {}",
                    trial.ranks,
                    told.cells,
                    told.digest,
                    self.truth_name(),
                    wanted.cells,
                    wanted.digest
                ),
            })),
            Err(NoResult::Failed(why)) => {
                Ok(Some(Failure { kind: Kind::Fails, told: format!("{}: {why}", trial.ranks) }))
            }
            Err(NoResult::Hung(why)) => {
                Ok(Some(Failure { kind: Kind::Hangs, told: format!("{}: {why}", trial.ranks) }))
            }
            Err(why) => Err(why.to_string()),
        }
    }

    /// Both meshes of a trial, for `harness diff`: that of the engine, that which was wanted.
    ///
    /// # Errors
    /// Where there are not two.
    pub fn meshes(&self, trial: &Trial) -> Result<[PathBuf; 2], String> {
        let case = self.write(&trial.case)?;
        let wrong = |why: NoResult| why.to_string();
        self.run(&self.engine, &case, trial.ranks, "engine", true).map_err(wrong)?;
        self.run(&self.truth, &case, Ranks::Serial, "truth", true).map_err(wrong)?;
        Ok(["engine", "truth"].map(|name| self.place.path().join(name).join("mesh")))
    }

    /// What the engine is held against.
    pub fn truth_name(&self) -> &'static str {
        if self.ranks == Ranks::Serial { "the reference" } else { "its serial run" }
    }

    fn write(&self, case: &PlainCase) -> Result<PathBuf, String> {
        case.write(self.place.path()).map_err(|error| error.to_string())
    }

    fn run(
        &self,
        engine: &Engine,
        case: &Path,
        ranks: Ranks,
        name: &str,
        write: bool,
    ) -> Result<Told, NoResult> {
        let place = self.place.path().join(name);
        let _ = std::fs::remove_dir_all(&place);
        std::fs::create_dir_all(&place).map_err(|error| NoResult::Missing(error.to_string()))?;
        engine.run(case, ranks, &place, write).map(|(told, _)| told)
    }
}
