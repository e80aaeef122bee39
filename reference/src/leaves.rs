//! Leaf words: what can be read off them, and the digest.

/// The finaliser of a well-known generator (SplitMix64): every input bit sways every output bit.
fn scramble(mut x: u64) -> u64 {
    x ^= x >> 30;
    x = x.wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x ^= x >> 27;
    x = x.wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ x >> 31
}

/// What one leaf word adds to a digest.
#[must_use]
pub fn mix(word: u64) -> u128 {
    let high = scramble(word.wrapping_add(0x9e37_79b9_7f4a_7c15));
    let low = scramble(high ^ word.rotate_left(32));
    u128::from(high) << 64 | u128::from(low)
}

/// The digest of a set of leaves: a sum, so that neither order nor partition matters.
#[must_use]
pub fn digest(words: &[u64]) -> u128 {
    words.iter().fold(0, |sum, &word| sum.wrapping_add(mix(word)))
}

/// Counts and digests of a set of leaves.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tally {
    /// How many leaves there are of each level.
    pub leaves_by_level: [u64; 20],
    /// How many leaves there are outside, inside and crossing.
    pub leaves_by_side: [u64; 3],
    /// The digest of them all.
    pub digest: u128,
    /// The digest of the leaves whose minimum corner lies in each octant of level 3, in Morton order.
    pub octant_digests: Vec<u128>,
}

impl Tally {
    /// Of these leaves.
    ///
    /// # Panics
    /// When a word is not a leaf's.
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

/// A digest as it is written: 32 hexadecimal digits.
#[must_use]
pub fn hex(digest: u128) -> String {
    format!("{digest:032x}")
}
