//! The checker of `reference/proof`, whose correctness is a theorem.

use crate::engine::failure::{End, Failure};
use crate::engine::process::{self, Watch};
use check::checks::CheckResult;
use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

/// Name of the check.
pub const NAME: &str = "proof";

/// Returns why the checker cannot be used, if it cannot.
pub fn lacks(checker: &Path) -> Option<String> {
    (!checker.is_file())
        .then(|| format!("{} is missing: ci/prove proves and builds it", checker.display()))
}

/// What the checker finds of a mesh with so many leaves, given the directory of its base tree T0. The note on a mesh that is accepted says what
/// is proven of it, and what is only tested.
///
/// # Errors
/// If the checker gives no answer within the limit, or cannot read the files.
pub fn check(
    checker: &Path,
    (mesh, base): (&Path, &Path),
    leaves: u64,
    limit: Duration,
) -> Result<CheckResult, Failure> {
    let place = tempfile::tempdir()?;
    let mut command = Command::new(checker);
    command.arg(mesh).arg(base);
    let mut proof = CheckResult::new(NAME);
    proof.examined = leaves;
    match process::run(&mut command, &Watch::new("the proven checker", limit, place.path())) {
        Ok(finished) => {
            let answer = fs::read_to_string(finished.stdout)?;
            // An older checker proves less.
            let silent = "does not say what it proves: ci/prove builds the present one".to_owned();
            let meaning = answer.lines().nth(1);
            proof.note = meaning.ok_or(Failure::new(NAME, End::Unusable(silent)))?.to_owned();
        }
        Err(failure) if matches!(failure.end, End::Exited { code: 1, .. }) => {
            proof.report("the checker of reference/proof rejects the mesh");
        }
        Err(failure) => return Err(failure),
    }
    Ok(proof)
}
