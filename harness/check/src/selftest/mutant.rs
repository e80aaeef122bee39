//! A corruption: its name, the check that must detect it, and what it changes; and operations on leaves: split, merge and move them,
//! with a manifest that agrees with the result.

use std::io;
use std::path::Path;

use super::SelftestCase;
use contract::leafset::LeafSet;
use contract::manifest::{Components, Manifest, Tree as Kind};
use contract::neighbourhood::Neighbourhood;
use contract::octant::CELLS_PER_EDGE;
use contract::tree::{Kinds, Tree};
use contract::word::{self, Side};

/// A way to corrupt a correct mesh.
#[derive(Clone, Copy, Debug)]
pub struct Mutant {
    /// Description of the change.
    pub name: &'static str,
    /// The check that must report it.
    pub expected: &'static str,
    /// Whether the check of that name in the audit must report it, too.
    pub audit: bool,
    pub(super) change: Change,
}

/// In place of `audit`: the leaves alone show the corruption.
pub(super) const AUDITED: bool = true;
/// In place of `audit`: only the case, T0 or another mesh shows the corruption.
pub(super) const INFORMED: bool = false;

/// What a corruption changes. `None` if it does not apply.
#[derive(Clone, Copy, Debug)]
pub(super) enum Change {
    /// The leaves of the final mesh or of T0, with a manifest that agrees with them: no check shall detect the change by a digest.
    Words(Kind, fn(&SelftestCase) -> Option<Vec<u64>>),
    /// The manifest of the mesh.
    Manifest(fn(&mut Manifest)),
    /// The components that the manifest counts, if it does.
    Components(fn(&mut Components)),
    /// The files of the mesh.
    Files(fn(&Path) -> io::Result<()>),
    /// Anything.
    Sets(fn(&SelftestCase, &mut Mutation) -> Option<()>),
}

/// A corrupted mesh.
pub struct Mutation {
    /// The tree that was corrupted.
    pub tree: Kind,
    /// The mesh to write.
    pub mesh: LeafSet,
    /// A change of the files after they were written.
    pub tamper: Option<fn(&Path) -> io::Result<()>>,
}

impl Mutation {
    /// The final mesh or T0 without a change.
    pub fn of(correct: &SelftestCase, tree: Kind) -> Self {
        Self { tree, mesh: correct.set(tree).clone(), tamper: None }
    }
}

impl Mutant {
    /// The corrupted mesh; `None` if the corruption does not apply.
    pub fn make(&self, correct: &SelftestCase) -> Option<Mutation> {
        let mut made = Mutation::of(correct, Kind::Final);
        match self.change {
            Change::Words(tree, words) => {
                let mesh = with_words(correct.set(tree), words(correct)?);
                made = Mutation { tree, mesh, ..made };
            }
            Change::Manifest(edit) => {
                edit(&mut made.mesh.manifest);
                (made.mesh.manifest != correct.mesh.manifest).then_some(())?;
            }
            Change::Components(edit) => edit(made.mesh.manifest.components.as_mut()?),
            Change::Files(tamper) => {
                // Both parts have enough leaves for the damage to have an effect.
                let are_enough = |part: &Vec<u64>| (2..1 << 20).contains(&part.len());
                correct.mesh.parts[1..].iter().all(are_enough).then_some(())?;
                made.tamper = Some(tamper);
            }
            Change::Sets(change) => change(correct, &mut made)?,
        }
        Some(made)
    }
}

macro_rules! rows {
    ($($function:ident: $change:ident $([$tree:ident])? ($type:ty);)*) => {$(
        /// A row of the tables.
        pub(super) const fn $function(
            name: &'static str, expected: &'static str, audit: bool, change: $type,
        ) -> Mutant {
            Mutant { name, expected, audit, change: Change::$change($(Kind::$tree,)? change) }
        }
    )*};
}

rows! {
    words: Words[Final](fn(&SelftestCase) -> Option<Vec<u64>>);
    base: Words[Base](fn(&SelftestCase) -> Option<Vec<u64>>);
    edit: Manifest(fn(&mut Manifest));
    counts: Components(fn(&mut Components));
    damaged: Files(fn(&Path) -> io::Result<()>);
    sets: Sets(fn(&SelftestCase, &mut Mutation) -> Option<()>);
}

/// Number of parts of every mesh.
const PARTS: usize = 3;

/// The case with its mesh in several parts that interleave in Morton order, like those of METIS.
pub(super) fn in_parts(correct: &SelftestCase) -> SelftestCase {
    SelftestCase { mesh: with_words(&correct.mesh, correct.mesh.words.clone()), ..correct.clone() }
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

/// Whether a leaf and its neighbours have none of these kinds.
pub(super) fn is_far(tree: &Tree, word: u64, from: Kinds) -> bool {
    let around = Neighbourhood::of(tree, word::octant(word));
    around.handles.iter().all(|&handle| tree.kinds(handle) & from == 0)
}

/// The leaf with this side.
pub(super) fn with_side(word: u64, side: Side) -> u64 {
    word & !3 | side as u64
}

/// The leaf with the side that follows its own.
pub(super) fn other_side(word: u64) -> u64 {
    with_side(word, Side::ALL[(word as usize % 4 + 1) % 3])
}

/// The eight children of a leaf, with its side.
pub(super) fn children(word: u64) -> [u64; 8] {
    let (octant, side) = (word::octant(word), word::side(word));
    std::array::from_fn(|d| word::encode(octant.child(d as u8), side))
}

/// The words with the first leaf split that satisfies a predicate.
pub(super) fn split_first(words: &[u64], predicate: impl Fn(u64) -> bool) -> Option<Vec<u64>> {
    let i = words.iter().position(|&w| predicate(w))?;
    Some([&words[..i], &children(words[i]), &words[i + 1..]].concat())
}

/// Indices of the first of eight sibling leaves that have the same side.
pub(super) fn sibling_groups(words: &[u64]) -> Vec<usize> {
    let are_siblings =
        |eight: &[u64]| word::level(eight[0]) > 0 && eight == children(parent(eight[0])).as_slice();
    (0..words.len()).filter(|i: &usize| words[*i..].get(..8).is_some_and(are_siblings)).collect()
}

/// The parent of a leaf, with the leaf's side.
pub(super) fn parent(word: u64) -> u64 {
    word::encode(word::octant(word).parent(), word::side(word))
}

/// The words with the groups of eight siblings at these ascending indices merged.
pub(super) fn merge(words: &[u64], sibling_groups: &[usize]) -> Vec<u64> {
    let mut all = words.to_vec();
    // From the last on, so that the indices of those before it remain.
    for &i in sibling_groups.iter().rev() {
        all.splice(i..i + 8, [parent(words[i])]);
    }
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
        let mut octant = word::octant(w);
        octant.corner[0] = CELLS_PER_EDGE - octant.edge() - octant.corner[0];
        word::encode(octant, word::side(w))
    };
    let mut all: Vec<u64> = words.iter().map(mirror).collect();
    all.sort_unstable();
    all
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
