//! Leaves are as fine as surface and boxes ask, and T0 no finer.
//!
//! Section 3 of reference/DEFINITION.md: every leaf that a facet crosses has the surface's level at
//! least, every leaf whose inside meets a box's inside has the box's; T0 is the least such tree, so
//! each octant that it splits is crossed and coarser than the surface level, or meets a box of a
//! deeper level. Without T0: only that leaves are fine enough. Misses: needless refinement by
//! gradation, for which there is `identical`.

use super::facets::{Facets, Visit};
use super::{CheckResult, Subject, Terms, identical};
use contract::manifest::ExtentBox;
use contract::octant::Octant;
use contract::tree::{Handle, Tree};
use contract::word::{self, Side};

const NAME: &str = "spacing";

/// Checks the mesh, and T0 where it is given.
pub fn check(subject: &Subject) -> CheckResult {
    let mut result = check_tree(subject.tree(), &subject.terms);
    result.examined = subject.mesh.words.len() as u64;
    if let (Some(base), Some(tree)) = (subject.base, subject.tree_base()) {
        boxes_met(tree, &subject.terms, "T0 ", &mut result);
        least(subject.facets(), &subject.sound(&base.words), &subject.terms, &mut result);
        result.examined += base.words.len() as u64;
    }
    result
}

/// What can be said of the leaves alone.
pub fn check_tree(tree: &Tree, terms: &Terms) -> CheckResult {
    let mut result = CheckResult::new(NAME);
    boxes_met(tree, terms, "", &mut result);
    crossing_fine(tree, tree.root(), Octant::ROOT, terms, &mut result);
    result
}

/// Whether the insides of an octant and a box meet.
fn insides_meet(octant: &Octant, extent: &ExtentBox) -> bool {
    let (low, high) = octant.bounds();
    (0..3).all(|a| low[a].max(extent.min[a]) < high[a].min(extent.max[a]))
}

/// Every leaf in a box has the box's level.
fn boxes_met(tree: &Tree, terms: &Terms, whose: &str, result: &mut CheckResult) {
    for extent in &terms.boxes {
        box_met(tree, tree.root(), Octant::ROOT, extent, &mut |coarse| {
            result.find_with(|| {
                let (leaf, level) = (terms.root.describe(&coarse), extent.level);
                format!("the {whose}leaf {leaf} lies in a box that asks for level {level}")
            });
        });
    }
}

fn box_met(
    tree: &Tree,
    at: Handle,
    octant: Octant,
    extent: &ExtentBox,
    find: &mut dyn FnMut(Octant),
) {
    if tree.coarsest_level(at, octant.level) >= extent.level || !insides_meet(&octant, extent) {
        return;
    }
    if at.is_node() {
        for d in 0..8 {
            box_met(tree, tree.child(at, d, octant.level), octant.child(d), extent, find);
        }
    } else {
        find(octant);
    }
}

/// Every crossing leaf has the surface's level.
fn crossing_fine(tree: &Tree, at: Handle, octant: Octant, terms: &Terms, result: &mut CheckResult) {
    let crossing = tree.kinds(at) & 1 << Side::Crossing as u8 != 0;
    if !crossing || octant.level >= terms.level_surface {
        return;
    }
    if at.is_node() {
        for d in 0..8 {
            crossing_fine(tree, tree.child(at, d, octant.level), octant.child(d), terms, result);
        }
    } else {
        let (leaf, level) = (terms.root.describe(&octant), terms.level_surface);
        result.find(format!("the crossing leaf {leaf} is coarser than level {level}"));
    }
}

/// T0 is fine enough where facets are, and splits nothing without need.
fn least(facets: &Facets, words: &[u64], terms: &Terms, result: &mut CheckResult) {
    facets.walk(words, &mut |visit, octant, crossed| {
        let wanted = crossed && octant.level < terms.level_surface;
        match visit {
            Visit::Leaf(i) if wanted => {
                debug_assert_eq!(word::level(words[i]), octant.level);
                let level = terms.level_surface;
                result.find_with(|| {
                    let leaf = identical::tell(words[i], &terms.root);
                    format!("a facet crosses the T0 {leaf}, coarser than level {level}")
                });
            }
            Visit::Split if !wanted && !box_asks(octant, terms) => {
                result.find_with(|| {
                    let octant = terms.root.describe(octant);
                    format!("T0 splits without need the {octant}")
                });
            }
            _ => {}
        }
    });
}

/// Whether a box wants this octant split.
fn box_asks(octant: &Octant, terms: &Terms) -> bool {
    terms.boxes.iter().any(|b| b.level > octant.level && insides_meet(octant, b))
}
