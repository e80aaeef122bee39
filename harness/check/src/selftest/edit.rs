//! Operations on leaves: split, merge and move them, with a manifest that agrees with the result.

use super::SelftestCase;
use contract::leafset::LeafSet;
use contract::octant::CELLS_PER_EDGE;
use contract::tree::{Neighbourhood, Tree};
use contract::word::{self, Leaf, Side};

/// Number of parts of every mesh.
const PARTS: usize = 3;

/// The case with its mesh in several parts that interleave in Morton order, like those of METIS.
pub(super) fn in_parts(correct: &SelftestCase) -> SelftestCase {
    let mesh = with_words(&correct.mesh, correct.mesh.words.clone());
    SelftestCase { mesh, ..correct.clone() }
}

/// The set with other leaves.
pub(super) fn with_words(set: &LeafSet, mut words: Vec<u64>) -> LeafSet {
    words.sort_unstable();
    let mut parts = vec![Vec::new(); PARTS];
    // By level-2 octant, so that neighbours in Morton order are often in different parts.
    words.iter().for_each(|&w| parts[(w >> 58) as usize % PARTS].push(w));
    set.with_parts(parts)
}

/// Index of the middle one of the leaves that satisfy a predicate.
pub(super) fn middle(words: &[u64], predicate: impl Fn(u64) -> bool) -> Option<usize> {
    let fit: Vec<usize> = (0..words.len()).filter(|&i| predicate(words[i])).collect();
    fit.get(fit.len() / 2).copied()
}

/// The leaves of the mesh after a change at the middle one of those that satisfy a predicate.
pub(super) fn changed(
    s: &SelftestCase,
    predicate: impl Fn(u64) -> bool,
    change: impl FnOnce(&mut Vec<u64>, usize),
) -> Option<Vec<u64>> {
    let mut words = s.mesh.words.clone();
    let i = middle(&words, predicate)?;
    change(&mut words, i);
    Some(words)
}

/// The leaf with this side.
pub(super) fn with_side(word: u64, side: Side) -> u64 {
    word & !3 | side as u64
}

/// The leaf with the side that follows its own.
pub(super) fn other_side(word: u64) -> u64 {
    with_side(word, Side::ALL[(word as usize % 4 + 1) % 3])
}

/// Whether a leaf has this side.
pub(super) fn has_side(word: u64, side: Side) -> bool {
    word & 3 == side as u64
}

/// The eight children of a leaf, with its side.
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

/// Indices of the first of eight sibling leaves that have the same side.
pub(super) fn sibling_groups(words: &[u64]) -> Vec<usize> {
    let complete = |i: &usize| words[*i..].get(..8).is_some_and(is_sibling_group);
    (0..words.len()).filter(complete).collect()
}

fn is_sibling_group(eight: &[u64]) -> bool {
    let (first, last) = (word::octant(eight[0]), word::octant(eight[7]));
    let alike = eight.iter().all(|w| w & 127 == eight[0] & 127);
    alike && first.level > 0 && first.digit() == 0 && {
        let parent = first.ancestor(first.level - 1);
        parent.contains(&last) && last.digit() == 7
    }
}

/// The parent of a leaf, with the leaf's side.
pub(super) fn parent(word: u64) -> u64 {
    let octant = word::octant(word);
    word::encode(&Leaf { octant: octant.ancestor(octant.level - 1), side: word::side(word) })
}

/// The words with the groups of eight siblings at these ascending indices merged.
pub(super) fn merge(words: &[u64], sibling_groups: &[usize]) -> Vec<u64> {
    let mut all = Vec::with_capacity(words.len());
    let mut from = 0;
    for &i in sibling_groups {
        all.extend(&words[from..i]);
        all.push(parent(words[i]));
        from = i + 8;
    }
    all.extend(&words[from..]);
    all
}

/// The leaves, shifted periodically by `by` level-19 cells along x.
pub(super) fn shifted(words: &[u64], by: u32) -> Vec<u64> {
    let moved = |&w: &u64| {
        let mut corner = word::corner_of(word::key(w));
        corner[0] = (corner[0] + by) % CELLS_PER_EDGE;
        word::key_of(corner) << 7 | w & 127
    };
    words.iter().map(moved).collect()
}

/// The leaves, mirrored in the middle plane across x.
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

/// The neighbourhood of a leaf in a mesh.
pub(super) fn neighbourhood(tree: &Tree, word: u64) -> Neighbourhood {
    Neighbourhood::of(tree, word::octant(word))
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::testing::words_of;

    #[test]
    fn eight_leaves_of_one_side_are_a_sibling_group_if_they_fill_an_octant() {
        let words = words_of(|o| o.level < 1 || o.digit() == 7 && o.level < 2);
        assert_eq!((words.len(), sibling_groups(&words)), (15, vec![7]));
        let merged = merge(&words, &[7]);
        assert_eq!(
            (merged, sibling_groups(&merge(&words, &[7]))),
            (words_of(|o| o.level < 1), vec![0])
        );
        let mut sides = words.clone();
        sides[9] |= 1;
        assert_eq!(sibling_groups(&sides), [0usize; 0]);
        assert_eq!(sibling_groups(&words[1..9]), [0usize; 0]);
        // The root has no siblings.
        assert_eq!(sibling_groups(&[0; 8]), [0usize; 0]);
    }
}
