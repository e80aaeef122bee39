//! Base trees that are too coarse or too fine, and meshes that such a base tree leads to. The check `spacing`
//! must detect most of them.

use super::SelftestCase;
use super::edit::{self, has_side, merge, sibling_groups, split};
use super::mutant::{Mutant, Mutation, audited, informed};
use contract::octant::Octant;
use contract::word::{self, Side};

pub(super) const MUTANTS: &[Mutant] = &[
    informed("T0 too coarse at the surface", "spacing", coarse_at_surface),
    informed("T0 too coarse in a box", "spacing", coarse_in_box),
    informed("T0 needlessly fine away from the surface", "spacing", fine_away),
    informed("T0 needlessly fine at the surface", "spacing", fine_at_surface),
    informed("T0 with a hole", "complete", with_hole),
    informed("T0 with a duplicate leaf", "linear", duplicated),
    informed("T0 one level too coarse along the whole surface", "spacing", one_level_too_coarse),
    audited("crossing leaves of the mesh merged", "spacing", crossing_merged),
    audited("leaves of the mesh merged in a box", "spacing", merged_in_box),
];

fn with_base(s: &SelftestCase, words: Vec<u64>) -> Option<Mutation> {
    let base = edit::with_words(&s.base, words);
    Some(Mutation { base, ..Mutation::of(s) })
}

/// Index of eight sibling leaves that are all crossing.
fn crossing_siblings(words: &[u64]) -> Option<usize> {
    sibling_groups(words).into_iter().find(|&i| has_side(words[i], Side::Crossing))
}

fn coarse_at_surface(s: &SelftestCase) -> Option<Mutation> {
    let i = siblings_at_surface(s)?;
    let words = &s.base.words;
    let crossing = edit::with_side(edit::parent(words[i]), Side::Crossing);
    let mut all = words.clone();
    all.splice(i..i + 8, [crossing]);
    with_base(s, all)
}

/// Index of eight sibling leaves of T0 on the surface's level, of which at least one is crossing. (All eight
/// rarely are.)
fn siblings_at_surface(s: &SelftestCase) -> Option<usize> {
    let words = &s.base.words;
    let sideless: Vec<u64> = words.iter().map(|w| w & !3).collect();
    sibling_groups(&sideless).into_iter().find(|&i| {
        let level = word::level(words[i]);
        level == s.case.level_surface
            && words[i..i + 8].iter().any(|&w| has_side(w, Side::Crossing))
    })
}

/// The words with eight siblings merged whose level a box requires.
fn merged_where_box_requires(s: &SelftestCase, words: &[u64]) -> Option<Vec<u64>> {
    let required = |&i: &usize| {
        let octant = word::octant(words[i]);
        let parent = octant.ancestor(octant.level - 1);
        let boxes = &s.case.boxes;
        boxes.iter().any(|b| b.level == octant.level && b.meets(&parent))
    };
    let i = sibling_groups(words).into_iter().find(required)?;
    Some(merge(words, &[i]))
}

fn coarse_in_box(s: &SelftestCase) -> Option<Mutation> {
    with_base(s, merged_where_box_requires(s, &s.base.words)?)
}

fn merged_in_box(s: &SelftestCase) -> Option<Mutation> {
    Some(Mutation::with_words(s, merged_where_box_requires(s, &s.mesh.words)?))
}

fn fine_away(s: &SelftestCase) -> Option<Mutation> {
    let i =
        s.base.words.iter().position(|&w| !has_side(w, Side::Crossing) && word::level(w) < 19)?;
    with_base(s, split(&s.base.words, i))
}

fn fine_at_surface(s: &SelftestCase) -> Option<Mutation> {
    // On the deepest level, no box requires the split.
    let deepest = s.case.level_deepest();
    let fit = |&w: &u64| has_side(w, Side::Crossing) && word::level(w) == deepest && deepest < 19;
    let i = s.base.words.iter().position(fit)?;
    with_base(s, split(&s.base.words, i))
}

