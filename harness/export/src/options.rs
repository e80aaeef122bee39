//! What every export is given besides mesh and selection, and what it returns.

use std::num::NonZero;

use crate::error::ExportError;

/// Options of every export.
#[derive(Clone, Copy)]
pub struct Options<'a> {
    /// Number of threads.
    pub jobs: NonZero<usize>,
    /// Whoever waits for the export.
    pub watch: &'a dyn Watch,
}

impl Options<'_> {
    /// Whether to continue.
    ///
    /// # Errors
    /// If the user has interrupted the export.
    pub fn check(&self) -> Result<(), ExportError> {
        if self.watch.is_interrupted() { Err(ExportError::Interrupted) } else { Ok(()) }
    }
}

/// Shows progress and passes on the user's interrupt. Threads call it at least every tenth of a second or so.
pub trait Watch: Sync {
    /// `done` of `total` leaves are written.
    fn progress(&self, done: u64, total: u64);

    /// Whether the user has interrupted the export.
    fn is_interrupted(&self) -> bool;
}

/// What was written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Summary {
    /// Number of leaves.
    pub leaves: u64,
    /// Number of files.
    pub files: u64,
    /// Size of all files together.
    pub bytes: u64,
}
