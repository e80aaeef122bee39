//! Bricks: 4 x 4 x 4 octants of one level, as the 64 bits of a word.
//!
//! Invariants:
//! - brick `key` of level `l` holds the octants with Morton codes `key << 6 | bit`: its bits are in Morton
//!   order, and its key is the code of the octant of level `l - 2` that it fills;
//! - each byte of a brick is a group of eight siblings: byte `j` of brick `key` holds the children of the
//!   octant of level `l - 1` with code `key << 3 | j`;
//! - levels 0 and 1 have a single brick, with key 0, of which 1 and 8 bits are used.

use crate::octant::{self, Level};
use crate::with_avx512;
use bytemuck::{Pod, Zeroable};

/// A brick's key and its 64 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Pod, Zeroable)]
#[repr(C)]
pub struct Brick {
    /// Code of the octant, two levels higher, that the brick fills.
    pub key: u64,
    /// One bit per octant, in Morton order.
    pub bits: u64,
}

impl Brick {
    /// The parents of its octants, in the brick that they lie in.
    #[inline]
    pub fn parents(self) -> Self {
        Self { key: self.key >> 3, bits: u64::from(parents(self.bits)) << (8 * (self.key & 7)) }
    }

    /// The codes of its octants in Morton order.
    #[inline]
    pub fn codes(self) -> impl Iterator<Item = u64> {
        ones(self.bits).map(move |bit| self.key << 6 | u64::from(bit))
    }
}

/// Positions of the set bits of `bits`, ascending.
#[inline]
pub fn ones(mut bits: u64) -> impl Iterator<Item = u32> {
    std::iter::from_fn(move || {
        (bits != 0).then(|| {
            let bit = bits.trailing_zeros();
            bits &= bits - 1;
            bit
        })
    })
}

/// Masks of the octants whose position along an axis is in `first..=last`, by axis, `first` and `last`.
pub const SPANS: [[[u64; 4]; 4]; 3] = [spans(0), spans(1), spans(2)];

const fn spans(axis: u32) -> [[u64; 4]; 4] {
    let mut table = [[0; 4]; 4];
    let mut bit = 0;
    while bit < 64u32 {
        let index = (bit >> axis & 1) | (bit >> (axis + 3) & 1) << 1;
        let mut span = 0;
        while span < 16u32 {
            let (first, last) = (span >> 2, span & 3);
            if first <= index && index <= last {
                table[first as usize][last as usize] |= 1 << bit;
            }
            span += 1;
        }
        bit += 1;
    }
    table
}

/// Mask of the bits that octants of level `l` can have: all but at levels 0 and 1.
#[inline]
pub const fn valid(l: Level) -> u64 {
    match l {
        0 => 1,
        1 => 0xff,
        _ => u64::MAX,
    }
}

/// Minimum corner of a brick of level `l`, in lattice units.
#[inline]
pub fn min_corner(l: Level, key: u64) -> [i64; 3] {
    if l < 2 { [0; 3] } else { octant::corner(l - 2, key) }
}

/// The parents of the octants `bits` of a brick: one bit for each byte that is not zero.
#[inline]
pub const fn parents(bits: u64) -> u8 {
    let v = bits | bits >> 4;
    let v = v | v >> 2;
    let v = (v | v >> 1) & 0x0101_0101_0101_0101;
    (v.wrapping_mul(0x0102_0408_1020_4080) >> 56) as u8
}

/// All children of the octants `byte`: byte `j` of the result is 0xff if bit `j` is set, 0 otherwise.
#[inline]
pub const fn children(byte: u8) -> u64 {
    let v = (byte as u64).wrapping_mul(0x0101_0101_0101_0101) & 0x8040_2010_0804_0201;
    let ones = ((v.wrapping_add(0x7f7f_7f7f_7f7f_7f7f) | v) >> 7) & 0x0101_0101_0101_0101;
    ones.wrapping_mul(0xff)
}

/// Byte `j` of `bits`.
#[inline]
pub const fn byte(bits: u64, j: u64) -> u8 {
    (bits >> (8 * j)) as u8
}

/// Flood fill: the octants of `within` that faces within `within` connect to those of `seed`.
#[inline]
pub const fn flood(seed: u64, within: u64) -> u64 {
    let mut w = seed & within;
    loop {
        // Axis by axis it takes fewer steps than over all faces at once.
        let x = w | (moved(w, 0, false) | moved(w, 0, true)) & within;
        let y = x | (moved(x, 1, false) | moved(x, 1, true)) & within;
        let z = y | (moved(y, 2, false) | moved(y, 2, true)) & within;
        if z == w || z == within {
            return z;
        }
        w = z;
    }
}

/// Whether any bit is set. A comparison with an array of zeros would compile to a call.
#[inline(always)]
pub fn any(words: &[u64]) -> bool {
    words.iter().fold(0, |all, w| all | w) != 0
}

