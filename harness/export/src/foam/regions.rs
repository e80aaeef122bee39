//! Regions of cells that are connected by faces.
//!
//! Cells that fill an octant are connected, so regions consist of [blocks](super::tree::Tree::blocks).

use std::cmp::Reverse;
use std::collections::BTreeMap;

use contract::word;

use super::tree::Tree;

/// Disjoint sets of blocks. A set is represented by its least block.
#[derive(Debug)]
pub struct Regions {
    parent: Vec<u32>,
}

/// Size of a region.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Size {
    /// Volume in level-19 cells.
    pub volume: u64,
    /// Number of cells.
    pub cells: u64,
}

impl Regions {
    /// Every block on its own.
    pub fn new(blocks: u32) -> Self {
        Self { parent: (0..blocks).collect() }
    }

    fn least(&mut self, mut block: u32) -> u32 {
        loop {
            let parent = self.parent[block as usize];
            if parent == block {
                return block;
            }
            let above = self.parent[parent as usize];
            self.parent[block as usize] = above;
            block = above;
        }
    }

    /// Joins the regions of two blocks.
    pub fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.least(a), self.least(b));
        self.parent[a.max(b) as usize] = a.min(b);
    }

    /// The regions by their least blocks, those of largest volume first.
    pub fn sizes(&mut self, tree: &Tree, blocks: &Tree) -> Vec<(u32, Size)> {
        let mut sizes: BTreeMap<u32, Size> = BTreeMap::new();
        tree.visit_blocks(blocks, &mut |block, level, cells| {
            let size = sizes.entry(self.least(block)).or_default();
            size.volume += word::span(level);
            size.cells += cells.len() as u64;
        });
        let mut sizes: Vec<_> = sizes.into_iter().collect();
        sizes.sort_by_key(|&(_, size)| Reverse(size));
        sizes
    }

    /// Whether each block is in the region of `block`.
    pub fn members(&mut self, block: u32) -> Vec<bool> {
        let region = self.least(block);
        (0..self.parent.len() as u32).map(|b| self.least(b) == region).collect()
    }
}
