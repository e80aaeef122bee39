//! Leaves of any octant, without those before it.
//!
//! The children of a node begin at eight times the number of split nodes before it on its level.

use super::{Result, TreeFile, Walk};
use crate::word::{self, KEY_END};

/// Reads the leaves of octants. Each one has buffers of its own, so every thread should have its own cursor.
pub struct Cursor<'a> {
    tree: &'a TreeFile,
    walk: Walk<'a>,
}

/// A descent from the root.
struct Descent {
    /// The first node of each level that does not precede the key.
    next: Vec<u64>,
    /// Number of leaves that begin before the key.
    before: u64,
    /// The level at which the descent met a leaf.
    leaf: usize,
}

impl<'a> Cursor<'a> {
    /// A cursor for a tree.
    pub fn new(tree: &'a TreeFile) -> Self {
        Self { tree, walk: Walk::new(tree, tree.file.ranks.as_ref()) }
    }

    /// Number of leaves whose Morton codes are less than `key`.
    pub fn leaves_before(&self, key: u64) -> u64 {
        // There is no octant at the end of the root.
        if key >= KEY_END { self.tree.leaves } else { self.descend(key).before }
    }

    /// Appends the words of the leaves of an octant, given by its Morton code and level; if a coarser leaf begins there, that one. If the tree
    /// has ranks, appends those of the leaves.
    ///
    /// # Errors
    /// If the file is damaged.
    pub fn words(
        &mut self,
        key: u64,
        level: u8,
        into: &mut Vec<u64>,
        ranks_into: &mut Vec<u32>,
    ) -> Result<()> {
        let Descent { next, leaf, .. } = self.descend(key);
        let from = leaf.min(usize::from(level));
        if !key.is_multiple_of(word::span(from as u8)) {
            return Ok(());
        }
        self.walk.seek(&next);
        let mut run = |words: &[u64], ranks: &[u32]| {
            into.extend_from_slice(words);
            ranks_into.extend_from_slice(ranks);
            true
        };
        let result = self.walk.siblings(from, key, 1, &mut run);
        self.walk.flush(&mut run);
        result.map(drop)
    }

    fn descend(&self, key: u64) -> Descent {
        let TreeFile { levels, split, masked, .. } = self.tree;
        let mut descent = Descent { next: Vec::new(), before: 0, leaf: levels.len() };
        let mut number = 0;
        for (level, nodes) in levels.iter().enumerate() {
            let mut node = nodes.start + number;
            if level <= descent.leaf && split.get(node, 1) == 0 {
                descent.leaf = level;
                let starts_before = !key.is_multiple_of(word::span(level as u8));
                node += u64::from(starts_before);
            }
            let splits = split.ones_before(node) - split.ones_before(nodes.start);
            let holes = masked.ones_before(node) - masked.ones_before(nodes.start);
            descent.before += node - nodes.start - splits - holes;
            descent.next.push(node);
            number = 8 * splits;
            if level < descent.leaf {
                number += (key / word::span(level as u8 + 1)) & 7;
            }
        }
        descent
    }
}
