//! Which checks a case fails: those of the definition or of the engine's promises on a serial run, and the comparison
//! with the serial run on several ranks.

use check::checks::{self, CheckResult, Outcome, Subject, identical};
use check::promises::Independence;
use contract::case::Case;
use contract::leafset::LeafSet;
use contract::plain::PlainCase;
use run::engine::failure::{End, Failure as RunFailure};
use run::engine::layout::{Layout, Ranks};
use run::engine::options::RunOptions;
use run::engine::runner::Engine;
use run::verify::case::RUNS;
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

/// A check that a case fails.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// Its name, as in `harness verify`; `runs` for an engine that gives no mesh.
    pub check: String,
    /// How the engine ended, if the check is `runs`. Another end is another failure.
    end: Option<String>,
    /// The failure in a sentence.
    sentence: String,
}

/// A check that was run on a trial.
#[derive(Clone, Debug)]
pub struct Judged {
    /// Its name.
    pub check: &'static str,
    /// How it fails; `None` if it holds.
    pub failure: Option<Failure>,
}

/// The checks that are run on a mesh that equals that of the reference.
const OF_EQUAL: [&str; 4] = [RUNS, "manifest", "linear", identical::NAME];

impl Failure {
    #[cfg(test)]
    pub(super) fn of(check: &str, sentence: &str) -> Self {
        Self { check: check.to_owned(), end: None, sentence: sentence.to_owned() }
    }

    /// Whether this is the same failure of, perhaps, another case.
    pub fn is_same_as(&self, other: &Self) -> bool {
        self.check == other.check && self.end == other.end
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}: {}", self.check, self.sentence)
    }
}

/// Why it is unknown whether a case fails.
#[derive(Debug, thiserror::Error)]
pub enum Unknown {
    /// The engine does not support the case, or nothing was checked.
    #[error("left out: {0}")]
    LeftOut(String),
    /// A program could not be run, or the case could not be read.
    #[error("{0}")]
    Error(String),
}

/// Runs trials.
#[derive(Debug)]
pub struct Probe {
    engine: Engine,
    reference: Engine,
    /// What must make the same mesh, and its name; `None` if only promises are checked.
    truth: Option<(Engine, &'static str)>,
    ranks: Ranks,
    limit: Duration,
    place: TempDir,
}

impl Probe {
    /// A serial engine is compared with the reference if it promises the definition, and its own promises are checked if
    /// not. An engine on several ranks is compared with its own serial run: if both runs are wrong in the same way, the
    /// serial case is the simpler one to shrink. Each run may take `limit`.
    ///
    /// # Errors
    /// If no directory for runs can be created.
    pub fn new(
        engine: Engine,
        reference: Engine,
        ranks: Ranks,
        limit: Duration,
    ) -> Result<Self, String> {
        let place = tempfile::Builder::new().prefix("harness-shrink-").tempdir();
        let place = place.map_err(|error| error.to_string())?;
        let promises = &engine.description().promises;
        let truth = match ranks {
            Ranks::Serial => promises.definition.then(|| (reference.clone(), "the reference")),
            _ => promises
                .is_independent_of(Independence::Ranks)
                .then(|| (engine.clone(), "its serial run")),
        };
        Ok(Self { engine, reference, truth, ranks, limit, place })
    }

    /// The ranks of the first trial.
    pub fn ranks(&self) -> Ranks {
        self.ranks
    }

    /// The checks of a trial, in order, with the failures of those that fail; among them the one of this name, if it can be run at
    /// all. A case that both programs refuse fails none.
    ///
    /// # Errors
    /// If the engine declines the case or cannot be run, if no mesh exists to compare with, or if nothing was checked.
    pub fn judge(&self, trial: &Trial, check: Option<&str>) -> Result<Vec<Judged>, Unknown> {
        let path = self.write(&trial.case)?;
        let case = Case::read(&path).map_err(|error| Unknown::Error(error.to_string()))?;
        if let Some(why) = self.engine.description().declines(&case) {
            return Err(Unknown::LeftOut(why));
        }
        let truth = self.truth(&path)?;
        let mesh = match self.run(&self.engine, &path, trial.ranks, "engine", false) {
            Ok(mesh) => mesh,
            Err(failure) => {
                let failure = Some(failed_run(failure, trial.ranks)?);
                return Ok(vec![Judged { check: RUNS, failure }]);
            }
        };
        let subject = Subject::new(&case, &mesh);
        let results = match truth {
            Some(truth) if self.ranks != Ranks::Serial => {
                vec![identical::compare(&mesh.words, &truth.words, &case.root)]
            }
            // The other checks hold as well if they do of the reference.
            Some(truth)
                if truth.words == mesh.words && check.is_none_or(|c| OF_EQUAL.contains(&c)) =>
            {
                let compared = identical::compare(&mesh.words, &truth.words, &case.root);
                let mut results = checks::only(&subject, &["manifest", "linear"]);
                results.push(compared);
                results
            }
            Some(truth) => {
                let base = self
                    .run(&self.reference, &path, Ranks::Serial, "base", true)
                    .map_err(|why| Unknown::Error(why.to_string()))?;
                checks::all(&subject.with_base(&base).with_reference(&truth))
            }
            None => self.promised(&path, trial, subject)?,
        };
        let mut judged = vec![Judged { check: RUNS, failure: None }];
        for result in &results {
            let failure = match result.outcome() {
                Outcome::LeftOut { .. } => continue,
                Outcome::Pass { .. } => None,
                Outcome::Fail { .. } => Some(failed_check(result, trial.ranks)),
            };
            judged.push(Judged { check: result.name, failure });
        }
        match judged.len() {
            1 => Err(Unknown::LeftOut("no check had anything to check".to_owned())),
            _ => Ok(judged),
        }
    }

