//! One tile: 32 x 32 x 32 octants and a margin, one word per row.

use super::{Gathered, MARGIN, TILE, TILE_BRICKS_LOG2};
use crate::brick::ones;
use crate::brick::{self, Brick};
use crate::octant::{Level, position};
use crate::widest;
use std::cell::Cell;
use std::ops::Range;

/// A tile and its margin, one word per row. Tiles are mostly empty at coarse levels, so only rows that can hold a
/// result are touched. One tile serves all passes of a thread, to avoid zeroing its memory.
///
/// Invariant between tiles: it is empty, so `rows` and `half` are zero.
#[derive(Default)]
struct Tile {
    radius: usize,
    /// Rows on either side of the tile's own along y and z: the radius, rounded up to whole bricks of parents.
    margin: usize,
    /// Number of rows along y, and along z.
    side: usize,
    /// All zero in an empty tile.
    rows: Vec<u64>,
    /// Masks of the tile's own positions that have a source: along z; along y, at any z and at each z.
    layers: u32,
    columns: u32,
    columns_at: [u32; TILE],
    /// Scratch: the rows after the passes along x and y.
    spread: Vec<u64>,
    /// Rows of parents; all zero except during a flush.
    half: Vec<u64>,
}

thread_local! {
    /// An empty tile, while no pass has it.
    static SPARE: Cell<Tile> = Cell::default();
}

/// The range from the first set bit to the last.
fn span(bits: u32) -> Range<usize> {
    bits.trailing_zeros() as usize..(u32::BITS - bits.leading_zeros()) as usize
}

/// The octants of level `l` within `radius` of a source, or their parents if `to_parents`, made tile by tile; and the number of words
/// dilated.
pub(super) fn pass(
    l: Level,
    sources: impl Iterator<Item = Brick>,
    radius: u32,
    to_parents: bool,
) -> (Gathered, u64) {
    let (mut tile, mut out) = (SPARE.take().with_radius(radius as usize), Gathered::new(l));
    let (mut words, mut now) = (0, None);
    for b in sources {
        let key = b.key >> (3 * TILE_BRICKS_LOG2);
        if let Some(done) = now.filter(|n| *n != key) {
            words += tile.dilate(done, to_parents, &mut out);
        }
        now = Some(key);
        tile.put(b);
    }
    words += now.map_or(0, |done| tile.dilate(done, to_parents, &mut out));
    SPARE.set(tile);
    (out, words)
}

impl Tile {
    /// The same, empty, for another radius.
    fn with_radius(mut self, radius: usize) -> Self {
        assert!(radius <= MARGIN, "one pass reaches {MARGIN} octants");
        (self.radius, self.margin) = (radius, radius.next_multiple_of(8));
        self.side = TILE + 2 * self.margin;
        self.rows.resize(self.rows.len().max(self.side * self.side), 0);
        self.spread.resize(self.rows.len(), 0);
        self.half.resize(self.rows.len() / 4, 0);
        self
    }

    /// The ranges of rows, along y and along z, that can hold results. The tile must not be empty.
    fn reached(&self) -> [Range<usize>; 2] {
        [self.columns, self.layers].map(|sources| {
            let Range { start, end } = span(sources);
            self.margin + start - self.radius..self.margin + end + self.radius
        })
    }

