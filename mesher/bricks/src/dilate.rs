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

mod gathered;
mod tile;

use crate::brick::Brick;
use crate::brickset::BrickSet;
use crate::octant::Level;
use gathered::Gathered;
pub use tile::Tile;

/// Octants along a tile's edge.
const TILE: usize = 32;
/// Margin of a row on either side of the tile's own bits: the maximum radius of one pass.
const MARGIN: usize = 16;
/// log2 of the number of bricks along a tile's edge.
const TILE_BRICKS_LOG2: u32 = 3;

/// Number of words dilated: rows of tiles that sources can reach along y, in each layer with sources.
pub type Words = u64;

/// The union of several dilations: octants of one level inside the root.
pub struct Reach<'t> {
    level: Level,
    tile: &'t mut Tile,
    out: Gathered,
    words: Words,
}

impl<'t> Reach<'t> {
    /// The empty union, of octants of level `level`. `tile` is scratch; it must be empty and is left empty.
    pub fn new(level: Level, tile: &'t mut Tile) -> Self {
        Self { level, tile, out: Gathered::new(level), words: 0 }
    }

    /// Adds all octants within `radius` of a source of the same level. Sources come in Morton order.
    pub fn dilate(&mut self, sources: impl Iterator<Item = Brick>, radius: u32) {
        // A radius greater than the root's width reaches no more than the root.
        let radius = radius.min(1 << self.level);
        let first = radius.min(MARGIN as u32);
        self.pass(sources, first, false, radius - first);
    }

    /// Adds the parents of all octants within `radius` of a source, with sources and radius one level deeper than
    /// the union. Sources come in Morton order.
    pub fn dilate_children(&mut self, sources: impl Iterator<Item = Brick>, radius: u32) {
        self.pass(sources, radius & 1, true, radius / 2);
    }

    /// Adds all octants within `rest` of those that a pass reaches.
    fn pass(
        &mut self,
        sources: impl Iterator<Item = Brick>,
        radius: u32,
        to_parents: bool,
        rest: u32,
    ) {
        if rest == 0 {
            self.words += self.tile.pass(sources, radius, to_parents, &mut self.out);
            return;
        }
        let mut near = Gathered::new(self.level);
        self.words += self.tile.pass(sources, radius, to_parents, &mut near);
        self.dilate(near.into_set().bricks(), rest);
    }

    /// The octants reached, and the work done.
    pub fn finish(self) -> (BrickSet, Words) {
        (self.out.into_set(), self.words)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brickset::tests::set;
    use crate::octant::{morton, position};
    use crate::wide::widths;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

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
