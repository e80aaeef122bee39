//! Wrong sides, wrong components and wrong counts of them, which the checks `sides` and `kept` must detect.
//!
//! The leaves to corrupt are found from the correct mesh and T0 alone, so that the corruptions apply to a window of a
//! larger mesh, too.

use super::SelftestCase;
use super::mutant::{
    AUDITED, INFORMED, Mutant, changed, counts, edit, is_far, sets, with_side, words,
};
use crate::checks::components;
use contract::manifest::Keep;
use contract::tree::Tree;
use contract::word::{self, Side};

pub(super) const MUTANTS: &[Mutant] = &[
    sides("one outside leaf labelled inside", |s| relabelled(s, Side::Outside, Side::Inside)),
    sides("one inside leaf labelled outside", |s| relabelled(s, Side::Inside, Side::Outside)),
    words("one leaf of the side that is deleted", "sides", AUDITED, |s| match s.case.keep {
        Keep::Outside => relabelled(s, Side::Outside, Side::Inside),
        Keep::Inside => relabelled(s, Side::Inside, Side::Outside),
        Keep::All => None,
    }),
    words("one leaf of a component flipped", "sides", AUDITED, |s| {
        let tree = Tree::of_words(&s.mesh.words);
        let outside = 1 << Side::Outside as u8;
        // Leaves of the same component surround it.
        let deep = |w| word::side(w) == Side::Outside && is_far(&tree, w, !outside);
        labelled(s, Side::Inside, deep).filter(|_| s.case.keep == Keep::All)
    }),
    sides("all inside leaves labelled outside", |s| flipped(s, |w| word::side(w) == Side::Inside)),
    sides("inside and outside swapped everywhere", |s| flipped(s, |_| true)),
    sides("crossing leaf labelled outside", |s| relabelled(s, Side::Crossing, Side::Outside)),
    sides("crossing leaf labelled inside", |s| relabelled(s, Side::Crossing, Side::Inside)),
    sides("leaf labelled crossing", |s| labelled(s, Side::Crossing, |w| !word::is_crossing(w))),
    sides("leaf of the surface's level labelled crossing", |s| {
        let of_surface = |w| word::level(w) == s.case.level_surface;
        labelled(s, Side::Crossing, |w| !word::is_crossing(w) && of_surface(w))
    }),
    edit("one ambiguous component too many in the manifest", "sides", INFORMED, |m| {
        m.components_ambiguous.get_or_insert_default().count += 1;
    }),
    edit("wrong example of an ambiguous component", "sides", INFORMED, |m| {
        m.components_ambiguous.get_or_insert_default().example = Some(m.root.origin);
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
    sides("side flipped against the seeds", |s| {
        let flow = s.case.side_of_flow();
        swapped(s, |w| word::side(w) == flow).filter(|_| !s.case.seeds.is_empty())
    }),
    counts("manifest: one outside component too many", "kept", INFORMED, |c| c.outside += 1),
    counts("manifest: one inside component too many", "kept", INFORMED, |c| c.inside += 1),
    counts("manifest: one enclosed component too many", "kept", INFORMED, |c| {
        c.enclosed.count += 1
    }),
    counts("manifest: one enclosed leaf too many", "kept", INFORMED, |c| c.enclosed.leaves += 1),
    sets("manifest: enclosed component in the mesh", "kept", AUDITED, |s, mutation| {
        let leaf = word::octant(*s.mesh.words.first()?);
        let components = mutation.mesh.manifest.components.as_mut()?;
        components.enclosed.example = Some(s.case.root.to_user(leaf.centre()));
        Some(())
    }),
    edit("manifest: every outside component enclosed", "kept", AUDITED, |m| {
        m.components.iter_mut().for_each(|c| c.enclosed.count = c.outside);
    }),
];

/// Sides of which only the case shows that they are wrong.
const fn sides(name: &'static str, change: fn(&SelftestCase) -> Option<Vec<u64>>) -> Mutant {
    words(name, "sides", INFORMED, change)
}

/// The mesh with another side for one leaf of those that satisfy a predicate.
fn labelled(s: &SelftestCase, to: Side, predicate: impl Fn(u64) -> bool) -> Option<Vec<u64>> {
    changed(s, predicate, |words, i| words[i] = with_side(words[i], to))
}

/// The same of those with a side.
fn relabelled(s: &SelftestCase, from: Side, to: Side) -> Option<Vec<u64>> {
    labelled(s, to, |w| word::side(w) == from)
}

/// The mesh with inside and outside swapped where a predicate holds, if there is such a leaf.
fn swapped(s: &SelftestCase, predicate: impl Fn(u64) -> bool) -> Option<Vec<u64>> {
    let swap = |&w: &u64| if w & 3 < 2 && predicate(w) { w ^ 1 } else { w };
    Some(s.mesh.words.iter().map(swap).collect()).filter(|words| *words != s.mesh.words)
}

/// The same if nothing is deleted.
fn flipped(s: &SelftestCase, predicate: impl Fn(u64) -> bool) -> Option<Vec<u64>> {
    swapped(s, predicate).filter(|_| s.case.keep == Keep::All)
}

/// The mesh with leaves of T0 in enclosed components, at most `most`: leaves of the wanted side that the mesh does not have.
fn enclosed_kept(s: &SelftestCase, most: usize) -> Option<Vec<u64>> {
    let mesh = &s.mesh.words;
    let refined = |w: u64| word::leaf_at(mesh, word::octant(w).bounds().0).is_some();
    let enclosed = |w: &u64| word::side(*w) == Side::Outside && !refined(*w);
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