fn with_hole(s: &SelftestCase) -> Option<Mutation> {
    let mut words = s.base.words.clone();
    // The self test at scale does not know T0 of a mesh that it did not make.
    (!words.is_empty()).then(|| words.remove(words.len() / 3))?;
    with_base(s, words)
}

fn duplicated(s: &SelftestCase) -> Option<Mutation> {
    let mut words = s.base.words.clone();
    words.push(*words.get(words.len() / 3)?);
    with_base(s, words)
}

/// Merges all sibling leaves on the surface's level, as if that level were too coarse by one.
fn one_level_too_coarse(s: &SelftestCase) -> Option<Mutation> {
    let surface = s.case.level_surface;
    let sideless: Vec<u64> = s.base.words.iter().map(|w| w & !3).collect();
    let of_surface = |&i: &usize| word::level(sideless[i]) == surface;
    let groups: Vec<usize> = sibling_groups(&sideless).into_iter().filter(of_surface).collect();
    let merged: Vec<Octant> =
        groups.iter().map(|&i| word::octant(edit::parent(sideless[i]))).collect();
    let mut words = merge(&s.base.words, &groups);
    for w in &mut words {
        if merged.binary_search_by_key(&word::key(*w), |o| word::key_of(o.corner)).is_ok() {
            *w = edit::with_side(*w, Side::Crossing);
        }
    }
    (!groups.is_empty()).then(|| with_base(s, words)).flatten()
}

fn crossing_merged(s: &SelftestCase) -> Option<Mutation> {
    let words = &s.mesh.words;
    let i = crossing_siblings(words).filter(|&i| word::level(words[i]) == s.case.level_surface)?;
    Some(Mutation::with_words(s, merge(words, &[i])))
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::case::Case;
    use contract::octant::LEVEL_MAX;
    use contract::testing::{leaf_set, words_with_sides};

    #[test]
    fn no_leaf_of_the_deepest_level_is_split() {
        let text = "spacing_min = 1.0\nkeep = 'all'\nroot = { origin = [0.0, 0.0, 0.0], edge = 524288.0 }\n";
        let facet = [[0.5, 0.5, 0.5], [1.5, 0.5, 0.5], [0.5, 1.5, 0.5]];
        let case = Case::from_parts(text, vec![facet]).unwrap();
        let split = |side| {
            let path = |o: &Octant| o.corner == [0; 3] && o.level < LEVEL_MAX;
            let deepest = |o: &Octant| (o.level == LEVEL_MAX).then_some(side);
            let base = leaf_set(vec![words_with_sides(path, deepest)]);
            let mesh = leaf_set(vec![]);
            let correct = SelftestCase { case: case.clone(), mesh, base };
            fine_away(&correct).is_some() || fine_at_surface(&correct).is_some()
        };
        assert_eq!(Side::ALL.map(split), [false; 3]);
    }

    /// Octant 0 has no crossing leaf, and the one in octant 1 is finer than the surface.
    #[test]
    fn eight_leaves_of_the_surface_level_with_a_crossing_one_are_merged() {
        let text =
            "spacing_min = 2.0\nkeep = 'all'\nroot = { origin = [0.0, 0.0, 0.0], edge = 8.0 }\n";
        let facet = [[0.5, 4.5, 0.5], [1.5, 4.5, 0.5], [0.5, 5.5, 0.5]];
        let case = Case::from_parts(text, vec![facet]).unwrap();
        let is_crossing = |o: &Octant| ["1.0.3", "2.4", "2"].contains(&&*o.path());
        let side = |o: &Octant| Some(if is_crossing(o) { Side::Crossing } else { Side::Outside });
        let words = |split: &'static [&'static str]| {
            words_with_sides(|o| o.level == 0 || split.contains(&&*o.path()), side)
        };
        let base = leaf_set(vec![words(&["0", "1", "1.0", "2"])]);
        let correct = SelftestCase { case, mesh: leaf_set(vec![]), base };
        let merged = coarse_at_surface(&correct).unwrap();
        assert_eq!(merged.base.words, words(&["0", "1", "1.0"]));
    }
}
