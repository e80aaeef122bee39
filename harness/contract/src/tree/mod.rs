//! Leaves as a tree in which equal subtrees are stored once.
//!
//! Built in one pass over sorted words. A node is nothing but its eight children; it knows neither
//! its place nor its level, so that a billion leaves around a smooth surface, most of them in
//! uniform runs, fit in a small part of the memory that one node per octant would take. Walking it
//! with a [`Hood`] (an octant and what surrounds it) gives every leaf its neighbours without any
//! search.
//!
//! Invariants: a node has at least one child that is not a hole; children precede parents.

mod build;
mod hood;
mod region;
mod store;
mod walk;

pub use build::{Builder, Refusal};
pub use hood::{Hood, OFFSETS};
pub use region::{Coarsest, Region};
use store::Store;
pub use walk::walk;

use crate::octant::{CELLS_PER_EDGE, Octant};
use crate::word;

/// What is at a place of the tree: nothing, a leaf, or a node.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct Handle(u32);

/// What sort of leaf: the side's code, or [`GHOST`].
pub type Kind = u8;
/// A deleted crossing leaf that may have been refined before it was deleted: at least this fine.
pub const GHOST: Kind = 3;
/// Set of kinds, one bit each; [`HOLES`] stands for holes.
pub type Kinds = u8;
/// The bit of holes in [`Kinds`].
pub const HOLES: Kinds = 1 << 4;

const FIRST_LEAF: u32 = 4;
const FIRST_WIDE: u32 = 16;
const FIRST_NODE: u32 = 128;

impl Handle {
    /// No leaf here.
    pub const HOLE: Self = Self(0);
    /// Not in the root.
    pub const BEYOND: Self = Self(1);

    /// A leaf that is exactly here.
    pub fn leaf(kind: Kind) -> Self {
        Self(FIRST_LEAF + u32::from(kind))
    }

    /// Part of a leaf of a coarser level.
    fn wide(kind: Kind, level: u8) -> Self {
        Self(FIRST_WIDE + 4 * u32::from(level) + u32::from(kind))
    }

    fn node(index: usize) -> Self {
        Self(FIRST_NODE + u32::try_from(index).expect("fewer than 2^32 distinct nodes"))
    }

    /// The kind, if this is a leaf that is exactly here.
    pub fn as_leaf(self) -> Option<Kind> {
        (FIRST_LEAF..FIRST_WIDE).contains(&self.0).then(|| (self.0 - FIRST_LEAF) as Kind)
    }

    /// Kind and level, if this is part of a coarser leaf.
    pub fn as_wide(self) -> Option<(Kind, u8)> {
        let code = self.0.wrapping_sub(FIRST_WIDE);
        (code < FIRST_NODE - FIRST_WIDE).then_some(((code & 3) as Kind, (code >> 2) as u8))
    }

    /// Whether this is split further.
    pub fn is_node(self) -> bool {
        self.0 >= FIRST_NODE
    }

    fn index(self) -> usize {
        (self.0 - FIRST_NODE) as usize
    }
}

/// What is below a node, in one look.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Summary {
    /// Most levels from here down to a leaf.
    finest: u8,
    /// Fewest levels from here down to a leaf other than a ghost; `NO_LEAF` if there is none.
    coarsest: u8,
    kinds: Kinds,
}

/// A level (or number of levels) that no leaf has.
pub const NO_LEAF: u8 = 100;

/// The leaves of a mesh as a tree.
#[derive(Debug, Default)]
pub struct Tree {
    store: Store,
    root: Handle,
}

impl Tree {
    /// The tree of sorted words. Words that are no leaves or overlap one before them are left out:
    /// they are for `linear` to report.
    pub fn of_words(words: &[u64]) -> Self {
        let mut builder = Builder::default();
        for &w in words {
            let _ = builder.push(w);
        }
        builder.finish()
    }

    /// The whole.
    pub fn root(&self) -> Handle {
        self.root
    }

    /// Distinct nodes stored.
    pub fn nodes(&self) -> usize {
        self.store.len()
    }

    /// The child of whatever is at an octant of this level.
    pub fn child(&self, of: Handle, digit: u8, level: u8) -> Handle {
        if of.is_node() {
            self.store.children(of)[usize::from(digit)]
        } else if let Some(kind) = of.as_leaf() {
            Handle::wide(kind, level)
        } else {
            of
        }
    }

