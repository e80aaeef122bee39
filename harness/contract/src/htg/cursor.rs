//! Leaves of any octant, without those before it.
//!
//! The children of a node begin at eight times the number of split nodes before it on its level, which the [`Index`] gives.

use super::index::Index;
use super::{Result, TreeFile, Walk, nodes};
use crate::octant::LEVEL_MAX;
use crate::word::{self, KEY_END};

/// Reads the leaves of octants. Each one has buffers of its own, so every thread should have its own cursor.
pub struct Cursor<'a> {
    index: &'a Index,
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
    /// A cursor for a tree and its index.
    pub fn new(tree: &'a TreeFile, index: &'a Index) -> Self {
        let ranks = tree.file.ranks.as_ref();
        let levels =
            (0..tree.file.shape.nodes.len()).map(|level| tree.level(level, ranks)).collect();
        Self { index, walk: Walk::new(levels) }
    }

    /// Number of leaves of the tree.
    pub fn leaves(&self) -> u64 {
        self.index.leaves
    }

    /// Number of leaves whose Morton codes are less than `key`.
    ///
    /// # Errors
    /// If the file is damaged.
    pub fn leaves_before(&mut self, key: u64) -> Result<u64> {
        // There is no octant at the end of the root.
        if key >= KEY_END { Ok(self.index.leaves) } else { Ok(self.descend(key)?.before) }
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
        let Descent { next, leaf, .. } = self.descend(key)?;
        let from = leaf.min(usize::from(level));
        for (reader, next) in self.walk.levels.iter_mut().zip(next).skip(from) {
            reader.seek(next);
        }
        if !key.is_multiple_of(word::span(from as u8)) {
            return Ok(());
        }
        let mut run = |words: &[u64], ranks: &[u32]| {
            into.extend_from_slice(words);
            ranks_into.extend_from_slice(ranks);
            true
        };
        let result = self.walk.siblings(from, key, 1, &mut run);
        self.walk.flush(&mut run);
        result.map(drop)
    }

    fn descend(&mut self, key: u64) -> Result<Descent> {
        let mut descent = Descent { next: Vec::new(), before: 0, leaf: self.walk.levels.len() };
        let mut number = 0;
        for (level, reader) in self.walk.levels.iter_mut().enumerate() {
            let is_on_path = level <= descent.leaf;
            let mut node = reader.begin() + number;
            if is_on_path && !reader.is_split(node)? {
                descent.leaf = level;
                let starts_before = !key.is_multiple_of(word::span(level as u8));
                node += u64::from(starts_before);
            }
            let [split, masked] = reader.bits_before(node, self.index)?;
            let Some(leaves) = (node - reader.begin()).checked_sub(split + masked) else {
                return nodes(format!("nodes of level {level} are split and masked"));
            };
            descent.before += leaves;
            descent.next.push(node);
            number = 8 * split;
            if level < descent.leaf && level < usize::from(LEVEL_MAX) {
                number += (key / word::span(level as u8 + 1)) & 7;
            }
        }
        Ok(descent)
    }
}
