//! One tile: 32 x 32 x 32 octants and a margin, one machine word per row.

use super::gathered::Gathered;
use super::{MARGIN, TILE, TILE_BRICKS_LOG2, Words};
use crate::brick::{self, Brick};
use crate::octant::position;

/// A tile and its margin, one word per row.
pub struct Tile {
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
    pub fn new(radius: usize) -> Self {
        assert!(radius <= MARGIN, "one pass reaches {MARGIN} octants");
        let margin = radius.next_multiple_of(8);
        let side = TILE + 2 * margin;
        Self { radius, margin, side, rows: vec![0; side * side], spread: vec![0; side * side] }
    }

    /// Adds a source brick.
    pub fn put(&mut self, b: Brick) {
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
    pub fn dilate(&mut self, words: &mut Words) {
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
    pub fn give(&mut self, tile: u64, to_parents: bool, out: &mut Gathered) {
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

#[cfg(test)]
mod tests {
    use super::*;

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
