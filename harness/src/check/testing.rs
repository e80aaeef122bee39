//! Small meshes for tests, made by hand or at random.

use proptest::prelude::*;

use crate::octant::Octant;
use crate::word::{self, Leaf, Side};

/// The leaves of the tree in which exactly the octants that `split` picks are split, all outside.
pub fn words_of(split: impl Fn(&Octant) -> bool) -> Vec<u64> {
    sided(split, |_| Some(Side::Outside))
}

/// The same, each leaf with the side that `side` gives it, or left out.
pub fn sided(split: impl Fn(&Octant) -> bool, side: impl Fn(&Octant) -> Option<Side>) -> Vec<u64> {
    let mut words = Vec::new();
    let mut stack = vec![Octant::ROOT];
    while let Some(octant) = stack.pop() {
        if split(&octant) {
            stack.extend((0..8).map(|d| octant.child(d)));
        } else if let Some(side) = side(&octant) {
            words.push(word::encode(&Leaf { octant, side }));
        }
    }
    words.sort_unstable();
    words
}

/// Any tree to this level, with sides and holes at random.
pub fn random_words(level: u8) -> impl Strategy<Value = Vec<u64>> {
    any::<u64>().prop_map(move |seed| {
        let pick = |octant: &Octant, salt: u64| {
            let word = word::key_of(octant.corner) << 5 | u64::from(octant.level);
            (crate::digest::mix(word ^ seed.rotate_left(salt as u32 * 8)) >> 100) as u64
        };
        sided(
            |o| o.level < level && pick(o, 0) % 5 < 3,
            |o| Side::ALL.get(pick(o, 1) as usize % 4).copied(),
        )
    })
}

/// The leaves' octants and all their ancestors, each once.
pub fn octants_of(words: &[u64]) -> Vec<Octant> {
    let mut all: Vec<Octant> = Vec::new();
    for octant in words.iter().map(|&w| word::octant(w)) {
        all.extend((0..=octant.level).map(|l| octant.ancestor(l)));
    }
    all.sort_unstable_by_key(|o| (o.level, o.corner));
    all.dedup();
    all
}
