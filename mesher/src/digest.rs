//! The mesh's fingerprint: a sum over leaf words that does not depend on order or partition.
//!
//! `mix(w) = f(w + c) * 2^64 + f(f(w + c) ^ rotl(w, 32))` with splitmix64's finaliser `f`, summed
//! modulo 2^128. Sums of parts add up to the sum of the whole.

use crate::octant::Level;
use crate::wide::widest;

/// Level of the octants that have a digest of their own in the manifest.
pub const OCTANT_LEVEL: Level = 3;
/// Number of such octants.
pub const OCTANTS: usize = 512;

#[inline]
const fn finalise(x: u64) -> u64 {
    let x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ x >> 31
}

/// What one leaf word adds to the digest.
#[inline]
pub const fn mix(w: u64) -> u128 {
    let (a, b) = halves(w);
    (a as u128) << 64 | b as u128
}

#[inline]
const fn halves(w: u64) -> (u64, u64) {
    let a = finalise(w.wrapping_add(0x9e37_79b9_7f4a_7c15));
    (a, finalise(a ^ w.rotate_left(32)))
}

widest! {
    /// The digest of some words.
    pub fn digest(words: &[u64]) -> u128 = digest_lanes;
}

/// Sums with the low halves' two 32-bit parts apart, so that no carry is needed inside the loop.
#[inline(always)]
fn digest_lanes(words: &[u64]) -> u128 {
    let mut total = 0u128;
    // Fewer than 2^32 words at a time, so that the parts cannot overflow.
    for chunk in words.chunks(1 << 30) {
        let (mut high, mut low, mut low_top) = (0u64, 0u64, 0u64);
        for &w in chunk {
            let (a, b) = halves(w);
            high = high.wrapping_add(a);
            low += b & 0xffff_ffff;
            low_top += b >> 32;
        }
        let sum = (u128::from(high) << 64)
            .wrapping_add(u128::from(low))
            .wrapping_add(u128::from(low_top) << 32);
        total = total.wrapping_add(sum);
    }
    total
}

/// A digest as the manifest has it.
pub fn hex(digest: u128) -> String {
    format!("{digest:032x}")
}

/// Digests of a stream of sorted words: of the whole and of each octant of level 3.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Digests {
    /// Of the words whose leaf's minimum corner is in the octant.
    pub octants: Vec<u128>,
}

impl Default for Digests {
    fn default() -> Self {
        Self { octants: vec![0; OCTANTS] }
    }
}

impl Digests {
    /// Adds sorted words.
    pub fn add(&mut self, mut words: &[u64]) {
        const SHIFT: u32 = 64 - 3 * OCTANT_LEVEL;
        while let (Some(first), Some(last)) = (words.first(), words.last()) {
            let octant = first >> SHIFT;
            let run = if last >> SHIFT == octant {
                words.len()
            } else {
                words.partition_point(|w| w >> SHIFT == octant)
            };
            let sum = &mut self.octants[octant as usize];
            *sum = sum.wrapping_add(digest(&words[..run]));
            words = &words[run..];
        }
    }

    /// The digest of all words.
    pub fn whole(&self) -> u128 {
        self.octants.iter().fold(0, |s, d| s.wrapping_add(*d))
    }

    /// Adds another part's digests, by octant.
    pub fn merge(&mut self, other: impl IntoIterator<Item = (usize, u128)>) {
        for (octant, digest) in other {
            self.octants[octant] = self.octants[octant].wrapping_add(digest);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_of_parts_are_the_sum_of_the_whole() {
        let mut words: Vec<u64> =
            (0..5000u64).map(|i| i.wrapping_mul(0x9e37_79b9_7f4a_7c15)).collect();
        words.sort_unstable();
        let naive = words.iter().fold(0u128, |s, &w| s.wrapping_add(mix(w)));
        for (width, sum) in crate::wide::tests::widths(|| digest(&words)) {
            assert_eq!(sum, naive, "{width:?}");
        }
        let mut d = Digests::default();
        words.chunks(77).for_each(|c| d.add(c));
        assert_eq!(d.whole(), naive);
        let mut other = Digests::default();
        other.merge(d.octants.iter().copied().enumerate());
        assert_eq!(other, d);
    }
}
