//! Wrong sides, which the checks `sides` and `crossing` must detect.

use super::SelftestCase;
use super::edit::{self, changed, has_side, middle, with_side};
use super::mutant::{AUDITED, INFORMED, Mutant, both, sets, words};
use contract::manifest::Keep;
use contract::tree::Tree;
use contract::word::{self, Side};

pub(super) const MUTANTS: &[Mutant] = &[
    words("one outside leaf labelled inside", "sides", INFORMED, |s| {
        relabelled(s, Side::Outside, Side::Inside)
    }),
    words("one inside leaf labelled outside", "sides", INFORMED, |s| {
        relabelled(s, Side::Inside, Side::Outside)
    }),
    words("one leaf of the side that is deleted", "sides", AUDITED, |s| match s.case.keep {
        Keep::Outside => relabelled(s, Side::Outside, Side::Inside),
        Keep::Inside => relabelled(s, Side::Inside, Side::Outside),
        Keep::All => None,
    }),
    words("one leaf of a component flipped", "sides", AUDITED, |s| {
        let tree = Tree::of_words(&s.mesh.words);
        let outside = 1 << Side::Outside as u8;
        // Leaves of the same component surround it.
        let deep = |w: u64| {
            let around = edit::neighbourhood(&tree, w);
            has_side(w, Side::Outside)
                && around.handles.iter().all(|&h| tree.kinds(h) & !outside == 0)
        };
        let flip = |words: &mut Vec<u64>, i: usize| words[i] = with_side(words[i], Side::Inside);
        changed(s, deep, flip).filter(|_| s.case.keep == Keep::All)
    }),
    both("one leaf flipped in mesh and T0", "sides", INFORMED, |s| {
        in_both(s, Side::Inside, |w| has_side(w, Side::Outside))
    }),
    both("a whole component flipped in mesh and T0", "sides", INFORMED, |s| {
        let inside = |w: u64| has_side(w, Side::Inside);
        flipped(s, inside).filter(|_| s.base.words.iter().any(|&w| inside(w)))
    }),
    both("inside and outside swapped everywhere", "sides", INFORMED, |s| flipped(s, |_| true)),
    words("crossing leaf of the mesh labelled outside", "crossing", INFORMED, |s| {
        relabelled(s, Side::Crossing, Side::Outside)
    }),
    both("crossing leaf labelled outside in mesh and T0", "crossing", INFORMED, |s| {
        in_both(s, Side::Outside, |w| has_side(w, Side::Crossing))
    }),
    both("crossing leaf labelled inside in mesh and T0", "crossing", INFORMED, |s| {
        in_both(s, Side::Inside, |w| has_side(w, Side::Crossing))
    }),
    words("leaf of the mesh labelled crossing", "crossing", INFORMED, |s| {
        let label = |words: &mut Vec<u64>, i: usize| words[i] = with_side(words[i], Side::Crossing);
        changed(s, |w| !has_side(w, Side::Crossing), label)
    }),
    both("leaf labelled crossing in mesh and T0", "crossing", INFORMED, |s| {
        let of_surface = |w| word::level(w) == s.case.level_surface;
        in_both(s, Side::Crossing, |w| !has_side(w, Side::Crossing) && of_surface(w))
    }),
    sets("one ambiguous component too many in the manifest", "sides", INFORMED, |_, mutation| {
        mutation.mesh.manifest.components_ambiguous.count += 1;
        Some(())
    }),
    sets("wrong example of an ambiguous component", "sides", INFORMED, |s, mutation| {
        mutation.mesh.manifest.components_ambiguous.example = Some(s.case.root.origin);
        Some(())
    }),
];

/// The mesh with another side for one leaf.
fn relabelled(s: &SelftestCase, from: Side, to: Side) -> Option<Vec<u64>> {
    changed(s, |w| has_side(w, from), |words, i| words[i] = with_side(words[i], to))
}

/// Mesh and T0 with another side for one leaf that they have in common.
fn in_both(s: &SelftestCase, to: Side, predicate: impl Fn(u64) -> bool) -> Option<[Vec<u64>; 2]> {
    let in_base = |w: u64| s.base.words.binary_search(&w).is_ok();
    let leaf = s.mesh.words[middle(&s.mesh.words, |w| predicate(w) && in_base(w))?];
    let label = |&w: &u64| if w == leaf { with_side(w, to) } else { w };
    Some([&s.mesh, &s.base].map(|set| set.words.iter().map(label).collect()))
}

/// Mesh and T0 with inside and outside swapped where a predicate holds, if nothing is deleted and not all leaves are crossing.
fn flipped(s: &SelftestCase, predicate: impl Fn(u64) -> bool) -> Option<[Vec<u64>; 2]> {
    let swap = |&w: &u64| if w & 3 < 2 && predicate(w) { w ^ 1 } else { w };
    let swapped: [Vec<u64>; 2] = [&s.mesh, &s.base].map(|set| set.words.iter().map(swap).collect());
    (s.case.keep == Keep::All && swapped[0] != s.mesh.words).then_some(swapped)
}
