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

use crate::brick::{self, Brick};
use crate::brickset::BrickSet;
use crate::octant::{Level, morton, position};
use std::collections::HashMap;

/// Octants along a tile's edge.
const TILE: usize = 32;
/// Bits of a row on each side of the tile's own: the most that one pass can dilate by.
const MARGIN: usize = 16;
/// Bricks along a tile's edge, as a power of two; three of these per key.
const TILE_BRICKS_LOG2: u32 = 3;

/// Bricks that results are gathered in together, as a power of two: 2 x 2 x 2, of which a layer fills most.
const BLOCK_LOG2: u32 = 3;
/// The same as a number.
const BLOCK: usize = 1 << BLOCK_LOG2;

/// Words that were dilated, counting every row of every tile.
pub type Words = u64;

/// What several dilations reach together: octants of one level, those outside the root left out.
pub struct Reach {
    level: Level,
    out: Gathered,
    words: Words,
}

impl Reach {
    /// Nothing yet, of level `level`.
    pub fn new(level: Level) -> Self {
        Self { level, out: Gathered::new(level), words: 0 }
    }

    /// Adds all octants within `radius` of a source of the same level. Sources come in Morton order.
    pub fn dilate(&mut self, sources: impl Iterator<Item = Brick>, radius: u32) {
        // Further than the root is wide, nothing more is reached.
        let mut left = radius.min(1 << self.level) as usize;
        if left <= MARGIN {
            return dilate_tiles(sources, left, false, &mut self.out, &mut self.words);
        }
        let mut near = Gathered::new(self.level);
        dilate_tiles(sources, MARGIN, false, &mut near, &mut self.words);
        let mut set = near.into_set();
        left -= MARGIN;
        while left > MARGIN {
            let mut near = Gathered::new(self.level);
            dilate_tiles(set.bricks().iter().copied(), MARGIN, false, &mut near, &mut self.words);
            set = near.into_set();
            left -= MARGIN;
        }
        dilate_tiles(set.bricks().iter().copied(), left, false, &mut self.out, &mut self.words);
    }

