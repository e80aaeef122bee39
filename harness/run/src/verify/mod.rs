//! `harness verify`: meshes every case with the reference and with the mesher on every layout, and checks the meshes.
//!
//! [`options`] are the user's choices and what is missing on this machine, [`case`] verifies one case
//! with a module per family of checks, and [`report`] is the result.
//!
//! Invariants of the directories of results: only directories that a verification made are removed, which a marker file proves;
//! without `--out` and `--keep`, only the directories of failed cases are kept; that of a case under way does not outlive an interrupt.

pub mod case;
mod meshes;
pub mod options;
pub mod others;
pub mod report;

use crate::engine::interrupt;
use crate::engine::runner::Programs;
use case::CaseRun;
use contract::catalogue::Selected;
use contract::failure::{Failure, Result, progress};
use contract::files::publications;
use options::{Needs, Options};
use report::{Asked, CaseReport, Report};
use std::path::{Path, PathBuf};
use std::time::Instant;
use std::{fs, thread};
use tempfile::TempDir;

/// Verifies the cases that the options select.
///
/// # Errors
/// If the verification could not begin. Failures after that are in the report.
pub fn verify(options: &Options, programs: &Programs) -> Result<Report> {
    let start = Instant::now();
    programs.require()?;
    let selected = programs.paths.catalogue.select(&options.cases, &options.size)?;
    let why = format!("no case in {} has this size", programs.paths.catalogue.path.display());
    Failure::unless(!selected.is_empty(), why)?;
    let workplace = Workplace::new(options)?;
    // What is in the way of a later case must not cost the results of those before it.
    let mut places = selected.iter().map(|case| workplace.root.join(&case.name));
    if let Some(place) = places.find(|place| place.exists() && !place.join(MARKER).is_file()) {
        return Err(Failure::about(&place, "is there already, and no verification made it"));
    }
    let verification =
        Verification { options, programs, workplace, needs: Needs::probe(options, programs) };
    let begun = selected.iter().take_while(|_| !interrupt::requested());
    let cases = begun.map(|case| verification.case(case)).collect::<Result<Vec<_>>>()?;
    let Verification { needs, workplace, .. } = verification;
    progress("");
    let interrupted = interrupt::requested();
    workplace.close(cases.iter().any(|case| case.kept.is_some()));
    let engine = &programs.engine.description;
    let subjects = case::steps(engine).iter().map(|((subject, _), _)| (*subject).to_owned());
    let report = Report {
        schema: report::SCHEMA.to_owned(),
        program: format!("harness {}", env!("CARGO_PKG_VERSION")),
        cores: thread::available_parallelism().map_or(1, usize::from),
        asked: Asked {
            cases: selected.iter().map(|case| case.name.clone()).collect(),
            named: !options.cases.is_empty(),
            ranks: options.rank_counts(engine),
            subjects: subjects.collect(),
        },
        missing: needs.missing(options, engine, &cases, interrupted),
        cases,
        interrupted,
        time_s: start.elapsed().as_secs_f64(),
    };
    report.check_invariants();
    Ok(report)
}

/// What the verifications of all cases share.
struct Verification<'a> {
    options: &'a Options,
    programs: &'a Programs,
    needs: Needs,
    workplace: Workplace,
}

impl Verification<'_> {
    fn case(&self, selected: &Selected) -> Result<CaseReport> {
        let start = Instant::now();
        let place = self.workplace.enter(&selected.name)?;
        // A case that the harness cannot read is passed on unchanged, because refusing it is part of the verification.
        let prepared = self.programs.engine.prepare(&selected.path, &place.join("plain"));
        let file = prepared.unwrap_or_else(|_| selected.path.clone());
        let report = CaseReport { name: selected.name.clone(), ..CaseReport::default() };
        let mut run = CaseRun { all: self, selected, file, place: &place, report };
        match &selected.absent {
            Some(why) => run.leave_out(("case", options::GEOMETRY), why),
            None => run.verify(),
        }
        run.leave_out_rest();
        let mut report = run.report;
        report.time_s = start.elapsed().as_secs_f64();
        let keep = self.options.keep || (report.failed() && !interrupt::requested());
        leave(&place, keep);
        report.kept = keep.then(|| place.display().to_string());
        Ok(report)
    }
}

