//! Regions of cells that are connected by faces.

use std::cmp::Reverse;

use contract::sets::Sets;
use contract::word;

use crate::leaves::Leaves;
use crate::options::Options;
use crate::squares::squares;
use contract::failure::Failure;

/// The regions.
#[derive(Debug)]
pub struct Regions {
    /// Number of regions.
    pub count: usize,
    /// The first cell of the one with the largest volume, then the most cells.
    largest: u32,
    /// The first cell of each cell's region.
    of_cell: Vec<u32>,
}

impl Regions {
    /// The regions of the cells among leaves.
    ///
    /// # Errors
    /// If the user interrupts.
    pub fn new(leaves: &Leaves, options: &Options) -> Result<Self, Failure> {
        // Sets of cells, which are represented by their first cells.
        let mut sets = Sets::new(leaves.count() as usize);
        let mut squares_of = Vec::new();
        leaves.walk(options, &mut |cell, around| {
            squares(leaves, around, &mut squares_of);
            let high = squares_of.iter().filter(|square| square.is_high);
            for across in high.filter_map(|square| square.across.as_cell()) {
                sets.union(cell, across);
            }
            Ok(())
        })?;
        let of_cell: Vec<u32> = (0..leaves.count()).map(|cell| sets.root(cell)).collect();
        let mut sizes = vec![(0, 0); of_cell.len()];
        for (&set, word) in of_cell.iter().zip(leaves.cells()) {
            let (volume, cells) = &mut sizes[set as usize];
            (*volume, *cells) = (*volume + word::span(word::level(word)), *cells + 1);
        }
        let count = sizes.iter().filter(|size| size.1 > 0).count();
        let largest = (0..).zip(sizes).min_by_key(|&(_, size)| Reverse(size));
        Ok(Self { count, largest: largest.map_or(0, |(cell, _)| cell), of_cell })
    }

    /// Whether a cell belongs to the largest region.
    pub fn is_in_largest(&self, cell: u32) -> bool {
        self.of_cell[cell as usize] == self.largest
    }
}
