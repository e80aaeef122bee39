//! The octants of components, in few bytes: of the bricks of a block, only those halves that are not empty.
//!
//! About half of the halves are empty. When sides are stored, blocks are read a last time, in order, and the chunks before them are freed:
//! what is stored takes about as much memory.

use bricks::brick::Block;
use bricks::with_avx512;

/// Number of a local component: leaves of one block that are connected.
pub type Component = u32;

/// Number of words of a chunk: as many bytes as the heap of the program maps apart, so that the system gets them back when they are freed.
const CHUNK: usize = 1 << 20;

/// Most words of a block: one for each octant.
const BLOCK_MAX: usize = 512;

/// Number of halves of the bricks of a block.
const HALVES: usize = 16;

/// The octants of all components.
#[derive(Default, PartialEq)]
pub struct Masks {
    /// For each component, the halves of bricks in which it has octants: bits `2 j` and `2 j + 1` for the lower and the upper half of brick `j`.
    halves: Vec<u16>,
    /// The octants of these halves; a block is in one chunk.
    chunks: Vec<Vec<u32>>,
    /// Their end in the last chunk. Zeros follow, so that `HALVES` words can be read from the start of every component.
    end: usize,
}

/// The components of a brick, which are those of its block; or those of a block, whatever the brick.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    /// The first of them, and the first after them.
    pub components: [Component; 2],
    /// Where their octants begin.
    pub word: u32,
    /// The brick's place in the block.
    pub brick: u8,
}

impl Masks {
    /// Begins a block: the first component that will be in it, and where its octants begin.
    pub fn begin(&mut self) -> (Component, u32) {
        if self.chunks.is_empty() || self.end + BLOCK_MAX > CHUNK {
            // Most ranks need only the first, which grows.
            self.chunks.push(Vec::with_capacity(CHUNK * usize::from(!self.chunks.is_empty())));
            self.end = 0;
        }
        let word = u32::try_from((self.chunks.len() - 1) * CHUNK + self.end);
        // Every component has a word, so there are no more of them.
        (self.halves.len() as Component, word.expect("fewer than 2^32 words"))
    }

    /// Appends a component of the block.
    #[inline(always)]
    pub fn push(&mut self, octants: &Block) {
        let (mut words, mut count, mut halves) = ([0; HALVES], 0, 0);
        for k in 0..HALVES {
            let half = (octants[k / 2] >> (32 * (k % 2))) as u32;
            words[count % HALVES] = half;
            halves |= u16::from(half != 0) << k;
            count += usize::from(half != 0);
        }
        self.halves.push(halves);
        let chunk = self.chunks.last_mut().expect("a block has begun");
        chunk.truncate(self.end);
        chunk.extend(words);
        self.end += count;
    }

    /// Calls `each` with the components of a block and their octants.
    #[inline(always)]
    pub fn block(&self, block: Part, mut each: impl FnMut(Component, Block)) {
        let mut at = block.word as usize;
        for c in block.components[0]..block.components[1] {
            let (halves, words) = self.component(c, &mut at);
            each(c, spread(words, halves));
        }
    }

    /// Calls `each` with the components that have octants in a brick, and these.
    #[inline(always)]
    pub fn brick(&self, part: Part, mut each: impl FnMut(Component, u64)) {
        let mut at = part.word as usize;
        for c in part.components[0]..part.components[1] {
            let (halves, words) = self.component(c, &mut at);
            let from = halves >> (2 * part.brick) & 3;
            let before = (halves & ((1 << (2 * part.brick)) - 1)).count_ones() as usize;
            let [first, second] = [0, 1].map(|k| u64::from(words[(before + k) % HALVES]));
            match from {
                0 => {}
                1 => each(c, first),
                2 => each(c, first << 32),
                _ => each(c, second << 32 | first),
            }
        }
    }

    /// Calls `each` with the components that have octants among those of a brick.
    #[inline(always)]
    pub fn among(&self, part: Part, octants: u64, mut each: impl FnMut(Component)) {
        self.brick(part, |c, bits| {
            if bits & octants != 0 {
                each(c);
            }
        });
    }

