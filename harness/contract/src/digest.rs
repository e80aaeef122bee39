//! The digest of a set of leaf words (reference/DEFINITION.md, section 8): a sum, so neither order nor
//! partition changes it, and digests of parts merge by addition.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Sum modulo 2^128 of every leaf word's mix.
#[derive(Clone, Copy, Default, PartialEq, Eq, Hash)]
pub struct Digest(pub u128);

/// The finaliser of SplitMix64.
fn finalise(mut x: u64) -> u64 {
    x ^= x >> 30;
    x = x.wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x ^= x >> 27;
    x = x.wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ x >> 31
}

/// What one word adds to a digest.
pub fn mix(word: u64) -> u128 {
    let a = finalise(word.wrapping_add(0x9e37_79b9_7f4a_7c15));
    let b = finalise(a ^ word.rotate_left(32));
    u128::from(a) << 64 | u128::from(b)
}

impl Digest {
    /// The digest of some words.
    pub fn of(words: &[u64]) -> Self {
        let mut digest = Self::default();
        words.iter().for_each(|&w| digest.add(w));
        digest
    }

    /// Counts one more word in.
    pub fn add(&mut self, word: u64) {
        self.0 = self.0.wrapping_add(mix(word));
    }

    /// Counts another set of words in.
    pub fn merge(&mut self, other: Self) {
        self.0 = self.0.wrapping_add(other.0);
    }

    /// Counts a set of words out that was counted in.
    pub fn remove(&mut self, other: Self) {
        self.0 = self.0.wrapping_sub(other.0);
    }
}

impl fmt::Display for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:032x}", self.0)
    }
}

impl fmt::Debug for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self}")
    }
}

impl FromStr for Digest {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, String> {
        let hex = s.len() == 32 && s.bytes().all(|b| matches!(b, b'0'..=b'9' | b'a'..=b'f'));
        match u128::from_str_radix(s, 16) {
            Ok(value) if hex => Ok(Self(value)),
            _ => Err(format!("a digest is 32 lower-case hex digits, not {s:?}")),
        }
    }
}

impl Serialize for Digest {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Digest {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        String::deserialize(from)?.parse().map_err(serde::de::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn order_and_parts_do_not_matter() {
        let words = [5, 900, 1 << 40, 77];
        let mut merged = Digest::of(&[77, 5]);
        merged.merge(Digest::of(&[1 << 40, 900]));
        assert_eq!(merged, Digest::of(&words));
        assert_ne!(merged, Digest::of(&words[..3]));
    }

    #[test]
    fn hex_reads_back_and_only_hex() {
        let digest = Digest::of(&[42]);
        assert_eq!(digest.to_string().parse(), Ok(digest));
        assert!("12".parse::<Digest>().is_err());
        assert!("+0000000000000000000000000000001".parse::<Digest>().is_err());
    }

    /// The finaliser's own published value: SplitMix64 seeded with 0 gives this first.
    #[test]
    fn the_finaliser_is_splitmix64() {
        assert_eq!(finalise(0x9e37_79b9_7f4a_7c15), 0xe220_a839_7b1d_cdaf);
    }
}
