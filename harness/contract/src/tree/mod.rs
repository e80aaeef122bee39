//! The leaves of a mesh as a tree that stores equal subtrees once.
//!
//! The tree is built in one pass over sorted words. A node consists of its eight children only and has neither
//! a position nor a level. Most leaves around a smooth surface lie in uniform runs, so a billion of them need a
//! small fraction of the memory of one node per octant. A walk that carries a [`Neighbourhood`] (an octant and
//! its 26 neighbours) finds the neighbours of every leaf without a search.
//!
//! Invariants: a node has at least one child that is not a hole; children are stored before their parents.

mod build;
mod neighbourhood;
mod region;
#[cfg(test)]
mod tests;

use build::Store;
pub use build::{Builder, Refusal};
pub use neighbourhood::{Neighbourhood, OFFSETS};
pub use region::{Coarsest, Region};

use crate::octant::{CELLS_PER_EDGE, Octant};
use crate::word;

/// The content of an octant: a hole, a leaf, part of a coarser leaf, a node, or outside the root.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct Handle(u32);

/// Kind of a leaf: the code of its side, or [`DELETED`].
pub type Kind = u8;
/// A deleted crossing leaf whose level is a lower bound, because it may have been refined before it was deleted.
pub const DELETED: Kind = 3;
/// Set of kinds, one bit each, and [`HOLES`].
pub type Kinds = u8;
/// Bit of [`Kinds`] that represents holes.
pub const HOLES: Kinds = 1 << 4;

const FIRST_LEAF: u32 = 4;
const FIRST_COARSER: u32 = 16;
const FIRST_NODE: u32 = 128;

impl Handle {
    /// No leaf.
    pub const HOLE: Self = Self(0);
    /// Outside the root.
    pub const OUTSIDE_ROOT: Self = Self(1);

    /// A leaf that coincides with the octant.
    pub fn leaf(kind: Kind) -> Self {
        Self(FIRST_LEAF + u32::from(kind))
    }

    /// Part of a leaf of a coarser level.
    fn coarser_leaf(kind: Kind, level: u8) -> Self {
        Self(FIRST_COARSER + 4 * u32::from(level) + u32::from(kind))
    }

    fn node(index: usize) -> Self {
        Self(FIRST_NODE + u32::try_from(index).expect("fewer than 2^32 distinct nodes"))
    }

    /// The kind, if a leaf coincides with the octant.
    pub fn as_leaf(self) -> Option<Kind> {
        (FIRST_LEAF..FIRST_COARSER).contains(&self.0).then(|| (self.0 - FIRST_LEAF) as Kind)
    }

    /// Kind and level of the leaf, if the octant is part of a coarser leaf.
    pub fn as_coarser_leaf(self) -> Option<(Kind, u8)> {
        let code = self.0.wrapping_sub(FIRST_COARSER);
        (code < FIRST_NODE - FIRST_COARSER).then_some(((code & 3) as Kind, (code >> 2) as u8))
    }

    /// Whether the octant is split.
    pub fn is_node(self) -> bool {
        self.0 >= FIRST_NODE
    }

    fn index(self) -> usize {
        (self.0 - FIRST_NODE) as usize
    }
}

/// Summary of the leaves below a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Summary {
    /// Largest number of levels from the node down to a leaf.
    finest: u8,
    /// Smallest number of levels from the node down to a leaf that is not deleted; `NO_LEAF` if there is none.
    coarsest: u8,
    kinds: Kinds,
}

/// A level, or number of levels, greater than that of any leaf.
pub const NO_LEAF: u8 = 100;

/// The leaves of a mesh as a tree.
#[derive(Debug, Default)]
pub struct Tree {
    store: Store,
    root: Handle,
}

impl Tree {
    /// The tree of sorted words. Words that are not leaves or that overlap an earlier leaf are omitted; the
    /// check `linear` reports them.
    pub fn of_words(words: &[u64]) -> Self {
        let mut builder = Builder::default();
        for &w in words {
            let _ = builder.push(w);
        }
        builder.finish()
    }

    /// The content of the root.
    pub fn root(&self) -> Handle {
        self.root
    }

    /// Number of distinct nodes.
    pub fn nodes(&self) -> usize {
        self.store.len()
    }

    /// The content of a child of an octant with content `of` at this level.
    pub fn child(&self, of: Handle, digit: u8, level: u8) -> Handle {
        if of.is_node() {
            self.store.children(of)[usize::from(digit)]
        } else if let Some(kind) = of.as_leaf() {
            Handle::coarser_leaf(kind, level)
        } else {
            of
        }
    }

    /// Level of the finest leaf in an octant with content `of` at this level; 0 if there is none.
    pub fn finest_level(&self, of: Handle, level: u8) -> u8 {
        if of.is_node() {
            level + self.store.summary(of).finest
        } else if of.as_leaf().is_some() {
            level
        } else {
            of.as_coarser_leaf().map_or(0, |(_, level)| level)
        }
    }

    /// Level of the coarsest leaf in an octant with content `of` at this level, deleted leaves excluded; at
    /// least [`NO_LEAF`] if there is none.
    pub fn coarsest_level(&self, of: Handle, level: u8) -> u8 {
        if of.is_node() {
            return level + self.store.summary(of).coarsest;
        }
        match (of.as_leaf(), of.as_coarser_leaf()) {
            (Some(kind), _) if kind != DELETED => level,
            (_, Some((kind, level))) if kind != DELETED => level,
            _ => NO_LEAF,
        }
    }

    /// The kinds of leaves in `of`, and [`HOLES`] if it has holes; the empty set outside the root.
    pub fn kinds(&self, of: Handle) -> Kinds {
        if of.is_node() {
            return self.store.summary(of).kinds;
        }
        match (of.as_leaf(), of.as_coarser_leaf()) {
            (Some(kind), _) | (_, Some((kind, _))) => 1 << kind,
            _ if of == Handle::HOLE => HOLES,
            _ => 0,
        }
    }

    /// Visits octants in Morton order, parents first: the root, and the children of nodes for which `enter` returns true.
    pub fn walk(&self, enter: &mut dyn FnMut(Octant, Handle) -> bool) {
        self.walk_below(Octant::ROOT, self.root, enter);
    }

    /// The same from an octant with content `of` on.
    pub fn walk_below(
        &self,
        octant: Octant,
        of: Handle,
        enter: &mut dyn FnMut(Octant, Handle) -> bool,
    ) {
        if enter(octant, of) && of.is_node() {
            for digit in 0..8 {
                let child = self.child(of, digit, octant.level);
                self.walk_below(octant.child(digit), child, enter);
            }
        }
    }

    /// What the tree has at an octant: a node, a leaf, or a hole. Within a leaf it is the leaf's handle.
    pub fn at(&self, octant: &Octant) -> Handle {
        let mut handle = self.root;
        for level in 1..=octant.level {
            if !handle.is_node() {
                break;
            }
            handle = self.child(handle, octant.ancestor(level).digit(), level - 1);
        }
        handle
    }

    /// The leaf that contains a level-19 cell, and its kind.
    pub fn locate(&self, cell: [u32; 3]) -> Option<(Octant, Kind)> {
        debug_assert!(cell.iter().all(|&c| c < CELLS_PER_EDGE));
        let key = word::key_of(cell);
        let (mut handle, mut octant) = (self.root, Octant::ROOT);
        while handle.is_node() {
            let digit = ((key / word::span(octant.level + 1)) & 7) as u8;
            handle = self.store.children(handle)[usize::from(digit)];
            octant = octant.child(digit);
        }
        handle.as_leaf().map(|kind| (octant, kind))
    }
}