/// Removes the directory of a case, unless it is kept.
fn leave(place: &Path, keep: bool) {
    match keep {
        true => publications().retain(|other| other != place),
        // Failing to remove a directory is no reason to lose the report.
        false => _ = fs::remove_dir_all(place),
    }
}

/// The file that marks the directory of a case.
const MARKER: &str = "made-by-harness-verify";

/// The directory of all cases.
struct Workplace {
    root: PathBuf,
    temporary: Option<TempDir>,
}

impl Workplace {
    /// The directory given by the options, or a temporary one.
    ///
    /// # Errors
    /// If it cannot be made.
    fn new(options: &Options) -> Result<Self> {
        if let Some(out) = &options.out {
            let root = fs::create_dir_all(out).and_then(|()| fs::canonicalize(out));
            return Ok(Self { root: root.map_err(|e| Failure::at(out, e))?, temporary: None });
        }
        let temporary = tempfile::Builder::new().prefix("harness-verify-").tempdir()?;
        Ok(Self { root: temporary.path().to_owned(), temporary: Some(temporary) })
    }

    /// Makes the directory of a case, and replaces one that an earlier verification left.
    ///
    /// # Errors
    /// If something else has that name, or the directory cannot be made.
    fn enter(&self, case: &str) -> Result<PathBuf> {
        let place = self.root.join(case);
        if place.join(MARKER).is_file() {
            // What cannot be removed is in the way of the new directory.
            let _ = fs::remove_dir_all(&place);
        }
        let mark = |()| {
            publications().push(place.clone());
            fs::write(place.join(MARKER), "")
        };
        let made = fs::create_dir(&place).and_then(mark);
        made.map_err(|e| Failure::input(format!("{} cannot be made: {e}", place.display())))?;
        Ok(place)
    }

    /// Closes it. A temporary directory is kept only for the cases that were kept in it.
    fn close(self, keep: bool) {
        self.temporary.filter(|_| keep).map(TempDir::keep);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::options;

    #[test]
    fn a_temporary_directory_is_kept_only_if_a_case_is_kept() {
        for keep in [false, true] {
            let workplace = Workplace::new(&options()).unwrap();
            let root = workplace.root.clone();
            let place = workplace.enter("cube").unwrap();
            leave(&place, keep);
            workplace.close(keep);
            assert_eq!((root.exists(), place.exists()), (keep, keep));
            let _ = fs::remove_dir_all(root);
        }
    }

    #[test]
    fn an_interrupt_removes_the_results_of_the_case_under_way_but_not_those_that_are_kept() {
        let out = tempfile::tempdir().unwrap();
        let options = Options { out: Some(out.path().to_owned()), ..options() };
        let workplace = Workplace::new(&options).unwrap();
        let [failed, under_way] = ["failed", "under-way"].map(|case| {
            let place = workplace.enter(case).unwrap();
            assert!(publications().contains(&place));
            place
        });
        leave(&failed, true);
        assert!(!publications().contains(&failed) && publications().contains(&under_way));
    }

    #[test]
    fn only_an_earlier_result_is_replaced() {
        let out = tempfile::tempdir().unwrap();
        let options = Options { out: Some(out.path().to_owned()), ..options() };
        let workplace = Workplace::new(&options).unwrap();
        let place = workplace.enter("cube").unwrap();
        fs::write(place.join("mesh"), "").unwrap();
        assert_eq!(workplace.enter("cube").unwrap(), place);
        assert!(!place.join("mesh").exists());
        fs::create_dir(out.path().join("precious")).unwrap();
        let refused = workplace.enter("precious").unwrap_err();
        assert!(refused.why.contains("precious cannot be made"), "{refused}");
    }
}
