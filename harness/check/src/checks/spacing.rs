//! Leaves are as fine as the surface and the boxes require, and T0 is no finer than that.
//!
//! Section 3 of reference/DEFINITION.md: every leaf that a facet crosses has at least the level of the surface,
//! and every leaf whose interior meets the interior of a box has at least the level of the box. T0 is the
//! smallest such tree: an engine's T0 splits what the harness's own splits, and nothing else. Of the mesh the check
//! establishes only that leaves labelled crossing are fine enough; `complete` compares all of them with T0, and `splits`
//! detects needless refinement.

use super::{Check, CheckResult, Subject, for_definition, some_leaves};
use contract::manifest::Manifest;
use contract::tree::Tree;
use contract::word::Side;

pub(super) const CHECK: Check = Check {
    name: "spacing",
    wanted: for_definition,
    needs: |subject| {
        let kinds = subject.tree().kinds(subject.tree().root());
        let without = kinds & 1 << Side::Crossing as u8 == 0 && subject.terms.boxes.is_empty();
        let uncrossed = || "no leaf is crossing, and there are no boxes".to_owned();
        let missing = some_leaves(subject).or_else(|| without.then(uncrossed));
        missing.filter(|_| subject.base.is_none())
    },
    run,
};

/// The promise of boxes alone.
pub(super) const BOXES: Check = Check {
    name: "boxes",
    wanted: |subject| !subject.promises.definition && subject.promises.boxes,
    needs: |subject| subject.terms.boxes.is_empty().then(|| "the case has no boxes".to_owned()),
    run: |subject, result| boxes_met(subject.tree(), &subject.terms, result),
};

fn run(subject: &Subject, result: &mut CheckResult) {
    let (tree, terms) = (subject.tree(), &subject.terms);
    boxes_met(tree, terms, result);
    crossing_fine(tree, terms, result);
    let (Some(base), Some(truth)) = (subject.tree_base(), subject.truth()) else { return };
    truth.compare(base, &mut |found| {
        let what = match found.base {
            None => "a facet or a box requires T0 to split the leaf",
            Some(_) if found.is_finer => "T0 needlessly splits a leaf; it has",
            Some(_) => return,
        };
        result.report_with(|| format!("{what} {}", terms.root.describe(&found.octant)));
    });
}

/// Every leaf that meets a box has at least the level of the box.
fn boxes_met(tree: &Tree, terms: &Manifest, result: &mut CheckResult) {
    for extent in &terms.boxes {
        tree.walk(&mut |octant, handle| {
            let is_fine = tree.coarsest_level(handle, octant.level) >= extent.level;
            let may_be_coarse = !is_fine && extent.meets(&octant);
            if may_be_coarse && !handle.is_node() {
                result.report_with(|| {
                    let (leaf, level) = (terms.root.describe(&octant), extent.level);
                    format!("the leaf {leaf} meets a box that requires level {level}")
                });
            }
            may_be_coarse
        });
    }
}

/// Every crossing leaf has at least the level of the surface.
fn crossing_fine(tree: &Tree, terms: &Manifest, result: &mut CheckResult) {
    tree.walk(&mut |octant, handle| {
        let has_crossing = tree.kinds(handle) & 1 << Side::Crossing as u8 != 0;
        let may_be_coarse = has_crossing && octant.level < terms.level_surface;
        if may_be_coarse && !handle.is_node() {
            let (leaf, level) = (terms.root.describe(&octant), terms.level_surface);
            result.report(format!("the crossing leaf {leaf} is coarser than level {level}"));
        }
        may_be_coarse
    });
}
