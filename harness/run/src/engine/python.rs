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
    let mut command = command(name, script, paths)?;
    process::run(command.args(arguments), &Watch::new(name, limit, place)).map_err(explained)
}

/// The command of a script without arguments.
///
/// # Errors
/// [`End::Missing`] if Python is missing.
pub fn command(name: &str, script: &str, paths: &Paths) -> Result<Command, Failure> {
    let python = &paths.python;
    if !python.is_file() {
        let why = format!("needs Python at {} (ci/setup installs it)", python.display());
        return Err(Failure::new(name, End::Missing(why)));
    }
    let mut command = Command::new(python);
    command.arg("-B").arg(paths.oracles.join(script));
    Ok(command)
}

/// The failure of a script, in which a missing package is called so.
pub fn explained(failure: Failure) -> Failure {
    match failure.end {
        End::Exited { code: CODE_MISSING, error } => {
            Failure::new(failure.program, End::Missing(format!("is not installed: {error}")))
        }
        _ => failure,
    }
}
