//! Leaves are as fine as the surface and the boxes require, and T0 is no finer than that.
//!
//! Section 3 of reference/DEFINITION.md: every leaf that a facet crosses has at least the level of the surface,
//! and every leaf whose interior meets the interior of a box has at least the level of the box. T0 is the
//! smallest such tree: every octant that it splits is crossed and coarser than the surface, or meets a box of a
//! finer level. Without T0 the check establishes only that leaves are fine enough. It cannot detect needless
//! refinement by gradation; `identical` does.

use super::facets::{Facets, Visit};
use super::{CheckResult, Subject, Terms, identical, valid_leaves};
use contract::manifest::ExtentBox;
use contract::octant::Octant;
use contract::tree::{Handle, Tree};
use contract::word::{self, Side};

const NAME: &str = "spacing";

/// Checks the mesh and, if it is known, T0.
pub fn check(subject: &Subject) -> CheckResult {
    let mut result = check_tree(subject.tree(), &subject.terms);
    result.examined = subject.mesh.words.len() as u64;
    if let (Some(base), Some(tree)) = (subject.base, subject.tree_base()) {
        boxes_met(tree, &subject.terms, "T0 ", &mut result);
        least(subject.facets(), &valid_leaves(&base.words), &subject.terms, &mut result);
        result.examined += base.words.len() as u64;
    }
    result
}

/// Checks that the leaves of a tree are fine enough.
pub fn check_tree(tree: &Tree, terms: &Terms) -> CheckResult {
    let mut result = CheckResult::new(NAME);
    boxes_met(tree, terms, "", &mut result);
    crossing_fine(tree, tree.root(), Octant::ROOT, terms, &mut result);
    result
}

/// Checks that every leaf that meets a box has at least the level of the box.
pub fn check_boxes(tree: &Tree, terms: &Terms) -> CheckResult {
    let mut result = CheckResult::new("boxes");
    boxes_met(tree, terms, "", &mut result);
    match terms.boxes.is_empty() {
        true => CheckResult::nothing(result.name, "the case has no boxes"),
        false => result,
    }
}

/// Every leaf that meets a box has at least the level of the box.
fn boxes_met(tree: &Tree, terms: &Terms, prefix: &str, result: &mut CheckResult) {
    for extent in &terms.boxes {
        box_met(tree, tree.root(), Octant::ROOT, extent, &mut |leaf| {
            result.report_with(|| {
                let (leaf, level) = (terms.root.describe(&leaf), extent.level);
                format!("the {prefix}leaf {leaf} meets a box that requires level {level}")
            });
        });
    }
}

/// Reports every leaf that meets a box and is coarser than its level.
fn box_met(
    tree: &Tree,
    handle: Handle,
    octant: Octant,
    extent: &ExtentBox,
    report: &mut dyn FnMut(Octant),
) {
    let fine_enough = tree.coarsest_level(handle, octant.level) >= extent.level;
    if fine_enough || !extent.meets(&octant) {
        return;
    }
    if handle.is_node() {
        for d in 0..8 {
            box_met(tree, tree.child(handle, d, octant.level), octant.child(d), extent, report);
        }
    } else {
        report(octant);
    }
}

/// Every crossing leaf has at least the level of the surface.
fn crossing_fine(
    tree: &Tree,
    handle: Handle,
    octant: Octant,
    terms: &Terms,
    result: &mut CheckResult,
) {
    let crossing = tree.kinds(handle) & 1 << Side::Crossing as u8 != 0;
    if !crossing || octant.level >= terms.level_surface {
        return;
    }
    if handle.is_node() {
        for d in 0..8 {
            let child = tree.child(handle, d, octant.level);
            crossing_fine(tree, child, octant.child(d), terms, result);
        }
    } else {
        let (leaf, level) = (terms.root.describe(&octant), terms.level_surface);
        result.report(format!("the crossing leaf {leaf} is coarser than level {level}"));
    }
}

/// T0 is fine enough at the surface, and every split is required.
fn least(facets: &Facets, words: &[u64], terms: &Terms, result: &mut CheckResult) {
    facets.walk(words, &mut |visit, octant, crossed| {
        let surface_splits = crossed && octant.level < terms.level_surface;
        match visit {
            Visit::Leaf(i) if surface_splits => {
                debug_assert_eq!(word::level(words[i]), octant.level);
                let level = terms.level_surface;
                result.report_with(|| {
                    let leaf = identical::describe(words[i], &terms.root);
                    format!("a facet crosses the T0 {leaf}, which is coarser than level {level}")
                });
            }
            Visit::Split if !surface_splits && terms.box_that_splits(octant).is_none() => {
                result.report_with(|| {
                    format!("T0 needlessly splits {}", terms.root.describe(octant))
                });
            }
            _ => {}
        }
    });
}
