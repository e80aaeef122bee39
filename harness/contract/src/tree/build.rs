//! Construction of a tree from sorted leaves, in one pass.

use super::{DELETED, HOLES, Handle, Kind, NO_LEAF, Summary, Tree};
use crate::octant::LEVEL_MAX;
use crate::word;
use hashbrown::HashTable;
use hashbrown::hash_table::Entry;
use rustc_hash::FxBuildHasher;
use std::hash::BuildHasher;

/// Builds a tree from leaves in ascending order of their keys.
///
/// The octants from the root to the parent of the last leaf are open, one per level. An octant is closed, and
/// its node is stored, as soon as a leaf follows that lies outside it.
#[derive(Debug, Default)]
pub struct Builder {
    store: Store,
    path: [[Handle; 8]; LEVEL_MAX as usize],
    /// Number of open octants: `path[..open]` is in use.
    open: usize,
    /// Key of the last leaf, which determines the open octants.
    key: u64,
    /// End of the key range of the last leaf.
    end: u64,
    root: Handle,
}

/// Why a leaf was rejected.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// The word is not a leaf.
    Fault(String),
    /// The leaf overlaps an earlier leaf, or is not in ascending order.
    Overlap,
}

impl Builder {
    /// Adds a leaf word.
    ///
    /// # Errors
    /// If it is rejected; the tree is unchanged.
    pub fn push(&mut self, word: u64) -> Result<(), Refusal> {
        match word::fault(word) {
            Some(why) => Err(Refusal::Fault(why)),
            None => self.push_leaf(word::key(word), word::level(word), (word & 3) as Kind),
        }
    }

    /// Adds a leaf of any kind, [`DELETED`](super::DELETED) included.
    ///
    /// # Errors
    /// If it is rejected; the tree is unchanged.
    pub fn push_leaf(&mut self, key: u64, level: u8, kind: Kind) -> Result<(), Refusal> {
        if key < self.end {
            return Err(Refusal::Overlap);
        }
        self.end = key + word::span(level);
        let leaf = Handle::leaf(kind);
        if level == 0 {
            self.root = leaf;
            return Ok(());
        }
        let parent = usize::from(level) - 1;
        self.close_down_to(shared_levels(self.key, key));
        self.key = key;
        while self.open <= parent {
            self.path[self.open] = [Handle::HOLE; 8];
            self.open += 1;
        }
        self.path[parent][digit(key, parent)] = leaf;
        Ok(())
    }

    /// Closes open octants until at most `levels` are open.
    fn close_down_to(&mut self, levels: usize) {
        while self.open > levels {
            self.open -= 1;
            let node = self.store.intern(self.path[self.open]);
            match self.open.checked_sub(1) {
                Some(parent) => self.path[parent][digit(self.key, parent)] = node,
                None => self.root = node,
            }
        }
    }

    /// Number of distinct nodes so far.
    pub fn nodes(&self) -> usize {
        self.store.len()
    }

    /// The tree of all leaves added.
    pub fn finish(mut self) -> Tree {
        self.close_down_to(0);
        Tree { store: self.store, root: self.root }
    }
}

/// Number of common ancestors of two level-19 cells, themselves excluded.
fn shared_levels(a: u64, b: u64) -> usize {
    match (a ^ b).checked_ilog2() {
        Some(bit) => usize::from(LEVEL_MAX) - bit as usize / 3,
        None => usize::from(LEVEL_MAX),
    }
}

/// The digit of the child that contains this cell, among the children of its ancestor at `level`.
fn digit(key: u64, level: usize) -> usize {
    (key >> (3 * (usize::from(LEVEL_MAX) - 1 - level)) & 7) as usize
}

/// All nodes of a tree.
#[derive(Debug, Default)]
pub(super) struct Store {
    children: Vec<[Handle; 8]>,
    summaries: Vec<Summary>,
    /// The indices of all nodes, by the hash of their children.
    indices: HashTable<u32>,
}

impl Store {
    pub(super) fn len(&self) -> usize {
        self.children.len()
    }

    pub(super) fn children(&self, of: Handle) -> &[Handle; 8] {
        &self.children[of.index()]
    }

    pub(super) fn summary(&self, of: Handle) -> Summary {
        self.summaries[of.index()]
    }

    /// The node with these children, which is stored if it is new.
    pub(super) fn intern(&mut self, children: [Handle; 8]) -> Handle {
        let (all, hash) = (&self.children, |node: &[Handle; 8]| FxBuildHasher.hash_one(node));
        let is_same = |&index: &u32| all[index as usize] == children;
        match self.indices.entry(hash(&children), is_same, |&index| hash(&all[index as usize])) {
            Entry::Occupied(known) => Handle::node(*known.get() as usize),
            Entry::Vacant(vacant) => {
                let index = all.len();
                vacant.insert(u32::try_from(index).expect("fewer than 2^32 nodes"));
                self.summaries.push(self.summarise(&children));
                self.children.push(children);
                Handle::node(index)
            }
        }
    }

    fn summarise(&self, children: &[Handle; 8]) -> Summary {
        let mut all = Summary { finest: 0, coarsest: NO_LEAF, kinds: 0 };
        for &child in children {
            let below = self.summary_of_child(child);
            all.finest = all.finest.max(below.finest);
            all.coarsest = all.coarsest.min(below.coarsest);
            all.kinds |= below.kinds;
        }
        all
    }

    /// The contribution of a child to its parent's summary, one level deeper.
    fn summary_of_child(&self, child: Handle) -> Summary {
        if child.is_node() {
            let Summary { finest, coarsest, kinds } = self.summary(child);
            let coarsest = if coarsest == NO_LEAF { NO_LEAF } else { coarsest + 1 };
            return Summary { finest: finest + 1, coarsest, kinds };
        }
        match child.as_leaf() {
            Some(DELETED) => Summary { finest: 1, coarsest: NO_LEAF, kinds: 1 << DELETED },
            Some(kind) => Summary { finest: 1, coarsest: 1, kinds: 1 << kind },
            None => Summary { finest: 0, coarsest: NO_LEAF, kinds: HOLES },
        }
    }
}
