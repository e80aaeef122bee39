//! Leaves dropped, doubled, moved: for `linear`, `complete`, `identical`.

use super::Specimen;
use super::mutant::{Mutant, Mutation, audited, informed};
use super::surgery::{self, is, octets, split};
use contract::manifest::Keep;
use contract::octant::LEVEL_MAX;
use contract::tree::Tree;
use contract::word::{self, Side};

pub(super) const MUTANTS: &[Mutant] = &[
    audited("leaf doubled", "linear", doubled),
    audited("leaf doubled with another side", "linear", doubled_other_side),
    audited("leaf kept beside its children", "linear", kept_beside_children),
    audited("leaf of twice the size among its siblings", "linear", outgrown),
    audited("leaf level beyond the deepest", "linear", too_deep),
    audited("side that does not exist", "linear", no_side),
    audited("leaf off its own grid", "linear", misaligned),
    audited("all leaves shifted by one finest cell", "linear", shifted_by_cell),
    audited("part not sorted", "linear", unsorted),
    informed("all leaves shifted by half the root", "crossing", shifted_by_half),
    informed("mesh mirrored", "identical", mirrored),
    audited("leaf dropped away from the surface", "complete", dropped_wanted),
    informed("crossing leaf dropped", "complete", dropped_crossing),
    audited("octant emptied", "complete", emptied),
    informed("all leaves after the first half dropped", "complete", cut_short),
    informed("deleted leaf put back", "complete", put_back),
    informed("leaf of T0 merged with its siblings", "complete", coarser_than_base),
    informed("leaf split without need", "identical", split_without_need),
];

/// A leaf somewhere in the middle that some condition holds for.
fn middle(words: &[u64], wanted: impl Fn(u64) -> bool) -> Option<usize> {
    let fit: Vec<usize> = (0..words.len()).filter(|&i| wanted(words[i])).collect();
    fit.get(fit.len() / 2).copied()
}

fn changed(s: &Specimen, change: impl FnOnce(&mut Vec<u64>)) -> Option<Mutation> {
    let mut words = s.mesh.words.clone();
    change(&mut words);
    Some(Mutation::with_words(s, words))
}

fn doubled(s: &Specimen) -> Option<Mutation> {
    let i = middle(&s.mesh.words, |_| true)?;
    changed(s, |words| words.push(words[i]))
}

fn doubled_other_side(s: &Specimen) -> Option<Mutation> {
    let i = middle(&s.mesh.words, |_| true)?;
    changed(s, |words| words.push(surgery::other_side(words[i])))
}

fn kept_beside_children(s: &Specimen) -> Option<Mutation> {
    let i = middle(&s.mesh.words, |w| word::level(w) < LEVEL_MAX)?;
    changed(s, |words| words.extend(surgery::children(words[i])))
}

fn outgrown(s: &Specimen) -> Option<Mutation> {
    let first = |w| word::level(w) > 0 && word::octant(w).digit() == 0;
    let sibling = |w| word::octant(surgery::parent(w));
    let words = &s.mesh.words;
    let i = (1..words.len()).find(|&i| {
        first(words[i - 1]) && sibling(words[i - 1]).contains(&word::octant(words[i]))
    })?;
    changed(s, |words| words[i - 1] = surgery::parent(words[i - 1]))
}

fn too_deep(s: &Specimen) -> Option<Mutation> {
    let i = middle(&s.mesh.words, |_| true)?;
    changed(s, |words| words[i] = words[i] & !(31 << 2) | u64::from(LEVEL_MAX + 1) << 2)
}

fn no_side(s: &Specimen) -> Option<Mutation> {
    let i = middle(&s.mesh.words, |_| true)?;
    changed(s, |words| words[i] |= 3)
}

fn misaligned(s: &Specimen) -> Option<Mutation> {
    let i = middle(&s.mesh.words, |w| word::level(w) < LEVEL_MAX)?;
    changed(s, |words| words[i] += 1 << 7)
}

