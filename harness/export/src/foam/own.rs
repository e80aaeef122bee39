//! The points of a directory that has not all cells.
//!
//! They are a set of numbers of points of the mesh. Points that neighbour each other have similar numbers, so the set mostly consists of
//! long intervals: one bit per point is stored only where a block of numbers is neither full nor empty.

use std::ops::Range;

/// Numbers per block.
const BLOCK: usize = 4096;
type Bits = [u64; BLOCK / 64];

/// A set of numbers.
#[derive(Debug)]
pub struct Own {
    blocks: Vec<Block>,
}

#[derive(Clone, Debug, Default)]
struct Block {
    /// The numbers in the set, unless the block is full or empty.
    bits: Option<Box<Bits>>,
    count: u32,
    /// How many numbers in the set are in the blocks before.
    before: u32,
}

impl Own {
    /// The set of the numbers that `mark` gives its argument, each of them below `all`.
    ///
    /// # Errors
    /// Those of `mark`.
    pub fn new<E>(
        all: u64,
        mark: impl FnOnce(&mut dyn FnMut(u32)) -> Result<(), E>,
    ) -> Result<Self, E> {
        let mut blocks = vec![Block::default(); (all as usize).div_ceil(BLOCK)];
        mark(&mut |number| blocks[number as usize / BLOCK].insert(number as usize % BLOCK))?;
        let mut before = 0;
        for block in &mut blocks {
            block.before = before;
            before += block.count;
        }
        Ok(Self { blocks })
    }

    /// How many numbers are in the set.
    pub fn count(&self) -> u64 {
        self.blocks.last().map_or(0, |last| u64::from(last.before) + u64::from(last.count))
    }

    /// How many numbers of the set are below `number`.
    pub fn rank(&self, number: u32) -> u32 {
        let (block, at) = (&self.blocks[number as usize / BLOCK], number as usize % BLOCK);
        let Some(bits) = &block.bits else { return block.before + (at as u32).min(block.count) };
        let before = bits[..at / 64].iter().map(|word| word.count_ones()).sum::<u32>();
        block.before + before + (bits[at / 64] & ((1 << (at % 64)) - 1)).count_ones()
    }

    /// The numbers, ascending.
    pub fn iter(&self) -> impl Iterator<Item = u32> + '_ {
        let numbers = |index: usize| index * BLOCK..(index + 1) * BLOCK;
        let not_empty = self.blocks.iter().enumerate().filter(|(_, block)| block.count > 0);
        not_empty.flat_map(move |(index, block)| {
            let has = move |n: &usize| block.bits.as_ref().is_none_or(|b| has(b, n % BLOCK));
            let numbers: Range<usize> = numbers(index);
            numbers.filter(has).map(|number| number as u32)
        })
    }
}

fn has(bits: &Bits, at: usize) -> bool {
    bits[at / 64] >> (at % 64) & 1 == 1
}

impl Block {
    fn insert(&mut self, at: usize) {
        if self.count as usize == BLOCK {
            return;
        }
        let bits = self.bits.get_or_insert_with(|| Box::new([0; BLOCK / 64]));
        self.count += u32::from(!has(bits, at));
        bits[at / 64] |= 1 << (at % 64);
        if self.count as usize == BLOCK {
            self.bits = None;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    proptest! {
        #[test]
        fn a_number_has_its_rank_in_the_set(
            intervals in prop::collection::vec((0u32..30_000, 1u32..9_000), 0..6), single in prop::collection::vec(0u32..40_000, 0..20)
        ) {
            let intervals = intervals.into_iter().flat_map(|(first, count)| first..first + count);
            let numbers: Vec<u32> = single.into_iter().chain(intervals).collect();
            let own = Own::new(40_000, |mark| {
                numbers.iter().for_each(|&number| mark(number));
                Ok::<(), ()>(())
            }).unwrap();
            let expected: BTreeSet<u32> = numbers.into_iter().collect();
            prop_assert_eq!(own.count(), expected.len() as u64);
            prop_assert!(own.iter().eq(expected.iter().copied()));
            prop_assert!(expected.iter().enumerate().all(|(rank, &number)| own.rank(number) == rank as u32));
        }
    }
}
