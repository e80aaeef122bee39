//! Wrong components and wrong counts of them, which the checks `kept` and `sides` must detect.
//!
//! The leaves to corrupt are found from the correct mesh and T0 alone, so that the corruptions apply to a window of a
//! larger mesh, too.

use super::SelftestCase;
use super::edit::{has_side, with_side};
use super::mutant::{AUDITED, INFORMED, Mutant, Mutation, both, sets, words};
use crate::checks::components;
use contract::manifest::{Components, Keep};
use contract::word::{self, Side};

pub(super) const MUTANTS: &[Mutant] = &[
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
        let flow = s.case.inputs().side_of_flow();
        let other = if flow == Side::Inside { Side::Outside } else { Side::Inside };
        let flip = |&w: &u64| if has_side(w, flow) { with_side(w, other) } else { w };
        let flipped: [Vec<u64>; 2] =
            [&s.mesh, &s.base].map(|set| set.words.iter().map(flip).collect());
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
