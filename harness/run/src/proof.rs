//! The checker of `reference/proof`, whose correctness is a theorem.

use crate::engine::failure::{End, Failure};
use crate::engine::process::{self, Watch};
use check::checks::CheckResult;
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

/// What the checker finds of a mesh with so many leaves, given the directory of its base tree T0.
///
/// # Errors
/// If the checker gives no answer within the limit, or cannot read the files.
pub fn check(
    checker: &Path,
    (mesh, base): (&Path, &Path),
    leaves: u64,
    limit: Duration,
) -> Result<CheckResult, Failure> {
    let unusable = |why: std::io::Error| Failure::new(NAME, End::Unusable(why.to_string()));
    let place = tempfile::tempdir().map_err(unusable)?;
    let mut command = Command::new(checker);
    command.arg(mesh).arg(base);
    let mut proof = CheckResult::new(NAME);
    proof.examined = leaves;
    proof.note = "proven, given T0: octants, completeness, sides of components, balance, layers, and that no split is needless or missing; \
                  only tested: which leaves facets cross, boxes, and rays"
        .to_owned();
    match process::run(&mut command, &Watch::new("the proven checker", limit, place.path())) {
        Ok(_) => {}
        Err(failure) if matches!(failure.end, End::Exited { code: 1, .. }) => {
            proof.report("the checker of reference/proof rejects the mesh".to_owned());
        }
        Err(failure) => return Err(failure),
    }
    Ok(proof)
}
