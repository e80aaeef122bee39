//! Why a mesh was not exported.

use contract::leafset::ReadError;
use std::io;
use std::path::Path;

/// Why a mesh was not exported. The message is one sentence for the user.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The mesh cannot be opened or read.
    #[error(transparent)]
    Mesh(#[from] ReadError),
    /// A file could not be written.
    #[error("{0}")]
    Write(#[from] io::Error),
    /// The user interrupted the export.
    #[error("interrupted")]
    Interrupted,
    /// A request that cannot be fulfilled, as one sentence.
    #[error("{0}")]
    Request(String),
}

impl ExportError {
    /// A file or directory could not be written.
    pub fn write(path: &Path, error: io::Error) -> Self {
        Self::Write(io::Error::new(error.kind(), format!("{}: {error}", path.display())))
    }
}
