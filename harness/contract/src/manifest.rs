//! `mesh.json`: what a leaf-set directory says about itself.

use serde::{Deserialize, Serialize};

use crate::digest::Digest;
use crate::lattice::Root;
use crate::octant::LEVEL_MAX;

/// The only schema that is understood.
pub const SCHEMA: &str = "octree-leaf-set/1";
/// Name of the manifest in its directory.
pub const FILE: &str = "mesh.json";
/// Level-3 octants, each with a digest of its own.
pub const OCTANTS: usize = 512;

/// Which side of the body stays in the mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Keep {
    /// External flow.
    #[default]
    Outside,
    /// Internal flow.
    Inside,
    /// Everything.
    All,
}

/// Which of the two trees a leaf set holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Tree {
    /// All leaves of the base tree T0, sides decided, nothing deleted.
    Base,
    /// The final mesh.
    Final,
}

/// An extent box on the lattice, clamped to the root.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExtentBox {
    /// Minimum corner, lattice units.
    pub min: [i64; 3],
    /// Maximum corner, lattice units.
    pub max: [i64; 3],
    /// Leaves whose interior meets the box's have at least this level.
    pub level: u8,
}

/// Leaves by side.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BySide {
    /// Leaves outside of the body.
    pub outside: u64,
    /// Leaves inside.
    pub inside: u64,
    /// Leaves that contain surface.
    pub crossing: u64,
}

/// Components whose side was decided by majority.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ambiguous {
    /// How many.
    pub count: u64,
    /// Centroid of the first candidate of one of them, user coordinates.
    pub example: Option<[f64; 3]>,
}

/// One part file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Part {
    /// File name within the directory.
    pub file: String,
    /// Leaves in it.
    pub leaves: u64,
    /// Their digest.
    pub digest: Digest,
}

/// The whole manifest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// [`SCHEMA`].
    pub schema: String,
    /// Name and version of the program that wrote it.
    pub program: String,
    /// Base tree or final mesh.
    pub tree: Tree,
    /// The root cube.
    pub root: Root,
    /// D: the level that crossing leaves have.
    pub level_surface: u8,
    /// n: minimum thickness of a layer, in cells.
    pub layer_cells_min: u32,
    /// Which side was kept.
    pub keep: Keep,
    /// Whether crossing leaves were kept.
    pub keep_crossing: bool,
    /// Extent boxes.
    pub boxes: Vec<ExtentBox>,
    /// Leaves in all parts.
    pub leaves: u64,
    /// Leaves by level.
    pub leaves_by_level: [u64; LEVEL_MAX as usize + 1],
    /// Leaves by side.
    pub leaves_by_side: BySide,
    /// Components decided by majority.
    pub components_ambiguous: Ambiguous,
    /// Digest of all leaves.
    pub digest: Digest,
    /// Digest of each level-3 octant's leaves; the index is the leaf word's top nine bits.
    pub octant_digests: Vec<Digest>,
    /// The part files.
    pub parts: Vec<Part>,
}

/// Everything in a manifest that follows from the leaves alone.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tally {
    /// Leaves counted.
    pub leaves: u64,
    /// By level; words whose level is impossible are not in here.
    pub by_level: [u64; LEVEL_MAX as usize + 1],
    /// By side.
    pub by_side: BySide,
    /// Digest of all.
    pub digest: Digest,
    /// Digest by level-3 octant.
    pub octants: Vec<Digest>,
}

impl Default for Tally {
    fn default() -> Self {
        Self {
            leaves: 0,
            by_level: [0; LEVEL_MAX as usize + 1],
            by_side: BySide::default(),
            digest: Digest::default(),
            octants: vec![Digest::default(); OCTANTS],
        }
    }
}

impl Tally {
    /// Counts some words.
    pub fn of(words: &[u64]) -> Self {
        let mut tally = Self::default();
        words.iter().for_each(|&w| tally.add(w));
        tally.close();
        tally
    }

    /// Counts one word; [`Tally::close`] after the last.
    pub fn add(&mut self, word: u64) {
        self.leaves += 1;
        if let Some(count) = self.by_level.get_mut(usize::from(crate::word::level(word))) {
            *count += 1;
        }
        match word & 3 {
            0 => self.by_side.outside += 1,
            1 => self.by_side.inside += 1,
            2 => self.by_side.crossing += 1,
            _ => {}
        }
        self.octants[octant_index(word)].add(word);
    }

    /// Sums the octants' digests into the whole mesh's: one addition per leaf is saved that way.
    pub fn close(&mut self) {
        self.digest = Digest::default();
        for &octant in &self.octants {
            self.digest.merge(octant);
        }
    }
}

/// Which level-3 octant a word belongs to: that of its minimum corner.
pub fn octant_index(word: u64) -> usize {
    (word >> 55) as usize
}
