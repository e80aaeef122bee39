//! Removed, duplicated and moved leaves, which the checks `linear`, `complete` and `identical` must detect; base trees that are too coarse or too
//! fine, and meshes that such a base tree leads to, which `spacing` and `identical` must.

use super::SelftestCase;
use super::mutant::{
    self, AUDITED, INFORMED, Mutant, base, changed, is_far, merge, middle, sets, sibling_groups,
    split_first, words,
};
use contract::manifest::Keep;
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
        let within = |two: &[u64]| first(two[0]) && parent(two[0]).contains(&word::octant(two[1]));
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
        let crossing = s.mesh.words.iter().any(|&w| word::is_crossing(w));
        (crossing && words.iter().any(|w| s.mesh.words.binary_search(w).is_err())).then_some(words)
    }),
    words("mesh mirrored", "identical", INFORMED, |s| {
        Some(mutant::mirrored(&s.mesh.words)).filter(|words| *words != s.mesh.words)
    }),
    words("leaf removed away from the surface", "complete", AUDITED, |s| {
        // Next to deleted crossing leaves, one more hole would be indistinguishable from them.
        let tree = Tree::of_words(&s.mesh.words);
        let near_surface = HOLES | 1 << Side::Crossing as u8;
        let away = |w| word::level(w) < s.case.level_surface && is_far(&tree, w, near_surface);
        changed(s, away, |words, i| _ = words.remove(i))
    }),
    words("crossing leaf removed", "complete", INFORMED, |s| {
        changed(s, word::is_crossing, |words, i| _ = words.remove(i))
    }),
    words("octant emptied", "complete", AUDITED, |s| {
        // The corner of the root is far from the body, so the leaves around the hole are coarse.
        let octant = Octant::ROOT.child(0).child(0);
        let (inside, left): (Vec<u64>, Vec<u64>) =
            s.mesh.words.iter().partition(|&&w| octant.contains(&word::octant(w)));
        (!inside.iter().any(|&w| word::is_crossing(w)) && !inside.is_empty()).then_some(left)
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
        let i = middle(&s.base.words, |w| word::side(w) == deleted && !in_mesh(w))?;
        Some([&s.mesh.words[..], &[s.base.words[i]]].concat())
    }),
    words("leaf of T0 merged with its siblings", "complete", INFORMED, |s| {
        let words = &s.mesh.words;
        let of_base =
            |&i: &usize| words[i..i + 8].iter().all(|w| s.base.words.binary_search(w).is_ok());
        Some(merge(words, &[sibling_groups(words).into_iter().find(of_base)?]))
    }),
    words("leaf split needlessly", "identical", INFORMED, |s| {
        changed(s, is_not_finest, |words, i| _ = words.splice(i..=i, mutant::children(words[i])))
    }),
    base("T0 too coarse at the surface", "spacing", AUDITED, coarse_at_surface),
    base("T0 too coarse in a box", "spacing", AUDITED, |s| merged_in_box(s, &s.base.words)),
    base("T0 needlessly fine away from the surface", "identical", INFORMED, |s| {
        split_first(&s.base.words, |w| !word::is_crossing(w) && is_not_finest(w))
    }),
    base("T0 needlessly fine at the surface", "spacing", AUDITED, |s| {
        // On the deepest level, neither surface nor boxes require the split.
        let is_deepest = |w| is_not_finest(w) && word::level(w) == s.case.level_deepest();
        split_first(&s.base.words, |w| word::is_crossing(w) && is_deepest(w))
    }),
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
        let i = sibling_groups(words).into_iter().find(|&i: &usize| word::is_crossing(words[i]))?;
        (word::level(words[i]) == s.case.level_surface).then(|| merge(words, &[i]))
    }),
    words("leaves of the mesh merged in a box", "spacing", AUDITED, |s| {
        merged_in_box(s, &s.mesh.words)
    }),
];

fn is_not_finest(word: u64) -> bool {
    word::level(word) < LEVEL_MAX
}

/// Merges siblings on the surface's level of which at least one is crossing (all eight rarely are) into a crossing leaf.
fn coarse_at_surface(s: &SelftestCase) -> Option<Vec<u64>> {
    let sideless: Vec<u64> = s.base.words.iter().map(|w| w & !3).collect();
    let fit = |&i: &usize| {
        word::level(sideless[i]) == s.case.level_surface
            && s.base.words[i..i + 8].iter().any(|&w| word::is_crossing(w))
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
        s.case.boxes.iter().any(|b| b.level == octant.level && b.meets(&octant.parent()))
    };
    Some(merge(words, &[sibling_groups(words).into_iter().find(required)?]))
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
            let fine = MUTANTS.iter().filter(|m| m.name.starts_with("T0 needlessly fine"));
            fine.map(|mutant| mutant.make(&correct).is_some()).collect::<Vec<bool>>()
        };
        assert_eq!(Side::ALL.map(split), [(); 3].map(|()| vec![false; 2]));
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