    /// The checks of the engine's promises, and a second run if it is promised to be the same.
    fn promised(
        &self,
        path: &Path,
        trial: &Trial,
        subject: Subject,
    ) -> Result<Vec<CheckResult>, Unknown> {
        let promises = &self.engine.description().promises;
        let subject = subject.promising(promises);
        let mut results = checks::all(&subject);
        if promises.deterministic && trial.ranks == Ranks::Serial {
            let again = self.run(&self.engine, path, trial.ranks, "again", false);
            let again = again.map_err(|why| Unknown::Error(why.to_string()))?;
            let words = subject.mesh.map_or(&[][..], |mesh| &mesh.words);
            let compared = identical::compare(&again.words, words, &subject.terms.root);
            results.push(CheckResult { name: "deterministic", ..compared });
        }
        Ok(results)
    }

    /// The mesh that the engine must make, if there is one.
    fn truth(&self, case: &Path) -> Result<Option<LeafSet>, Unknown> {
        let Some((engine, name)) = &self.truth else { return Ok(None) };
        let mesh = self.run(engine, case, Ranks::Serial, "truth", false);
        mesh.map(Some).map_err(|why| {
            Unknown::Error(format!("no mesh to compare with, because {name} failed: {why}"))
        })
    }

    /// What the engine is compared with; `None` if only its promises are checked.
    pub fn truth_name(&self) -> Option<&'static str> {
        self.truth.as_ref().map(|(_, name)| *name)
    }

    /// Both meshes of a trial, for `harness diff`: that of the engine, and the expected one.
    ///
    /// # Errors
    /// If one of them cannot be made.
    pub fn meshes(&self, trial: &Trial) -> Result<[PathBuf; 2], String> {
        let case = self.write(&trial.case).map_err(|error| error.to_string())?;
        let run = |engine, ranks, name| {
            let made = self.run(engine, &case, ranks, name, false);
            made.map(|_| self.place.path().join(name).join("mesh")).map_err(|why| why.to_string())
        };
        let (truth, _) = self.truth.as_ref().ok_or("there is no mesh to compare with")?;
        Ok([run(&self.engine, trial.ranks, "engine")?, run(truth, Ranks::Serial, "truth")?])
    }

    fn write(&self, case: &PlainCase) -> Result<PathBuf, Unknown> {
        let form = self.engine.description().takes.stl;
        case.write(self.place.path(), form).map_err(|error| Unknown::Error(error.to_string()))
    }

    /// Runs an engine and reads its mesh.
    fn run(
        &self,
        engine: &Engine,
        case: &Path,
        ranks: Ranks,
        name: &str,
        ungraded: bool,
    ) -> Result<LeafSet, RunFailure> {
        let place = self.place.path().join(name);
        let _ = std::fs::remove_dir_all(&place);
        std::fs::create_dir_all(&place).map_err(|error| {
            let why = format!("has no directory {}: {error}", place.display());
            RunFailure::new(engine.name(), End::Missing(why))
        })?;
        let mesh = place.join("mesh");
        let options =
            RunOptions { mesh: Some(&mesh), ungraded, ..RunOptions::new(&place, self.limit) };
        let completed = engine.run(case, &Layout::on(ranks), &options)?;
        let read = completed.read_mesh().and_then(|mesh| mesh.ok_or("no mesh".to_owned()));
        read.map_err(|why| engine.unusable(format!("wrote a mesh that cannot be read: {why}")))
    }
}

/// A run without a mesh as a failed check.
fn failed_run(failure: RunFailure, ranks: Ranks) -> Result<Failure, Unknown> {
    let end = match &failure.end {
        End::Missing(_) | End::Interrupted => return Err(Unknown::Error(failure.to_string())),
        End::TimedOut { .. } => "hangs".to_owned(),
        End::Exited { code, error } => format!("code {code} {}", place_in_source(error)),
        End::Signalled(signal) => format!("signal {signal}"),
        End::Unusable(_) => "unusable output".to_owned(),
    };
    let sentence = format!("{ranks}: {failure}");
    Ok(Failure { check: RUNS.to_owned(), end: Some(end), sentence })
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

fn failed_check(result: &CheckResult, ranks: Ranks) -> Failure {
    let first = result.findings.first().map_or("", |finding| finding.detail.as_str());
    let sentence = match result.findings_total {
        1 => format!("{ranks}: {first}"),
        count => format!("{ranks}: {count} findings, the first: {first}"),
    };
    Failure { check: result.name.to_owned(), end: None, sentence }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_elsewhere_is_another_failure() {
        let failed = |error: &str| {
            let end = End::Exited { code: 70, error: error.to_owned() };
            failed_run(RunFailure::new("m", end), Ranks::Mpi(2)).unwrap()
        };
        let first = failed("m: panicked at src/tree.rs:12:40: | 7 points");
        assert!(first.is_same_as(&failed("m: panicked at src/tree.rs:12:40: | 9 points")));
        assert!(!first.is_same_as(&failed("m: panicked at src/tools.rs:12:40: | 7 points")));
        assert!(failed("error: 7 points").is_same_as(&failed("error: 9 points at 12:30")));
    }
}