    /// Adds the parents of all octants within `radius` of a source, which is one level deeper. Sources
    /// come in Morton order.
    pub fn dilate_children(&mut self, sources: impl Iterator<Item = Brick>, radius: u32) {
        if radius < 2 {
            return dilate_tiles(sources, radius as usize, true, &mut self.out, &mut self.words);
        }
        let mut odd = Gathered::new(self.level);
        dilate_tiles(sources, (radius & 1) as usize, true, &mut odd, &mut self.words);
        self.dilate(odd.into_set().bricks().iter().copied(), radius / 2);
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
    out: &mut Gathered,
    words: &mut Words,
) {
    let mut tile = Tile::new(radius);
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

/// A tile and its margin, one word per row.
struct Tile {
    radius: usize,
    /// Rows before and behind the tile's own along y and z: the radius, up to whole parent bricks.
    margin: usize,
    /// Rows along y and along z.
    side: usize,
    rows: Vec<u64>,
    /// The rows after the passes along x and y; scratch.
    spread: Vec<u64>,
}

impl Tile {
    fn new(radius: usize) -> Self {
        assert!(radius <= MARGIN, "one pass reaches {MARGIN} octants");
        let margin = radius.next_multiple_of(8);
        let side = TILE + 2 * margin;
        Self { radius, margin, side, rows: vec![0; side * side], spread: vec![0; side * side] }
    }

    /// Adds a source brick.
    fn put(&mut self, b: Brick) {
        let [x, y, z] =
            position(b.key & ((1 << (3 * TILE_BRICKS_LOG2)) - 1)).map(|p| 4 * p as usize);
        let rows = brick::to_rows(b.bits);
        let shift = MARGIN + x;
        for dz in 0..4 {
            let base = (self.margin + z + dz) * self.side + self.margin + y;
            let four = rows >> (16 * dz);
            for (dy, row) in self.rows[base..base + 4].iter_mut().enumerate() {
                *row |= (four >> (4 * dy) & 15) << shift;
            }
        }
    }

    /// Dilates what was put in, along x, then y, then z.
    fn dilate(&mut self, words: &mut Words) {
        *words += self.rows.len() as u64;
        if self.radius == 0 {
            return;
        }
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx512f") {
            // SAFETY: the features that the function is compiled for were just detected.
            return unsafe { self.dilate_avx512() };
        } else if is_x86_feature_detected!("avx2") {
            // SAFETY: as above.
            return unsafe { self.dilate_avx2() };
        }
        self.dilate_portable();
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
    fn dilate_avx512(&mut self) {
        self.dilate_portable();
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn dilate_avx2(&mut self) {
        self.dilate_portable();
    }

    /// Sources are in the middle, so only the rows that results can be in are touched.
    #[inline(always)]
    fn dilate_portable(&mut self) {
        let (r, m, side) = (self.radius, self.margin, self.side);
        let spread = &mut self.spread;
        for z in m..m + TILE {
            let rows = &mut self.rows[z * side..(z + 1) * side];
            for row in &mut rows[m..m + TILE] {
                *row = dilate_row(*row, r);
            }
            let out = &mut spread[z * side..(z + 1) * side];
            out.copy_from_slice(rows);
            for s in 1..=r {
                or_into(&mut out[m - s..m - s + TILE], &rows[m..m + TILE]);
                or_into(&mut out[m + s..m + s + TILE], &rows[m..m + TILE]);
            }
        }
        for z in m - r..m + TILE + r {
            let (first, last) = ((z - r.min(z)).max(m), (z + r).min(m + TILE - 1));
            let rows = &mut self.rows[z * side..(z + 1) * side];
            for from in first..=last {
                or_into(rows, &spread[from * side..(from + 1) * side]);
            }
        }
    }

    /// Hands over the result and empties the tile.
    fn give(&mut self, tile: u64, to_parents: bool, out: &mut Gathered) {
        let scale = if to_parents { 2 } else { 1 };
        let halved;
        let rows = if to_parents {
            halved = self.halved();
            &halved
        } else {
            &self.rows
        };
        let side = self.side / scale;
        // The first brick of the padded tile, in bricks of the result's level.
        let origin = position(tile).map(|p| i64::from(p) * (TILE / scale / 4) as i64);
        let first = [MARGIN / scale / 4, self.margin / scale / 4, self.margin / scale / 4];
        for bz in 0..side / 4 {
            for by in 0..side / 4 {
                let mut four_by_four: [u64; 16] =
                    std::array::from_fn(|i| rows[(4 * bz + (i >> 2)) * side + 4 * by + (i & 3)]);
                if four_by_four.iter().fold(0, |any, row| any | row) == 0 {
                    continue;
                }
                transpose(&mut four_by_four);
                for (bx, &bits) in four_by_four.iter().enumerate().filter(|b| *b.1 != 0) {
                    let b = [bx, by, bz];
                    let p = std::array::from_fn(|a| origin[a] + b[a] as i64 - first[a] as i64);
                    out.add(p, brick::from_rows(bits));
                }
            }
        }
        self.rows.fill(0);
    }

    /// Rows of the parents: pairs along all three axes ored together.
    fn halved(&self) -> Vec<u64> {
        let half = self.side / 2;
        let mut out = vec![0; half * half];
        for z in 0..half {
            for y in 0..half {
                let at = |dy: usize, dz: usize| self.rows[(2 * z + dz) * self.side + 2 * y + dy];
                out[z * half + y] = pairs(at(0, 0) | at(1, 0) | at(0, 1) | at(1, 1));
            }
        }
        out
    }
}

/// Makes the four bits `j` of row `i` the four bits `i` of row `j`: from 16 rows of 16 bricks to 16 bricks.
#[inline]
fn transpose(rows: &mut [u64; 16]) {
    for (step, low) in [
        (8, u64::MAX >> 32),
        (4, 0x0000_ffff_0000_ffff),
        (2, 0x00ff_00ff_00ff_00ff),
        (1, 0x0f0f_0f0f_0f0f_0f0f),
    ] {
        for i in (0..16).filter(|i| i & step == 0) {
            let t = (rows[i] >> (4 * step) ^ rows[i + step]) & low;
            rows[i + step] ^= t;
            rows[i] ^= t << (4 * step);
        }
    }
}

/// `to |= from`, word by word.
#[inline]
fn or_into(to: &mut [u64], from: &[u64]) {
    for (t, f) in to.iter_mut().zip(from) {
        *t |= f;
    }
}

/// A row with every bit spread by `r` to both sides, by doubling.
#[inline]
fn dilate_row(row: u64, r: usize) -> u64 {
    // Every bit starts a run that is `run` long; the margin below keeps bits from falling out.
    let mut wide = row >> r;
    let mut run = 1;
    while run < 2 * r + 1 {
        let step = run.min(2 * r + 1 - run);
        wide |= wide << step;
        run += step;
    }
    wide
}

/// Bit `i` of the result is set where bit `2i` or `2i + 1` of `row` is.
#[inline]
fn pairs(row: u64) -> u64 {
    let v = (row | row >> 1) & 0x5555_5555_5555_5555;
    let v = (v | v >> 1) & 0x3333_3333_3333_3333;
    let v = (v | v >> 2) & 0x0f0f_0f0f_0f0f_0f0f;
    let v = (v | v >> 4) & 0x00ff_00ff_00ff_00ff;
    let v = (v | v >> 8) & 0x0000_ffff_0000_ffff;
    (v | v >> 16) & 0xffff_ffff
}

/// Bricks gathered from overlapping tiles, block by block.
struct Gathered {
    /// Bricks along the root's edge.
    extent: i64,
    /// Bits that exist at this level.
    valid: u64,
    blocks: HashMap<u64, u32, Spread>,
    words: Vec<[u64; BLOCK]>,
    last: Option<(u64, u32)>,
}

impl Gathered {
    fn new(l: Level) -> Self {
        Self {
            extent: if l < 2 { 1 } else { 1 << (l - 2) },
            valid: brick::valid(l),
            blocks: HashMap::default(),
            words: Vec::new(),
            last: None,
        }
    }

    /// Ors bits into the brick at a position; outside the root they are dropped.
    fn add(&mut self, p: [i64; 3], bits: u64) {
        if p.iter().any(|c| !(0..self.extent).contains(c)) {
            return;
        }
        let key = morton(p.map(|c| c as u32));
        let block = match self.last {
            Some((k, i)) if k == key >> BLOCK_LOG2 => i,
            _ => *self.blocks.entry(key >> BLOCK_LOG2).or_insert_with(|| {
                self.words.push([0; BLOCK]);
                (self.words.len() - 1) as u32
            }),
        };
        self.last = Some((key >> BLOCK_LOG2, block));
        self.words[block as usize][(key & (BLOCK as u64 - 1)) as usize] |= bits & self.valid;
    }

    fn into_set(self) -> BrickSet {
        let mut order: Vec<(u64, u32)> = self.blocks.into_iter().collect();
        order.sort_unstable();
        let mut set = BrickSet::default();
        for (block, i) in order {
            for (k, &bits) in (0..).zip(&self.words[i as usize]) {
                set.push(block << BLOCK_LOG2 | k, bits);
            }
        }
        set
    }
}

/// Hashing of Morton codes: a multiplication spreads them well enough.
#[derive(Clone, Copy, Default)]
struct Spread(u64);

impl std::hash::BuildHasher for Spread {
    type Hasher = Self;
    fn build_hasher(&self) -> Self {
        Self(0)
    }
}

impl std::hash::Hasher for Spread {
    fn finish(&self) -> u64 {
        self.0
    }
    fn write(&mut self, bytes: &[u8]) {
        for &b in bytes {
            self.write_u64(u64::from(b));
        }
    }
    fn write_u64(&mut self, v: u64) {
        self.0 = (self.0 ^ v).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(26);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
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
            let mut got = Reach::new(l);
            got.dilate(set(&codes).bricks().iter().copied(), r);
            prop_assert!(got.finish().0.codes().eq(grown.iter().copied()));
            let parents: BTreeSet<u64> = grown.iter().map(|c| c >> 3).collect();
            let mut got = Reach::new(l - 1);
            got.dilate_children(set(&codes).bricks().iter().copied(), r);
            prop_assert!(got.finish().0.codes().eq(parents.iter().copied()));
        }
    }

    #[test]
    fn every_nibble_is_transposed() {
        for (i, j) in (0..16).flat_map(|i| (0..16).map(move |j| (i, j))) {
            let mut rows = [0; 16];
            rows[i] = 0b1011 << (4 * j);
            transpose(&mut rows);
            assert!(
                rows.iter()
                    .enumerate()
                    .all(|(k, &r)| r == if k == j { 0b1011 << (4 * i) } else { 0 })
            );
        }
    }

    #[test]
    fn rows_spread_both_ways() {
        for r in 0..=16 {
            let want = (32 - r..=32 + r).fold(0u64, |w, b| w | 1 << b);
            assert_eq!(dilate_row(1 << 32, r), want);
        }
    }
}
