//! Removed, duplicated and moved leaves, which the checks `linear`, `complete` and `identical` must detect.

use super::SelftestCase;
use super::edit::{self, has_side, sibling_groups, split};
use super::mutant::{Mutant, Mutation, audited, informed};
use contract::manifest::Keep;
use contract::octant::LEVEL_MAX;
use contract::tree::{HOLES, Tree};
use contract::word::{self, Side};

pub(super) const MUTANTS: &[Mutant] = &[
    audited("leaf duplicated", "linear", duplicated),
    audited("leaf duplicated with another side", "linear", duplicated_other_side),
    audited("leaf kept beside its children", "linear", kept_beside_children),
    audited("leaf of twice the size among its siblings", "linear", enlarged),
    audited("leaf deeper than the deepest level", "linear", too_deep),
    audited("side that does not exist", "linear", no_side),
    audited("leaf not aligned to its level", "linear", misaligned),
    audited("all leaves shifted by one finest cell", "linear", shifted_by_cell),
    audited("part not sorted", "linear", unsorted),
    informed("all leaves shifted by half the root", "crossing", shifted_by_half),
    informed("mesh mirrored", "identical", mirrored),
    audited("leaf removed away from the surface", "complete", removed_away),
    informed("crossing leaf removed", "complete", removed_crossing),
    audited("octant emptied", "complete", emptied),
    informed("all leaves after the first half removed", "complete", truncated),
    informed("deleted leaf restored", "complete", restored),
    informed("leaf of T0 merged with its siblings", "complete", coarser_than_base),
    informed("leaf split needlessly", "identical", split_needlessly),
];

/// Index of the middle one of the leaves that satisfy a predicate.
pub(super) fn middle(words: &[u64], predicate: impl Fn(u64) -> bool) -> Option<usize> {
    let fit: Vec<usize> = (0..words.len()).filter(|&i| predicate(words[i])).collect();
    fit.get(fit.len() / 2).copied()
}

fn changed(s: &SelftestCase, change: impl FnOnce(&mut Vec<u64>)) -> Option<Mutation> {
    let mut words = s.mesh.words.clone();
    change(&mut words);
    Some(Mutation::with_words(s, words))
}

fn duplicated(s: &SelftestCase) -> Option<Mutation> {
    let i = middle(&s.mesh.words, |_| true)?;
    changed(s, |words| words.push(words[i]))
}

fn duplicated_other_side(s: &SelftestCase) -> Option<Mutation> {
    let i = middle(&s.mesh.words, |_| true)?;
    changed(s, |words| words.push(edit::other_side(words[i])))
}

fn kept_beside_children(s: &SelftestCase) -> Option<Mutation> {
    let i = middle(&s.mesh.words, |w| word::level(w) < LEVEL_MAX)?;
    changed(s, |words| words.extend(edit::children(words[i])))
}

fn enlarged(s: &SelftestCase) -> Option<Mutation> {
    let first = |w| word::octant(w).digit() == 0;
    let sibling = |w| word::octant(edit::parent(w));
    let within = |pair: &[u64]| first(pair[0]) && sibling(pair[0]).contains(&word::octant(pair[1]));
    let i = s.mesh.words.windows(2).position(within)?;
    changed(s, |words| words[i] = edit::parent(words[i]))
}

fn too_deep(s: &SelftestCase) -> Option<Mutation> {
    let i = middle(&s.mesh.words, |_| true)?;
    changed(s, |words| words[i] = words[i] & !(31 << 2) | u64::from(LEVEL_MAX + 1) << 2)
}

fn no_side(s: &SelftestCase) -> Option<Mutation> {
    let i = middle(&s.mesh.words, |_| true)?;
    changed(s, |words| words[i] |= 3)
}

fn misaligned(s: &SelftestCase) -> Option<Mutation> {
    let i = middle(&s.mesh.words, |w| word::level(w) < LEVEL_MAX)?;
    changed(s, |words| words[i] += 1 << 7)
}

