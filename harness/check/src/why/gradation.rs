//! The leaves that force an octant to split, by layer or balance (section 6 of reference/DEFINITION.md).
//!
//! For an octant P of level p that T0 does not split:
//! - a source S of level l > p forces the split by its **layer** if it is nearer to P than n - 1 cells of level l;
//! - a leaf S of level l > p + 1 forces it by **balance** if it touches P.
//!
//! S is a source only if its parent is split before the layer of level l is made. That is, the parent Q of level l - 1 is
//! **deep**: T0 or the extra layer splits it, or a leaf of level l + 1 or deeper forces it. A layer made at level l makes
//! leaves of level l, too, which are no sources of it but count for the balance. So P is
//! - deep iff T0 or the extra layer splits it, or a leaf S of level p + 2 or deeper forces it (by layer if the parent of S
//!   is deep, by balance if the parent of S is justified);
//! - **justified** iff it is deep, or the layer of a leaf of level p + 1 with a deep parent forces it.
//!
//! Both refer to finer octants only, or to the same level in the order deep, justified; so the recursion ends. A leaf S
//! inside P need not be considered: whatever forces the parent of S from outside P is at least as near to P.
//!
//! Crossing leaves that were deleted after gradation are sources. They are the crossing leaves of T0, which the facets
//! determine. Only near a box finer than D they may have been split, which the same recursion decides.

use std::ops::RangeInclusive;

use super::Mesh;
use super::leaves::{Node, id, parent};
use contract::octant::{CELLS_PER_EDGE, Octant};
use contract::tree::OFFSETS;

/// Edge of a cell of a level, in level-19 cells.
fn edge(level: u8) -> i64 {
    i64::from(CELLS_PER_EDGE >> level)
}

impl Mesh<'_> {
    /// Distance from a source of this level within which its layer reaches, in level-19 cells.
    pub(super) fn layer_reach(&self, level: u8) -> i64 {
        i64::from(self.terms.layer_cells_min - 1) * edge(level)
    }

    /// Whether the layer of a finer leaf reaches an octant.
    pub(super) fn forces_by_layer(&self, leaf: &Octant, octant: &Octant) -> bool {
        octant.distance(leaf) < self.layer_reach(leaf.level)
    }

    /// Whether balance with a leaf requires an octant to be split.
    pub(super) fn forces_by_balance(&self, leaf: &Octant, octant: &Octant) -> bool {
        leaf.level > octant.level + 1 && octant.distance(leaf) == 0
    }

    /// Whether T0, the extra layer or a leaf at least two levels finer forces an octant to split.
    pub(super) fn is_deep(&self, octant: &Octant) -> bool {
        let id = id(octant);
        if let Some(&known) = self.known.deep.borrow().get(&id) {
            return known;
        }
        let levels = octant.level + 2..=self.level_deepest;
        let forces = &mut |leaf: Octant| {
            let from = parent(&leaf);
            self.forces_by_layer(&leaf, octant) && self.is_deep(&from)
                || self.forces_by_balance(&leaf, octant) && self.is_justified(&from)
        };
        let deep = self.base_splits(octant)
            || self.extra_layer(octant).is_some()
            || self.any_leaf_near(octant, levels, forces);
        self.known.deep.borrow_mut().insert(id, deep);
        deep
    }

    /// Whether a rule requires an octant to be split.
    pub(super) fn is_justified(&self, octant: &Octant) -> bool {
        if self.is_deep(octant) {
            return true;
        }
        let id = id(octant);
        if let Some(&known) = self.known.justified.borrow().get(&id) {
            return known;
        }
        let level = octant.level + 1;
        let forces =
            &mut |leaf: Octant| self.forces_by_layer(&leaf, octant) && self.is_deep(&parent(&leaf));
        let justified =
            level <= self.level_deepest && self.any_leaf_near(octant, level..=level, forces);
        self.known.justified.borrow_mut().insert(id, justified);
        justified
    }

    /// Visits the leaves of these levels outside an octant that may force it to split, until `visit` returns true.
    /// Returns whether it did. The order is fixed.
    pub(super) fn any_leaf_near(
        &self,
        octant: &Octant,
        levels: RangeInclusive<u8>,
        visit: &mut dyn FnMut(Octant) -> bool,
    ) -> bool {
        if self.is_base || levels.is_empty() {
            return false;
        }
        let (first, last) = (*levels.start(), *levels.end());
        let mut start = octant.level;
        while start > 0 && edge(start) < self.layer_reach(first) {
            start -= 1;
        }
        let mut search = Search { mesh: self, octant, first, last, visit };
        let centre = octant.ancestor(start);
        let starts = OFFSETS.iter().filter_map(|&offset| centre.neighbour(offset));
        starts.into_iter().any(|start| search.enter(start, self.content(&start), false))
    }

    /// The content of an octant: split, or else without leaves of a deeper level.
    fn content(&self, octant: &Octant) -> Content {
        if self.leaves.node(octant).is_split() { Content::Split } else { Content::Nothing }
    }
}

