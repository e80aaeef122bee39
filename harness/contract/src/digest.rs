//! The digest of a set of leaf words (reference/DEFINITION.md, section 8). It is a sum, so it depends neither
//! on order nor on the partition, and the digests of parts are merged by addition.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::lattice::FacetLattice;

/// Sum of [`mix`] over all leaf words, modulo 2^128.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Digest(pub u128);

/// The finaliser of SplitMix64.
fn finalise(mut x: u64) -> u64 {
    x ^= x >> 30;
    x = x.wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x ^= x >> 27;
    x = x.wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ x >> 31
}

/// The contribution of one word to a digest.
pub fn mix(word: u64) -> u128 {
    let a = finalise(word.wrapping_add(INCREMENT));
    let b = finalise(a ^ word.rotate_left(32));
    u128::from(a) << 64 | u128::from(b)
}

/// The increment of SplitMix64.
const INCREMENT: u64 = 0x9e37_79b9_7f4a_7c15;

impl Digest {
    /// The digest of a geometry: that of one word per facet.
    pub fn of_facets(facets: &[FacetLattice]) -> Self {
        let mut digest = Self::default();
        for facet in facets {
            let step = |w: u64, &c: &i64| finalise((w ^ c as u64).wrapping_add(INCREMENT));
            digest.add(facet.as_flattened().iter().fold(0, step));
        }
        digest
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

    #[test]
    fn a_digest_depends_neither_on_order_nor_on_parts() {
        let words = [5, 900, 1 << 40, 77];
        let mut merged = Digest::of(&[77, 5]);
        merged.merge(Digest::of(&[1 << 40, 900]));
        assert_eq!(merged, Digest::of(&words));
        assert_ne!(merged, Digest::of(&words[..3]));
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
