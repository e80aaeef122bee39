//! Distinct nodes, and the hash table that finds equal ones.
//!
//! The entries of the table are indices into `children`: a standard map would store every node twice.

use super::{DELETED, HOLES, Handle, NO_LEAF, Summary};
use hashbrown::HashTable;
use hashbrown::hash_table::Entry;
use rustc_hash::FxBuildHasher;
use std::hash::BuildHasher;

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

    pub(super) fn all(&self) -> &[[Handle; 8]] {
        &self.children
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
