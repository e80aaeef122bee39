//! Whether a case fails, and how: the engine compared with the reference, or with its own serial run.

use contract::plain::PlainCase;
use run::engine::failure::{End, Failure as RunFailure};
use run::engine::layout::{Layout, Ranks};
use run::engine::options::RunOptions;
use run::engine::report::RunReport;
use run::engine::runner::Engine;
use std::fmt;
use std::path::{Path, PathBuf};
use std::time::Duration;
use tempfile::TempDir;

/// A case and the ranks on which it is run.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// The case.
    pub case: PlainCase,
    /// The ranks.
    pub ranks: Ranks,
}

/// Kinds of failures. A smaller case must fail in the same way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The mesh differs from the expected one.
    Differs,
    /// The engine fails.
    Fails,
    /// The engine does not end.
    Hangs,
}

/// How a case fails.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// The kind.
    pub kind: Kind,
    /// The failure in a sentence.
    pub sentence: String,
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&self.sentence)
    }
}

/// Runs trials.
#[derive(Debug)]
pub struct Probe {
    engine: Engine,
    truth: Engine,
    ranks: Ranks,
    limit: Duration,
    place: TempDir,
}

impl Probe {
    /// A serial engine is compared with the reference, one on several ranks with its own serial run: if both runs are
    /// wrong in the same way, the serial case is the simpler one to shrink. Each run may take `limit`.
    ///
    /// # Errors
    /// If no directory for runs can be created.
    pub fn new(
        engine: Engine,
        reference: Engine,
        ranks: Ranks,
        limit: Duration,
    ) -> Result<Self, String> {
        let truth = if ranks == Ranks::Serial { reference } else { engine.clone() };
        let place = tempfile::Builder::new().prefix("harness-shrink-").tempdir();
        Ok(Self { engine, truth, ranks, limit, place: place.map_err(|error| error.to_string())? })
    }

    /// The ranks of the first trial.
    pub fn ranks(&self) -> Ranks {
        self.ranks
    }

    /// How a trial fails; `None` if it does not. A case that both programs refuse does not fail.
    ///
    /// # Errors
    /// If the engine cannot be run, or no mesh exists to compare with.
    pub fn failure(&self, trial: &Trial) -> Result<Option<Failure>, String> {
        let case = self.write(&trial.case)?;
        let expected = self.run(&self.truth, &case, Ranks::Serial, "truth", false);
        let expected = expected.map_err(|why| {
            format!("no mesh to compare with, because {} failed: {why}", self.truth_name())
        })?;
        let report = match self.run(&self.engine, &case, trial.ranks, "engine", false) {
            Ok(report) if report.digest == expected.digest => return Ok(None),
            Ok(report) => report,
            Err(failure) => {
                let kind = match failure.end {
                    End::Missing(_) | End::Interrupted => return Err(failure.to_string()),
                    End::TimedOut { .. } => Kind::Hangs,
                    End::Exited { .. } | End::Signalled(_) | End::Unusable(_) => Kind::Fails,
                };
                let sentence = format!("{}: {failure}", trial.ranks);
                return Ok(Some(Failure { kind, sentence }));
            }
        };
        let mesh = |report: &RunReport| format!("{} cells, digest {}", report.cells, report.digest);
        let sentence = format!(
            "{}: {}; {}: {}",
            trial.ranks,
            mesh(&report),
            self.truth_name(),
            mesh(&expected)
        );
        Ok(Some(Failure { kind: Kind::Differs, sentence }))
    }

    /// Both meshes of a trial, for `harness diff`: that of the engine, and the expected one.
    ///
    /// # Errors
    /// If one of them cannot be made.
    pub fn meshes(&self, trial: &Trial) -> Result<[PathBuf; 2], String> {
        let case = self.write(&trial.case)?;
        let why = |failure: RunFailure| failure.to_string();
        self.run(&self.engine, &case, trial.ranks, "engine", true).map_err(why)?;
        self.run(&self.truth, &case, Ranks::Serial, "truth", true).map_err(why)?;
        Ok(["engine", "truth"].map(|name| self.place.path().join(name).join("mesh")))
    }

    /// What the engine is compared with.
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
    ) -> Result<RunReport, RunFailure> {
        let place = self.place.path().join(name);
        let _ = std::fs::remove_dir_all(&place);
        std::fs::create_dir_all(&place).map_err(|error| {
            let why = format!("has no directory {}: {error}", place.display());
            RunFailure::new(engine.name(), End::Missing(why))
        })?;
        let mesh = place.join("mesh");
        let options =
            RunOptions { mesh: write.then_some(&mesh), ..RunOptions::new(&place, self.limit) };
        engine.run(case, &Layout::on(ranks), &options).map(|completed| completed.report)
    }
}
