//! Where results are while they are being checked, and which of them stay.
//!
//! Invariants: nothing is removed that a verification did not make, which a marker file proves; without
//! `--out` and `--keep` nothing stays but the directories of failing cases.

use super::VerifyError;
use super::options::Options;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Marks a directory as a case's.
const MARKER: &str = "made-by-harness-verify";

/// The directory of all cases.
#[derive(Debug)]
pub struct Workplace {
    root: PathBuf,
    temporary: Option<TempDir>,
    kept: bool,
}

impl Workplace {
    /// The directory that was asked for, or a temporary one.
    ///
    /// # Errors
    /// Where it cannot be made.
    pub fn new(options: &Options) -> Result<Self, VerifyError> {
        let wrong =
            |error: io::Error| VerifyError::Input(format!("no directory for results: {error}"));
        if let Some(out) = &options.out {
            fs::create_dir_all(out).map_err(wrong)?;
            let root = fs::canonicalize(out).map_err(wrong)?;
            return Ok(Self { root, temporary: None, kept: false });
        }
        let temporary =
            tempfile::Builder::new().prefix("harness-verify-").tempdir().map_err(wrong)?;
        Ok(Self { root: temporary.path().to_owned(), temporary: Some(temporary), kept: false })
    }

    /// The directory itself.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Makes a case's own directory, in place of one that an earlier verification left.
    ///
    /// # Errors
    /// Where something else is there, or it cannot be made.
    pub fn enter(&self, case: &str) -> Result<PathBuf, VerifyError> {
        let place = self.root.join(case);
        let shown = place.display();
        if place.join(MARKER).is_file() {
            fs::remove_dir_all(&place).map_err(|error| {
                VerifyError::Input(format!("{shown} cannot be replaced: {error}"))
            })?;
        }
        let made = fs::create_dir(&place).and_then(|()| fs::write(place.join(MARKER), ""));
        made.map_err(|error| VerifyError::Input(format!("{shown} cannot be made: {error}")))?;
        Ok(place)
    }

    /// Removes a case's directory or keeps it; where it is, if it was kept.
    pub fn leave(&mut self, place: &Path, keep: bool) -> Option<PathBuf> {
        if keep {
            self.kept = true;
            return Some(place.to_owned());
        }
        // A directory that cannot be removed is a nuisance and no reason to lose the report.
        let _ = fs::remove_dir_all(place);
        None
    }

    /// Ends it: a temporary directory stays only for the cases that were kept in it.
    pub fn close(self, remove_all: bool) {
        if let Some(temporary) = self.temporary
            && self.kept
            && !remove_all
        {
            let _ = temporary.keep();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::options;

    #[test]
    fn a_temporary_one_stays_for_what_was_kept_and_only_then() {
        for keep in [false, true] {
            let mut workplace = Workplace::new(&options()).unwrap();
            let root = workplace.root().to_owned();
            let place = workplace.enter("cube").unwrap();
            assert_eq!(workplace.leave(&place, keep).is_some(), keep);
            workplace.close(false);
            assert_eq!((root.exists(), place.exists()), (keep, keep));
            let _ = fs::remove_dir_all(root);
        }
    }

    #[test]
    fn an_earlier_result_is_replaced_and_anything_else_is_not() {
        let out = tempfile::tempdir().unwrap();
        let options = Options { out: Some(out.path().to_owned()), ..options() };
        let workplace = Workplace::new(&options).unwrap();
        let place = workplace.enter("cube").unwrap();
        fs::write(place.join("mesh"), "").unwrap();
        assert_eq!(workplace.enter("cube").unwrap(), place);
        assert!(!place.join("mesh").exists());
        fs::create_dir(out.path().join("precious")).unwrap();
        let refused = workplace.enter("precious").unwrap_err();
        assert!(
            matches!(refused, VerifyError::Input(why) if why.contains("precious cannot be made"))
        );
    }
}
