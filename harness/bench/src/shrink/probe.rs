//! Which checks a case fails: those of the definition or of the engine's promises on a serial run, and the comparison
//! with the serial run on several ranks.

use crate::emptied;
use check::checks::{self, CheckResult, Outcome, Subject, identical};
use check::promises::Independence;
use contract::case::Case;
use contract::failure::{Failure, Result};
use contract::leafset::LeafSet;
use contract::manifest::Tree;
use contract::plain::PlainCase;
use run::engine::failure::{End, Failure as Ended};
use run::engine::layout::{Layout, Ranks, RunOptions};
use run::engine::runner::Engine;
use run::verify::report::RUNS;
use std::path::Path;
use std::time::Duration;
use tempfile::TempDir;
use toml::Value;

/// A case and the ranks on which it is run.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// The case.
    pub case: PlainCase,
    /// The ranks.
    pub ranks: Ranks,
}

impl Trial {
    /// Numbers of facets, boxes, seeds and ranks.
    pub(super) fn counts(&self) -> [usize; 4] {
        let list = |key| self.case.table.get(key).and_then(Value::as_array).map_or(0, Vec::len);
        [self.case.facets.len(), list("box"), list("seeds"), self.ranks.count()]
    }
}

/// How a case fails a check.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{check}: {sentence}")]
pub struct Fault {
    /// The check's name, as in `harness verify`; `runs` for an engine that gives no mesh.
    pub check: String,
    /// How the engine ended, if the check is `runs`. Another end is another fault.
    end: String,
    /// The fault in a sentence.
    sentence: String,
}

