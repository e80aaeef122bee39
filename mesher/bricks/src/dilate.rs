//! Chebyshev dilation of a set of octants: the paper's enlarged extent boxes, 64 octants per word.
//!
//! The union of the enlarged boxes of all sources is a dilation by a cube. It is separable: along x, then
//! y, then z, by shifts and ors. It works on *tiles* of 32 x 32 x 32 octants, dense in memory, with one
//! 64-bit word for each row along x. The tile's own octants are the middle 32 bits of a word; the
//! margin of 16 bits on either side holds what reaches the neighbouring tiles. So the cost per octant is a few
//! word operations, almost independent of the radius.
//!
//! Two identities keep the radius of a pass small. Dilations compose: by `a` and then by `b` is by
//! `a + b`. And a dilation by `2k` followed by [coarsening](BrickSet::coarsen) equals coarsening followed
//! by a dilation by `k`, because octants `2p` and `2p + 1` both reach exactly the parents
//! `p - k ..= p + k`.

mod tile;

use crate::brick::{self, Brick};
use crate::brickset::BrickSet;
use crate::octant::{Level, morton};
use rustc_hash::FxHashMap;
use std::collections::BTreeSet;
use tile::pass;

/// Octants along a tile's edge.
const TILE: usize = 32;
/// Margin of a row on either side of the tile's own bits: the maximum radius of one pass.
const MARGIN: usize = 16;
/// log2 of the number of bricks along a tile's edge.
const TILE_BRICKS_LOG2: u32 = 3;

/// What a dilation reaches, octants of one level inside the root, and what that took.
pub struct Reached {
    /// The octants.
    pub octants: BrickSet,
    /// Number of words dilated: rows of tiles that sources can reach along y, in each layer with sources.
    pub words: u64,
    /// Bytes that it took at most: passes on the way reach less.
    pub bytes: usize,
}

/// All octants of level `l` within `radius` of a source of the same level. Sources come in Morton order.
pub fn dilate(l: Level, sources: impl Iterator<Item = Brick>, radius: u32) -> Reached {
    // A radius greater than the root's width reaches no more than the root.
    let radius = radius.min(1 << l);
    let first = radius.min(MARGIN as u32);
    further(l, pass(l, sources, first, false), radius - first)
}

/// The octants of level `l` that are parents of those within `radius` of a source, with sources and radius one level deeper. Sources
/// come in Morton order.
pub fn dilate_children(l: Level, sources: impl Iterator<Item = Brick>, radius: u32) -> Reached {
    further(l, pass(l, sources, radius & 1, true), (radius / 2).min(1 << l))
}

/// All octants within `radius` of those that a pass has reached by dilating some words.
fn further(l: Level, (mut near, mut words): (Gathered, u64), mut rest: u32) -> Reached {
    while rest > 0 {
        let mut sources = near.into_set();
        sources.condense();
        let (reached, more) = pass(l, sources.bricks(), rest.min(MARGIN as u32), false);
        // The sources are freed before what they reach becomes a set, which takes the most memory.
        (near, words, rest) = (reached, words + more, rest.saturating_sub(MARGIN as u32));
    }
    Reached { words, bytes: near.bytes(), octants: near.into_set() }
}

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
struct Gathered {
    /// Blocks along the root's edge.
    extent: i64,
    /// Bits that octants of this level can have, by brick of a block.
    valid: [u64; BLOCK],
    /// Where the words of the blocks of each page are, or [`NONE`].
    pages: FxHashMap<u64, [u32; PAGE]>,
    words: Vec<[u64; BLOCK]>,
}

impl Gathered {
    /// No bricks, of level `l`.
    fn new(l: Level) -> Self {
        // At levels 0 to 2 the root is a single brick.
        let valid = |i: usize| if l < 3 && i > 0 { 0 } else { brick::valid(l) };
        Self {
            extent: if l < 3 { 1 } else { 1 << (l - 3) },
            valid: std::array::from_fn(valid),
            pages: FxHashMap::default(),
            words: Vec::new(),
        }
    }

