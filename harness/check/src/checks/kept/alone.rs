//! The kept region, from the components of a mesh or of T0 itself.
//!
//! Section 5 of reference/DEFINITION.md. Refinement connects and separates nothing, so the components of a mesh are the
//! kept ones of T0: if enclosed components are deleted, either all outside components have a face on the root's boundary
//! or none has; every seed lies in a leaf of flow, and every component of flow has a seed; and each side has as many
//! components as the manifest counts. The check cannot detect that a whole component is missing if the manifest has no
//! counts, or any wrong component if the surface is larger than some millions of octants (a note says so).

#[cfg(test)]
mod tests;

use crate::checks::{CheckResult, Terms, components, contact, json};
use contract::manifest::{Components, EnclosedComponents, Manifest, Tree as Kind};
use contract::octant::{Octant, UNITS_PER_CELL};
use contract::tree::{Handle, Tree};
use contract::word::{self, Leaf, Side};

/// Checks a tree, final or T0, by itself.
pub(super) fn check(tree: &Tree, terms: &Terms, manifest: &Manifest, result: &mut CheckResult) {
    seeds_in_flow(tree, terms, result);
    if let Some(counted) = &manifest.components {
        possible(tree, counted, manifest.tree, terms, result);
    }
    let Some(octants) = uniform_octants(tree) else {
        result.note =
            format!("components are not known: over {OCTANTS_MAX} octants have leaves of one side");
        return;
    };
    let found = Found { terms, groups: components::groups(&octants), octants };
    if manifest.tree == Kind::Final {
        found.check_enclosed(result);
    }
    if !terms.seeds.is_empty() {
        found.check_seeds(result);
    }
    if let Some(counted) = &manifest.components {
        found.check_counts(counted, manifest.tree, result);
    }
}

/// The components of a tree's leaves, as lists of indices of [`uniform_octants`].
struct Found<'a> {
    terms: &'a Terms,
    octants: Vec<u64>,
    groups: Vec<Vec<u32>>,
}

impl Found<'_> {
    fn of_side(&self, side: Side) -> impl Iterator<Item = &Vec<u32>> {
        self.groups.iter().filter(move |group| word::side(self.octants[group[0] as usize]) == side)
    }

    fn describe(&self, group: &[u32]) -> String {
        self.terms.root.describe(&word::octant(self.octants[group[0] as usize]))
    }

    /// Outside components without a face on the root's boundary, if another has one and they are to be deleted.
    fn enclosed(&self) -> Vec<&Vec<u32>> {
        let at_boundary = |group: &&Vec<u32>| components::touches_boundary(&self.octants, group);
        let (far_field, enclosed): (Vec<_>, Vec<_>) =
            self.of_side(Side::Outside).partition(at_boundary);
        if self.terms.deletes_enclosed() && !far_field.is_empty() { enclosed } else { Vec::new() }
    }

    /// No enclosed component is left in a final mesh.
    fn check_enclosed(&self, result: &mut CheckResult) {
        for group in self.enclosed() {
            result.report_with(|| {
                format!(
                    "an outside component has no face on the root's boundary, although another has, so it is enclosed \
                     and must be deleted; in it lies {}",
                    self.describe(group)
                )
            });
        }
    }

    /// Every component of flow has a seed.
    fn check_seeds(&self, result: &mut CheckResult) {
        let seeded = components::seeded_leaves(&self.octants, self.terms);
        let has_seed = |group: &[u32]| components::seed_in(group, &seeded).is_some();
        for group in self.of_side(self.terms.side_of_flow()).filter(|group| !has_seed(group)) {
            result.report_with(|| {
                format!("no seed lies in a component of flow, that of {}", self.describe(group))
            });
        }
    }

    /// There are as many components as a manifest counts.
    fn check_counts(&self, counted: &Components, kind: Kind, result: &mut CheckResult) {
        for (side, expected) in counts_of_tree(counted, self.terms, kind) {
            let found = self.of_side(side).count() as u64;
            if found != expected {
                result.report(format!(
                    "the manifest leaves {expected} {side} components, and there are {found}"
                ));
            }
        }
        let (found, count) = (self.enclosed().len() as u64, counted.enclosed.count);
        if kind == Kind::Base && found != count {
            result.report(format!(
                "the manifest counts {count} enclosed components, and T0 has {found}"
            ));
        }
    }
}

/// Maximum number of octants whose components are sought, at some 30 bytes and a microsecond each.
const OCTANTS_MAX: usize = 4_000_000;

