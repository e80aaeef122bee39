//! Leaves are as fine as the surface and the boxes require.
//!
//! Section 3 of reference/DEFINITION.md: every leaf that a facet crosses has at least the level of the surface,
//! and every leaf whose interior meets the interior of a box has at least the level of the box. No rule asks for a leaf that is finer than the
//! deepest of these levels. The check
//! establishes only that leaves labelled crossing are fine enough; `complete` compares all of them with T0, and `splits`
//! detects needless refinement, also of a T0.
//!
//! The promise `surface`: crossed leaves are found from the facets, never from the mesh's own sides. A leaf that is coarser than the
//! surface level is a finding if a facet reaches deeper into it than a tolerance. The check cannot detect a crossed leaf that is
//! missing from the mesh; `complete` does, if `crossing` is promised or the band of `sides` has no width.

use super::truth::Facets;
use super::{CheckResult, NO_GEOMETRY, Subject, UNKNOWN_INPUTS, some_leaves};
use contract::lattice::UNITS_PER_EDGE;
use contract::manifest::{ExtentBox, Manifest};
use contract::octant::Octant;
use contract::tree::{Builder, DELETED, Handle, Kind, Tree};
use contract::word::{self, Side};

/// The promise of boxes alone.
pub(super) fn boxes(subject: &Subject, result: &mut CheckResult) {
    let (tree, terms) = (subject.tree(), &subject.terms);
    boxes_met(tree, terms, result);
    let is_met = |octant: &Octant, _| terms.boxes.iter().any(|extent| extent.meets(octant));
    tree.walk_where(is_met, &mut |_, at| result.examined += u64::from(at != Handle::HOLE));
    let none = "no leaf meets a box of the case";
    result.needs_objects(if terms.lacks_inputs { UNKNOWN_INPUTS } else { none });
}

pub(super) fn run(subject: &Subject, result: &mut CheckResult) {
    let (tree, terms) = (subject.tree(), &subject.terms);
    if terms.lacks_inputs {
        return result.lacks(UNKNOWN_INPUTS);
    }
    boxes_met(tree, terms, result);
    crossing_fine(tree, terms, result);
    none_finer(tree, terms, result);
    let without = tree.kinds(tree.root) & 1 << Side::Crossing as u8 == 0
        && !terms.boxes.iter().any(ExtentBox::is_in_root);
    let uncrossed = || "no leaf is crossing, and no box is in the root".to_owned();
    result.requires(some_leaves(subject.tree_with_deleted()).or_else(|| without.then(uncrossed)));
}

/// Every leaf that meets a box has at least the level of the box.
fn boxes_met(tree: &Tree, terms: &Manifest, result: &mut CheckResult) {
    for extent in &terms.boxes {
        let level = extent.level;
        let is_coarse = |octant: &Octant, handle| {
            tree.coarsest_level(handle, octant.level) < level && extent.meets(octant)
        };
        tree.walk_where(is_coarse, &mut |octant, _| {
            let leaf = terms.root.place(octant);
            result.report(format_args!("the leaf {leaf} meets a box that requires level {level}"));
        });
    }
}

/// Every crossing leaf has at least the level of the surface.
fn crossing_fine(tree: &Tree, terms: &Manifest, result: &mut CheckResult) {
    let level = terms.level_surface;
    let is_coarse = |octant: &Octant, handle| {
        let has_crossing = tree.kinds(handle) & 1 << Side::Crossing as u8 != 0;
        has_crossing && tree.coarsest_level(handle, octant.level) < level
    };
    tree.walk_where(is_coarse, &mut |octant, _| {
        let leaf = terms.root.place(octant);
        result.report(format_args!("the crossing leaf {leaf} is coarser than level {level}"));
    });
}

/// No leaf is finer than the surface and the boxes require anywhere. Only the first is a finding, as all of a mesh may be.
fn none_finer(tree: &Tree, terms: &Manifest, result: &mut CheckResult) {
    let level = terms.level_deepest();
    let mut is_found = false;
    tree.walk(&mut |octant, handle| {
        let is_finer = !is_found && tree.finest_level(handle, octant.level) > level;
        if is_finer && !handle.is_node() {
            is_found = true;
            let leaf = terms.root.place(octant);
            result.report(format_args!(
                "the leaf {leaf} is finer than level {level}, the deepest of surface and boxes"
            ));
        }
        is_finer
    });
}

/// The promise of the surface alone.
pub(super) fn surface(subject: &Subject, result: &mut CheckResult) {
    match Crossed::of(subject) {
        Some(crossed) => crossed.check(subject.tree(), result),
        None => result.lacks(NO_GEOMETRY),
    }
}

/// The facets and the depth to which they may reach into a leaf.
pub struct Crossed<'a> {
    facets: &'a Facets,
    terms: &'a Manifest,
    /// The depth, in lattice units.
    tolerance: i64,
}

impl<'a> Crossed<'a> {
    /// The facets of a subject with the tolerance that it promises, if they are known.
    pub fn of(subject: &'a Subject) -> Option<Self> {
        let cells = subject.promises.surface.map_or(0.0, |surface| surface.tolerance_cells);
        Some(Self::new(&subject.truth()?.facets, &subject.terms, cells))
    }

    fn new(facets: &'a Facets, terms: &'a Manifest, tolerance_cells: f64) -> Self {
        let cell = UNITS_PER_EDGE >> terms.level_surface;
        Self { facets, terms, tolerance: (tolerance_cells * cell as f64) as i64 }
    }