fn shifted_by_cell(s: &SelftestCase) -> Option<Mutation> {
    let finest = s.mesh.words.iter().map(|&w| word::level(w)).max()?;
    let coarser = s.mesh.words.iter().any(|&w| word::level(w) < finest);
    let by = contract::octant::CELLS_PER_EDGE >> finest;
    coarser.then(|| Mutation::with_words(s, edit::shifted(&s.mesh.words, by)))
}

fn shifted_by_half(s: &SelftestCase) -> Option<Mutation> {
    let words = edit::shifted(&s.mesh.words, contract::octant::CELLS_PER_EDGE / 2);
    let crossing = s.mesh.words.iter().any(|&w| has_side(w, Side::Crossing));
    let moved = words.iter().any(|w| s.mesh.words.binary_search(w).is_err());
    (crossing && moved).then(|| Mutation::with_words(s, words))
}

fn mirrored(s: &SelftestCase) -> Option<Mutation> {
    let words = edit::mirrored(&s.mesh.words);
    (words != s.mesh.words).then(|| Mutation::with_words(s, words))
}

fn unsorted(s: &SelftestCase) -> Option<Mutation> {
    let mut mutation = Mutation::of(s);
    let mut parts = s.mesh.parts.clone();
    let part = parts.iter_mut().find(|p| p.len() > 1)?;
    let middle = part.len() / 2;
    part.swap(middle, middle - 1);
    mutation.mesh = s.mesh.with_parts(parts);
    Some(mutation)
}

fn removed_away(s: &SelftestCase) -> Option<Mutation> {
    // Next to deleted crossing leaves, one more hole would be indistinguishable from them.
    let tree = Tree::of_words(&s.mesh.words);
    let near_surface = HOLES | 1 << Side::Crossing as u8;
    let away = |w: u64| {
        let neighbourhood = edit::neighbourhood(&tree, w);
        let clear = neighbourhood.handles.iter().all(|&h| tree.kinds(h) & near_surface == 0);
        clear && word::level(w) < s.case.level_surface
    };
    let i = middle(&s.mesh.words, away)?;
    changed(s, |words| {
        words.remove(i);
    })
}

fn removed_crossing(s: &SelftestCase) -> Option<Mutation> {
    let i = middle(&s.mesh.words, |w| has_side(w, Side::Crossing))?;
    changed(s, |words| {
        words.remove(i);
    })
}

fn emptied(s: &SelftestCase) -> Option<Mutation> {
    // The corner of the root is far from the body, so the leaves around the hole are coarse.
    let octant = contract::octant::Octant::ROOT.child(0).child(0);
    let inside = |w: u64| octant.contains(&word::octant(w));
    let crossing = s.mesh.words.iter().any(|&w| inside(w) && has_side(w, Side::Crossing));
    let applies = !crossing && s.mesh.words.iter().any(|&w| inside(w));
    applies.then(|| changed(s, |words| words.retain(|&w| !inside(w)))).flatten()
}

fn truncated(s: &SelftestCase) -> Option<Mutation> {
    changed(s, |words| words.truncate(words.len() / 2))
}

fn restored(s: &SelftestCase) -> Option<Mutation> {
    let in_mesh = |w: u64| s.mesh.words.binary_search(&w).is_ok();
    let deleted = match s.case.keep {
        Keep::Outside => Side::Inside,
        Keep::Inside => Side::Outside,
        Keep::All => Side::Crossing,
    };
    let i = middle(&s.base.words, |w| has_side(w, deleted) && !in_mesh(w))?;
    if s.case.keep == Keep::All && s.case.keep_crossing {
        return None;
    }
    changed(s, |words| words.push(s.base.words[i]))
}

fn coarser_than_base(s: &SelftestCase) -> Option<Mutation> {
    let words = &s.mesh.words;
    let of_base =
        |&i: &usize| words[i..i + 8].iter().all(|w| s.base.words.binary_search(w).is_ok());
    let i = sibling_groups(words).into_iter().find(of_base)?;
    Some(Mutation::with_words(s, edit::merge(words, &[i])))
}

fn split_needlessly(s: &SelftestCase) -> Option<Mutation> {
    let i = middle(&s.mesh.words, |w| word::level(w) < LEVEL_MAX)?;
    Some(Mutation::with_words(s, split(&s.mesh.words, i)))
}
