//! The scripts of `harness/oracles`. Each ends with code 3 if a package that it needs is missing.

use super::failure::{End, Failure};
use super::paths::Paths;
use super::process::{self, Finished, Watch};
use std::ffi::OsStr;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

/// Exit code of a script whose package is missing.
const CODE_MISSING: i32 = 3;

/// Runs a script, which is called `name` in messages, with its output in `place`.
///
/// # Errors
/// [`End::Missing`] if Python or a package is missing; another end if the script fails.
pub fn run<A: AsRef<OsStr>>(
    name: &str,
    script: &str,
    arguments: impl IntoIterator<Item = A>,
    paths: &Paths,
    limit: Duration,
    place: &Path,
) -> Result<Finished, Failure> {
    let missing = |why| Failure::new(name, End::Missing(why));
    let python = &paths.python;
    if !python.is_file() {
        return Err(missing(format!(
            "needs Python at {} (ci/setup installs it)",
            python.display()
        )));
    }
    let mut command = Command::new(python);
    command.arg("-B").arg(paths.oracles.join(script)).args(arguments);
    process::run(&mut command, &Watch::new(name, limit, place)).map_err(|failure| {
        match failure.end {
            End::Exited { code: CODE_MISSING, error } => {
                missing(format!("is not installed: {error}"))
            }
            _ => failure,
        }
    })
}
