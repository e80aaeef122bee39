//! Views in three dimensions, drawn by pyvista; `harness/oracles/view.py` describes how.

use crate::engine::failure::{End, Failure};
use crate::engine::paths::Paths;
use crate::engine::process::{self, Watch};
use std::fs;
use std::process::Command;
use std::time::Duration;

/// Exit code of the script if pyvista cannot be imported.
const CODE_MISSING: i32 = 3;

/// The view as PNG; `scene` is JSON.
///
/// # Errors
/// [`End::Missing`] if Python or pyvista is missing; another end if the script fails.
pub fn png(scene: &str, paths: &Paths, limit: Duration) -> Result<Vec<u8>, Failure> {
    let failure = |end| Failure::new("pyvista", end);
    if !paths.python.is_file() {
        let why = format!("needs Python at {} (ci/setup installs it)", paths.python.display());
        return Err(failure(End::Missing(why)));
    }
    let unusable = |error: std::io::Error| failure(End::Unusable(format!("has no files: {error}")));
    let place = tempfile::tempdir().map_err(unusable)?;
    let (input, output) = (place.path().join("scene.json"), place.path().join("view.png"));
    fs::write(&input, scene).map_err(unusable)?;
    let mut command = Command::new(&paths.python);
    command.arg("-B").arg(paths.oracles.join("view.py")).args([&input, &output]);
    process::run(&mut command, &Watch::new("pyvista", limit, place.path())).map_err(|other| {
        match other.end {
            End::Exited { code: CODE_MISSING, error } => {
                failure(End::Missing(format!("is not installed: {error}")))
            }
            _ => other,
        }
    })?;
    fs::read(&output).map_err(|error| failure(End::Unusable(format!("drew no picture: {error}"))))
}
