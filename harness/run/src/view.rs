//! Views in three dimensions, drawn by pyvista; `harness/oracles/view.py` describes how.

use crate::engine::failure::{End, Failure};
use crate::engine::paths::Paths;
use crate::engine::python;
use std::fs;
use std::time::Duration;

/// The view as PNG; `scene` is JSON.
///
/// # Errors
/// [`End::Missing`] if Python or pyvista is missing; another end if the script fails.
pub fn png(scene: &str, paths: &Paths, limit: Duration) -> Result<Vec<u8>, Failure> {
    let failure = |end| Failure::new("pyvista", end);
    let unusable = |error: std::io::Error| failure(End::Unusable(format!("has no files: {error}")));
    let place = tempfile::tempdir().map_err(unusable)?;
    let (input, output) = (place.path().join("scene.json"), place.path().join("view.png"));
    fs::write(&input, scene).map_err(unusable)?;
    python::run("pyvista", "view.py", [&input, &output], paths, limit, place.path())?;
    fs::read(&output).map_err(|error| failure(End::Unusable(format!("drew no picture: {error}"))))
}
