//! The mesh's digest: a sum over leaf words that depends neither on their order nor on the partition.
//!
//! `mix(w) = f(w + c) * 2^64 + f(f(w + c) ^ rotl(w, 32))` with the finaliser `f` of splitmix64, summed
//! modulo 2^128. So the digest of a mesh is the sum of the digests of its parts.

use crate::facet::Facet;
use crate::octant::Level;
use crate::widest;

/// Level of the octants whose digests are in the manifest.
pub const OCTANT_LEVEL: Level = 3;

/// The increment of splitmix64.
const INCREMENT: u64 = 0x9e37_79b9_7f4a_7c15;

#[inline]
const fn finalise(x: u64) -> u64 {
    let x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ x >> 31
}

/// Contribution of one leaf word to the digest.
#[inline]
pub const fn mix(w: u64) -> u128 {
    let (a, b) = halves(w);
    (a as u128) << 64 | b as u128
}

#[inline]
const fn halves(w: u64) -> (u64, u64) {
    let a = finalise(w.wrapping_add(INCREMENT));
    (a, finalise(a ^ w.rotate_left(32)))
}

widest! {
    /// The digest of some words.
    pub fn digest(words: &[u64]) -> u128 = digest_lanes;
}

/// Sums the low halves modulo 2^64, and their upper 32 bits alone: the sum of the lower 32 bits follows, and the loop needs no carry.
#[inline(always)]
fn digest_lanes(words: &[u64]) -> u128 {
    let mut total = 0u128;
    // Fewer than 2^32 words at a time, so that the sums of 32-bit parts cannot overflow.
    for chunk in words.chunks(1 << 30) {
        let (mut high, mut low, mut top) = (0u64, 0u64, 0u64);
        for &w in chunk {
            let (a, b) = halves(w);
            high = high.wrapping_add(a);
            low = low.wrapping_add(b);
            top += b >> 32;
        }
        let low = u128::from(low.wrapping_sub(top << 32)) + (u128::from(top) << 32);
        total = total.wrapping_add(low).wrapping_add(u128::from(high) << 64);
    }
    total
}

widest! {
    /// The digest of a geometry: that of one word per facet.
    pub fn of_facets(facets: &[Facet]) -> u128 = of_facets_lanes;
}

/// A facet's word is a chain of nine dependent steps, so many facets are taken at a time.
#[inline(always)]
fn of_facets_lanes(facets: &[Facet]) -> u128 {
    let mut total = 0u128;
    for chunk in facets.chunks(64) {
        let mut words = [0; 64];
        for i in 0..9 {
            for (w, f) in words.iter_mut().zip(chunk) {
                *w = chained(*w, f.v[i / 3][i % 3]);
            }
        }
        total = total.wrapping_add(digest_lanes(&words[..chunk.len()]));
    }
    total
}

/// The word of some coordinates and of one more.
#[inline(always)]
pub fn chained(word: u64, coordinate: i32) -> u64 {
    finalise((word ^ i64::from(coordinate) as u64).wrapping_add(INCREMENT))
}

/// A digest in the manifest's notation: 32 hexadecimal digits.
pub fn hex(digest: u128) -> String {
    format!("{digest:032x}")
}

/// Digests of a stream of sorted words, by octant of level 3.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Digests {
    /// One digest per octant in Morton order, of the leaves whose minimum corner is in the octant.
    pub octants: Vec<u128>,
}

impl Default for Digests {
    fn default() -> Self {
        Self { octants: vec![0; 1 << (3 * OCTANT_LEVEL)] }
    }
}

impl Digests {
    /// Adds sorted words.
    pub fn add(&mut self, mut words: &[u64]) {
        const SHIFT: u32 = 64 - 3 * OCTANT_LEVEL;
        while let Some(octant) = words.first().map(|w| w >> SHIFT) {
            let (run, rest) = words.split_at(words.partition_point(|w| w >> SHIFT == octant));
            self.merge([(octant as usize, digest(run))]);
            words = rest;
        }
    }

    /// The digest of all words.
    pub fn whole(&self) -> u128 {
        self.octants.iter().fold(0, |s, d| s.wrapping_add(*d))
    }

    /// Adds digests of another part, given by octant.
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
    fn digests_of_parts_add_up_to_the_digest_of_the_whole() {
        let mut words: Vec<u64> =
            (0..5000u64).map(|i| i.wrapping_mul(0x9e37_79b9_7f4a_7c15)).collect();
        words.sort_unstable();
        let naive = words.iter().fold(0u128, |s, &w| s.wrapping_add(mix(w)));
        for (width, sum) in crate::wide::widths(|| digest(&words)) {
            assert_eq!(sum, naive, "{width:?}");
        }
        let mut d = Digests::default();
        words.chunks(77).for_each(|c| d.add(c));
        assert_eq!(d.whole(), naive);
        let mut other = Digests::default();
        other.merge(d.octants.iter().copied().enumerate());
        assert_eq!(other, d);
    }

    #[test]
    fn values_are_those_of_the_proofs() {
        let halves = |d: u128| vec![(d >> 64) as i128, d as u64 as i128];
        crate::values::compare(
            "bricks/src/digest.rs",
            &[
                ("mix", &|a| halves(mix(a[0] as u64))),
                ("digest_lanes", &|a| {
                    halves(digest(&a.iter().map(|w| *w as u64).collect::<Vec<u64>>()))
                }),
            ],
        );
    }
}
