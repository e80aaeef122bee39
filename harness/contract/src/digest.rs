//! The digest of a set of leaf words (reference/DEFINITION.md, section 8). It is a sum, so it depends neither
//! on order nor on the partition, and the digests of parts are merged by addition.

use std::fmt;

use multiversion::multiversion;
use serde::{Deserialize, Serialize};

use crate::htg::Block;
use crate::lattice::FacetLattice;

/// Sum of [`mix`] over all leaf words, modulo 2^128.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Digest(pub u128);

/// The finaliser of SplitMix64.
#[inline(always)]
fn finalise(mut x: u64) -> u64 {
    x ^= x >> 30;
    x = x.wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x ^= x >> 27;
    x = x.wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ x >> 31
}

/// The contribution of one word to a digest.
pub fn mix(word: u64) -> u128 {
    let (a, b) = halves(word);
    u128::from(a) << 64 | u128::from(b)
}

#[inline(always)]
fn halves(word: u64) -> (u64, u64) {
    let a = finalise(word.wrapping_add(INCREMENT));
    (a, finalise(a ^ word.rotate_left(32)))
}

/// The increment of SplitMix64.
const INCREMENT: u64 = 0x9e37_79b9_7f4a_7c15;

/// The sum of [`mix`] of all words. The two parts of the low halves are summed separately, so that the loop needs no carry, and of so few words at
/// once that they cannot overflow.
#[multiversion(targets("x86_64+avx512f+avx512dq"))]
fn sum_of(block: &Block) -> u128 {
    let (mut sum, count, step) = (0u128, block.leaves().min(1 << 30), block.step());
    for begin in (0..block.leaves()).step_by(1 << 30) {
        let [mut high, mut low, mut low_top] = [0u64; 3];
        for i in begin..begin + count {
            let (a, b) = halves(block.first.wrapping_add(i.wrapping_mul(step)));
            high = high.wrapping_add(a);
            low += b & 0xffff_ffff;
            low_top += b >> 32;
        }
        let of_low = u128::from(low).wrapping_add(u128::from(low_top) << 32);
        sum = sum.wrapping_add(u128::from(high) << 64).wrapping_add(of_low);
    }
    sum
}

impl Digest {
    /// The digest of a geometry: that of one word per facet.
    pub fn of_facets(facets: &[FacetLattice]) -> Self {
        let step = |w: u64, &c: &i64| finalise((w ^ c as u64).wrapping_add(INCREMENT));
        let word = |facet: &FacetLattice| facet.as_flattened().iter().fold(0, step);
        Self::of(&facets.iter().map(word).collect::<Vec<u64>>())
    }

    /// The digest of these words.
    pub fn of(words: &[u64]) -> Self {
        let mut digest = Self::default();
        words.iter().for_each(|&w| digest.add(w));
        digest
    }

    /// Adds one word.
    pub fn add(&mut self, word: u64) {
        self.0 = self.0.wrapping_add(mix(word));
    }

    /// Adds the words of a block: as many at once as the processor can.
    pub fn add_block(&mut self, block: &Block) {
        self.merge(Self(sum_of(block)));
    }

    /// Adds the words of another digest.
    pub fn merge(&mut self, other: Self) {
        self.0 = self.0.wrapping_add(other.0);
    }
}

impl fmt::Display for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:032x}", self.0)
    }
}

impl From<Digest> for String {
    fn from(digest: Digest) -> Self {
        digest.to_string()
    }
}

impl TryFrom<String> for Digest {
    type Error = String;

    fn try_from(s: String) -> Result<Self, String> {
        let hex = s.len() == 32 && s.bytes().all(|b| matches!(b, b'0'..=b'9' | b'a'..=b'f'));
        match u128::from_str_radix(&s, 16) {
            Ok(value) if hex => Ok(Self(value)),
            _ => Err(format!("a digest is 32 lower-case hex digits, not {s:?}")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::octant::Octant;
    use crate::word::{Side, encode};

    #[test]
    fn a_digest_depends_neither_on_order_nor_on_parts() {
        let words = [5, 900, 1 << 40, 77];
        let mut merged = Digest::of(&[77, 5]);
        merged.merge(Digest::of(&[1 << 40, 900]));
        assert_eq!(merged, Digest::of(&words));
        assert_ne!(merged, Digest::of(&words[..3]));
    }

    #[test]
    fn the_digest_of_a_block_is_that_of_its_words() {
        for depth in 0..=4u8 {
            for level in [depth + 3, 11, 19] {
                let octant = Octant { corner: [1 << 18, 3 << 16, 5 << 16], level: level - depth };
                let first = encode(octant, Side::Crossing);
                let block = Block { first: first + (u64::from(depth) << 2), depth };
                let words: Vec<u64> = block.words().collect();
                let expected = octant.contains(&crate::word::octant(words[words.len() - 1]));
                assert!(expected && words.len() as u64 == block.leaves(), "{block:?}");
                let mut digest = Digest::of(&[7]);
                digest.add_block(&block);
                assert_eq!(digest, Digest::of(&[&words[..], &[7]].concat()), "{block:?}");
            }
        }
    }

    #[test]
    fn digests_are_parsed_from_32_hex_digits_only() {
        let digest = Digest::of(&[42]);
        assert_eq!(Digest::try_from(digest.to_string()), Ok(digest));
        assert!(Digest::try_from("12".to_owned()).is_err());
        assert!(Digest::try_from("+0000000000000000000000000000001".to_owned()).is_err());
    }

    /// Published value: the first output of SplitMix64 with seed 0.
    #[test]
    fn the_finaliser_is_splitmix64() {
        assert_eq!(finalise(INCREMENT), 0xe220_a839_7b1d_cdaf);
    }
}
