//! Digests and counts of leaf words (`DEFINITION.md`, section 8).
use crate::lattice::Facet;
use serde::Serialize;

/// The finaliser of the SplitMix64 generator: every input bit affects every output bit.
fn scramble(mut x: u64) -> u64 {
    x ^= x >> 30;
    x = x.wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x ^= x >> 27;
    x = x.wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ x >> 31
}

/// The contribution of one leaf word to a digest.
#[must_use]
pub fn mix(word: u64) -> u128 {
    let high = scramble(word.wrapping_add(0x9e37_79b9_7f4a_7c15));
    let low = scramble(high ^ word.rotate_left(32));
    u128::from(high) << 64 | u128::from(low)
}

/// The digest of a set of leaves: a sum modulo 2^128, which depends neither on the order of the
/// words nor on their partition.
#[must_use]
pub fn digest(words: &[u64]) -> u128 {
    words.iter().fold(0, |sum, &word| sum.wrapping_add(mix(word)))
}

/// The digest of a geometry: that of one word per facet.
#[must_use]
pub fn digest_of_facets(facets: &[Facet]) -> u128 {
    let step = |w: u64, &c: &i64| scramble((w ^ c as u64).wrapping_add(0x9e37_79b9_7f4a_7c15));
    let word = |facet: &Facet| facet.as_flattened().iter().fold(0, step);
    digest(&facets.iter().map(word).collect::<Vec<u64>>())
}

/// Counts and digests of a set of leaves.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tally {
    /// Number of leaves of each level.
    pub leaves_by_level: [u64; 20],
    /// Numbers of outside, inside and crossing leaves.
    pub leaves_by_side: [u64; 3],
    /// The digest of all leaves.
    pub digest: u128,
    /// The digest of the leaves whose minimum corner lies in each octant of level 3, in Morton
    /// order.
    pub octant_digests: Vec<u128>,
}

impl Tally {
    /// The counts and digests of the leaves with these words.
    ///
    /// # Panics
    /// If a word is not a valid leaf word.
    #[must_use]
    pub fn of(words: &[u64]) -> Self {
        let mut tally = Self {
            leaves_by_level: [0; 20],
            leaves_by_side: [0; 3],
            digest: digest(words),
            octant_digests: vec![0; 512],
        };
        for &word in words {
            tally.leaves_by_level[(word >> 2 & 31) as usize] += 1;
            tally.leaves_by_side[(word & 3) as usize] += 1;
            let of_octant = &mut tally.octant_digests[(word >> 55) as usize];
            *of_octant = of_octant.wrapping_add(mix(word));
        }
        tally
    }
}

/// The facets as read, as manifest and record contain them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Geometry {
    /// Their number.
    pub facets: u64,
    /// Their digest on the lattice.
    pub digest: String,
}

impl Geometry {
    /// The geometry of these facets.
    #[must_use]
    pub fn of(facets: &[Facet]) -> Self {
        Self { facets: facets.len() as u64, digest: hex(digest_of_facets(facets)) }
    }
}

/// A digest as 32 lower-case hexadecimal digits.
#[must_use]
pub fn hex(digest: u128) -> String {
    format!("{digest:032x}")
}
