//! From sorted leaves to a tree, in one pass.

use super::store::Store;
use super::{Handle, Kind, Tree};
use crate::octant::LEVEL_MAX;
use crate::word::{self, WordError};

/// Takes leaves in ascending order of their keys.
///
/// Open are the octants between the root and the last leaf's parent, one per level; an octant is
/// closed, and its node found or made, when the next leaf lies beyond it.
#[derive(Debug, Default)]
pub struct Builder {
    store: Store,
    path: [[Handle; 8]; LEVEL_MAX as usize],
    /// Levels open: `path[..open]` are in use.
    open: usize,
    /// Key of the last leaf, which says where the open octants are.
    key: u64,
    /// Where the last leaf ends.
    end: u64,
    root: Handle,
}

/// Why a leaf was left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// Not a leaf word.
    Fault(WordError),
    /// Overlaps an earlier leaf, or comes before it.
    Overlap,
}

impl Builder {
    /// Adds a leaf word.
    pub fn push(&mut self, word: u64) -> Result<(), Refusal> {
        match word::fault(word) {
            Some(why) => Err(Refusal::Fault(why)),
            None => self.push_leaf(word::key(word), word::level(word), (word & 3) as Kind),
        }
    }

    /// Adds a leaf of any kind, ghosts among them.
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

    /// Closes open octants until at most `levels` of them are left.
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

    /// Distinct nodes so far.
    pub fn nodes(&self) -> usize {
        self.store.len()
    }

    /// The tree of all leaves added.
    pub fn finish(mut self) -> Tree {
        self.close_down_to(0);
        Tree { store: self.store, root: self.root }
    }
}

/// How many octants, from the root down, two level-19 cells share, not counting the cells themselves.
fn shared_levels(a: u64, b: u64) -> usize {
    match (a ^ b).checked_ilog2() {
        Some(bit) => usize::from(LEVEL_MAX) - bit as usize / 3,
        None => usize::from(LEVEL_MAX),
    }
}

/// Which child of the level-`level` octant above it holds this cell.
fn digit(key: u64, level: usize) -> usize {
    (key >> (3 * (usize::from(LEVEL_MAX) - 1 - level)) & 7) as usize
}
