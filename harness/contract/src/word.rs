//! The leaf word: one leaf packed into a `u64` (reference/DEFINITION.md, section 8).
//!
//! A word is `morton57 << 7 | level << 2 | side`. The Morton code interleaves the bits of x (lowest), y and z
//! of the minimum corner in level-19 cells. Ascending words are in Morton order.

use std::fmt;

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

use crate::lattice::cell_at;
use crate::octant::{CELLS_PER_EDGE, LEVEL_MAX, Octant};

/// One past the Morton code of the last level-19 cell.
pub const KEY_END: u64 = 1 << 57;

/// The bits of a word that hold the side.
pub const SIDE_BITS: u64 = 3;

/// Position of a leaf relative to the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// Outside the body
    Outside = 0,
    /// Inside the body
    Inside = 1,
    /// The surface crosses the leaf
    Crossing = 2,
}

impl Side {
    /// All sides, in the order of their codes.
    pub const ALL: [Self; 3] = [Self::Outside, Self::Inside, Self::Crossing];
}

impl fmt::Display for Side {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(["outside", "inside", "crossing"][*self as usize])
    }
}

/// Spreads the low 19 bits of `v`, with two zero bits after each.
fn spread(v: u32) -> u64 {
    let mut x = u64::from(v);
    x = (x | x << 32) & 0x001f_0000_0000_ffff;
    x = (x | x << 16) & 0x001f_0000_ff00_00ff;
    x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

/// The inverse of [`spread`].
fn gather(v: u64) -> u32 {
    let mut x = v & 0x1249_2492_4924_9249;
    x = (x | x >> 2) & 0x10c3_0c30_c30c_30c3;
    x = (x | x >> 4) & 0x100f_00f0_0f00_f00f;
    x = (x | x >> 8) & 0x001f_0000_ff00_00ff;
    x = (x | x >> 16) & 0x001f_0000_0000_ffff;
    ((x | x >> 32) & 0x001f_ffff) as u32
}

/// Morton code of a level-19 cell.
pub fn key_of(corner: [u32; 3]) -> u64 {
    debug_assert!(corner.iter().all(|&c| c < CELLS_PER_EDGE));
    spread(corner[0]) | spread(corner[1]) << 1 | spread(corner[2]) << 2
}

/// The level-19 cell with this Morton code.
pub fn corner_of(key: u64) -> [u32; 3] {
    [gather(key), gather(key >> 1), gather(key >> 2)]
}

/// Number of level-19 cells in an octant of this level.
pub fn span(level: u8) -> u64 {
    1 << (3 * (LEVEL_MAX - level))
}

/// The Morton code in a word.
pub fn key(word: u64) -> u64 {
    word >> 7
}

/// The level field of a word, which may be invalid (0 to 31).
pub fn level(word: u64) -> u8 {
    (word >> 2 & 31) as u8
}

/// Checks that a word is a leaf.
///
/// # Errors
/// The reason why it is none.
pub fn check(word: u64) -> Result<(), String> {
    let level = level(word);
    Err(match () {
        () if level > LEVEL_MAX => format!("level {level} is deeper than {LEVEL_MAX}"),
        () if word & 3 == 3 => "side 3 does not exist".to_owned(),
        () if key(word) & (span(level) - 1) == 0 => return Ok(()),
        () => "the corner is not a multiple of the leaf's edge".to_owned(),
    })
}

/// The end of the leaves so far, as a Morton code.
#[derive(Clone, Copy, Debug, Default)]
pub struct Order(u64);

impl Order {
    /// Adds the next word of a linear oct-tree.
    ///
    /// # Errors
    /// Why the word is none.
    pub fn add(&mut self, word: u64) -> Result<(), String> {
        check(word).map_err(|why| format!("the word {word:#018x} is not a leaf: {why}"))?;
        if key(word) < self.0 {
            return Err(format!("{} overlaps or precedes the leaf before it", octant(word)));
        }
        self.0 = key(word) + span(level(word));
        Ok(())
    }
}

/// The word of a leaf.
pub fn encode(octant: Octant, side: Side) -> u64 {
    key_of(octant.corner) << 7 | u64::from(octant.level) << 2 | side as u64
}

/// The octant of a valid word.
pub fn octant(word: u64) -> Octant {
    Octant { corner: corner_of(key(word)), level: level(word) }
}

/// The index of the leaf whose half-open octant contains a lattice point, among sorted leaves that do not overlap; `None` for a point outside
/// the root.
pub fn leaf_at(words: &[u64], point: [i64; 3]) -> Option<usize> {
    let of_cell = key_of(cell_at(point)?);
    let i = words.partition_point(|&w| key(w) <= of_cell).checked_sub(1)?;
    (of_cell < key(words[i]) + span(level(words[i]))).then_some(i)
}

/// Whether the surface crosses the leaf of a word.
pub fn is_crossing(word: u64) -> bool {
    word & SIDE_BITS == Side::Crossing as u64
}

/// The side of a valid word.
pub fn side(word: u64) -> Side {
    Side::ALL[(word & SIDE_BITS) as usize]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice::UNITS_PER_EDGE;
    use crate::testing::random_words;
    use proptest::prelude::*;

    #[test]
    fn axes_interleave_with_x_lowest() {
        assert_eq!(key_of([1, 0, 0]), 1);
        assert_eq!(key_of([0, 1, 0]), 2);
        assert_eq!(key_of([0, 0, 1]), 4);
        assert_eq!(key_of([CELLS_PER_EDGE - 1; 3]), KEY_END - 1);
    }

    proptest! {
        #[test]
        fn decoding_inverts_encoding(x in 0..CELLS_PER_EDGE, y in 0..CELLS_PER_EDGE, z in 0..CELLS_PER_EDGE,
                           level in 0..=LEVEL_MAX, side in 0usize..3) {
            let leaf = Octant { corner: [x, y, z], level: LEVEL_MAX }.ancestor(level);
            let word = encode(leaf, Side::ALL[side]);
            prop_assert_eq!(check(word), Ok(()));
            prop_assert_eq!((octant(word), super::side(word)), (leaf, Side::ALL[side]));
        }

        #[test]
        fn keys_interleave_bit_by_bit(x in 0..CELLS_PER_EDGE, y in 0..CELLS_PER_EDGE, z in 0..CELLS_PER_EDGE) {
            let mut expected = 0u64;
            for bit in 0..19 {
                for (a, c) in [x, y, z].into_iter().enumerate() {
                    expected |= u64::from(c >> bit & 1) << (3 * bit + a);
                }
            }
            prop_assert_eq!(key_of([x, y, z]), expected);
            prop_assert_eq!(corner_of(expected), [x, y, z]);
        }

        #[test]
        fn the_leaf_at_a_point_is_found_among_all(words in random_words(3), point in prop::array::uniform3(-5i64..=UNITS_PER_EDGE + 5)) {
            let contains = |w: &u64| {
                let (low, high) = octant(*w).bounds();
                (0..3).all(|a| low[a] <= point[a] && point[a] < high[a])
            };
            prop_assert_eq!(leaf_at(&words, point), words.iter().position(contains));
            for &w in &words {
                let (low, high) = octant(w).bounds();
                prop_assert_eq!(leaf_at(&words, low).map(|i| words[i]), Some(w));
                prop_assert_eq!(leaf_at(&words, high.map(|c| c - 1)).map(|i| words[i]), Some(w));
            }
        }
    }

    #[test]
    fn each_invalid_field_has_its_own_error() {
        assert_eq!(check(20 << 2).unwrap_err(), "level 20 is deeper than 19");
        assert!(check(0x1234_5670_0000_004c_u64.swap_bytes()).is_err());
        assert_eq!(check(3).unwrap_err(), "side 3 does not exist");
        assert!(check(1 << 7).unwrap_err().starts_with("the corner"));
        assert_eq!(check(1 << 7 | 19 << 2), Ok(()));
    }

    #[test]
    fn the_root_is_half_open() {
        assert_eq!(cell_at([0; 3]), Some([0; 3]));
        assert_eq!(cell_at([UNITS_PER_EDGE - 1; 3]), Some([CELLS_PER_EDGE - 1; 3]));
        for axis in 0..3 {
            for outside in [-1, UNITS_PER_EDGE] {
                let mut point = [5; 3];
                point[axis] = outside;
                assert!(cell_at(point).is_none() && leaf_at(&[0], point).is_none());
            }
        }
    }
}
