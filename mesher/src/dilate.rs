//! Chebyshev dilation of a set of octants: the paper's enlarged extent boxes, 64 octants to the word.
//!
//! The boxes of all sources together are a dilation by a cube, which is separable: along x, then y,
//! then z, by shifts and ors. It is done in *tiles* of 32 x 32 x 32 octants, dense in memory, one
//! machine word for a row along x: the tile's own octants are the word's middle 32 bits, which
//! leaves a margin of 16 for what reaches into the tiles beside it. So the cost per octant is that of a few
//! word operations, whatever the radius.
//!
//! Two identities keep radii small. Dilations add up: by `a` and then by `b` is by `a + b`. And a
//! dilation by `2k` followed by [coarsening](BrickSet::coarsen) is coarsening followed by a
//! dilation by `k`, as both reach from octant `2p` and from `2p + 1` exactly the parents
//! `p - k ..= p + k`.

mod gathered;
mod tile;

use crate::brick::Brick;
use crate::brickset::BrickSet;
use crate::octant::Level;
use gathered::Gathered;
pub use tile::Tile;

/// Octants along a tile's edge.
const TILE: usize = 32;
/// Bits of a row on each side of the tile's own: the most that one pass can dilate by.
const MARGIN: usize = 16;
/// Bricks along a tile's edge, as a power of two; three of these per key.
const TILE_BRICKS_LOG2: u32 = 3;

/// Words that were dilated: rows of tiles that sources can reach along y, in each layer that has any.
pub type Words = u64;

/// What several dilations reach together: octants of one level, those outside the root left out.
pub struct Reach<'t> {
    level: Level,
    tile: &'t mut Tile,
    out: Gathered,
    words: Words,
}

impl<'t> Reach<'t> {
    /// Nothing yet, of level `level`; an empty tile is for scratch, and left empty.
    pub fn new(level: Level, tile: &'t mut Tile) -> Self {
        Self { level, tile, out: Gathered::new(level), words: 0 }
    }

    /// Adds all octants within `radius` of a source of the same level. Sources come in Morton order.
    pub fn dilate(&mut self, sources: impl Iterator<Item = Brick>, radius: u32) {
        // Further than the root is wide, nothing more is reached.
        let mut left = radius.min(1 << self.level) as usize;
        if left <= MARGIN {
            return dilate_tiles(sources, left, false, self.tile, &mut self.out, &mut self.words);
        }
        let mut near = Gathered::new(self.level);
        dilate_tiles(sources, MARGIN, false, self.tile, &mut near, &mut self.words);
        let mut set = near.into_set();
        left -= MARGIN;
        while left > MARGIN {
            let mut near = Gathered::new(self.level);
            dilate_tiles(set.bricks(), MARGIN, false, self.tile, &mut near, &mut self.words);
            set = near.into_set();
            left -= MARGIN;
        }
        dilate_tiles(set.bricks(), left, false, self.tile, &mut self.out, &mut self.words);
    }

    /// Adds the parents of all octants within `radius` of a source, which is one level deeper. Sources
    /// come in Morton order.
    pub fn dilate_children(&mut self, sources: impl Iterator<Item = Brick>, radius: u32) {
        if radius < 2 {
            return dilate_tiles(
                sources,
                radius as usize,
                true,
                self.tile,
                &mut self.out,
                &mut self.words,
            );
        }
        let mut odd = Gathered::new(self.level);
        dilate_tiles(sources, (radius & 1) as usize, true, self.tile, &mut odd, &mut self.words);
        self.dilate(odd.into_set().bricks(), radius / 2);
    }

    /// What was reached, and the work that it took.
    pub fn finish(self) -> (BrickSet, Words) {
        (self.out.into_set(), self.words)
    }
}

/// One pass over the tiles; what is given is of the next coarser level if `to_parents`.
fn dilate_tiles(
    sources: impl Iterator<Item = Brick>,
    radius: usize,
    to_parents: bool,
    tile: &mut Tile,
    out: &mut Gathered,
    words: &mut Words,
) {
    tile.set_radius(radius);
    let mut now = None;
    for b in sources {
        let key = b.key >> (3 * TILE_BRICKS_LOG2);
        if let Some(done) = now.filter(|n| *n != key) {
            tile.dilate(words);
            tile.give(done, to_parents, out);
        }
        now = Some(key);
        tile.put(b);
    }
    if let Some(done) = now {
        tile.dilate(words);
        tile.give(done, to_parents, out);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::octant::{morton, position};
    use crate::wide::tests::widths;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    fn set(codes: &BTreeSet<u64>) -> BrickSet {
        BrickSet::from_unsorted(
            codes.iter().map(|c| Brick { key: c >> 6, bits: 1 << (c & 63) }).collect(),
        )
    }

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
        fn equals_one_box_per_octant(l in 1u32..8, seeds in prop::collection::vec(any::<u64>(), 0..12), r in 0u32..21) {
            let codes: BTreeSet<u64> = seeds.iter().map(|s| s % (1 << (3 * l))).collect();
            let grown = naive(l, &codes, i64::from(r));
            let all = widths(|| {
                let mut tile = Tile::default();
                let mut same = Reach::new(l, &mut tile);
                same.dilate(set(&codes).bricks(), r);
                let same = same.finish().0;
                let mut parents = Reach::new(l - 1, &mut tile);
                parents.dilate_children(set(&codes).bricks(), r);
                [same, parents.finish().0]
            });
            let parents: BTreeSet<u64> = grown.iter().map(|c| c >> 3).collect();
            for (width, [same, above]) in all {
                prop_assert!(same.codes().eq(grown.iter().copied()), "{:?}", width);
                prop_assert!(above.codes().eq(parents.iter().copied()), "{:?}", width);
            }
        }
    }
}
