//! Instruments: leaves split, merged and moved, with manifests made true to the result.

use super::Specimen;
use contract::leafset::LeafSet;
use contract::octant::{CELLS_PER_EDGE, Octant};
use contract::tree::{Hood, Tree};
use contract::word::{self, Leaf, Side};

/// Parts that every specimen is cut into.
const PARTS: usize = 3;

/// A specimen in several parts that interleave in Morton order, as METIS makes them.
pub(super) fn in_parts(specimen: &Specimen) -> Specimen {
    let mesh = with_words(&specimen.mesh, specimen.mesh.words.clone());
    Specimen { mesh, ..specimen.clone() }
}

/// The set with other leaves.
pub(super) fn with_words(set: &LeafSet, mut words: Vec<u64>) -> LeafSet {
    words.sort_unstable();
    let mut parts = vec![Vec::new(); PARTS];
    // By level-2 octant: neighbours in Morton order are often in different parts.
    words.iter().for_each(|&w| parts[(w >> 58) as usize % PARTS].push(w));
    set.with_parts(parts)
}

/// The same leaf with another side.
pub(super) fn sided(word: u64, side: Side) -> u64 {
    word & !3 | side as u64
}

/// The same leaf with the side after its own.
pub(super) fn other_side(word: u64) -> u64 {
    sided(word, Side::ALL[(word as usize % 4 + 1) % 3])
}

/// Whether a leaf has this side.
pub(super) fn is(word: u64, side: Side) -> bool {
    word & 3 == side as u64
}

/// The leaf's eight children, with its side.
pub(super) fn children(word: u64) -> [u64; 8] {
    let (octant, side) = (word::octant(word), word::side(word));
    std::array::from_fn(|d| word::encode(&Leaf { octant: octant.child(d as u8), side }))
}

/// The words with the leaf at this index split.
pub(super) fn split(words: &[u64], i: usize) -> Vec<u64> {
    let mut all = words.to_vec();
    all.splice(i..=i, children(words[i]));
    all
}

/// Indices at which eight leaves of one side make up an octant.
pub(super) fn octets(words: &[u64]) -> Vec<usize> {
    let whole = |i: &usize| words[*i..].get(..8).is_some_and(is_octet);
    (0..words.len()).filter(whole).collect()
}

fn is_octet(eight: &[u64]) -> bool {
    let (first, last) = (word::octant(eight[0]), word::octant(eight[7]));
    let alike = eight.iter().all(|w| w & 127 == eight[0] & 127);
    alike && first.level > 0 && first.digit() == 0 && {
        let parent = first.ancestor(first.level - 1);
        parent.contains(&last) && last.digit() == 7
    }
}

/// The leaf that eight siblings make when merged.
pub(super) fn parent(word: u64) -> u64 {
    let octant = word::octant(word);
    word::encode(&Leaf { octant: octant.ancestor(octant.level - 1), side: word::side(word) })
}

/// The words with the octets at these ascending indices merged.
pub(super) fn merge(words: &[u64], octets: &[usize]) -> Vec<u64> {
    let mut all = Vec::with_capacity(words.len());
    let mut from = 0;
    for &i in octets {
        all.extend(&words[from..i]);
        all.push(parent(words[i]));
        from = i + 8;
    }
    all.extend(&words[from..]);
    all
}

/// Every leaf moved by `by` level-19 cells along x, around the root where it leaves it.
pub(super) fn shifted(words: &[u64], by: u32) -> Vec<u64> {
    let moved = |&w: &u64| {
        let mut corner = word::corner_of(word::key(w));
        corner[0] = (corner[0] + by) % CELLS_PER_EDGE;
        word::key_of(corner) << 7 | w & 127
    };
    words.iter().map(moved).collect()
}

/// Every leaf mirrored in the middle plane across x.
pub(super) fn mirrored(words: &[u64]) -> Vec<u64> {
    let mirror = |&w: &u64| {
        let Leaf { mut octant, side } = Leaf { octant: word::octant(w), side: word::side(w) };
        octant.corner[0] = CELLS_PER_EDGE - octant.edge() - octant.corner[0];
        word::encode(&Leaf { octant, side })
    };
    let mut all: Vec<u64> = words.iter().map(mirror).collect();
    all.sort_unstable();
    all
}

/// A leaf's hood in a mesh.
pub(super) fn hood(tree: &Tree, word: u64) -> Hood {
    Hood::at(tree, word::octant(word))
}

/// The T0 leaf's level where a leaf of the mesh lies.
pub(super) fn base_level(base: &Tree, octant: &Octant) -> u8 {
    base.locate(octant.corner).map_or(0, |(o, _)| o.level)
}
