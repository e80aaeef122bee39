//! Errors of the user's input and output. Each message is one sentence: the problem, its location
//! and a remedy.
use crate::case::Root;
use std::io;
use std::path::PathBuf;
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
    /// A case file is invalid.
    #[error("case file {}: {problem}", path.display())]
    CaseFile {
        /// The file.
        path: PathBuf,
        /// The problem and the remedy.
        problem: String,
    },
    /// A geometry is damaged or not STL.
    #[error("geometry {}: {problem}", path.display())]
    Stl {
        /// The file.
        path: PathBuf,
        /// The problem and the remedy.
        problem: String,
    },
    /// The origin of the root is not finite.
    #[error("the root's origin {0:?} is not finite: give three finite numbers")]
    RootOrigin([f64; 3]),
    /// The edge of the root is not a length.
    #[error("the root's edge is {0}: it must be finite and greater than 0")]
    RootEdge(f64),
    /// A layer has no cells.
    #[error("layer_cells_min is 0: it must be at least 1, which is plain 2:1 balance")]
    LayerCells,
    /// A spacing is not a length.
    #[error("{name} is {spacing}: it must be finite and greater than 0")]
    Spacing {
        /// The name of the spacing.
        name: String,
        /// Its value.
        spacing: f64,
    },
    /// A spacing requires a level beyond the deepest.
    #[error(
        "{name} is {spacing}, less than {least}, the cell edge at the deepest level, 19: \
         choose a larger spacing or a smaller root"
    )]
    SpacingTooFine {
        /// The name of the spacing.
        name: String,
        /// Its value.
        spacing: f64,
        /// The least spacing that this root allows.
        least: f64,
    },
    /// A box has a corner that is not finite, or min >= max along an axis.
    #[error(
        "box {index} extends from {min:?} to {max:?}: \
         its corners must be finite and min less than max along every axis"
    )]
    BoxCorners {
        /// Index of the box, from 0.
        index: usize,
        /// Its minimum corner.
        min: [f64; 3],
        /// Its maximum corner.
        max: [f64; 3],
    },
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
    /// A vertex is not finite.
    #[error("facet {facet} has a vertex {vertex:?} that is not finite: repair the geometry")]
    VertexNotFinite {
        /// Index of the facet, from 0.
        facet: usize,
        /// The vertex.
        vertex: [f64; 3],
    },
    /// A vertex is too far from the root.
    #[error(
        "facet {facet} has a vertex {vertex:?} more than one root edge outside the root \
         (origin {:?}, edge {}): enlarge or move the root, or correct the vertex",
        root.origin, root.edge
    )]
    VertexOutside {
        /// Index of the facet, from 0.
        facet: usize,
        /// The vertex.
        vertex: [f64; 3],
        /// The root.
        root: Root,
    },
    /// A seed is not finite.
    #[error("seed {index} is {seed:?}: give three finite numbers")]
    SeedNotFinite {
        /// Index of the seed, from 0.
        index: usize,
        /// The seed.
        seed: [f64; 3],
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
