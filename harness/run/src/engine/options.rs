//! The options of a run: its files, choices and limits.

use super::service::Services;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Files, choices and limits of a run.
#[derive(Clone, Copy, Debug)]
pub struct RunOptions<'a> {
    /// Existing directory for the run report, the status and the logs; no other run may use it at the same time.
    pub place: &'a Path,
    /// Time after which the run is killed.
    pub limit: Duration,
    /// Leaf-set directory to write. An engine without a run report writes its mesh even if this is `None`, to `mesh`
    /// in `place`.
    pub mesh: Option<&'a Path>,
    /// Write a run report. Without one, cells and digest are read from the mesh.
    pub report: bool,
    /// Keep the ranks' activity on disk, to report it if the run hangs.
    pub status: bool,
    /// Stop at the base tree.
    pub ungraded: bool,
    /// Sample the memory of an engine that does not report it.
    pub sample_memory: bool,
    /// Where runs on MPI use the engine's service, if it has one.
    pub services: Option<&'a Services>,
}

impl<'a> RunOptions<'a> {
    /// A run that writes a run report and nothing else.
    pub fn new(place: &'a Path, limit: Duration) -> Self {
        Self {
            place,
            limit,
            mesh: None,
            report: true,
            status: false,
            ungraded: false,
            sample_memory: false,
            services: None,
        }
    }

    pub(super) fn report_path(&self) -> PathBuf {
        self.place.join("run.json")
    }

    pub(super) fn status_path(&self) -> PathBuf {
        self.place.join("status")
    }
}
