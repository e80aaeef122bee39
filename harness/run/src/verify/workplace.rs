//! The directories of results: where they are, and which of them are kept.
//!
//! Invariants: only directories that a verification made are removed, which a marker file proves; without `--out` and
//! `--keep`, only the directories of failed cases are kept; that of a case under way does not outlive an interrupt.

use super::options::Options;
use contract::failure::Failure;
use contract::files::publications;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// The file that marks the directory of a case.
const MARKER: &str = "made-by-harness-verify";

/// The directory of all cases.
#[derive(Debug)]
pub(super) struct Workplace {
    root: PathBuf,
    temporary: Option<TempDir>,
}

impl Workplace {
    /// The directory given by the options, or a temporary one.
    ///
    /// # Errors
    /// If it cannot be made.
    pub(super) fn new(options: &Options) -> Result<Self, Failure> {
        let made = || match &options.out {
            Some(out) => {
                fs::create_dir_all(out)?;
                Ok(Self { root: fs::canonicalize(out)?, temporary: None })
            }
            None => {
                let temporary = tempfile::Builder::new().prefix("harness-verify-").tempdir()?;
                Ok(Self { root: temporary.path().to_owned(), temporary: Some(temporary) })
            }
        };
        made().map_err(|error: io::Error| {
            Failure::input(format!("the directory for results cannot be made: {error}"))
        })
    }

    /// Makes the directory of a case, and replaces one that an earlier verification left.
    ///
    /// # Errors
    /// If something else has that name, or the directory cannot be made.
    pub(super) fn enter(&self, case: &str) -> Result<PathBuf, Failure> {
        let place = self.root.join(case);
        let shown = place.display();
        if place.join(MARKER).is_file() {
            fs::remove_dir_all(&place)
                .map_err(|error| Failure::input(format!("{shown} cannot be replaced: {error}")))?;
        }
        let mark = |()| {
            publications().push(place.clone());
            fs::write(place.join(MARKER), "")
        };
        let made = fs::create_dir(&place).and_then(mark);
        made.map_err(|error| Failure::input(format!("{shown} cannot be made: {error}")))?;
        Ok(place)
    }

    /// Removes the directory of a case, or keeps and returns it.
    pub(super) fn leave(&self, place: &Path, keep: bool) -> Option<PathBuf> {
        if keep {
            publications().retain(|other| other != place);
            return Some(place.to_owned());
        }
        // Failing to remove a directory is no reason to lose the report.
        let _ = fs::remove_dir_all(place);
        None
    }

    /// Closes it. A temporary directory is kept only for the cases that were kept in it.
    pub(super) fn close(self, keep: bool) {
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
            assert_eq!(workplace.leave(&place, keep).is_some(), keep);
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
        workplace.leave(&failed, true);
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
