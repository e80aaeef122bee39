//! T0 too coarse or too fine: for `spacing`, and for what a wrong T0 does to a mesh.

use super::Specimen;
use super::mutant::{Mutant, Mutation, audited, informed};
use super::surgery::{self, is, merge, octets, split};
use contract::octant::Octant;
use contract::word::{self, Side};

pub(super) const MUTANTS: &[Mutant] = &[
    informed("T0 too coarse at the surface", "spacing", coarse_at_surface),
    informed("T0 too coarse in a box", "spacing", coarse_in_box),
    informed("T0 needlessly fine away from all", "spacing", fine_away),
    informed("T0 needlessly fine at the surface", "spacing", fine_at_surface),
    informed("T0 with a gap", "complete", with_gap),
    informed("T0 with a leaf doubled", "linear", doubled),
    informed("T0 one level short all along the surface", "spacing", one_level_short),
    audited("crossing leaves of the mesh merged", "spacing", crossing_merged),
    audited("leaves of the mesh merged in a box", "spacing", merged_in_box),
];

fn with_base(s: &Specimen, words: Vec<u64>) -> Option<Mutation> {
    let base = surgery::with_words(&s.base, words);
    Some(Mutation { base, ..Mutation::of(s) })
}

/// An octet of crossing leaves.
fn octet_crossing(words: &[u64]) -> Option<usize> {
    octets(words).into_iter().find(|&i| is(words[i], Side::Crossing))
}

fn coarse_at_surface(s: &Specimen) -> Option<Mutation> {
    let i = octet_of_mixed_sides(s)?;
    let words = &s.base.words;
    let crossing = surgery::parent(words[i]) & !3 | Side::Crossing as u64;
    let mut all = words.clone();
    all.splice(i..i + 8, [crossing]);
    with_base(s, all)
}

/// Eight leaves of T0 that make up an octant, one of them crossing and of the surface's level. (Seldom
/// are all eight crossing.)
fn octet_of_mixed_sides(s: &Specimen) -> Option<usize> {
    let words = &s.base.words;
    let sideless: Vec<u64> = words.iter().map(|w| w & !3).collect();
    octets(&sideless).into_iter().find(|&i| {
        let level = word::level(words[i]);
        level == s.case.level_surface && words[i..i + 8].iter().any(|&w| is(w, Side::Crossing))
    })
}

/// An octet that lies in a box which asks for its level, merged.
fn merged_where_box_asks(s: &Specimen, words: &[u64]) -> Option<Vec<u64>> {
    let asked = |&i: &usize| {
        let octant = word::octant(words[i]);
        let (low, high) = octant.ancestor(octant.level - 1).bounds();
        s.case.boxes.iter().any(|b| {
            let meets = (0..3).all(|a| low[a].max(b.min[a]) < high[a].min(b.max[a]));
            meets && b.level == octant.level
        })
    };
    let i = octets(words).into_iter().find(asked)?;
    Some(merge(words, &[i]))
}

fn coarse_in_box(s: &Specimen) -> Option<Mutation> {
    with_base(s, merged_where_box_asks(s, &s.base.words)?)
}

fn merged_in_box(s: &Specimen) -> Option<Mutation> {
    Some(Mutation::with_words(s, merged_where_box_asks(s, &s.mesh.words)?))
}

fn fine_away(s: &Specimen) -> Option<Mutation> {
    let i = s.base.words.iter().position(|&w| !is(w, Side::Crossing) && word::level(w) < 19)?;
    with_base(s, split(&s.base.words, i))
}

fn fine_at_surface(s: &Specimen) -> Option<Mutation> {
    // One that no box wants any finer, or there would be a need.
    let deepest = s.case.level_deepest();
    let fit = |&w: &u64| is(w, Side::Crossing) && word::level(w) == deepest && deepest < 19;
    let i = s.base.words.iter().position(fit)?;
    with_base(s, split(&s.base.words, i))
}

fn with_gap(s: &Specimen) -> Option<Mutation> {
    let mut words = s.base.words.clone();
    words.remove(words.len() / 3);
    with_base(s, words)
}

fn doubled(s: &Specimen) -> Option<Mutation> {
    let mut words = s.base.words.clone();
    words.push(words[words.len() / 3]);
    with_base(s, words)
}

/// The surface's level misread by one: every octant that has leaves of that level merged.
fn one_level_short(s: &Specimen) -> Option<Mutation> {
    let surface = s.case.level_surface;
    let sideless: Vec<u64> = s.base.words.iter().map(|w| w & !3).collect();
    let of_surface = |&i: &usize| word::level(sideless[i]) == surface;
    let at: Vec<usize> = octets(&sideless).into_iter().filter(of_surface).collect();
    let merged: Vec<Octant> =
        at.iter().map(|&i| word::octant(surgery::parent(sideless[i]))).collect();
    let mut words = merge(&s.base.words, &at);
    for w in &mut words {
        if merged.binary_search_by_key(&word::key(*w), |o| word::key_of(o.corner)).is_ok() {
            *w = surgery::sided(*w, Side::Crossing);
        }
    }
    (!at.is_empty()).then(|| with_base(s, words)).flatten()
}

fn crossing_merged(s: &Specimen) -> Option<Mutation> {
    let words = &s.mesh.words;
    let i = octet_crossing(words).filter(|&i| word::level(words[i]) == s.case.level_surface)?;
    Some(Mutation::with_words(s, merge(words, &[i])))
}
