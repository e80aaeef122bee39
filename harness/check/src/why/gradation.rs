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
//!
//! T0 is that of the case or, without one, where the crossing leaves of the mesh show it. If section 3 requires the split of an octant, it
//! requires the split of its ancestors. So the leaf of T0 at a point is the first octant on the way down that no rule splits.

use super::Mesh;
use crate::checks::truth::Truth;
use contract::manifest::{ExtentBox, Tree as MeshKind};
use contract::neighbourhood::OFFSETS;
use contract::octant::{LEVEL_MAX, Octant, UNITS_PER_CELL, edge_of};
use contract::tree::Handle;
use contract::word::{self, Side};
use std::ops::RangeInclusive;

/// The rule by which a leaf forces an octant to split (section 6 of reference/DEFINITION.md).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// The leaf is a deleted crossing leaf of T0, and the octant touches it.
    ExtraLayer,
    /// The layer of the leaf reaches the octant.
    Layer,
    /// The octant touches the leaf, which is at least two levels finer.
    Balance,
}

impl Mesh<'_> {
    /// Distance from a source of this level within which its layer reaches, in level-19 cells.
    pub(super) fn layer_reach(&self, level: u8) -> i64 {
        i64::from(self.inputs.layer_cells_min - 1) * edge_of(level)
    }

    /// Whether T0, the extra layer or a leaf at least two levels finer forces an octant to split.
    pub(super) fn is_deep(&self, octant: &Octant) -> bool {
        self.remembered(octant, true, || self.is_forced(octant, octant.level + 2))
    }

    /// Whether a rule requires an octant to be split.
    pub(super) fn is_justified(&self, octant: &Octant) -> bool {
        self.is_deep(octant)
            || self.remembered(octant, false, || {
                let level = octant.level + 1;
                self.leaf_that_forces(octant, level..=level.min(self.level_deepest)).is_some()
            })
    }

    /// Whether T0, the extra layer or a leaf of a level from `first` on forces an octant to split. The answer is not remembered: about a leaf it is
    /// asked once.
    pub(super) fn is_forced(&self, octant: &Octant, first: u8) -> bool {
        self.base_splits(octant)
            || self.extra_layer(octant).is_some()
            || self.leaf_that_forces(octant, first..=self.level_deepest).is_some()
    }

    /// Whether an octant is deep, or justified, which is sought once.
    fn remembered(&self, octant: &Octant, deep: bool, seek: impl Fn() -> bool) -> bool {
        let id = path_of(octant) << 1 | u64::from(deep);
        if let Some(&known) = self.known.borrow().get(&id) {
            return known;
        }
        let found = seek();
        self.known.borrow_mut().insert(id, found);
        found
    }

    /// The levels of sources in an octant with this content, as a mask that lacks none from `first` on, but may have others: of leaves whose parent
    /// is deep, also below a needless split, and all levels where crossing leaves were deleted.
    fn sources(&self, octant: &Octant, content: Handle, first: u8) -> u32 {
        if !content.is_node() {
            let is_deleted = content.as_leaf().is_none() && self.has_deleted_crossing();
            return if is_deleted && self.is_crossed(octant) { u32::MAX } else { 0 };
        }
        let (path, level) = (path_of(octant), octant.level);
        match self.sources.borrow().get(&path) {
            Some(&(from, levels)) if from <= first => return levels,
            _ => {}
        }
        let children =
            || (0..8).map(|digit| (octant.child(digit), self.tree.child(content, digit, level)));
        let below = children().fold(0, |all, (at, of)| all | self.sources(&at, of, first));
        // An octant that is split needlessly counts as a leaf.
        let is_leaf = |(at, of): (Octant, Handle)| !of.is_node() || !self.is_justified(&at);
        let has_own = level + 1 >= first && self.is_deep(octant) && children().any(is_leaf);
        let levels = below | u32::from(has_own) << (level + 1);
        self.sources.borrow_mut().insert(path, (first, levels));
        levels
    }

    /// The rule by which a finer leaf forces an octant to split.
    fn rule_of(&self, leaf: &Octant, octant: &Octant) -> Option<Rule> {
        let (from, distance) = (leaf.parent(), octant.distance(leaf));
        if distance < self.layer_reach(leaf.level) && self.is_deep(&from) {
            return Some(Rule::Layer);
        }
        let may_balance = leaf.level > octant.level + 1 && distance == 0;
        (may_balance && self.is_justified(&from)).then_some(Rule::Balance)
    }

    /// The first leaf of these levels outside an octant that forces it to split, with the rule. The order is fixed.
    pub(super) fn leaf_that_forces(
        &self,
        octant: &Octant,
        levels: RangeInclusive<u8>,
    ) -> Option<(Rule, Octant)> {
        // T0 precedes gradation.
        if self.inputs.tree == MeshKind::Base || levels.is_empty() {
            return None;
        }
        let (first, last) = (*levels.start(), *levels.end());
        let search = Search { mesh: self, octant, first, last };
        let is_wide = |&level: &u8| edge_of(level) >= self.layer_reach(first);
        let centre = octant.ancestor((1..=octant.level).rev().find(is_wide).unwrap_or(0));
        OFFSETS.iter().filter_map(|&offset| centre.neighbour(offset)).find_map(|start| {
            // A leaf of the octant's level or a coarser one contains no leaf that is sought.
            let found = Some(self.tree.at(&start)).filter(|handle| handle.is_node());
            search.enter(start, found.unwrap_or(Handle::HOLE), false)
        })
    }

    /// Whether the surface crosses an octant that is a leaf of T0 or contains some. Without facets the answer holds for octants coarser
    /// than D only: such an octant contains a crossing leaf iff a facet crosses it.
    pub(super) fn is_crossed(&self, octant: &Octant) -> bool {
        let tree = self.body.map_or(self.tree, |truth| &truth.tree);
        tree.kinds(tree.at(octant)) & 1 << Side::Crossing as u8 != 0
    }

    /// Whether T0 splits an octant.
    pub(super) fn base_splits(&self, octant: &Octant) -> bool {
        match self.body {
            Some(truth) => truth.tree.at(octant).is_node(),
            None => {
                octant.level < LEVEL_MAX
                    && (self.inputs.box_that_splits(octant).is_some()
                        || octant.level < self.inputs.level_surface && self.is_crossed(octant))
            }
        }
    }

    /// The facets that cross an octant, ascending; empty if facets are not known.
    pub(super) fn facets_of(&self, octant: &Octant) -> Vec<u32> {
        let Some(Truth { facets, .. }) = self.body else { return Vec::new() };
        facets.meeting(&facets.all(), octant, 0).collect()
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
        !self.inputs.keep_crossing && self.body.is_some()
    }

    /// A crossing leaf of T0 that by touching an octant forces it to split: the extra layer of section 6.
    pub(super) fn extra_layer(&self, octant: &Octant) -> Option<Octant> {
        let applies = self.has_deleted_crossing() && self.inputs.layer_cells_min < 3;
        if !applies || octant.level >= self.inputs.level_surface || self.base_splits(octant) {
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

/// The bits of an octant's path after a one: the hash needs low bits that differ.
fn path_of(octant: &Octant) -> u64 {
    (1 << 57 | word::key_of(octant.corner)) >> (3 * (LEVEL_MAX - octant.level))
}

/// A search for a leaf of levels `first` to `last` that forces an octant to split.
struct Search<'a> {
    mesh: &'a Mesh<'a>,
    octant: &'a Octant,
    first: u8,
    last: u8,
}

impl Search<'_> {
    /// Searches an octant with this content. `in_deleted` states that it lies in a crossing leaf of T0 that was deleted.
    fn enter(&self, at: Octant, handle: Handle, in_deleted: bool) -> Option<(Rule, Octant)> {
        let is_hole = !handle.is_node() && handle.as_leaf().is_none();
        let distance = self.octant.distance(&at);
        // No leaf of the searched levels in it can force the split.
        let is_far = distance > 0 && distance >= self.mesh.layer_reach(at.level.max(self.first));
        match () {
            () if at == *self.octant || is_far => None,
            () if is_hole && !self.mesh.has_deleted_crossing() => None,
            () if is_hole => self.hole(at, handle, in_deleted),
            () if handle.is_node() && self.counts_as_split(&at) => {
                let may_force = distance == 0 || self.reaches(&at, handle, distance);
                may_force.then(|| self.descend(&at, handle, false)).flatten()
            }
            () => self.leaf(at),
        }
    }

    /// Whether a source in an octant that does not touch the one in question may be near enough.
    fn reaches(&self, at: &Octant, content: Handle, distance: i64) -> bool {
        let sources = self.mesh.sources(at, content, self.first);
        let is_near = |l: u8| sources >> l & 1 != 0 && distance < self.mesh.layer_reach(l);
        (self.first..=self.last).any(is_near)
    }

    fn descend(&self, at: &Octant, content: Handle, in_deleted: bool) -> Option<(Rule, Octant)> {
        let child = |digit| self.mesh.tree.child(content, digit, at.level);
        let digits = if at.level < self.last { 0..8 } else { 0..0 };
        digits.into_iter().find_map(|d| self.enter(at.child(d), child(d), in_deleted))
    }

    /// Searches an octant without leaves for deleted crossing leaves.
    fn hole(&self, at: Octant, content: Handle, in_deleted: bool) -> Option<(Rule, Octant)> {
        if !in_deleted {
            match self.mesh.base_leaf(&at) {
                None if self.mesh.is_crossed(&at) => return self.descend(&at, content, false),
                Some(leaf) if self.mesh.is_crossed(&leaf) => {}
                _ => return None,
            }
        }
        match self.is_near_box(&at) && self.counts_as_split(&at) {
            true => self.descend(&at, content, true),
            false => self.leaf(at),
        }
    }

    /// Whether a box may be the cause that an octant of level p in a crossing leaf of T0 is split. A leaf of level l > p that forces the split is nearer
    /// than n - 1 cells of level l, or touches the octant. Its parent, 2 cells of level l wide, meets such a box or is itself forced to split by
    /// finer leaves, so all steps together are at most (n + 1) (1/2 + 1/4 + ...) = n + 1 cells of level p.
    fn is_near_box(&self, at: &Octant) -> bool {
        let inputs = &self.mesh.inputs;
        let reach = (i64::from(inputs.layer_cells_min) + 1) * edge_of(at.level) * UNITS_PER_CELL;
        let near = |b: &ExtentBox| {
            let (min, max) = (b.min.map(|q| q - reach), b.max.map(|q| q + reach));
            ExtentBox { min, max, ..*b }.meets(at)
        };
        inputs.boxes.iter().any(|b| b.level > at.level && near(b))
    }

    /// Whether an octant is split before the step that is asked about. Above the parents of the leaves that are
    /// searched, this need not be known: a leaf is visited only if its own parent is split.
    fn counts_as_split(&self, at: &Octant) -> bool {
        match () {
            () if at.level >= self.mesh.level_deepest => false,
            () if at.level + 1 < self.first => true,
            () if at.level == self.octant.level => self.mesh.is_deep(at),
            () => self.mesh.is_justified(at),
        }
    }

    fn leaf(&self, at: Octant) -> Option<(Rule, Octant)> {
        let is_sought = (self.first..=self.last).contains(&at.level);
        is_sought.then(|| self.mesh.rule_of(&at, self.octant)).flatten().map(|rule| (rule, at))
    }
}
