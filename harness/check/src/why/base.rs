//! T0: of the case or, without one, where the crossing leaves of the mesh show it.
//!
//! If section 3 requires the split of an octant, it requires the split of its ancestors. So the leaf of T0 at a
//! point is the first octant on the way down that no rule splits.

use super::Mesh;
use contract::octant::{LEVEL_MAX, Octant};
use contract::tree::OFFSETS;
use contract::word::Side;

impl Mesh<'_> {
    /// Whether the surface crosses an octant that is a leaf of T0 or contains some. Without facets the answer holds for octants coarser
    /// than D only: such an octant contains a crossing leaf iff a facet crosses it.
    pub(super) fn is_crossed(&self, octant: &Octant) -> bool {
        let tree = self.body.map_or(self.tree, |(_, truth)| &truth.tree);
        tree.kinds(tree.at(octant)) & 1 << Side::Crossing as u8 != 0
    }

    /// Whether T0 splits an octant.
    pub(super) fn base_splits(&self, octant: &Octant) -> bool {
        match self.body {
            Some((_, truth)) => truth.tree.at(octant).is_node(),
            None => {
                octant.level < LEVEL_MAX
                    && (self.terms.box_that_splits(octant).is_some()
                        || octant.level < self.terms.level_surface && self.is_crossed(octant))
            }
        }
    }

    /// The facets that cross an octant, ascending; empty if facets are not known.
    pub(super) fn facets_of(&self, octant: &Octant) -> Vec<u32> {
        let (low, high) = octant.bounds();
        self.body.map_or(Vec::new(), |(facets, _)| facets.meeting(&facets.all(), low, high))
    }

    /// The leaf of T0 that is or contains an octant; `None` if T0 splits the octant.
    pub(super) fn base_leaf(&self, octant: &Octant) -> Option<Octant> {
        if self.base_splits(octant) {
            return None;
        }
        let split_above = (0..octant.level).rev().find(|&l| self.base_splits(&octant.ancestor(l)));
        Some(octant.ancestor(split_above.map_or(0, |level| level + 1)))
    }

    /// Whether crossing leaves were deleted after gradation and are known from the facets.
    pub(super) fn has_deleted_crossing(&self) -> bool {
        !self.terms.keep_crossing && self.body.is_some()
    }

    /// A crossing leaf of T0 that by touching an octant forces it to split: the extra layer of section 6.
    pub(super) fn extra_layer(&self, octant: &Octant) -> Option<Octant> {
        let applies = self.has_deleted_crossing() && self.terms.layer_cells_min < 3;
        if !applies || octant.level >= self.terms.level_surface || self.base_splits(octant) {
            return None;
        }
        let around = OFFSETS.iter().filter(|offset| **offset != [0; 3]);
        let mut neighbours = around.filter_map(|&offset| octant.neighbour(offset));
        neighbours.find_map(|neighbour| self.crossing_leaf_touching(octant, &neighbour))
    }

    /// The first crossing leaf of T0 below `below` that touches an octant.
    fn crossing_leaf_touching(&self, octant: &Octant, below: &Octant) -> Option<Octant> {
        if octant.distance(below) > 0 || !self.is_crossed(below) {
            return None;
        }
        match self.base_splits(below) {
            true => (0..8).find_map(|d| self.crossing_leaf_touching(octant, &below.child(d))),
            false => Some(*below),
        }
    }
}
