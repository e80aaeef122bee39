//! Base trees that are too coarse or too fine, and meshes that such a base tree leads to.

use super::SelftestCase;
use super::mutant::{
    self, AUDITED, INFORMED, Mutant, base, has_side, merge, sibling_groups, split, words,
};
use contract::octant::LEVEL_MAX;
use contract::word::{self, Side};

pub(super) const MUTANTS: &[Mutant] = &[
    base("T0 too coarse at the surface", "spacing", AUDITED, coarse_at_surface),
    base("T0 too coarse in a box", "spacing", AUDITED, |s| merged_in_box(s, &s.base.words)),
    base("T0 needlessly fine away from the surface", "identical", INFORMED, fine_away),
    base("T0 needlessly fine at the surface", "identical", INFORMED, fine_at_surface),
    base("T0 with a hole", "complete", AUDITED, |s| {
        let mut words = s.base.words.clone();
        // The self test at scale does not know T0 of a mesh that it did not make.
        (!words.is_empty()).then(|| words.remove(words.len() / 3))?;
        Some(words)
    }),
    base("T0 with a duplicate leaf", "linear", AUDITED, |s| {
        let words = &s.base.words;
        Some([&words[..], &[*words.get(words.len() / 3)?]].concat())
    }),
    words("crossing leaves of the mesh merged", "spacing", AUDITED, |s| {
        let words = &s.mesh.words;
        let crossing = |&i: &usize| has_side(words[i], Side::Crossing);
        let i = sibling_groups(words).into_iter().find(crossing)?;
        (word::level(words[i]) == s.case.level_surface).then(|| merge(words, &[i]))
    }),
    words("leaves of the mesh merged in a box", "spacing", AUDITED, |s| {
        merged_in_box(s, &s.mesh.words)
    }),
];

/// Merges siblings on the surface's level of which at least one is crossing (all eight rarely are) into a crossing leaf.
fn coarse_at_surface(s: &SelftestCase) -> Option<Vec<u64>> {
    let sideless: Vec<u64> = s.base.words.iter().map(|w| w & !3).collect();
    let fit = |&i: &usize| {
        word::level(sideless[i]) == s.case.level_surface
            && s.base.words[i..i + 8].iter().any(|&w| has_side(w, Side::Crossing))
    };
    let i = sibling_groups(&sideless).into_iter().find(fit)?;
    let mut merged = merge(&s.base.words, &[i]);
    merged[i] = mutant::with_side(merged[i], Side::Crossing);
    Some(merged)
}

/// The words with eight siblings merged whose level a box requires.
fn merged_in_box(s: &SelftestCase, words: &[u64]) -> Option<Vec<u64>> {
    let required = |&i: &usize| {
        let octant = word::octant(words[i]);
        let parent = octant.ancestor(octant.level - 1);
        s.case.boxes.iter().any(|b| b.level == octant.level && b.meets(&parent))
    };
    Some(merge(words, &[sibling_groups(words).into_iter().find(required)?]))
}

fn fine_away(s: &SelftestCase) -> Option<Vec<u64>> {
    let fit = |&w: &u64| !has_side(w, Side::Crossing) && word::level(w) < LEVEL_MAX;
    Some(split(&s.base.words, s.base.words.iter().position(fit)?))
}

fn fine_at_surface(s: &SelftestCase) -> Option<Vec<u64>> {
    // On the deepest level, no box requires the split.
    let deepest = s.case.level_deepest();
    let fit = |&w: &u64| has_side(w, Side::Crossing) && word::level(w) == deepest;
    let i = s.base.words.iter().position(fit).filter(|_| deepest < LEVEL_MAX)?;
    Some(split(&s.base.words, i))
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::case::Case;
    use contract::octant::Octant;
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
        assert_eq!(merged, words(&["0", "1", "1.0"]));
    }
}
