//! Wrong components and wrong counts of them, which the checks `kept` and `sides` must detect.
//!
//! The leaves to corrupt are found from the correct mesh and T0 alone, so that the corruptions apply to a window of a
//! larger mesh, too.

use super::SelftestCase;
use super::edit::{self, has_side, with_side};
use super::mutant::{Mutant, Mutation, audited, informed};
use crate::checks::{Terms, components};
use contract::manifest::{Components, Keep};
use contract::word::{self, Side};

pub(super) const MUTANTS: &[Mutant] = &[
    informed("one leaf of an enclosed component kept", "kept", |s| enclosed_kept(s, 1)),
    informed("enclosed component kept", "kept", |s| enclosed_kept(s, usize::MAX)),
    informed("far-field component deleted", "kept", far_field_deleted),
    informed("component with a seed deleted", "kept", seeded_deleted),
    informed("side flipped against the seeds in mesh and T0", "sides", flipped_against_seeds),
    informed("manifest: one outside component too many", "kept", |s| {
        counted(s, |c| c.outside += 1)
    }),
    informed("manifest: one inside component too many", "kept", |s| counted(s, |c| c.inside += 1)),
    informed("manifest: one enclosed component too many", "kept", |s| {
        counted(s, |c| c.enclosed.count += 1)
    }),
    informed("manifest: one enclosed leaf too many", "kept", |s| {
        counted(s, |c| c.enclosed.leaves += 1)
    }),
    audited("manifest: enclosed component in the mesh", "kept", example_in_mesh),
    audited("manifest: every outside component enclosed", "kept", |s| {
        counted(s, |c| c.enclosed.count = c.outside)
    }),
];

/// Adds leaves of T0 in enclosed components, at most `most`: leaves of the wanted side that the mesh does not have.
fn enclosed_kept(s: &SelftestCase, most: usize) -> Option<Mutation> {
    let mesh = &s.mesh.words;
    let refined = |w: u64| {
        let first = mesh.partition_point(|&m| word::key(m) < word::key(w));
        let end = word::key(w) + word::span(word::level(w));
        mesh.get(first).is_some_and(|&m| word::key(m) < end)
    };
    let enclosed = |w: &u64| has_side(*w, Side::Outside) && !refined(*w);
    let restored: Vec<u64> = s.base.words.iter().copied().filter(enclosed).take(most).collect();
    let applies = s.case.keep == Keep::Outside && !restored.is_empty();
    applies.then(|| Mutation::with_words(s, [mesh.clone(), restored].concat()))
}

/// Removes a component of the mesh's leaves.
fn removed(s: &SelftestCase, applies: impl Fn(&[u32]) -> bool) -> Option<Mutation> {
    let groups = components::groups(&s.mesh.words);
    let group = groups.into_iter().find(|group| applies(group))?;
    let mut kept = s.mesh.words.clone();
    group.iter().for_each(|&i| kept[i as usize] = u64::MAX);
    kept.retain(|&w| w != u64::MAX);
    Some(Mutation::with_words(s, kept))
}

fn far_field_deleted(s: &SelftestCase) -> Option<Mutation> {
    let far_field = |group: &[u32]| components::touches_boundary(&s.mesh.words, group);
    let outside = s.case.keep == Keep::Outside && s.case.seeds.is_empty();
    outside.then(|| removed(s, far_field)).flatten()
}

fn seeded_deleted(s: &SelftestCase) -> Option<Mutation> {
    // If one side is deleted, every component that is left has a seed.
    let applies = s.case.keep != Keep::All && !s.case.seeds.is_empty();
    applies.then(|| removed(s, |_| true)).flatten()
}

fn flipped_against_seeds(s: &SelftestCase) -> Option<Mutation> {
    if s.case.seeds.is_empty() {
        return None;
    }
    let flow = Terms::of_case(&s.case).side_of_flow();
    let other = if flow == Side::Inside { Side::Outside } else { Side::Inside };
    let flip = |words: &[u64]| -> Vec<u64> {
        words.iter().map(|&w| if has_side(w, flow) { with_side(w, other) } else { w }).collect()
    };
    let words = flip(&s.mesh.words);
    if words == s.mesh.words {
        return None;
    }
    let mut mutation = Mutation::with_words(s, words);
    mutation.base = edit::with_words(&s.base, flip(&s.base.words));
    Some(mutation)
}

/// Changes the counts in the manifest, if it has any.
fn counted(s: &SelftestCase, change: fn(&mut Components)) -> Option<Mutation> {
    let mut mutation = Mutation::of(s);
    change(mutation.mesh.manifest.components.as_mut()?);
    (mutation.mesh.manifest != s.mesh.manifest).then_some(mutation)
}

/// Places an enclosed component at a leaf of the mesh.
fn example_in_mesh(s: &SelftestCase) -> Option<Mutation> {
    let mut mutation = Mutation::of(s);
    let leaf = word::octant(*s.mesh.words.first()?);
    let components = mutation.mesh.manifest.components.as_mut()?;
    components.enclosed.example = Some(s.case.root.to_user(leaf.centre()));
    Some(mutation)
}
