//! `mesh.json`, the manifest of a leaf-set directory: the inputs of the mesh, counts, digests and part files.

#[cfg(test)]
mod tests;

use std::fs;
use std::io;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::digest::Digest;
use crate::failure::{Failure, Result};
use crate::files;
use crate::htg::Block;
use crate::lattice::{FacetLattice, Root, UNITS_PER_EDGE};
use crate::octant::{LEVEL_MAX, Octant};

/// The only supported schema.
pub const SCHEMA: &str = "octree-leaf-set/1";
/// Name of the manifest in its directory.
pub const FILE: &str = "mesh.json";
/// Number of level-3 octants. Each has its own digest.
pub const OCTANTS: usize = 512;

/// The side of the body that is kept in the mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Keep {
    /// External flow.
    #[default]
    Outside,
    /// Internal flow.
    Inside,
    /// Both sides.
    All,
}

/// The treatment of outside components that the far field does not reach.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Enclosed {
    /// They are deleted.
    #[default]
    Delete,
    /// They are kept like any other outside component.
    Keep,
}

/// The tree that a leaf set holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Tree {
    /// All leaves of the base tree T0 with their sides, before deletion.
    Base,
    /// The final mesh.
    #[default]
    Final,
}

/// Whether the sides in the leaf words were found by the program that made the mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Sides {
    /// Every word holds the side of its leaf.
    #[default]
    Known,
    /// The mesh has no sides, as one from a format that stores cells only. Every word holds `outside`, which means nothing.
    Unknown,
}

fn are_known(sides: &Sides) -> bool {
    *sides == Sides::Known
}

/// An extent box on the lattice, clamped to the root.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExtentBox {
    /// Minimum corner, lattice units.
    pub min: [i64; 3],
    /// Maximum corner, lattice units.
    pub max: [i64; 3],
    /// Leaves whose interior meets the interior of the box have at least this level.
    pub level: u8,
}

impl ExtentBox {
    /// Whether the box has a volume in the root. One beyond it has none, as boxes are clamped to the root, and meets nothing.
    pub fn is_in_root(&self) -> bool {
        self.meets(&Octant::ROOT)
    }

    /// Whether the interiors of the box and of an octant meet.
    pub fn meets(&self, octant: &Octant) -> bool {
        let (low, high) = octant.bounds();
        (0..3).all(|a| low[a].max(self.min[a]) < high[a].min(self.max[a]))
    }
}

/// The facets of a mesh, as read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Geometry {
    /// Their number.
    pub facets: u64,
    /// Their digest on the lattice.
    pub digest: Digest,
}

impl Geometry {
    /// The geometry of these facets.
    pub fn of(facets: &[FacetLattice]) -> Self {
        Self { facets: facets.len() as u64, digest: Digest::of_facets(facets) }
    }
}

/// A region that is inside, or deleted, at a coarser spacing and outside, or kept, at that of the mesh. In the user's units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Leak {
    /// The spacing at which the region is closed.
    pub spacing_coarse: f64,
    /// The spacing of the mesh.
    pub spacing_fine: f64,
    /// The region's volume at the coarser spacing.
    pub volume: f64,
    /// A point in it.
    pub point: [f64; 3],
}

/// Leaf counts by side.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BySide {
    /// Leaves outside the body.
    pub outside: u64,
    /// Leaves inside the body.
    pub inside: u64,
    /// Leaves that the surface crosses.
    pub crossing: u64,
}

/// Components whose side was decided by a majority of rays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ambiguous {
    /// Their number.
    pub count: u64,
    /// Centroid of the first candidate leaf of one of them, in the user's units; `None` if there are none.
    pub example: Option<[f64; 3]>,
}

/// Components of T0 by side.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Components {
    /// Outside components, enclosed ones included.
    pub outside: u64,
    /// Inside components.
    pub inside: u64,
    /// Outside components that were deleted because the far field does not reach them.
    pub enclosed: EnclosedComponents,
}