/// The largest octants all of whose leaves have one side, crossing octants excluded, as sorted words; `None` if there
/// are too many. Their components are those of the leaves.
fn uniform_octants(tree: &Tree) -> Option<Vec<u64>> {
    fn below(tree: &Tree, handle: Handle, octant: Octant, words: &mut Vec<u64>) -> bool {
        let kinds = tree.kinds(handle);
        let one = [Side::Outside, Side::Inside].into_iter().find(|&s| kinds == 1 << s as u8);
        if let Some(side) = one {
            words.push(word::encode(&Leaf { octant, side }));
            return words.len() <= OCTANTS_MAX;
        }
        let child = |d| tree.child(handle, d, octant.level);
        !handle.is_node() || (0..8).all(|d| below(tree, child(d), octant.child(d), words))
    }
    let mut words = Vec::new();
    below(tree, tree.root(), Octant::ROOT, &mut words).then_some(words)
}

/// The sides of a tree's leaves, with the numbers of components that a manifest leaves of them.
fn counts_of_tree(counted: &Components, terms: &Terms, kind: Kind) -> Vec<(Side, u64)> {
    let sides = [(Side::Outside, counted.outside), (Side::Inside, counted.inside)];
    let left = |(side, count): (Side, u64)| match (side, kind) {
        (_, Kind::Base) => Some((side, count)),
        _ if !terms.keeps(side as u8) => None,
        (Side::Outside, _) => Some((side, count.saturating_sub(counted.enclosed.count))),
        _ => Some((side, count)),
    };
    sides.into_iter().filter_map(left).collect()
}

/// Every seed lies in a leaf of flow.
fn seeds_in_flow(tree: &Tree, terms: &Terms, result: &mut CheckResult) {
    let flow = terms.side_of_flow();
    for (i, &seed) in terms.seeds.iter().enumerate() {
        if !components::in_root(seed) {
            result.report(format!("seed {i} at {seed:?} on the lattice lies outside the root"));
            continue;
        }
        let found = tree.locate(seed.map(|q| (q / UNITS_PER_CELL) as u32));
        if found.is_none_or(|(_, kind)| kind != flow as u8) {
            let at = terms.root.to_user(seed);
            let found = match found {
                Some((leaf, kind)) => {
                    format!(
                        "in the {} leaf {}",
                        contact::name(1 << kind),
                        terms.root.describe(&leaf)
                    )
                }
                None => "in no leaf".to_owned(),
            };
            result.report(format!(
                "seed {i} at {at:?} lies {found}, and not in a leaf that is {flow}"
            ));
        }
    }
}

/// Whether the counts in a manifest can be right, and the example lies in a leaf that is deleted.
fn possible(
    tree: &Tree,
    counted: &Components,
    kind: Kind,
    terms: &Terms,
    result: &mut CheckResult,
) {
    let EnclosedComponents { count, leaves, example } = counted.enclosed;
    let none = count == 0 && leaves == 0 && example.is_none();
    // The far field is another outside component.
    let some = terms.deletes_enclosed()
        && 0 < count
        && count < counted.outside
        && count <= leaves
        && example.is_some_and(|at| deleted_at(tree, at, kind, terms));
    if !none && !some {
        result.report(format!(
            "{count} of {} outside components cannot be enclosed with {leaves} leaves of T0 and one at {}",
            counted.outside,
            json(&example)
        ));
    }
    let kinds = tree.kinds(tree.root());
    for (side, expected) in counts_of_tree(counted, terms, kind) {
        if (expected > 0) != (kinds & 1 << side as u8 != 0) {
            let leaves = if expected > 0 { "no leaf is" } else { "leaves are" };
            result.report(format!(
                "the manifest leaves {expected} {side} components, but {leaves} {side}"
            ));
        }
    }
}

/// Whether a point lies in a leaf that was deleted from a final mesh, or that is outside in T0.
fn deleted_at(tree: &Tree, at: [f64; 3], kind: Kind, terms: &Terms) -> bool {
    let Some(point) = terms.root.quantise_seed(at) else { return false };
    let found = tree.locate(point.map(|q| (q / UNITS_PER_CELL) as u32));
    match kind {
        Kind::Final => found.is_none(),
        Kind::Base => found.is_some_and(|(leaf, side): (Octant, u8)| {
            side == Side::Outside as u8 && terms.same_place(at, terms.root.to_user(leaf.centre()))
        }),
    }
}