    /// Deepest level of a leaf in `of`, which is at an octant of this level; 0 if there is none.
    pub fn finest_level(&self, of: Handle, level: u8) -> u8 {
        if of.is_node() {
            level + self.store.summary(of).finest
        } else if of.as_leaf().is_some() {
            level
        } else {
            of.as_wide().map_or(0, |(_, level)| level)
        }
    }

    /// Level of the coarsest leaf other than a ghost in `of`; [`NO_LEAF`] or more if there is none.
    pub fn coarsest_level(&self, of: Handle, level: u8) -> u8 {
        if of.is_node() {
            return level + self.store.summary(of).coarsest;
        }
        match (of.as_leaf(), of.as_wide()) {
            (Some(kind), _) if kind != GHOST => level,
            (_, Some((kind, level))) if kind != GHOST => level,
            _ => NO_LEAF,
        }
    }

    /// The kinds of leaves in `of`, and whether there are holes. Beyond the root there is nothing
    /// at all.
    pub fn kinds(&self, of: Handle) -> Kinds {
        if of.is_node() {
            return self.store.summary(of).kinds;
        }
        match (of.as_leaf(), of.as_wide()) {
            (Some(kind), _) | (_, Some((kind, _))) => 1 << kind,
            _ if of == Handle::HOLE => HOLES,
            _ => 0,
        }
    }

    /// The leaf that holds a level-19 cell, and its kind.
    pub fn locate(&self, cell: [u32; 3]) -> Option<(Octant, Kind)> {
        debug_assert!(cell.iter().all(|&c| c < CELLS_PER_EDGE));
        let key = word::key_of(cell);
        let (mut at, mut octant) = (self.root, Octant::ROOT);
        while at.is_node() {
            let digit = ((key / word::span(octant.level + 1)) & 7) as u8;
            at = self.store.children(at)[usize::from(digit)];
            octant = octant.child(digit);
        }
        at.as_leaf().map(|kind| (octant, kind))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{octants_of, random_words, words_of};
    use proptest::prelude::*;

    #[test]
    fn equal_subtrees_are_stored_once() {
        let level_4 = words_of(|octant| octant.level < 4);
        let tree = Tree::of_words(&level_4);
        assert_eq!(level_4.len(), 4096);
        assert_eq!(tree.nodes(), 4);
        assert_eq!(tree.finest_level(tree.root(), 0), 4);
        assert_eq!(tree.coarsest_level(tree.root(), 0), 4);
    }

    proptest! {
        /// Every cell is found in the leaf that a linear search finds.
        #[test]
        fn cells_are_found_where_they_are(words in random_words(4), cells in prop::collection::vec(any::<[u32; 3]>(), 50)) {
            let tree = Tree::of_words(&words);
            for cell in cells {
                let cell = cell.map(|c| c % CELLS_PER_EDGE);
                let holds = |w: &&u64| word::octant(**w).contains(&Octant { corner: cell, level: 19 });
                let want = words.iter().find(holds).map(|&w| (word::octant(w), (w & 3) as Kind));
                prop_assert_eq!(tree.locate(cell), want);
            }
        }

        /// A hood's 27 handles are what a search for each neighbour finds.
        #[test]
        fn hoods_hold_the_neighbours(words in random_words(3)) {
            let tree = Tree::of_words(&words);
            for octant in octants_of(&words) {
                let hood = Hood::at(&tree, octant);
                for (i, by) in OFFSETS.iter().enumerate() {
                    let handle = hood.around[i];
                    let Some(neighbour) = octant.neighbour(*by) else {
                        prop_assert_eq!(handle, Handle::BEYOND);
                        continue;
                    };
                    let inside: Vec<_> = words.iter().filter(|&&w| neighbour.contains(&word::octant(w))).collect();
                    let above = words.iter().find(|&&w| word::octant(w).contains(&neighbour));
                    if let Some(&w) = above {
                        let (level, kind) = (word::level(w), (w & 3) as Kind);
                        let want = if level == octant.level { Handle::leaf(kind) } else { Handle::wide(kind, level) };
                        prop_assert_eq!(handle, want);
                    } else if inside.is_empty() {
                        prop_assert_eq!(handle, Handle::HOLE);
                    } else {
                        prop_assert!(handle.is_node());
                        let levels = inside.iter().map(|&&w| word::level(w));
                        prop_assert_eq!(tree.finest_level(handle, octant.level), levels.clone().max().unwrap());
                        prop_assert_eq!(tree.coarsest_level(handle, octant.level), levels.min().unwrap());
                    }
                }
            }
        }
    }
}
