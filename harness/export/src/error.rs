//! Why a mesh was not exported.

use contract::leafset::ReadError;
use contract::word::WordError;
use std::io;
use std::path::{Path, PathBuf};

/// Why a mesh was not exported. The message is one sentence for the user.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The mesh cannot be opened or read.
    #[error(transparent)]
    Mesh(#[from] ReadError),
    /// A word that does not encode a leaf.
    #[error("{part}: leaf {index} is invalid ({error}): run harness audit on the mesh")]
    Word {
        /// The part file.
        part: PathBuf,
        /// Index of the word in the part.
        index: u64,
        /// What is wrong with it.
        error: WordError,
    },
    /// The leaves of a part do not ascend or overlap.
    #[error(
        "{part}: leaf {index} does not follow the leaf before it: run harness audit on the mesh"
    )]
    Order {
        /// The part file.
        part: PathBuf,
        /// Index of the word in the part.
        index: u64,
    },
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
