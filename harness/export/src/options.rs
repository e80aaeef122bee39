//! What every export is given, and what it returns. What is written is counted as it is written, and compared with what was to be written before
//! a file gets its name:
//! - octants ascend along the Morton curve without overlap and end in the root;
//! - cells are as many as were selected, which another pass over the mesh has counted, or as all leaves of the mesh if there is no selection;
//! - in a format without holes, octants and fillers tile the root.

use std::fs;
use std::path::Path;

use contract::case::Case;
use contract::failure::{Failure, Result};
use contract::import::TOLERANCE;
use contract::mesh::Mesh;

use crate::selection::Selection;

/// The leaves that are exported, and how.
pub struct Export<'a> {
    /// The mesh.
    pub mesh: &'a Mesh,
    /// Which of its leaves are exported.
    pub selection: &'a Selection,
    /// The case of the mesh: its solids become patches of OpenFOAM.
    pub case: Option<&'a Case>,
    /// The regions that are exported to OpenFOAM.
    pub regions: Regions,
    /// Runs the script that makes a file of this format: its source and the file.
    pub script: fn(&str, &Path, &Path) -> Result<()>,
}

impl Export<'_> {
    /// Number of selected leaves, which is not 0.
    pub(crate) fn count(&self) -> Result<u64> {
        let mut leaves = 0;
        match self.is_of_all() {
            true => leaves = self.mesh.leaf_count(),
            false => self.selection.visit(self.mesh, &mut |_| {
                leaves += 1;
                Ok(())
            })?,
        }
        self.require_some(leaves)
    }

    /// Refuses cells of a level that coordinates in double precision do not resolve as an import needs it.
    pub(crate) fn require_resolved(&self, level: u8) -> Result<()> {
        let root = &self.mesh.manifest.root;
        let far = root.origin.iter().fold(root.edge, |far, at| far.max(at.abs()));
        let edge = root.edge_of(level);
        let why = format_args!(
            "coordinates up to {far} do not resolve cells with the edge {edge}: move the geometry towards the origin, or write .p8est or .vtkhdf"
        );
        Failure::unless(far * f64::EPSILON <= TOLERANCE * edge, why)
    }

    /// Refuses an export without leaves.
    pub(crate) fn require_some(&self, leaves: u64) -> Result<u64> {
        Failure::unless(leaves > 0, "no leaf satisfies all conditions, or the mesh has none")?;
        Ok(leaves)
    }

    /// Whether no leaf of the mesh is left out by a condition.
    pub(crate) fn is_of_all(&self) -> bool {
        *self.selection == Selection::default()
    }
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

/// Refuses to replace a file, or a directory with something in it: what exists may be the only copy of a body, or the case of a solver.
///
/// # Errors
/// If it exists.
pub(crate) fn require_new(path: &Path) -> Result<()> {
    let has_content = fs::read_dir(path).map_or(path.exists(), |mut dir| dir.next().is_some());
    let why = format!("{} exists: remove it, or choose another name", path.display());
    Failure::unless(!has_content, why)
}

/// Writes to a path. After an error, nothing exists under a final name.
pub type Write = fn(&Export<'_>, &Path) -> Result<Summary>;

/// What was written.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Summary {
    /// Number of leaves.
    pub leaves: u64,
    /// Size of all files together.
    pub bytes: u64,
    /// What else the user should know, one line each.
    pub notes: Vec<String>,
}