/// Enclosed components of T0, which were deleted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EnclosedComponents {
    /// Their number.
    pub count: u64,
    /// Number of their leaves in T0.
    pub leaves: u64,
    /// Centroid of the first of these leaves (coarsest, then by key), in the user's units; `None` if there are
    /// none.
    pub example: Option<[f64; 3]>,
}

/// One part file.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Part {
    /// File name, without a directory.
    pub file: String,
    /// Number of leaves.
    pub leaves: u64,
    /// Their digest.
    pub digest: Digest,
}

/// The manifest.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// [`SCHEMA`].
    pub schema: String,
    /// Name and version of the program that wrote the mesh.
    pub program: String,
    /// Base tree or final mesh.
    pub tree: Tree,
    /// The root cube.
    pub root: Root,
    /// Whether the other inputs, from the surface level to the treatment of enclosed components, are unknown, as in a mesh from a format
    /// that stores cells only: their values mean nothing. Written only if they are.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub lacks_inputs: bool,
    /// D: the level of crossing leaves.
    pub level_surface: u8,
    /// n: minimum thickness of a layer, in cells.
    pub layer_cells_min: u32,
    /// The side that was kept.
    pub keep: Keep,
    /// Whether crossing leaves were kept.
    pub keep_crossing: bool,
    /// Extent boxes.
    pub boxes: Vec<ExtentBox>,
    /// Seeds, in lattice units. A manifest without this key means none.
    #[serde(default)]
    pub seeds: Vec<[i64; 3]>,
    /// The treatment of enclosed components. A manifest without this key means [`Enclosed::Delete`].
    #[serde(default)]
    pub enclosed: Enclosed,
    /// Whether the words hold sides. Written only if they do not.
    #[serde(default, skip_serializing_if = "are_known")]
    pub sides: Sides,
    /// The facets as read; `None` if the program does not say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub geometry: Option<Geometry>,
    /// Leaks between coarser spacings and that of the mesh; `None` if the program does not look for them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub leaks: Option<Vec<Leak>>,
    /// Leaves in all parts.
    pub leaves: u64,
    /// Leaves by level.
    pub leaves_by_level: [u64; LEVEL_MAX as usize + 1],
    /// Leaves by side.
    pub leaves_by_side: BySide,
    /// Components of T0 by side; `None` if the program does not count them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub components: Option<Components>,
    /// Components decided by majority; `None` if the program does not count them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub components_ambiguous: Option<Ambiguous>,
    /// Digest of all leaves.
    pub digest: Digest,
    /// Digest of the leaves in each level-3 octant, indexed by [`octant_index`].
    pub octant_digests: Vec<Digest>,
    /// The part files.
    pub parts: Vec<Part>,
    /// Name of the file with the tree, a hyper-tree grid in VTKHDF; `None` if there is none. It has all leaves, and may be without parts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hyper_tree_grid: Option<String>,
}

impl Manifest {
    /// The manifest of a final mesh without rules and leaves: everything is kept, and no level is required.
    pub fn without_leaves(root: Root, program: String) -> Self {
        Self {
            schema: SCHEMA.to_owned(),
            program,
            root,
            layer_cells_min: 1,
            keep: Keep::All,
            keep_crossing: true,
            octant_digests: vec![Digest::default(); OCTANTS],
            ..Self::default()
        }
    }

    /// The names of its files.
    pub fn names(&self) -> impl Iterator<Item = &String> {
        self.parts.iter().map(|part| &part.file).chain(&self.hyper_tree_grid)
    }