    /// The positions along z that have sources, each with the range of rows that these reach along y.
    #[inline(always)]
    fn along_y(&self) -> impl Iterator<Item = (usize, Range<usize>)> + '_ {
        let (r, m) = (self.radius, self.margin);
        ones(u64::from(self.layers)).map(move |z| {
            let Range { start, end } = span(self.columns_at[z as usize]);
            (z as usize + m, m + start - r..m + end + r)
        })
    }

    /// Adds a source brick, which must not be empty.
    fn put(&mut self, b: Brick) {
        let [x, y, z] =
            position(b.key & ((1 << (3 * TILE_BRICKS_LOG2)) - 1)).map(|p| 4 * p as usize);
        let rows = brick::to_rows(b.bits);
        let shift = MARGIN + x;
        // Whether each row has a source, in the lowest of its four bits.
        let pairs = rows | rows >> 1;
        let has_source = (pairs | pairs >> 2) & 0x1111_1111_1111_1111;
        for dz in 0..4 {
            // The product moves the bits of four rows next to each other.
            let columns = (((has_source >> (16 * dz) & 0xffff) * 0x1248) >> 12 & 15) as u32;
            if columns == 0 {
                continue;
            }
            self.layers |= 1 << (z + dz);
            self.columns |= columns << y;
            self.columns_at[z + dz] |= columns << y;
            let base = (self.margin + z + dz) * self.side + self.margin + y;
            let four = rows >> (16 * dz);
            for (dy, row) in self.rows[base..base + 4].iter_mut().enumerate() {
                *row |= (four >> (4 * dy) & 15) << shift;
            }
        }
    }

    /// Dilates the sources along x, then y, then z, adds the result, or its parents, to `out`, and empties the tile.
    fn dilate(&mut self, tile: u64, to_parents: bool, out: &mut Gathered) -> u64 {
        let words = self.along_y().map(|(_, y)| y.len() as u64).sum();
        if self.radius > 0 {
            dilate_rows(self);
        }
        flush_blocks(self, tile, to_parents, out);
        let [along_y, along_z] = self.reached();
        for z in along_z {
            self.rows[z * self.side..(z + 1) * self.side][along_y.clone()].fill(0);
        }
        (self.layers, self.columns, self.columns_at) = (0, 0, [0; TILE]);
        words
    }

    #[inline(always)]
    fn dilate_lanes(&mut self) {
        let (r, side) = (self.radius, self.side);
        let mut rows = std::mem::take(&mut self.rows);
        let mut spread = std::mem::take(&mut self.spread);
        for (z, y) in self.along_y() {
            let (rows, out) =
                (&mut rows[z * side..][y.clone()], &mut spread[z * side..][y.clone()]);
            let n = y.len() - 2 * r;
            for row in &mut rows[r..r + n] {
                *row = dilate_row(*row, r);
            }
            out.copy_from_slice(rows);
            for s in (0..=2 * r).filter(|s| *s != r) {
                or_into(&mut out[s..s + n], &rows[r..r + n]);
            }
        }
        for (z, y) in self.along_y() {
            for to in z - r..=z + r {
                or_into(&mut rows[to * side..][y.clone()], &spread[z * side..][y.clone()]);
            }
        }
        (self.rows, self.spread) = (rows, spread);
    }

    #[inline(always)]
    fn flush_lanes(&mut self, tile: u64, to_parents: bool, out: &mut Gathered) {
        let scale = if to_parents { 2 } else { 1 };
        let side = self.side / scale;
        let reached = self.reached();
        if to_parents {
            halve(&self.rows, &mut self.half, side, &reached);
        }
        let rows = if to_parents { &self.half } else { &self.rows };
        // The first brick of the tile with its margin, in bricks of the result's level; even along x.
        let origin = position(tile).map(|p| i64::from(p) * (TILE / scale / 4) as i64);
        let margins = [MARGIN, self.margin, self.margin].map(|m| (m / scale / 4) as i64);
        let first: [i64; 3] = std::array::from_fn(|a| origin[a] - margins[a]);
        // Blocks of 2 x 2 x 2 bricks start at even positions.
        let [along_y, along_z] = [1, 2].map(|a| {
            let bricks = |row: usize| first[a] + (row / scale / 4) as i64;
            let Range { start, end } = reached[a - 1];
            bricks(start).div_euclid(2)..bricks(end - 1).div_euclid(2) + 1
        });
        for z in along_z {
            for y in along_y.clone() {
                let at = |a: usize, block: i64, odd: usize| 2 * block + odd as i64 - first[a];
                let bricks: [[u64; 16]; 4] = std::array::from_fn(|k| {
                    bricks_along(rows, side, at(1, y, k & 1), at(2, z, k >> 1))
                });
                let x = first[0].div_euclid(2);
                for (i, x) in (x..x + 8).enumerate() {
                    let block: [u64; 8] = std::array::from_fn(|o| bricks[o >> 1][2 * i + (o & 1)]);
                    if brick::any(&block) {
                        out.add([x, y, z], &block.map(brick::from_rows));
                    }
                }
            }
        }
        if to_parents {
            let [along_y, along_z] = halves(&reached);
            for z in along_z {
                self.half[z * side..(z + 1) * side][along_y.clone()].fill(0);
            }
        }
    }
}