/// The content of an octant in the mesh.
#[derive(Clone, Copy, Debug)]
enum Content {
    Leaf,
    Split,
    /// No leaf: deleted, outside the kept region, or part of a coarser leaf.
    Nothing,
}

impl Node {
    fn content(self, digit: u8) -> Content {
        match (self.leaves >> digit & 1, self.split >> digit & 1) {
            (1, _) => Content::Leaf,
            (_, 1) => Content::Split,
            _ => Content::Nothing,
        }
    }
}

/// A search for leaves of levels `first` to `last` near an octant.
struct Search<'a, 'b> {
    mesh: &'a Mesh<'a>,
    octant: &'a Octant,
    first: u8,
    last: u8,
    visit: &'b mut dyn FnMut(Octant) -> bool,
}

impl Search<'_, '_> {
    /// Searches an octant. `in_deleted` states that it lies in a crossing leaf of T0 that was deleted.
    fn enter(&mut self, at: Octant, content: Content, in_deleted: bool) -> bool {
        if at == *self.octant || self.is_far(&at) {
            return false;
        }
        match content {
            Content::Leaf => self.leaf(at),
            Content::Split if !self.mesh.distrusts || self.counts_as_split(&at) => {
                self.descend(&at, false)
            }
            Content::Split => self.leaf(at),
            Content::Nothing if self.mesh.has_deleted_crossing() => self.hole(at, in_deleted),
            Content::Nothing => false,
        }
    }

    fn descend(&mut self, at: &Octant, in_deleted: bool) -> bool {
        if at.level >= self.last {
            return false;
        }
        let node = self.mesh.leaves.node(at);
        (0..8).any(|digit| self.enter(at.child(digit), node.content(digit), in_deleted))
    }

    /// Searches an octant without leaves for deleted crossing leaves.
    fn hole(&mut self, at: Octant, in_deleted: bool) -> bool {
        if !in_deleted {
            match self.mesh.base_leaf(&at) {
                None => return self.mesh.is_crossed(&at) && self.descend(&at, false),
                Some(leaf) if !self.mesh.is_crossed(&leaf) => return false,
                Some(_) => {}
            }
        }
        match self.mesh.terms.has_box_finer_than_surface() && self.counts_as_split(&at) {
            true => self.descend(&at, true),
            false => self.leaf(at),
        }
    }

    /// Whether an octant is split before the step that is asked about. Above the parents of the leaves that are
    /// searched, this need not be known: a leaf is visited only if its own parent is split.
    fn counts_as_split(&self, at: &Octant) -> bool {
        if at.level >= self.mesh.level_deepest {
            false
        } else if at.level + 1 < self.first {
            true
        } else if at.level == self.octant.level {
            self.mesh.is_deep(at)
        } else {
            self.mesh.is_justified(at)
        }
    }

    fn leaf(&mut self, at: Octant) -> bool {
        (self.first..=self.last).contains(&at.level) && (self.visit)(at)
    }

    /// Whether no leaf of the searched levels in an octant can force the split.
    fn is_far(&self, at: &Octant) -> bool {
        let distance = self.octant.distance(at);
        distance > 0 && distance >= self.mesh.layer_reach(at.level.max(self.first))
    }
}
