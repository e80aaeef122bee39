//! What every export is given besides mesh and selection, and what it returns.

use std::num::NonZero;
use std::path::Path;

use contract::case::Case;

use crate::mesh::Mesh;
use crate::selection::Selection;
use contract::failure::Failure;
use contract::watch::Watch;

/// Options of every export.
#[derive(Clone, Copy)]
pub struct Options<'a> {
    /// Number of threads.
    pub jobs: NonZero<usize>,
    /// Whoever waits for the export.
    pub watch: &'a dyn Watch,
    /// The case of the mesh: its solids become patches of OpenFOAM, and its facets are those to which a surface has gaps.
    pub case: Option<&'a Case>,
    /// Width of OpenFOAM's labels.
    pub label: Label,
    /// The regions that are exported to OpenFOAM.
    pub regions: Regions,
    /// Runs the script that makes a file of this format: its source and the file.
    pub script: fn(&str, &Path, &Path) -> Result<(), Failure>,
}

/// Width of the numbers of cells, faces and points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Label {
    /// OpenFOAM's default
    #[default]
    #[value(name = "32")]
    Bits32,
    /// For more than about 169 million cells
    #[value(name = "64")]
    Bits64,
}

/// What becomes of cells that faces do not connect with the largest region.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Regions {
    /// They are exported
    #[default]
    All,
    /// They are left out: most solvers accept only one region
    Largest,
}

impl Options<'_> {
    /// Whether to continue.
    ///
    /// # Errors
    /// If the user has interrupted the export.
    pub fn check(&self) -> Result<(), Failure> {
        if self.watch.is_interrupted() { Err(Failure::interrupted()) } else { Ok(()) }
    }

    /// The same in a loop of fast steps, of which `count` are done. Most calls do not ask.
    ///
    /// # Errors
    /// As [`Self::check`].
    pub fn check_at(&self, count: u64) -> Result<(), Failure> {
        if count.is_multiple_of(1 << 14) { self.check() } else { Ok(()) }
    }
}

/// Writes the selected leaves of a mesh to a path. After an error, nothing exists under a final name.
pub type Write = fn(&Mesh, &Selection, &Path, &Options<'_>) -> Result<Summary, Failure>;

/// What was written.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Summary {
    /// Number of leaves.
    pub leaves: u64,
    /// Number of files.
    pub files: u64,
    /// Size of all files together.
    pub bytes: u64,
    /// What else the user should know, one line each.
    pub notes: Vec<String>,
}