    /// Combines bits with the bricks of the block at position `p` by or; drops those outside the root.
    #[inline]
    fn add(&mut self, p: [i64; 3], bits: &[u64; BLOCK]) {
        if p.iter().any(|c| !(0..self.extent).contains(c)) {
            return;
        }
        let key = morton(p.map(|c| c as u32));
        let page = self.pages.entry(key >> PAGE_LOG2).or_insert([NONE; PAGE]);
        let block = &mut page[key as usize % PAGE];
        if *block == NONE {
            *block = u32::try_from(self.words.len()).expect("fewer than 2^32 blocks");
            self.words.push([0; BLOCK]);
        }
        let words = self.words[*block as usize].iter_mut();
        words.zip(bits).zip(&self.valid).for_each(|((w, b), valid)| *w |= b & valid);
    }

    /// Bytes that it takes while it becomes a set: of each block its words, its key and place, and the keys of its bricks.
    fn bytes(&self) -> usize {
        self.words.len() * (size_of::<[u64; BLOCK]>() + 12 + 4 * BLOCK)
    }

    /// The set of all octants gathered. Blocks are put in order where they are: this is the largest set of a mesh.
    fn into_set(mut self) -> BrickSet {
        let mut keys: Vec<u64> = Vec::with_capacity(self.words.len());
        let mut places: Vec<u32> = Vec::with_capacity(self.words.len());
        for page in self.pages.keys().copied().collect::<BTreeSet<u64>>() {
            for (block, &at) in (0..).zip(&self.pages[&page]).filter(|b| *b.1 != NONE) {
                keys.push((page << PAGE_LOG2 | block) << BLOCK_LOG2);
                places.push(at);
            }
        }
        drop(self.pages);
        arrange(&mut self.words, &mut places);
        let keys = keys.iter().flat_map(|block| *block..block + BLOCK as u64);
        BrickSet::from_sorted(keys, self.words.into_flattened())
    }
}

/// Moves items in place so that item `i` is the one that was at `places[i]`. Cycle by cycle; a place that is done is its own.
fn arrange<T: Copy>(items: &mut [T], places: &mut [u32]) {
    for start in 0..items.len() {
        let (first, mut at) = (items[start], start);
        while places[at] as usize != start {
            let from = places[at] as usize;
            items[at] = items[from];
            places[at] = at as u32;
            at = from;
        }
        items[at] = first;
        places[at] = at as u32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brickset::tests::set;
    use crate::octant::{morton, position};
    use crate::wide::widths;
    use proptest::prelude::*;

    fn naive(l: Level, codes: &BTreeSet<u64>, r: i64) -> BTreeSet<u64> {
        let n = 1i64 << l;
        let mut out = BTreeSet::new();
        for p in codes.iter().map(|c| position(*c).map(i64::from)) {
            let span = |c: i64| (c - r).max(0)..=(c + r).min(n - 1);
            for z in span(p[2]) {
                for y in span(p[1]) {
                    out.extend(span(p[0]).map(|x| morton([x as u32, y as u32, z as u32])));
                }
            }
        }
        out
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]

        #[test]
        fn dilation_equals_one_box_per_octant(l in 1u32..8, seeds in prop::collection::vec(any::<u64>(), 0..12), r in 0u32..21) {
            let codes: BTreeSet<u64> = seeds.iter().map(|s| s % (1 << (3 * l))).collect();
            let grown = naive(l, &codes, i64::from(r));
            let all = widths(|| {
                let same = dilate(l, set(&codes).bricks(), r).octants;
                [same, dilate_children(l - 1, set(&codes).bricks(), r).octants]
            });
            let parents: BTreeSet<u64> = grown.iter().map(|c| c >> 3).collect();
            for (width, [same, above]) in all {
                prop_assert!(same.codes().eq(grown.iter().copied()), "{:?}", width);
                prop_assert!(above.codes().eq(parents.iter().copied()), "{:?}", width);
            }
        }
    }
}