/// The eight bricks below one: word `j` is that below octant group `j`.
pub type Block = [u64; 8];

/// Reorders a block's bits: from bricks to layers along z, in each x fastest, then y; and back.
#[inline(always)]
pub fn layers(mut b: Block) -> Block {
    // Swaps bits of the index, word first, from z2 y2 x2 z1 y1 x1 z0 y0 x0 to z2 z1 z0 y2 y1 y0 x2 x1 x0.
    for (distance, word, mask) in [(32, 2, 0xffff_ffff), (4, 1, 0x0f0f_0f0f_0f0f_0f0f)] {
        for j in (0..8).filter(|j| j & word == 0) {
            let t = (b[j] >> distance ^ b[j | word]) & mask;
            b[j] ^= t << distance;
            b[j | word] ^= t;
        }
    }
    b.map(swap::<3, 1>)
}

with_avx512! {
    /// For each layer of a block, those before and after it together. Measured: two shifts of lanes in place of a chain save 3 % of `sides`.
    fn beside(layers: Block) -> Block {
        let (layers, none) = (bytemuck::cast(layers), _mm512_setzero_si512());
        let (before, after) = (_mm512_alignr_epi64(layers, none, 7), _mm512_alignr_epi64(none, layers, 1));
        bytemuck::cast(_mm512_or_si512(before, after))
    } else {
        let at = |z: usize| if z < 8 { layers[z] } else { 0 };
        std::array::from_fn(|z| at(z + 1) | at(z.wrapping_sub(1)))
    }
}

/// Flood fill of a block in layers, as [`flood`] of a brick, from a seed that lies in `within`.
#[inline(always)]
pub fn flood_layers(seed: Block, within: &Block) -> Block {
    let mut w = seed;
    loop {
        const NOT_FIRST: u64 = 0xfefe_fefe_fefe_fefe;
        let along_x = |v: u64| v << 1 & NOT_FIRST | (v & NOT_FIRST) >> 1;
        let x: Block = std::array::from_fn(|z| w[z] | along_x(w[z]) & within[z]);
        let y: Block = std::array::from_fn(|z| x[z] | (x[z] << 8 | x[z] >> 8) & within[z]);
        let beside = beside(y);
        let next: Block = std::array::from_fn(|z| y[z] | beside[z] & within[z]);
        if (0..8).fold(0, |all, z| all | w[z] ^ next[z]) == 0 {
            return w;
        }
        w = next;
    }
}

/// The face neighbours of the octants `w` within the brick along `axis`, in the positive direction if `up`.
#[inline]
pub const fn moved(w: u64, axis: usize, up: bool) -> u64 {
    let m = SPANS[axis];
    let (low, one, unit, gap) = (m[0][0] | m[2][2], m[1][1], 1 << axis, 7 << axis);
    if up { (w & low) << unit | (w & one) << gap } else { w >> unit & low | w >> gap & one }
}

/// The face neighbours of the octants `w` in the neighbouring brick along `axis`, in the positive direction if
/// `up`.
#[inline]
pub const fn across(w: u64, axis: usize, up: bool) -> u64 {
    let shift = 9 << axis;
    if up { (w & SPANS[axis][3][3]) >> shift } else { (w & SPANS[axis][0][0]) << shift }
}

/// Reorders a brick's bits from Morton order to row order: x fastest, then y, then z.
#[inline]
pub const fn to_rows(w: u64) -> u64 {
    // Swaps bits of the index, highest first, from z1 y1 x1 z0 y0 x0 to z1 z0 y1 y0 x1 x0.
    let w = swap::<3, 1>(w); // z1 y1 y0 z0 x1 x0
    let w = swap::<4, 2>(w); // z1 z0 y0 y1 x1 x0
    swap::<3, 2>(w) // z1 z0 y1 y0 x1 x0
}

/// Inverse of [`to_rows`].
#[inline]
pub const fn from_rows(w: u64) -> u64 {
    let w = swap::<3, 2>(w);
    let w = swap::<4, 2>(w);
    swap::<3, 1>(w)
}

/// Swaps bits `A > B` in the index of every bit.
#[inline]
const fn swap<const A: u32, const B: u32>(w: u64) -> u64 {
    let distance = (1 << A) - (1 << B);
    let t = (w ^ w >> distance) & const { moved_up(A, B) };
    w ^ t ^ t << distance
}

