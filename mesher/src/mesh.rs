//! A mesh as one rank holds it, after phase 8.

use crate::input::lattice::Rules;
use crate::input::quantise::FacetCounts;
use crate::partition::Partitioner;
use crate::partition::ownership::Ownership;
use crate::sides::Sides;
use crate::sides::leaks::Leaks;
use bricks::octant::Level;
use bricks::tree::PerLevel;

/// A mesh as one rank holds it.
pub struct Mesh {
    /// The facets of all ranks, in numbers.
    pub facets: FacetCounts,
    /// The rules on the lattice.
    pub rules: Rules,
    /// The ranks that own and hold bricks.
    pub ownership: Ownership,
    /// Level of the base leaves, or of the octants between which partition boundaries lie.
    pub level_base: Level,
    /// The partitioner that was used; none for a single rank.
    pub partitioner: Option<Partitioner>,
    /// Split octants: of the graded tree, or of T0 if gradation was not asked for. Great sets of a graded tree are condensed: they can
    /// only be read.
    pub split: PerLevel,
    /// Crossing leaves of T0.
    pub crossing: PerLevel,
    /// Sides of the leaves of T0.
    pub sides: Sides,
    /// What is closed at a coarser spacing, and open at that of the mesh.
    pub leaks: Leaks,
    /// Whether the facets are an open body, and bound nothing although the outside is kept.
    pub bounds_nothing: bool,
    /// Bytes of split octants in gradation, at most.
    pub bytes_graded: usize,
    /// Whether the tree is T0, of which all leaves are in the mesh.
    pub is_base: bool,
}

impl Mesh {
    /// Whether crossing leaves of the base tree are no leaves of the mesh.
    pub fn drops_crossing(&self) -> bool {
        !self.is_base && !self.rules.keep_crossing
    }
}
