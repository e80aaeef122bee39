//! The results of overlapping tiles, combined and sorted.

use crate::brick;
use crate::brickset::BrickSet;
use crate::octant::{Level, morton};
use rustc_hash::FxHashMap;

/// log2 of the bricks in a block, in which results are gathered: 2 x 2 x 2, most of which a layer fills.
const BLOCK_LOG2: u32 = 3;
/// Number of bricks in a block.
const BLOCK: usize = 1 << BLOCK_LOG2;
/// log2 of the blocks in a page: 4 x 4 x 4, as many as a tile has.
const PAGE_LOG2: u32 = 6;
/// Number of blocks in a page.
const PAGE: usize = 1 << PAGE_LOG2;
/// Marks a block that does not exist.
const NONE: u32 = u32::MAX;

/// Bricks gathered from overlapping tiles, block by block.
///
/// Blocks are looked up by *page*. A tile and its margin touch 3 x 3 x 3 pages, many times each; a table of the
/// most recent page by position modulo 4, in which neighbours do not collide, finds these.
pub struct Gathered {
    /// Blocks along the root's edge.
    extent: i64,
    /// Bits that octants of this level can have, by brick of a block.
    valid: [u64; BLOCK],
    numbers: FxHashMap<u64, u32>,
    /// Blocks of each page, or [`NONE`].
    pages: Vec<[u32; PAGE]>,
    words: Vec<[u64; BLOCK]>,
    /// Keys of the most recent pages, and their numbers.
    latest: [(u64, u32); PAGE],
}

impl Gathered {
    /// No bricks, of level `l`.
    pub fn new(l: Level) -> Self {
        // At levels 0 to 2 the root is a single brick.
        let valid = |i: usize| if l < 3 && i > 0 { 0 } else { brick::valid(l) };
        Self {
            extent: if l < 3 { 1 } else { 1 << (l - 3) },
            valid: std::array::from_fn(valid),
            numbers: FxHashMap::default(),
            pages: Vec::new(),
            words: Vec::new(),
            latest: [(u64::MAX, 0); PAGE],
        }
    }

    /// Combines bits with the bricks of the block at position `p` by or; drops those outside the root.
    #[inline]
    pub fn add(&mut self, p: [i64; 3], bits: &[u64; BLOCK]) {
        if p.iter().any(|c| !(0..self.extent).contains(c)) {
            return;
        }
        let key = morton(p.map(|c| c as u32));
        let page = self.page(key >> PAGE_LOG2);
        let block = &mut self.pages[page as usize][key as usize % PAGE];
        if *block == NONE {
            *block = self.words.len() as u32;
            self.words.push([0; BLOCK]);
        }
        let words = self.words[*block as usize].iter_mut();
        words.zip(bits).zip(&self.valid).for_each(|((w, b), valid)| *w |= b & valid);
    }

    /// The number of a page, which is created if it does not exist.
    #[inline]
    fn page(&mut self, key: u64) -> u32 {
        let latest = &mut self.latest[key as usize % PAGE];
        if latest.0 != key {
            let number = *self.numbers.entry(key).or_insert_with(|| {
                self.pages.push([NONE; PAGE]);
                (self.pages.len() - 1) as u32
            });
            *latest = (key, number);
        }
        latest.1
    }

    /// The set of all octants gathered.
    pub fn into_set(self) -> BrickSet {
        let mut order: Vec<(u64, u32)> = self.numbers.into_iter().collect();
        order.sort_unstable();
        let mut set = BrickSet::default();
        for (page, number) in order {
            let blocks = (0..).zip(&self.pages[number as usize]).filter(|b| *b.1 != NONE);
            for (block, &at) in blocks {
                for (k, &bits) in (0..).zip(&self.words[at as usize]) {
                    set.push((page << PAGE_LOG2 | block) << BLOCK_LOG2 | k, bits);
                }
            }
        }
        set
    }
}