/// The 16 bricks along x, with bits in row order, at a position along y and z in bricks; empty outside the tile.
#[inline(always)]
fn bricks_along(rows: &[u64], side: usize, y: i64, z: i64) -> [u64; 16] {
    let inside = 0..(side / 4) as i64;
    if !(inside.contains(&y) && inside.contains(&z)) {
        return [0; 16];
    }
    let base = 4 * (z as usize * side + y as usize);
    let mut bricks = std::array::from_fn(|i| rows[base + (i >> 2) * side + (i & 3)]);
    if brick::any(&bricks) {
        transpose(&mut bricks);
    }
    bricks
}

widest! {
    fn dilate_rows(tile: &mut Tile) = Tile::dilate_lanes;
}

widest! {
    fn flush_blocks(tile: &mut Tile, number: u64, to_parents: bool, out: &mut Gathered) = Tile::flush_lanes;
}

/// The ranges, along y and along z, of the parents of some rows.
#[inline(always)]
fn halves(rows: &[Range<usize>; 2]) -> [Range<usize>; 2] {
    [0, 1].map(|a| rows[a].start / 2..rows[a].end.div_ceil(2))
}

/// Writes the parents of the reached rows to `half`, with `side` rows along y: combines pairs along all three
/// axes by or.
#[inline(always)]
fn halve(rows: &[u64], half: &mut [u64], side: usize, reached: &[Range<usize>; 2]) {
    let [along_y, along_z] = halves(reached);
    for z in along_z {
        let (low, high) = rows[4 * z * side..][..4 * side].split_at(2 * side);
        let [low, high] = [low, high].map(|rows| &rows[2 * along_y.start..2 * along_y.end]);
        let out = &mut half[z * side..(z + 1) * side][along_y.clone()];
        for (y, row) in out.iter_mut().enumerate() {
            *row = pairs(low[2 * y] | low[2 * y + 1] | high[2 * y] | high[2 * y + 1]);
        }
    }
}

/// Transposes a 16 x 16 matrix of nibbles: from 16 rows across 16 bricks to 16 bricks.
#[inline(always)]
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
#[inline(always)]
fn or_into(to: &mut [u64], from: &[u64]) {
    for (t, f) in to.iter_mut().zip(from) {
        *t |= f;
    }
}

/// Dilates a row by `r` in both directions, by doubling.
#[inline(always)]
fn dilate_row(row: u64, r: usize) -> u64 {
    // Each bit grows to a run of length `run`. The margin keeps bits from being shifted out.
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
#[inline(always)]
fn pairs(row: u64) -> u64 {
    let v = (row | row >> 1) & 0x5555_5555_5555_5555;
    let v = (v | v >> 1) & 0x3333_3333_3333_3333;
    let v = (v | v >> 2) & 0x0f0f_0f0f_0f0f_0f0f;
    let v = (v | v >> 4) & 0x00ff_00ff_00ff_00ff;
    let v = (v | v >> 8) & 0x0000_ffff_0000_ffff;
    (v | v >> 16) & 0xffff_ffff
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn transposition_moves_every_nibble() {
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
    fn rows_are_dilated_in_both_directions() {
        for r in 0..=16 {
            let want = (32 - r..=32 + r).fold(0u64, |w, b| w | 1 << b);
            assert_eq!(dilate_row(1 << 32, r), want);
        }
    }

    #[test]
    fn a_parent_is_set_if_any_of_its_children_is() {
        let (side, y, z, x) = (4, 1, 2, 5);
        for children in 0..256u64 {
            let (mut rows, mut half) = (vec![0; 4 * side * side], vec![0; side * side]);
            for child in (0..8).filter(|child| children >> child & 1 == 1) {
                let row = (2 * z + (child >> 2)) * 2 * side + 2 * y + (child >> 1 & 1);
                rows[row] |= 1 << (2 * x + (child & 1));
            }
            halve(&rows, &mut half, side, &[2 * y..2 * y + 2, 2 * z..2 * z + 2]);
            let mut want = vec![0; side * side];
            want[z * side + y] = u64::from(children != 0) << x;
            assert_eq!(half, want, "children {children:#b}");
        }
    }

    #[test]
    fn values_are_those_of_the_proofs() {
        crate::values::compare(
            "bricks/src/dilate/tile.rs",
            &[
                ("dilate_row", &|a| vec![dilate_row(a[0] as u64, a[1] as usize).into()]),
                ("pairs", &|a| vec![pairs(a[0] as u64).into()]),
                ("transpose", &|a| {
                    let mut rows = std::array::from_fn(|i| a[i] as u64);
                    transpose(&mut rows);
                    rows.map(i128::from).to_vec()
                }),
            ],
        );
    }
}
