//! What can be wrong, each in one sentence: what, where, and what to do about it.
use crate::case::Root;
use std::io;
use std::path::PathBuf;
use thiserror::Error;

/// An error that is the user's to mend. Bugs panic instead.
#[derive(Debug, Error)]
pub enum Error {
    /// A file that cannot be read.
    #[error("cannot read {}: {source}; check the path and its permissions", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: io::Error,
    },
    /// A case file that makes no sense.
    #[error("case file {}: {problem}", path.display())]
    CaseFile {
        /// The file.
        path: PathBuf,
        /// What is wrong and what to do.
        problem: String,
    },
    /// A geometry that is not STL, or damaged.
    #[error("geometry {}: {problem}", path.display())]
    Stl {
        /// The file.
        path: PathBuf,
        /// What is wrong and what to do.
        problem: String,
    },
    /// A root that is nowhere.
    #[error("the root's origin {0:?} is not finite: give three finite numbers")]
    RootOrigin([f64; 3]),
    /// A root without a size.
    #[error("the root's edge is {0}: it must be finite and greater than 0")]
    RootEdge(f64),
    /// A layer of no cells.
    #[error("layer_cells_min is 0: it must be at least 1, which is plain 2:1 balance")]
    LayerCells,
    /// A spacing that is no length.
    #[error("{name} is {spacing}: it must be finite and greater than 0")]
    Spacing {
        /// Which spacing.
        name: String,
        /// Its value.
        spacing: f64,
    },
    /// A spacing beyond the deepest level.
    #[error(
        "{name} is {spacing}, finer than level 19, whose cells have edge {least}: \
         make it coarser or the root smaller"
    )]
    SpacingTooFine {
        /// Which spacing.
        name: String,
        /// Its value.
        spacing: f64,
        /// The finest that this root allows.
        least: f64,
    },
    /// A box with no interior, or nowhere.
    #[error(
        "box {index} reaches from {min:?} to {max:?}: \
         its corners must be finite and min less than max along every axis"
    )]
    BoxCorners {
        /// Which box, from 0.
        index: usize,
        /// Its minimum corner.
        min: [f64; 3],
        /// Its maximum corner.
        max: [f64; 3],
    },
    /// A vertex that is nowhere.
    #[error("facet {facet} has a vertex {vertex:?} that is not finite: repair the geometry")]
    VertexNotFinite {
        /// Which facet, from 0.
        facet: usize,
        /// The vertex.
        vertex: [f64; 3],
    },
    /// A vertex too far from the root.
    #[error(
        "facet {facet} has a vertex {vertex:?} more than one root edge outside the root \
         (origin {:?}, edge {}): enlarge or move the root, or mend the vertex",
        root.origin, root.edge
    )]
    VertexOutside {
        /// Which facet, from 0.
        facet: usize,
        /// The vertex.
        vertex: [f64; 3],
        /// The root.
        root: Root,
    },
    /// An output directory that is in use.
    #[error("output directory {} is not empty: name another or empty it", path.display())]
    OutputNotEmpty {
        /// The directory.
        path: PathBuf,
    },
    /// A file that cannot be written.
    #[error("cannot write {}: {source}; check the path, its permissions and the free space", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: io::Error,
    },
}

impl Error {
    /// What the program exits with: 4 when output could not be written, 2 for any other input.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        match self {
            Error::OutputNotEmpty { .. } | Error::Write { .. } => 4,
            _ => 2,
        }
    }
}
