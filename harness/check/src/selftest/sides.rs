//! Wrong sides, wrong components and wrong counts of them, which the checks `sides`, `crossing` and `kept` must detect.
//!
//! The leaves to corrupt are found from the correct mesh and T0 alone, so that the corruptions apply to a window of a
//! larger mesh, too.

use super::SelftestCase;
use super::mutant::{
    self, AUDITED, INFORMED, Mutant, Mutation, both, changed, has_side, middle, sets, with_side,
    words,
};
use crate::checks::components;
use contract::manifest::{Components, Keep};
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
            let around = mutant::neighbourhood(&tree, w);
            has_side(w, Side::Outside)
                && around.handles.iter().all(|&h| tree.kinds(h) & !outside == 0)
        };
        labelled(s, Side::Inside, deep).filter(|_| s.case.keep == Keep::All)
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
        labelled(s, Side::Crossing, |w| !has_side(w, Side::Crossing))
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
    words("one leaf of an enclosed component kept", "kept", INFORMED, |s| enclosed_kept(s, 1)),
    words("enclosed component kept", "kept", INFORMED, |s| enclosed_kept(s, usize::MAX)),
    words("far-field component deleted", "kept", INFORMED, |s| {
        let far_field = |group: &[u32]| components::touches_boundary(&s.mesh.words, group);
        let applies = s.case.keep == Keep::Outside && s.case.seeds.is_empty();
        applies.then(|| removed(s, far_field)).flatten()
    }),
    words("component with a seed deleted", "kept", INFORMED, |s| {
        // If one side is deleted, every component that is left has a seed.
        let applies = s.case.keep != Keep::All && !s.case.seeds.is_empty();
        applies.then(|| removed(s, |_| true)).flatten()
    }),
    both("side flipped against the seeds in mesh and T0", "sides", INFORMED, |s| {
        let flow = s.case.side_of_flow();
        let other = if flow == Side::Inside { Side::Outside } else { Side::Inside };
        let flipped = mapped(s, |w| if has_side(w, flow) { with_side(w, other) } else { w });
        (!s.case.seeds.is_empty() && flipped[0] != s.mesh.words).then_some(flipped)
    }),
    sets("manifest: one outside component too many", "kept", INFORMED, |_, mutation| {
        counted(mutation, |c| c.outside += 1)
    }),
    sets("manifest: one inside component too many", "kept", INFORMED, |_, mutation| {
        counted(mutation, |c| c.inside += 1)
    }),
    sets("manifest: one enclosed component too many", "kept", INFORMED, |_, mutation| {
        counted(mutation, |c| c.enclosed.count += 1)
    }),
    sets("manifest: one enclosed leaf too many", "kept", INFORMED, |_, mutation| {
        counted(mutation, |c| c.enclosed.leaves += 1)
    }),
    sets("manifest: enclosed component in the mesh", "kept", AUDITED, |s, mutation| {
        let leaf = word::octant(*s.mesh.words.first()?);
        let components = mutation.mesh.manifest.components.as_mut()?;
        components.enclosed.example = Some(s.case.root.to_user(leaf.centre()));
        Some(())
    }),
    sets("manifest: every outside component enclosed", "kept", AUDITED, |_, mutation| {
        counted(mutation, |c| c.enclosed.count = c.outside)
    }),
];

/// The mesh with another side for one leaf of those that satisfy a predicate.
fn labelled(s: &SelftestCase, to: Side, predicate: impl Fn(u64) -> bool) -> Option<Vec<u64>> {
    changed(s, predicate, |words, i| words[i] = with_side(words[i], to))
}

/// The same of those with a side.
fn relabelled(s: &SelftestCase, from: Side, to: Side) -> Option<Vec<u64>> {
    labelled(s, to, |w| has_side(w, from))
}

/// Mesh and T0 with other words for all leaves.
fn mapped(s: &SelftestCase, map: impl Fn(u64) -> u64) -> [Vec<u64>; 2] {
    [&s.mesh, &s.base].map(|set| set.words.iter().map(|&w| map(w)).collect())
}

/// Mesh and T0 with another side for one leaf that they have in common.
fn in_both(s: &SelftestCase, to: Side, predicate: impl Fn(u64) -> bool) -> Option<[Vec<u64>; 2]> {
    let in_base = |w: u64| s.base.words.binary_search(&w).is_ok();
    let leaf = s.mesh.words[middle(&s.mesh.words, |w| predicate(w) && in_base(w))?];
    Some(mapped(s, |w| if w == leaf { with_side(w, to) } else { w }))
}

/// Mesh and T0 with inside and outside swapped where a predicate holds, if nothing is deleted and not all leaves are crossing.
fn flipped(s: &SelftestCase, predicate: impl Fn(u64) -> bool) -> Option<[Vec<u64>; 2]> {
    let swapped = mapped(s, |w| if w & 3 < 2 && predicate(w) { w ^ 1 } else { w });
    (s.case.keep == Keep::All && swapped[0] != s.mesh.words).then_some(swapped)
}

/// The mesh with leaves of T0 in enclosed components, at most `most`: leaves of the wanted side that the mesh does not have.
fn enclosed_kept(s: &SelftestCase, most: usize) -> Option<Vec<u64>> {
    let mesh = &s.mesh.words;
    let refined = |w: u64| {
        let first = mesh.partition_point(|&m| word::key(m) < word::key(w));
        let end = word::key(w) + word::span(word::level(w));
        mesh.get(first).is_some_and(|&m| word::key(m) < end)
    };
    let enclosed = |w: &u64| has_side(*w, Side::Outside) && !refined(*w);
    let restored: Vec<u64> = s.base.words.iter().copied().filter(enclosed).take(most).collect();
    let applies = s.case.keep == Keep::Outside && !restored.is_empty();
    applies.then(|| [mesh.clone(), restored].concat())
}

/// The mesh without the first component of its leaves to which this applies.
fn removed(s: &SelftestCase, applies: impl Fn(&[u32]) -> bool) -> Option<Vec<u64>> {
    let group = components::groups(&s.mesh.words).into_iter().find(|group| applies(group))?;
    let is_kept = |&(i, _): &(u32, u64)| !group.contains(&i);
    Some((0..).zip(s.mesh.words.iter().copied()).filter(is_kept).map(|(_, w)| w).collect())
}

/// Changes the counts in the manifest, if it has any.
fn counted(mutation: &mut Mutation, change: fn(&mut Components)) -> Option<()> {
    let components = mutation.mesh.manifest.components.as_mut()?;
    let before = *components;
    change(components);
    (*components != before).then_some(())
}