    /// The first of some facets that reaches into an octant deeper than the tolerance.
    fn reaching(&self, octant: &Octant, near: &[u32]) -> Option<u32> {
        // A leaf far below the surface level may be smaller than the tolerance.
        let has_core = 2 * self.tolerance <= UNITS_PER_EDGE >> octant.level;
        has_core.then(|| self.facets.meeting(near, octant, -self.tolerance).next()).flatten()
    }

    fn check(&self, tree: &Tree, result: &mut CheckResult) {
        let level = self.terms.level_surface;
        self.facets.leaves(tree, &mut |octant, _, near| {
            let is_coarse = octant.level < level;
            let hit = if is_coarse { self.reaching(&octant, near) } else { near.first().copied() };
            let Some(facet) = hit else { return };
            result.examined += 1;
            if is_coarse {
                let leaf = self.terms.root.place(octant);
                result.report(format_args!(
                    "facet {facet} crosses the leaf {leaf}, which is coarser than level {level}"
                ));
            }
        });
        result.needs_objects("the geometry crosses no leaf of the mesh");
    }

    /// The tree with the sides of its leaves, but for deleted ones, replaced: crossing if a facet crosses a leaf of the surface level, else
    /// outside.
    pub fn labelled(&self, tree: &Tree) -> Tree {
        let mut builder = Builder::default();
        self.facets.leaves(tree, &mut |octant, kind, near| {
            let is_of_surface = octant.level == self.terms.level_surface;
            let crossing = is_of_surface && self.reaching(&octant, near).is_some();
            let side = if crossing { Side::Crossing } else { Side::Outside };
            let kind = if kind == DELETED { DELETED } else { side as Kind };
            builder.push_leaf(word::key_of(octant.corner), octant.level, kind);
        });
        builder.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::lattice::FacetLattice;
    use contract::testing::{leaf_set, words_of};

    /// Lattice units of a root of edge 8 per unit of length.
    const UNIT: f64 = (UNITS_PER_EDGE / 8) as f64;

    /// Leaves of edge 4 but in the first octant, where they have edge 2, that of the surface.
    fn tree() -> Tree {
        Tree::of_words(&words_of(|o| o.level == 0 || o.level == 1 && o.digit() == 0))
    }

    fn terms() -> Manifest {
        let mut manifest = leaf_set(vec![]).manifest;
        manifest.level_surface = 2;
        manifest.clone()
    }

    fn facet(corners: [[f64; 3]; 3]) -> FacetLattice {
        corners.map(|corner| corner.map(|c| (c * UNIT) as i64))
    }

    fn checked(facet: FacetLattice, tolerance_cells: f64) -> CheckResult {
        let mut result = CheckResult::new("surface");
        let facets = Facets::new(&[facet]);
        Crossed::new(&facets, &terms(), tolerance_cells).check(&tree(), &mut result);
        result
    }

    #[test]
    fn a_crossed_leaf_coarser_than_the_surface_is_a_finding_and_a_finer_one_is_not() {
        let fine = facet([[0.5, 0.5, 0.5], [1.5, 0.5, 0.5], [0.5, 1.5, 0.5]]);
        let result = checked(fine, 0.0);
        assert_eq!((result.examined, result.findings_total, result.was_run()), (1, 0, true));
        // Half a cell within a leaf of one cell is a point.
        assert_eq!(checked(fine, 0.5).examined, 1);
        let coarse = facet([[6.5, 6.5, 6.5], [7.5, 6.5, 6.5], [6.5, 7.5, 6.5]]);
        let result = checked(coarse, 0.0);
        assert_eq!((result.examined, result.findings_total), (1, 1));
        let text = &result.findings[0];
        assert!(text.starts_with("facet 0 crosses the leaf") && text.contains(" 7 "), "{text}");
        let beyond = facet([[9.0, 1.0, 1.0], [9.5, 1.0, 1.0], [9.0, 2.0, 1.0]]);
        assert!(!checked(beyond, 0.0).was_run());
    }

    #[test]
    fn a_facet_may_reach_into_a_coarser_leaf_as_deep_as_the_tolerance() {
        // From the first octant it reaches one unit, half a cell, into the second.
        let facet = facet([[3.5, 1.0, 1.0], [5.0, 1.0, 1.0], [3.5, 1.5, 1.0]]);
        for (tolerance_cells, findings) in [(0.0, 1), (0.45, 1), (0.5, 1), (0.51, 0), (0.9, 0)] {
            let found = checked(facet, tolerance_cells).findings_total;
            assert_eq!(found, findings, "{tolerance_cells} cells");
        }
    }

    #[test]
    fn crossed_leaves_of_the_surface_level_are_labelled_crossing_and_all_others_outside() {
        let facet = facet([[0.5, 0.5, 0.5], [5.0, 0.5, 0.5], [0.5, 1.5, 0.5]]);
        let (facets, terms) = (Facets::new(&[facet]), terms());
        let labelled = Crossed::new(&facets, &terms, 0.0).labelled(&tree());
        let words = words_of(|o| o.level == 0 || o.level == 1 && o.digit() == 0);
        for octant in words.into_iter().map(word::octant) {
            let is_crossing = ["0.0", "0.1"].contains(&&*octant.path());
            let side = if is_crossing { Side::Crossing } else { Side::Outside };
            assert_eq!(labelled.locate(octant.corner), Some((octant, side as Kind)), "{octant}");
        }
    }
}
