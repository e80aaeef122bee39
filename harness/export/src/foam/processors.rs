//! The distribution of cells to processors, or to the ranks that wrote them.
//!
//! It consists of runs of consecutive cells: few, because parts of a mesh are intervals of the Morton curve or made of large octants.
//!
//! Invariants: consecutive runs are on different processors, and none is empty; the cells of a processor are numbered from 0 in the
//! order of all cells.

use std::ops::Range;

/// Cells distributed to processors.
#[derive(Clone, Debug)]
pub struct Distribution {
    runs: Vec<Run>,
    /// Number of cells of each processor.
    counts: Vec<u32>,
    /// Number of all cells.
    cells: u32,
}

#[derive(Clone, Copy, Debug)]
struct Run {
    /// The first cell.
    first: u32,
    processor: u32,
    /// Number of the first cell on its processor.
    number: u32,
}

impl Distribution {
    /// No cells on `count` processors.
    pub fn new(count: u32) -> Self {
        Self { runs: Vec::new(), counts: vec![0; count as usize], cells: 0 }
    }

    /// `count` intervals of the curve.
    pub fn equal(cells: u32, count: u32) -> Self {
        let begin = |p: u32| (u64::from(p) * u64::from(cells)).div_ceil(u64::from(count)) as u32;
        let mut distribution = Self::new(count);
        (0..count).for_each(|p| distribution.push(p, begin(p + 1) - begin(p)));
        distribution
    }

    /// Adds the next cells.
    pub fn push(&mut self, processor: u32, cells: u32) {
        let number = &mut self.counts[processor as usize];
        if cells > 0 && self.runs.last().is_none_or(|last| last.processor != processor) {
            self.runs.push(Run { first: self.cells, processor, number: *number });
        }
        *number += cells;
        self.cells += cells;
    }

    /// The distribution of the cells in ascending intervals, which are renumbered. `visit` calls its argument for each.
    pub fn retain(&self, visit: impl FnOnce(&mut dyn FnMut(Range<u32>))) -> Self {
        let mut retained = Self::new(self.processors());
        visit(&mut |Range { mut start, end }| {
            while start < end {
                let run = self.run(start);
                let end_of_run = self.cells_of(run).end.min(end);
                retained.push(self.runs[run].processor, end_of_run - start);
                start = end_of_run;
            }
        });
        retained
    }

    /// Number of processors.
    pub fn processors(&self) -> u32 {
        self.counts.len() as u32
    }

    /// Number of cells of a processor.
    pub fn count(&self, processor: u32) -> u32 {
        self.counts[processor as usize]
    }

    /// The cells of a processor, in ascending intervals.
    pub fn cells(&self, processor: u32) -> impl Iterator<Item = Range<u32>> {
        let runs = (0..self.runs.len()).filter(move |&run| self.runs[run].processor == processor);
        runs.map(|run| self.cells_of(run))
    }

    /// Processor of a cell, and the cell's number there.
    pub fn place(&self, cell: u32) -> (u32, u32) {
        let Run { first, processor, number } = self.runs[self.run(cell)];
        (processor, number + (cell - first))
    }

    /// The run of a cell.
    fn run(&self, cell: u32) -> usize {
        self.runs.partition_point(|run| run.first <= cell) - 1
    }

    fn cells_of(&self, run: usize) -> Range<u32> {
        self.runs[run].first..self.runs.get(run + 1).map_or(self.cells, |next| next.first)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cell_has_one_place() {
        let mut distribution = Distribution::new(4);
        [1, 0, 1, 3, 3, 0].into_iter().for_each(|p| distribution.push(p, 1));
        let check = |distribution: &Distribution, expected: [&[u32]; 4]| {
            for (processor, cells) in (0..).zip(expected) {
                assert!(distribution.cells(processor).flatten().eq(cells.iter().copied()));
                assert_eq!(distribution.count(processor) as usize, cells.len());
                for (number, &cell) in cells.iter().enumerate() {
                    assert_eq!(distribution.place(cell), (processor, number as u32));
                }
            }
        };
        check(&distribution, [&[1, 5], &[0, 2], &[], &[3, 4]]);
        check(
            &distribution.retain(|visit| [0..1, 2..4, 4..6].map(visit).into_iter().collect()),
            [&[4], &[0, 1], &[], &[2, 3]],
        );
        let equal = Distribution::equal(10, 3);
        assert_eq!([0, 1, 2].map(|p| equal.cells(p).flatten().count()), [4, 3, 3]);
    }
}
