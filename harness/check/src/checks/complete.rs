//! Kept and deleted leaves tile the root.
//!
//! Sections 5 and 7 of reference/DEFINITION.md. With the case the check is exact: leaves fill every kept leaf of T0,
//! every deleted one is empty, those in enclosed components included, and no leaf is coarser than T0. Without it the boundary of
//! every hole must be one that deletion can leave: a leaf lacks a neighbour across a face only if the definition may delete the
//! neighbours of such a leaf. Then the check cannot detect a missing leaf if all leaves around it may
//! lack neighbours, for example a crossing leaf among crossing leaves. A promise of less than the definition is judged beyond a
//! band around the geometry (`super::region`).

use super::region::Survey;
use super::truth::{Found, Truth};
use super::{CheckResult, Subject, UNKNOWN_SIDES, contact, some_leaves};
use contract::manifest::{Keep, Manifest, Sides};
use contract::octant::LEVEL_MAX;
use contract::tree::{HOLES, Handle, Kind, Tree};
use contract::word::Side;

pub(super) fn run(subject: &Subject, result: &mut CheckResult) {
    let (tree, terms) = (subject.tree(), &subject.terms);
    let deletes = terms.keep != Keep::All || !terms.keep_crossing;
    if !subject.promises.definition && deletes {
        return Survey::of(subject, result, Survey::check_complete);
    }
    // How fine a leaf must be is no matter of the promise of completeness.
    match subject.truth().filter(|_| subject.promises.definition) {
        Some(truth) => {
            result.examined = subject.examined_with(truth);
            truth.compare(tree, &mut |found| compare(&found, terms, result));
        }
        None if terms.sides == Sides::Unknown && deletes => return result.lacks(UNKNOWN_SIDES),
        None => check_holes(tree, terms, result),
    }
    if subject.case.is_none() {
        result.requires(some_leaves(subject.tree_with_deleted()));
    }
}

fn compare(found: &Found, terms: &Manifest, result: &mut CheckResult) {
    let what = match found.base {
        None => "a leaf is coarser than T0:",
        Some(kind) => match (Truth::keeps(kind, terms), found.kinds == HOLES) {
            (true, true) => "the mesh has a hole:",
            (false, false) if terms.keeps(Truth::side(kind) as Kind) => {
                "an enclosed T0 leaf still exists, at least in part:"
            }
            (false, false) => "a T0 leaf that must be deleted still exists, at least in part:",
            _ => return,
        },
    };
    result.report(format_args!("{what} {}", terms.root.place(found.octant)));
}

/// Checks the boundaries of holes, from the leaves only.
fn check_holes(tree: &Tree, terms: &Manifest, result: &mut CheckResult) {
    if tree.root == Handle::HOLE {
        // A body that fills the root leaves an empty mesh, unless nothing is ever deleted.
        if terms.keep == Keep::All && terms.keep_crossing {
            result.report("the mesh has no leaves, although nothing is deleted");
        }
        return;
    }
    // Crossing leaves may have deleted neighbours, because they separate the sides, unless everything is kept. If they are deleted
    // themselves, so may leaves beside them, which are at least as fine as the surface.
    let separate = terms.keep_crossing && terms.keep != Keep::All;
    let of = Side::ALL.into_iter().filter(|&side| !separate || side != Side::Crossing);
    let of = of.fold(0, |all, side| all | 1 << side as u8);
    let finest = if terms.keep_crossing { LEVEL_MAX + 1 } else { terms.level_surface };
    contact::visit(tree, of, HOLES, &mut |octant, kind, across| {
        if across & HOLES != 0 && octant.level < finest {
            let side = (terms.sides == Sides::Known).then(|| contact::name(1 << kind) + " ");
            let side = side.unwrap_or_default();
            let leaf = terms.root.place(octant);
            result.report(format_args!("the {side}leaf {leaf} has a hole across a face"));
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::testing::leaf_set;

    #[test]
    fn a_mesh_without_leaves_is_a_finding_if_nothing_is_ever_deleted() {
        let manifest = leaf_set(vec![]).manifest;
        for (keep, keep_crossing, findings) in
            [(Keep::All, true, 1), (Keep::All, false, 0), (Keep::Outside, true, 0)]
        {
            let terms = Manifest { keep, keep_crossing, ..manifest.clone() };
            let mut result = CheckResult::new("complete");
            check_holes(&Tree::default(), &terms, &mut result);
            assert_eq!(result.findings_total, findings);
        }
    }
}
