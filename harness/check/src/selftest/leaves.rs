//! Removed, duplicated and moved leaves, which the checks `linear`, `complete` and `identical` must detect.

use super::mutant::{
    self, AUDITED, INFORMED, Mutant, changed, has_side, middle, sets, sibling_groups, split, words,
};
use contract::manifest::Keep;
use contract::neighbourhood::Neighbourhood;
use contract::octant::{CELLS_PER_EDGE, LEVEL_MAX, Octant};
use contract::tree::{HOLES, Tree};
use contract::word::{self, Side};

pub(super) const MUTANTS: &[Mutant] = &[
    words("leaf duplicated", "linear", AUDITED, |s| {
        changed(s, |_| true, |words, i| words.push(words[i]))
    }),
    words("leaf duplicated with another side", "linear", AUDITED, |s| {
        changed(s, |_| true, |words, i| words.push(mutant::other_side(words[i])))
    }),
    words("leaf kept beside its children", "linear", AUDITED, |s| {
        changed(s, is_not_finest, |words, i| words.extend(mutant::children(words[i])))
    }),
    words("leaf of twice the size among its siblings", "linear", AUDITED, |s| {
        let first = |w| word::octant(w).digit() == 0;
        let parent = |w| word::octant(mutant::parent(w));
        let within =
            |pair: &[u64]| first(pair[0]) && parent(pair[0]).contains(&word::octant(pair[1]));
        let mut words = s.mesh.words.clone();
        let i = words.windows(2).position(within)?;
        words[i] = mutant::parent(words[i]);
        Some(words)
    }),
    words("leaf deeper than the deepest level", "linear", AUDITED, |s| {
        let level = u64::from(LEVEL_MAX + 1) << 2;
        changed(s, |_| true, |words, i| words[i] = words[i] & !(31 << 2) | level)
    }),
    words("side that does not exist", "linear", AUDITED, |s| {
        changed(s, |_| true, |words, i| words[i] |= 3)
    }),
    words("leaf not aligned to its level", "linear", AUDITED, |s| {
        changed(s, is_not_finest, |words, i| words[i] += 1 << 7)
    }),
    words("all leaves shifted by one finest cell", "linear", AUDITED, |s| {
        let finest = s.mesh.words.iter().map(|&w| word::level(w)).max()?;
        let has_coarser = s.mesh.words.iter().any(|&w| word::level(w) < finest);
        has_coarser.then(|| mutant::shifted(&s.mesh.words, CELLS_PER_EDGE >> finest))
    }),
    sets("part not sorted", "linear", AUDITED, |s, mutation| {
        let mut parts = s.mesh.parts.clone();
        let part = parts.iter_mut().find(|p| p.len() > 1)?;
        let middle = part.len() / 2;
        part.swap(middle, middle - 1);
        mutation.mesh = s.mesh.with_parts(parts);
        Some(())
    }),
    words("all leaves shifted by half the root", "sides", INFORMED, |s| {
        let words = mutant::shifted(&s.mesh.words, CELLS_PER_EDGE / 2);
        let crossing = s.mesh.words.iter().any(|&w| has_side(w, Side::Crossing));
        let moved = words.iter().any(|w| s.mesh.words.binary_search(w).is_err());
        (crossing && moved).then_some(words)
    }),
    words("mesh mirrored", "identical", INFORMED, |s| {
        Some(mutant::mirrored(&s.mesh.words)).filter(|words| *words != s.mesh.words)
    }),
    words("leaf removed away from the surface", "complete", AUDITED, |s| {
        // Next to deleted crossing leaves, one more hole would be indistinguishable from them.
        let tree = Tree::of_words(&s.mesh.words);
        let near_surface = HOLES | 1 << Side::Crossing as u8;
        let away = |w: u64| {
            let around = Neighbourhood::of(&tree, word::octant(w));
            word::level(w) < s.case.level_surface
                && around.handles.iter().all(|&h| tree.kinds(h) & near_surface == 0)
        };
        changed(s, away, |words, i| _ = words.remove(i))
    }),
    words("crossing leaf removed", "complete", INFORMED, |s| {
        changed(s, |w| has_side(w, Side::Crossing), |words, i| _ = words.remove(i))
    }),
    words("octant emptied", "complete", AUDITED, |s| {
        // The corner of the root is far from the body, so the leaves around the hole are coarse.
        let octant = Octant::ROOT.child(0).child(0);
        let (inside, left): (Vec<u64>, Vec<u64>) =
            s.mesh.words.iter().partition(|&&w| octant.contains(&word::octant(w)));
        let crossing = inside.iter().any(|&w| has_side(w, Side::Crossing));
        (!crossing && !inside.is_empty()).then_some(left)
    }),
    words("all leaves after the first half removed", "complete", INFORMED, |s| {
        Some(s.mesh.words[..s.mesh.words.len() / 2].to_vec())
    }),
    words("deleted leaf restored", "complete", INFORMED, |s| {
        let in_mesh = |w: u64| s.mesh.words.binary_search(&w).is_ok();
        let deleted = match s.case.keep {
            Keep::All if s.case.keep_crossing => return None,
            Keep::Outside => Side::Inside,
            Keep::Inside => Side::Outside,
            Keep::All => Side::Crossing,
        };
        let i = middle(&s.base.words, |w| has_side(w, deleted) && !in_mesh(w))?;
        Some([&s.mesh.words[..], &[s.base.words[i]]].concat())
    }),
    words("leaf of T0 merged with its siblings", "complete", INFORMED, |s| {
        let words = &s.mesh.words;
        let of_base =
            |&i: &usize| words[i..i + 8].iter().all(|w| s.base.words.binary_search(w).is_ok());
        Some(mutant::merge(words, &[sibling_groups(words).into_iter().find(of_base)?]))
    }),
    words("leaf split needlessly", "identical", INFORMED, |s| {
        Some(split(&s.mesh.words, middle(&s.mesh.words, is_not_finest)?))
    }),
];

fn is_not_finest(word: u64) -> bool {
    word::level(word) < LEVEL_MAX
}
