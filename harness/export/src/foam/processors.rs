//! The distribution of cells to processor directories.
//!
//! Invariant: the cells of a processor are numbered from 0 in the order of all cells.

use super::tree::CELLS_MAX;

/// Cells distributed to processors.
#[derive(Debug)]
pub struct Distribution {
    /// Processor of each cell.
    processor: Vec<u32>,
    /// Number of each cell on its processor.
    number: Vec<u32>,
    /// All cells, sorted by processor.
    cells: Vec<u32>,
    /// End of each processor in `cells`.
    ends: Vec<usize>,
}

impl Distribution {
    /// `count` intervals of the curve.
    pub fn equal(cells: u32, count: u32) -> Self {
        let of = |cell: u32| u64::from(cell) * u64::from(count) / u64::from(cells);
        Self::new((0..cells).map(|cell| of(cell) as u32).collect(), count)
    }

    /// Cells on given processors, all of which are below `count`.
    pub fn new(processor: Vec<u32>, count: u32) -> Self {
        debug_assert!(processor.len() as u64 <= CELLS_MAX);
        let mut ends = vec![0; count as usize];
        let number = processor.iter().map(|&p| {
            ends[p as usize] += 1;
            ends[p as usize] as u32 - 1
        });
        let number = number.collect();
        let mut cells: Vec<u32> = (0..processor.len() as u32).collect();
        cells.sort_by_key(|&cell| processor[cell as usize]);
        let mut end = 0;
        for of_processor in &mut ends {
            end += *of_processor;
            *of_processor = end;
        }
        Self { processor, number, cells, ends }
    }

    /// Number of processors.
    pub fn processors(&self) -> u32 {
        self.ends.len() as u32
    }

    /// The cells of a processor, ascending.
    pub fn cells(&self, processor: u32) -> &[u32] {
        let begin = processor.checked_sub(1).map_or(0, |before| self.ends[before as usize]);
        &self.cells[begin..self.ends[processor as usize]]
    }

    /// Processor of a cell, and the cell's number there.
    pub fn place(&self, cell: u32) -> (u32, u32) {
        (self.processor[cell as usize], self.number[cell as usize])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cell_has_one_place() {
        let distribution = Distribution::new(vec![1, 0, 1, 3, 0], 4);
        for (processor, cells) in [(0, &[1, 4][..]), (1, &[0, 2]), (2, &[]), (3, &[3])] {
            assert_eq!(distribution.cells(processor), cells);
            for (number, &cell) in cells.iter().enumerate() {
                assert_eq!(distribution.place(cell), (processor, number as u32));
            }
        }
        let equal = Distribution::equal(10, 3);
        assert_eq!((0..3).map(|p| equal.cells(p).len()).collect::<Vec<_>>(), [4, 3, 3]);
    }
}