/// The name of a check that was run on a trial, and how it fails; `None` if it holds.
pub type Judged = (&'static str, Option<Fault>);

impl Fault {
    pub(super) fn of(check: &str, sentence: &str) -> Self {
        Self { check: check.to_owned(), end: String::new(), sentence: sentence.to_owned() }
    }

    /// Whether this is the same fault of, perhaps, another case.
    pub fn is_same_as(&self, other: &Self) -> bool {
        (&self.check, &self.end) == (&other.check, &other.end)
    }
}

/// Runs trials.
pub struct Probe {
    engine: Engine,
    reference: Engine,
    limit: Duration,
    place: TempDir,
}

impl Probe {
    /// Each run may take `limit`.
    ///
    /// # Errors
    /// If no directory for runs can be created.
    pub fn new(engine: Engine, reference: Engine, limit: Duration) -> Result<Self> {
        let place = tempfile::Builder::new().prefix("harness-shrink-").tempdir()?;
        Ok(Self { engine, reference, limit, place })
    }

    /// The checks of a trial, in order. A serial engine is compared with the reference if it promises the definition, and its own
    /// promises are checked if not. An engine on several ranks is compared with its own serial run: if both runs are wrong in the same
    /// way, the serial case is the simpler one to shrink. A case that both programs refuse fails none.
    ///
    /// # Errors
    /// If the engine declines the case or cannot be run, if no mesh exists to compare with, or if nothing was checked.
    pub fn judge(&self, trial: &Trial) -> Result<Vec<Judged>> {
        let left_out = |why: &str| Failure::missing(format!("left out: {why}"));
        let promises = &self.engine.description.promises;
        let path = trial.case.write(self.place.path())?;
        let case = Case::read(&path)?;
        if let Some(why) = self.engine.description.declines(&case) {
            return Err(left_out(&why));
        }
        let independent = promises.is_independent_of(Independence::Ranks);
        let (engine, ranks) = (&self.engine, trial.ranks);
        let truth = match ranks {
            Ranks::Serial => promises.definition.then_some((&self.reference, "the reference")),
            _ => independent.then_some((engine, "its serial run")),
        };
        let truth = truth.map(|(engine, name)| {
            let none = |why| format!("no mesh to compare with, because {name} failed: {why}");
            self.run(engine, &path, Ranks::Serial).map_err(none)
        });
        let truth = truth.transpose()?;
        let mesh = match self.run(engine, &path, ranks) {
            Ok(mesh) => mesh,
            Err(failure) => return Ok(vec![(RUNS, Some(failed_run(failure, ranks)?))]),
        };
        let subject = Subject::new(&case, Tree::Final, &mesh);
        let results = match truth {
            Some(truth) if ranks != Ranks::Serial => {
                vec![identical::compare(&mesh.words, &truth.words, &case.root)]
            }
            Some(truth) => checks::all(&subject.with_reference(&truth)),
            None => self.promised(&path, ranks, subject)?,
        };
        let judged = |result: &CheckResult| match result.outcome() {
            Outcome::LeftOut { .. } => None,
            Outcome::Pass { .. } => Some((result.name, None)),
            Outcome::Fail { why } => {
                let sentence = format!("{ranks}: {}", why.replace('\n', "; "));
                Some((result.name, Some(Fault::of(result.name, &sentence))))
            }
        };
        let judged: Vec<Judged> = results.iter().filter_map(judged).collect();
        if judged.is_empty() {
            return Err(left_out("no check had anything to check"));
        }
        Ok([(RUNS, None)].into_iter().chain(judged).collect())
    }

    /// The checks of the engine's promises, and a second run if it is promised to be the same.
    fn promised(&self, path: &Path, ranks: Ranks, subject: Subject) -> Result<Vec<CheckResult>> {
        let promises = &self.engine.description.promises;
        let subject = subject.promising(promises);
        let mut results = checks::all(&subject);
        if promises.deterministic && ranks == Ranks::Serial {
            let again = self.run(&self.engine, path, ranks).map_err(Failure::input)?;
            let words = subject.mesh.map_or(&[][..], |mesh| &mesh.words);
            let compared = identical::compare(&again.words, words, &subject.terms.root);
            results.push(CheckResult { name: "deterministic", ..compared });
        }
        Ok(results)
    }

    /// Runs an engine and reads its mesh.
    fn run(&self, engine: &Engine, case: &Path, ranks: Ranks) -> Result<LeafSet, Ended> {
        let place = emptied(self.place.path().join("run"), engine)?;
        let mesh = place.join("mesh");
        let options = RunOptions { mesh: Some(&mesh), ..RunOptions::new(&place, self.limit) };
        engine.run(case, &Layout::on(ranks), &options)?;
        engine.read_mesh(&mesh)
    }
}

/// A run without a mesh as a failed check.
fn failed_run(failure: Ended, ranks: Ranks) -> Result<Fault> {
    let end = match &failure.end {
        End::Missing(_) | End::Interrupted => return Err(failure.into()),
        End::TimedOut { .. } => "hangs".to_owned(),
        End::Exited { code, error } => format!("code {code} {}", place_in_source(error)),
        End::Signalled(signal) => format!("signal {signal}"),
        End::Unusable(_) => "unusable output".to_owned(),
    };
    Ok(Fault { end, ..Fault::of(RUNS, &format!("{ranks}: {failure}")) })
}

/// The place in a source file that an error names first, such as `tree.rs:12`; empty if it names none. A program that
/// panics elsewhere fails differently.
fn place_in_source(error: &str) -> String {
    let is_place = |word: &&str| {
        let (file, line) = word.split_once(':').unwrap_or_default();
        file.contains('.') && line.starts_with(|c: char| c.is_ascii_digit())
    };
    error.split_whitespace().find(is_place).unwrap_or_default().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::failure::EXIT_MISSING;

    #[test]
    fn a_panic_elsewhere_is_another_failure() {
        let failed = |error: &str| {
            let end = End::Exited { code: 70, error: error.to_owned() };
            failed_run(Ended::new("m", end), Ranks::Mpi(2)).unwrap()
        };
        let first = failed("m: panicked at src/tree.rs:12:40: | 7 points");
        assert!(first.is_same_as(&failed("m: panicked at src/tree.rs:12:40: | 9 points")));
        assert!(!first.is_same_as(&failed("m: panicked at src/tools.rs:12:40: | 7 points")));
        assert!(failed("error: 7 points").is_same_as(&failed("error: 9 points at 12:30")));
        let missing = Ended::new("m", End::Missing("cannot be started".to_owned()));
        assert_eq!(failed_run(missing, Ranks::Mpi(2)).unwrap_err().code, EXIT_MISSING);
    }
}
