//! The kept region, from the components of a mesh or of T0 itself.
//!
//! Section 5 of reference/DEFINITION.md. Refinement connects and separates nothing, so the components of a mesh are the
//! kept ones of T0: if enclosed components are deleted, either all outside components have a face on the root's boundary
//! or none has; every seed lies in a leaf of flow, and every component of flow has a seed; and each side has as many
//! components as the manifest counts. The check cannot detect that a whole component is missing if the manifest has no
//! counts, or any wrong component if the surface is larger than some millions of octants (a note says so).

#[cfg(test)]
mod tests;

use crate::checks::components::{self, Component};
use crate::checks::{CheckResult, contact, json};
use contract::manifest::{EnclosedComponents, Manifest, Tree as Kind};
use contract::octant::{Octant, UNITS_PER_CELL};
use contract::tree::Tree;
use contract::word::{self, Leaf, Side};

/// Checks a tree, final or T0, by itself.
pub(super) fn check(tree: &Tree, terms: &Manifest, manifest: &Manifest, result: &mut CheckResult) {
    seeds_in_flow(tree, terms, result);
    possible(tree, terms, manifest, result);
    let is_base = manifest.tree == Kind::Base;
    let counts = manifest.components.as_ref().map(|counted| {
        let deleted = if is_base { 0 } else { counted.enclosed.count };
        let outside = counted.outside.saturating_sub(deleted);
        let counts = [(Side::Outside, outside), (Side::Inside, counted.inside)];
        counts.into_iter().filter(|(side, _)| is_base || terms.keeps(*side as u8))
    });
    let Some(octants) = uniform_octants(tree) else {
        let is_there = |side| tree.kinds(tree.root()) & 1 << side as u8 != 0;
        for (side, expected) in counts.into_iter().flatten() {
            if (expected > 0) != is_there(side) {
                result.report(format_args!(
                    "the manifest leaves {expected} {side} components, which its leaves contradict"
                ));
            }
        }
        let why = format!("over {OCTANTS_MAX} octants have leaves of one side");
        result.note = format!("components are not known: {why}");
        return;
    };
    let found = components::stated(&octants, terms);
    let place = |component: &Component| terms.root.place(component.first);
    let enclosed = || found.iter().filter(|component| component.enclosed);
    if manifest.tree == Kind::Final {
        for place in enclosed().map(place) {
            result.report(format_args!(
                "an outside component has no face on the root's boundary, although another has, so it is enclosed \
                 and must be deleted; in it lies {place}"
            ));
        }
    }
    if !terms.seeds.is_empty() {
        let seeded = components::seeded_leaves(&octants, terms);
        let lacks_seed = |component: &&Component| {
            component.side == terms.side_of_flow()
                && components::seed_in(&component.leaves, &seeded).is_none()
        };
        for place in found.iter().filter(lacks_seed).map(place) {
            result.report(format_args!("no seed lies in a component of flow, that of {place}"));
        }
    }
    let Some(counted) = &manifest.components else { return };
    for (side, expected) in counts.into_iter().flatten() {
        let found = found.iter().filter(|component| component.side == side).count() as u64;
        if found != expected {
            result.report(format_args!(
                "the manifest leaves {expected} {side} components, and there are {found}"
            ));
        }
    }
    let (found, count) = (enclosed().count() as u64, counted.enclosed.count);
    if is_base && found != count {
        result.report(format_args!(
            "the manifest counts {count} enclosed components, and T0 has {found}"
        ));
    }
}

/// Maximum number of octants whose components are sought, at some 30 bytes and a microsecond each.
const OCTANTS_MAX: usize = 4_000_000;

/// The largest octants all of whose leaves have one side, crossing octants excluded, as sorted words; `None` if there
/// are too many. Their components are those of the leaves.
fn uniform_octants(tree: &Tree) -> Option<Vec<u64>> {
    let mut words = Vec::new();
    tree.walk(&mut |octant, handle| {
        let kinds = tree.kinds(handle);
        let one = [Side::Outside, Side::Inside].into_iter().find(|&s| kinds == 1 << s as u8);
        words.extend(one.map(|side| word::encode(&Leaf { octant, side })));
        one.is_none() && words.len() <= OCTANTS_MAX
    });
    (words.len() <= OCTANTS_MAX).then_some(words)
}

/// Every seed lies in a leaf of flow.
fn seeds_in_flow(tree: &Tree, terms: &Manifest, result: &mut CheckResult) {
    let flow = terms.side_of_flow();
    for (i, &seed) in terms.seeds.iter().enumerate() {
        let cell = components::in_root(seed).then(|| seed.map(|q| (q / UNITS_PER_CELL) as u32));
        let found = match cell.map(|cell| tree.locate(cell)) {
            Some(Some((_, kind))) if kind == flow as u8 => continue,
            Some(Some((leaf, kind))) => {
                format!("in the {} leaf {}", contact::name(1 << kind), terms.root.place(leaf))
            }
            Some(None) => "in no leaf".to_owned(),
            None => "outside the root".to_owned(),
        };
        let at = terms.root.to_user(seed);
        result.report(format_args!(
            "seed {i} at {at:?} lies {found}, and not in a leaf that is {flow}"
        ));
    }
}

/// Whether the counts in a manifest can be right, and the example lies in a leaf that is deleted.
fn possible(tree: &Tree, terms: &Manifest, manifest: &Manifest, result: &mut CheckResult) {
    let Some(counted) = &manifest.components else { return };
    let EnclosedComponents { count, leaves, example } = counted.enclosed;
    let none = count == 0 && leaves == 0 && example.is_none();
    // The far field is another outside component.
    let some = terms.deletes_enclosed()
        && 0 < count
        && count < counted.outside
        && count <= leaves
        && example.is_some_and(|at| deleted_at(tree, at, manifest.tree, terms));
    if !none && !some {
        let (outside, at) = (counted.outside, json(&example));
        result.report(format_args!(
            "{count} of {outside} outside components cannot be enclosed with {leaves} leaves of T0 and one at {at}"
        ));
    }
}

/// Whether a point lies in a leaf that was deleted from a final mesh, or that is outside in T0.
fn deleted_at(tree: &Tree, at: [f64; 3], kind: Kind, terms: &Manifest) -> bool {
    let Some(point) = terms.root.quantise_seed(at) else { return false };
    let found = tree.locate(point.map(|q| (q / UNITS_PER_CELL) as u32));
    match kind {
        Kind::Final => found.is_none(),
        Kind::Base => found.is_some_and(|(leaf, side): (Octant, u8)| {
            side == Side::Outside as u8 && terms.same_place(at, terms.root.to_user(leaf.centre()))
        }),
    }
}
