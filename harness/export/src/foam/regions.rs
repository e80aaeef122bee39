//! Regions of cells that are connected by faces.

use contract::word;
use rustc_hash::FxHashMap;

/// Disjoint sets of cells. A set is represented by its least cell.
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
    /// Every cell on its own.
    pub fn new(cells: u32) -> Self {
        Self { parent: (0..cells).collect() }
    }

    fn least(&mut self, mut cell: u32) -> u32 {
        loop {
            let parent = self.parent[cell as usize];
            if parent == cell {
                return cell;
            }
            let above = self.parent[parent as usize];
            self.parent[cell as usize] = above;
            cell = above;
        }
    }

    /// Joins the regions of two cells.
    pub fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.least(a), self.least(b));
        self.parent[a.max(b) as usize] = a.min(b);
    }

    /// The regions by their least cells. `words` are those of the cells.
    pub fn sizes(&mut self, words: &[u64]) -> Vec<(u32, Size)> {
        let mut sizes: FxHashMap<u32, Size> = FxHashMap::default();
        for (cell, &word) in (0..).zip(words) {
            let size = sizes.entry(self.least(cell)).or_default();
            size.volume += word::span(word::level(word));
            size.cells += 1;
        }
        let mut sizes: Vec<_> = sizes.into_iter().collect();
        sizes.sort_unstable_by_key(|&(least, _)| least);
        sizes
    }

    /// Whether each cell is in the region of `cell`.
    pub fn members(&mut self, cell: u32) -> Vec<bool> {
        let region = self.least(cell);
        (0..self.parent.len() as u32).map(|c| self.least(c) == region).collect()
    }
}
