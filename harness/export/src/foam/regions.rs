//! Regions of cells that are connected by faces.

use std::cmp::Reverse;

use contract::sets::Sets;
use contract::word;

use super::leaves::Leaves;
use super::squares::squares;
use crate::options::Options;
use contract::failure::Failure;

/// The regions.
#[derive(Debug)]
pub struct Regions {
    /// The first cell of each region, and its size; the largest regions come first, by volume.
    pub sizes: Vec<(u32, Size)>,
    /// The first cell of each cell's region.
    pub of_cell: Vec<u32>,
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
    /// The regions of the cells among leaves.
    ///
    /// # Errors
    /// If the user interrupts.
    pub fn new(leaves: &Leaves, options: &Options) -> Result<Self, Failure> {
        // Sets of cells, which are represented by their first cells.
        let mut sets = Sets::new(leaves.count() as usize);
        let mut of_cell = Vec::new();
        leaves.walk(options, &mut |cell, around| {
            squares(leaves, around, &mut of_cell);
            let high = of_cell.iter().filter(|square| square.is_high);
            for across in high.filter_map(|square| square.across.as_cell()) {
                sets.union(cell, across);
            }
            Ok(())
        })?;
        let of_cells: Vec<u32> = (0..leaves.count()).map(|cell| sets.root(cell)).collect();
        let mut sizes = vec![Size::default(); of_cells.len()];
        for (&set, word) in of_cells.iter().zip(leaves.cells()) {
            sizes[set as usize].volume += word::span(word::level(word));
            sizes[set as usize].cells += 1;
        }
        let mut sizes: Vec<(u32, Size)> =
            (0..).zip(sizes).filter(|(_, size)| size.cells > 0).collect();
        sizes.sort_by_key(|&(_, size)| Reverse(size));
        Ok(Self { sizes, of_cell: of_cells })
    }
}