    /// The entry that no mesh has, because the schema is another, a number is out of range, or a name is a path; `None` if there is none. Checks
    /// compute with all these numbers.
    pub fn fault(&self) -> Option<String> {
        if self.schema != SCHEMA {
            return Some(format!("its schema is {:?}, not {SCHEMA:?}", self.schema));
        }
        // A path instead of a file name could refer to the leaves of another mesh.
        if let Some(name) = self.names().find(|name| Path::new(name).components().count() != 1) {
            return Some(format!("{name:?} is not a plain file name"));
        }
        let in_root = |at: &[i64; 3]| at.iter().all(|c| (0..=UNITS_PER_EDGE).contains(c));
        let is_box = |b: &ExtentBox| {
            let is_ordered = (0..3).all(|a| b.min[a] <= b.max[a]);
            b.level <= LEVEL_MAX && is_ordered && in_root(&b.min) && in_root(&b.max)
        };
        let faults = [
            (self.octant_digests.len() == OCTANTS, "octant_digests: give 512"),
            (self.level_surface <= LEVEL_MAX, "level_surface: give a level from 0 to 19"),
            (self.layer_cells_min > 0, "layer_cells_min: a layer has at least one cell"),
            (self.boxes.iter().all(is_box), "boxes: one is not in the root, or has no level"),
            (self.seeds.iter().all(in_root), "seeds: one is not in the root"),
            (self.root.is_cube(), "root: give a cube with an edge from 1e-100 to 1e100"),
        ];
        faults.into_iter().find(|(holds, _)| !holds).map(|(_, fault)| fault.to_owned())
    }

    /// Replaces all entries that depend on the leaves, but for the parts, by those of these words.
    pub fn set_leaves(&mut self, words: &[u64]) {
        self.clear_leaves();
        words.iter().for_each(|&first| _ = self.add_block(&Block { first, depth: 0 }));
    }

    /// Counts no leaves, and gives the mesh and every octant the digest of none.
    pub fn clear_leaves(&mut self) {
        (self.leaves, self.leaves_by_level, self.leaves_by_side) = Default::default();
        self.digest = Digest::default();
        self.octant_digests = vec![Digest::default(); OCTANTS];
    }

    /// Adds all leaves of a block to the counts, and their digest, which is returned, to those of its octant and of the mesh.
    pub fn add_block(&mut self, block: &Block) -> Digest {
        self.count(block.first, block.leaves());
        let mut digest = Digest::default();
        digest.add_block(block);
        self.octant_digests[octant_index(block.first)].merge(digest);
        self.digest.merge(digest);
        digest
    }

    /// Counts this many words of the level and side of one, and leaves the digests unchanged. An invalid level or side counts among all leaves alone.
    pub fn count(&mut self, word: u64, leaves: u64) {
        self.leaves += leaves;
        if let Some(count) = self.leaves_by_level.get_mut(usize::from(crate::word::level(word))) {
            *count += leaves;
        }
        match word & 3 {
            0 => self.leaves_by_side.outside += leaves,
            1 => self.leaves_by_side.inside += leaves,
            2 => self.leaves_by_side.crossing += leaves,
            _ => {}
        }
    }

    /// Reads the manifest of a directory.
    ///
    /// # Errors
    /// If it cannot be read, or does not follow its schema.
    pub fn read(dir: &Path) -> Result<Self> {
        let why = "is a file: give the directory of a mesh, which has mesh.json (`mesher CASE --out DIR` makes one)";
        Failure::unless(!dir.is_file(), format_args!("{} {why}", dir.display()))?;
        let path = dir.join(FILE);
        let text = files::read_text(&path).map_err(|error| Failure::about(&path, error))?;
        let wrong = |why| Failure::about(&path, format!("not a leaf-set manifest: {why}"));
        let manifest: Self =
            serde_json::from_str(&text).map_err(|error| wrong(error.to_string()))?;
        manifest.fault().map_or(Ok(()), |fault| Err(wrong(fault)))?;
        Ok(manifest)
    }

    /// Writes the manifest into an existing directory.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, directory: &Path) -> io::Result<()> {
        fs::write(directory.join(FILE), self.text())
    }

    /// The manifest as JSON.
    pub fn text(&self) -> String {
        serde_json::to_string(self).expect("a manifest is representable in JSON")
    }
}

/// The name of the part file with this index.
pub fn part_name(index: usize) -> String {
    format!("leaves-{index:05}.npy")
}

/// Index of the level-3 octant that contains the minimum corner of a leaf: the top nine bits of its word.
pub fn octant_index(word: u64) -> usize {
    (word >> 55) as usize
}