    /// The halves in which component `c` has octants, and words that begin with these, at `at`, where those of the next component will begin.
    #[inline(always)]
    fn component(&self, c: Component, at: &mut usize) -> (u16, &[u32; HALVES]) {
        let (halves, start) = (self.halves[c as usize], *at);
        *at += halves.count_ones() as usize;
        let words = self.chunks[start / CHUNK][start % CHUNK..].first_chunk();
        (halves, words.expect("words follow"))
    }

    /// Frees the chunks before that of a block.
    pub fn free_before(&mut self, block: Part) {
        let before = &mut self.chunks[..block.word as usize / CHUNK];
        before.iter_mut().rev().take_while(|c| c.capacity() > 0).for_each(|c| *c = Vec::new());
    }

    /// Bytes that they take.
    pub fn bytes(&self) -> usize {
        let words = self.chunks.iter().map(|chunk| size_of_val(&chunk[..]));
        size_of_val(&self.halves[..]) + words.sum::<usize>()
    }
}

with_avx512! {
    /// The first words, in order, as the halves whose bits are set; the others are empty. Measured: one instruction saves 7 % of `sides`.
    fn spread(words: &[u32; HALVES], halves: u16) -> Block {
        bytemuck::cast(_mm512_maskz_expand_epi32(halves, bytemuck::cast(*words)))
    } else {
        let (mut octants, mut at) = ([0; 8], 0);
        for k in 0..HALVES {
            let is_here = halves >> k & 1;
            octants[k / 2] |= u64::from(words[at % HALVES] * u32::from(is_here)) << (32 * (k % 2));
            at += usize::from(is_here);
        }
        octants
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bricks::wide::widths;
    use proptest::prelude::*;

    fn octants() -> impl Strategy<Value = Block> {
        let word = prop_oneof![Just(0u64), any::<u32>().prop_map(u64::from), any::<u64>()];
        prop::array::uniform8(word)
    }

    proptest! {
        #[test]
        fn what_was_pushed_is_read(blocks in prop::collection::vec(prop::collection::vec(octants(), 0..5), 1..20)) {
            for (_, parts) in widths(|| check(&blocks)) {
                prop_assert_eq!(parts, blocks.len());
            }
        }
    }

    /// Pushes and reads blocks; returns their number.
    fn check(blocks: &[Vec<Block>]) -> usize {
        let mut masks = Masks::default();
        let mut parts = Vec::new();
        for block in blocks {
            let (first, word) = masks.begin();
            block.iter().for_each(|octants| masks.push(octants));
            let components = [first, first + block.len() as Component];
            parts.push(Part { components, word, brick: 0 });
        }
        for (part, block) in parts.iter().zip(blocks) {
            let mut found = Vec::new();
            masks.block(*part, |c, octants| found.push((c, octants)));
            assert_eq!(
                found,
                (part.components[0]..).zip(block.iter().copied()).collect::<Vec<_>>()
            );
            for brick in 0..8u8 {
                let mut found = Vec::new();
                masks.brick(Part { brick, ..*part }, |c, octants| found.push((c, octants)));
                let all = (part.components[0]..)
                    .zip(block.iter().map(|octants| octants[usize::from(brick)]));
                assert_eq!(found, all.filter(|c| c.1 != 0).collect::<Vec<_>>());
            }
        }
        parts.len()
    }

    #[test]
    fn what_follows_a_block_stays_when_the_rest_is_freed() {
        let mut masks = Masks::default();
        let mut parts = Vec::new();
        let octants = |i: u64| [i, 1 << 40 | i, 0, i << 32, 3, 4, u64::MAX, i];
        // More than three chunks.
        for i in 0..=3 * CHUNK as u64 / 9 {
            let (first, word) = masks.begin();
            masks.push(&octants(i + 1));
            parts.push((i + 1, Part { components: [first, first + 1], word, brick: 0 }));
        }
        let bytes = masks.bytes();
        for &(i, part) in &parts[parts.len() / 2..] {
            masks.free_before(part);
            let mut found = Vec::new();
            masks.block(part, |c, octants| found.push((c, octants)));
            assert_eq!(found, [(part.components[0], octants(i))]);
        }
        assert!(masks.bytes() < bytes / 2, "{} of {bytes} bytes remain", masks.bytes());
    }
}