fn shifted_by_cell(s: &Specimen) -> Option<Mutation> {
    let finest = s.mesh.words.iter().map(|&w| word::level(w)).max()?;
    let coarser = s.mesh.words.iter().any(|&w| word::level(w) < finest);
    let by = contract::octant::CELLS_PER_EDGE >> finest;
    coarser.then(|| Mutation::with_words(s, surgery::shifted(&s.mesh.words, by)))
}

fn shifted_by_half(s: &Specimen) -> Option<Mutation> {
    let words = surgery::shifted(&s.mesh.words, contract::octant::CELLS_PER_EDGE / 2);
    let crossing = s.mesh.words.iter().any(|&w| is(w, Side::Crossing));
    let moved = words.iter().any(|w| s.mesh.words.binary_search(w).is_err());
    (crossing && moved).then(|| Mutation::with_words(s, words))
}

fn mirrored(s: &Specimen) -> Option<Mutation> {
    let words = surgery::mirrored(&s.mesh.words);
    (words != s.mesh.words).then(|| Mutation::with_words(s, words))
}

fn unsorted(s: &Specimen) -> Option<Mutation> {
    let mut mutation = Mutation::of(s);
    let mut parts = s.mesh.parts.clone();
    let part = parts.iter_mut().find(|p| p.len() > 2)?;
    let middle = part.len() / 2;
    part.swap(middle, middle - 1);
    mutation.mesh = s.mesh.with_parts(parts);
    Some(mutation)
}

fn dropped_wanted(s: &Specimen) -> Option<Mutation> {
    // Next to deleted crossing leaves one more gap would look like one of them.
    let tree = Tree::of_words(&s.mesh.words);
    let away = |w: u64| {
        let hood = surgery::hood(&tree, w);
        let whole = hood.around.iter().all(|&at| tree.kinds(at) & (contract::tree::HOLES | 4) == 0);
        whole && word::level(w) < s.case.level_surface
    };
    let i = middle(&s.mesh.words, away)?;
    changed(s, |words| {
        words.remove(i);
    })
}

fn dropped_crossing(s: &Specimen) -> Option<Mutation> {
    let i = middle(&s.mesh.words, |w| is(w, Side::Crossing))?;
    changed(s, |words| {
        words.remove(i);
    })
}

fn emptied(s: &Specimen) -> Option<Mutation> {
    // The corner of the root is far from the body, so what remains around the hole is coarse.
    let octant = contract::octant::Octant::ROOT.child(0).child(0);
    let inside = |w: u64| octant.contains(&word::octant(w));
    let crossing = s.mesh.words.iter().any(|&w| inside(w) && is(w, Side::Crossing));
    let applies = !crossing && s.mesh.words.iter().any(|&w| inside(w));
    applies.then(|| changed(s, |words| words.retain(|&w| !inside(w)))).flatten()
}

fn cut_short(s: &Specimen) -> Option<Mutation> {
    changed(s, |words| words.truncate(words.len() / 2))
}

fn put_back(s: &Specimen) -> Option<Mutation> {
    let there = |w: u64| s.mesh.words.binary_search(&w).is_ok();
    let deleted = match s.case.keep {
        Keep::Outside => Side::Inside,
        Keep::Inside => Side::Outside,
        Keep::All => Side::Crossing,
    };
    let i = middle(&s.base.words, |w| is(w, deleted) && !there(w))?;
    if s.case.keep == Keep::All && s.case.keep_crossing {
        return None;
    }
    changed(s, |words| words.push(s.base.words[i]))
}

fn coarser_than_base(s: &Specimen) -> Option<Mutation> {
    let words = &s.mesh.words;
    let of_base =
        |&i: &usize| words[i..i + 8].iter().all(|w| s.base.words.binary_search(w).is_ok());
    let i = octets(words).into_iter().find(of_base)?;
    Some(Mutation::with_words(s, surgery::merge(words, &[i])))
}

fn split_without_need(s: &Specimen) -> Option<Mutation> {
    let i = middle(&s.mesh.words, |w| word::level(w) < LEVEL_MAX)?;
    Some(Mutation::with_words(s, split(&s.mesh.words, i)))
}
