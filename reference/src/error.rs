//! Errors of the user's input and output. Each message is one sentence: the problem, its location
//! and a remedy.
use std::io;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// An error that the user can correct. Bugs panic instead.
#[derive(Debug, Error)]
pub enum Error {
    /// A file cannot be read.
    #[error("cannot read {}: {source}; check the path and its permissions", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: io::Error,
    },
    /// A case file, a geometry or a value of the case is invalid.
    #[error("{0}")]
    Invalid(String),
    /// A box alone has more cells than fit into memory.
    #[error(
        "box {index} alone has about {cells:.1e} cells, which do not fit into memory: increase its spacing or make it smaller"
    )]
    TooManyCells {
        /// Index of the box, from 0.
        index: usize,
        /// The number of cells of its level that fill it.
        cells: f64,
    },
    /// A seed lies outside the root.
    #[error("seed {index} at {seed:?} lies outside the root: {}", remedy(*nearest))]
    SeedOutside {
        /// Index of the seed, from 0.
        index: usize,
        /// The seed.
        seed: [f64; 3],
        /// The nearest centroid of a leaf of T0 that no facet crosses, if there is such a leaf.
        nearest: Option<[f64; 3]>,
    },
    /// A seed lies in a crossing leaf.
    #[error("seed {index} at {seed:?} lies in a cell that a facet crosses: {}", remedy(*nearest))]
    SeedCrossing {
        /// Index of the seed, from 0.
        index: usize,
        /// The seed.
        seed: [f64; 3],
        /// The nearest centroid of a leaf of T0 that no facet crosses, if there is such a leaf.
        nearest: Option<[f64; 3]>,
    },
    /// The output directory is not empty, or another run writes to it.
    #[error("output directory {}: {source}; choose another", path.display())]
    OutputTaken {
        /// The directory.
        path: PathBuf,
        /// The cause.
        source: io::Error,
    },
    /// A file cannot be written.
    #[error("cannot write {}: {source}; check the path, its permissions and the free space", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: io::Error,
    },
}

/// The remedy for a seed that marks no flow.
fn remedy(nearest: Option<[f64; 3]>) -> String {
    nearest.map_or_else(
        || "facets cross every cell, so choose a smaller spacing_min".to_owned(),
        |point| format!("move it into the flow; the nearest centroid of a free cell is {point:?}"),
    )
}

impl Error {
    /// The exit code of the program: 4 if output could not be written (2 if it would replace an input or another output), 71 if the mesh does not fit into memory, otherwise 2.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        match self {
            Error::Write { source, .. } if source.kind() == io::ErrorKind::InvalidInput => 2,
            Error::Write { .. } => 4,
            Error::TooManyCells { .. } => 71,
            _ => 2,
        }
    }
}

/// The bytes of a regular file.
///
/// # Errors
/// It is not a regular file, is an output of this run, or cannot be read.
pub(crate) fn read_file(path: &Path) -> Result<Vec<u8>, Error> {
    files::read(path).map_err(|source| Error::Read { path: path.to_owned(), source })
}