/// The bits that [`swap`] moves to higher positions: those whose index has bit `a` clear and bit `b` set.
const fn moved_up(a: u32, b: u32) -> u64 {
    let mut moved = 0;
    let mut i = 0;
    while i < 64u32 {
        if i >> a & 1 == 0 && i >> b & 1 == 1 {
            moved |= 1 << i;
        }
        i += 1;
    }
    moved
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::octant::{morton, position};

    fn draw() -> impl FnMut() -> u64 {
        let mut random = 1u64;
        move || {
            random = random.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(0x1405_7b7e_f767_814f);
            random ^ random >> 29
        }
    }

    /// The octants `w` and their face neighbours within the brick.
    fn spread(w: u64) -> u64 {
        (0..3).fold(w, |all, axis| all | moved(w, axis, false) | moved(w, axis, true))
    }

    #[test]
    fn parents_and_children_agree_for_every_byte() {
        for b in 0..=255u8 {
            assert_eq!(parents(children(b)), b);
            assert_eq!(children(b).count_ones(), 8 * b.count_ones());
            for bit in 0..8 {
                assert_eq!(byte(children(b), bit), if b >> bit & 1 == 1 { 0xff } else { 0 });
                assert_eq!(parents(1 << (8 * bit + u64::from(b & 7))), 1 << bit);
            }
        }
    }

    #[test]
    fn row_order_and_morton_order_are_inverse_for_every_bit() {
        for bit in 0..64 {
            let [x, y, z] = position(bit);
            assert_eq!(to_rows(1 << bit), 1 << (x + 4 * y + 16 * z));
            assert_eq!(from_rows(to_rows(1 << bit)), 1 << bit);
        }
    }

    #[test]
    fn face_neighbours_are_exactly_six_for_every_octant() {
        for bit in 0..64u64 {
            let p = position(bit);
            let mut want = 1u64 << bit;
            for axis in 0..3 {
                for up in [false, true] {
                    let mut q = p.map(i64::from);
                    q[axis] += if up { 1 } else { -1 };
                    let inside = (0..4).contains(&q[axis]);
                    let wrapped = q.map(|v| v.rem_euclid(4) as u32);
                    let outside = if inside { 0 } else { 1 << morton(wrapped) };
                    assert_eq!(across(1 << bit, axis, up), outside);
                    let within = if inside { 1 << morton(wrapped) } else { 0 };
                    assert_eq!(moved(1 << bit, axis, up), within);
                    want |= within;
                }
            }
            assert_eq!(spread(1 << bit), want);
        }
    }

    #[test]
    fn flood_fill_is_what_steps_over_all_faces_come_to() {
        let mut draw = draw();
        for _ in 0..10_000 {
            for within in [draw(), draw() | draw(), draw() & draw()] {
                let seed = draw() & draw() & draw();
                let mut filled = seed & within;
                while filled != spread(filled) & within {
                    filled = spread(filled) & within;
                }
                assert_eq!(flood(seed, within), filled, "{seed:#x} {within:#x}");
            }
        }
    }

    #[test]
    fn layers_have_every_octant_at_its_position_and_are_their_own_inverse() {
        for code in 0..512u64 {
            let [x, y, z] = position(code);
            let mut block = [0; 8];
            block[code as usize >> 6] = 1 << (code & 63);
            let mut want = [0; 8];
            want[z as usize] = 1 << (8 * y + x);
            assert_eq!(layers(block), want);
            assert_eq!(layers(want), block);
        }
    }

    #[test]
    fn flood_fill_of_a_block_is_what_steps_over_all_faces_come_to() {
        let mut draw = draw();
        for _ in 0..2_000 {
            let (mut within, mut filled) = ([0; 8], [0; 8]);
            within.fill_with(|| draw() | draw() & draw());
            filled[draw() as usize & 7] = 1 << (draw() & 63);
            let seed = filled;
            loop {
                let across =
                    |j: usize, axis: usize| across(filled[j ^ 1 << axis], axis, j >> axis & 1 == 1);
                let next = std::array::from_fn(|j| {
                    let beside = across(j, 0) | across(j, 1) | across(j, 2);
                    filled[j] | (spread(filled[j]) | beside) & within[j]
                });
                if next == filled {
                    break;
                }
                filled = next;
            }
            let found = layers(flood_layers(layers(seed), &layers(within)));
            assert_eq!(found, filled, "{seed:x?} {within:x?}");
        }
    }

    #[test]
    fn flood_fill_stops_at_walls() {
        let x = SPANS[0];
        let wall = !x[1][1];
        assert_eq!(flood(1, wall), x[0][0]);
        assert_eq!(flood(1 << 63, wall), x[2][3]);
        assert_eq!(flood(x[1][1], wall), 0);
    }

    #[test]
    fn values_are_those_of_the_proofs() {
        crate::values::compare(
            "bricks/src/brick.rs",
            &[
                ("parents", &|a| vec![parents(a[0] as u64).into()]),
                ("children", &|a| vec![children(a[0] as u8).into()]),
                ("to_rows", &|a| vec![to_rows(a[0] as u64).into()]),
                ("from_rows", &|a| vec![from_rows(a[0] as u64).into()]),
                ("moved", &|a| vec![moved(a[0] as u64, a[1] as usize, a[2] == 1).into()]),
                ("across", &|a| vec![across(a[0] as u64, a[1] as usize, a[2] == 1).into()]),
                ("flood", &|a| vec![flood(a[0] as u64, a[1] as u64).into()]),
            ],
        );
    }
}
