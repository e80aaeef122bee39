//! The promise `surface`: every leaf that the geometry crosses has at least the level of the surface.
//!
//! Crossed leaves are found from the facets, never from the mesh's own sides. A leaf that is coarser than the surface
//! level is a finding if a facet reaches deeper into it than a tolerance. The check cannot detect a crossed leaf that is
//! missing from the mesh; `complete` does, if `crossing` is promised or the band of `sides` has no width.

use super::facets::Facets;
use super::{Check, CheckResult, NO_GEOMETRY, nothing};
use crate::promises::Surface;
use contract::lattice::UNITS_PER_EDGE;
use contract::manifest::Manifest;
use contract::octant::Octant;
use contract::tree::{Builder, Kind, Tree};
use contract::word::{self, Side};

pub(super) const CHECK: Check = Check {
    name: "surface",
    wanted: |subject| !subject.promises.definition && subject.promises.surface.is_some(),
    needs: nothing,
    run: |subject, result| match subject.facets() {
        Some(facets) => {
            let crossed = Crossed::new(facets, &subject.terms, subject.promises.surface);
            Crossed { of_coarser: true, ..crossed }.check(subject.tree(), result);
        }
        None => result.lacks(NO_GEOMETRY),
    },
};

/// The facets and the depth to which they may reach into a leaf.
pub struct Crossed<'a> {
    facets: &'a Facets,
    terms: &'a Manifest,
    /// The depth, in lattice units.
    tolerance: i64,
    /// Whether it is that of leaves coarser than the surface alone.
    of_coarser: bool,
}

impl<'a> Crossed<'a> {
    /// The crossed leaves of a mesh, by this promise; without one, the tolerance is 0.
    pub fn new(facets: &'a Facets, terms: &'a Manifest, surface: Option<Surface>) -> Self {
        let cells = surface.map_or(0.0, |surface| surface.tolerance_cells);
        let tolerance = (cells * (UNITS_PER_EDGE >> terms.level_surface) as f64) as i64;
        Self { facets, terms, tolerance, of_coarser: false }
    }

    fn check(&self, tree: &Tree, result: &mut CheckResult) {
        let level = self.terms.level_surface;
        self.visit(tree, &mut |octant, _, facet| {
            let Some(facet) = facet else { return };
            result.examined += 1;
            if octant.level < level {
                result.report_with(|| {
                    let leaf = self.terms.root.describe(&octant);
                    format!(
                        "facet {facet} crosses the leaf {leaf}, which is coarser than level {level}"
                    )
                });
            }
        });
        if result.examined == 0 {
            result.lacks("the geometry crosses no leaf of the mesh");
        }
    }

    /// Whether a facet crosses an octant, whatever the tolerance.
    pub fn meets(&self, octant: &Octant) -> bool {
        let (low, high) = octant.bounds();
        self.facets.first_meeting(&self.facets.all(), low, high).is_some()
    }

    /// The tree with the sides of its leaves replaced: crossing if a facet crosses a leaf of the surface level, else
    /// outside.
    pub fn labelled(&self, tree: &Tree) -> Tree {
        let mut builder = Builder::default();
        self.visit(tree, &mut |octant, _, facet| {
            let crossing = facet.is_some() && octant.level == self.terms.level_surface;
            let side = if crossing { Side::Crossing } else { Side::Outside };
            builder
                .push_leaf(word::key_of(octant.corner), octant.level, side as Kind)
                .expect("the leaves of a tree are in order and do not overlap");
        });
        builder.finish()
    }

    /// Visits every leaf in Morton order, with a facet that reaches into it deeper than the tolerance.
    pub fn visit(&self, tree: &Tree, visit: &mut dyn FnMut(Octant, Kind, Option<u32>)) {
        self.facets.walk(0, &mut |octant, near| {
            let handle = tree.at(&octant);
            if let Some(kind) = handle.as_leaf() {
                let is_exact = self.of_coarser && octant.level >= self.terms.level_surface;
                let tolerance = if is_exact { 0 } else { self.tolerance };
                let (low, high) = octant.bounds();
                let (low, high) = (low.map(|c| c + tolerance), high.map(|c| c - tolerance));
                // A leaf far below the surface level may be smaller than the tolerance.
                let is_box = low[0] <= high[0];
                let found = is_box.then(|| self.facets.first_meeting(near, low, high)).flatten();
                visit(octant, kind, found);
            }
            handle.is_node()
        });
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
        let surface = Some(Surface { tolerance_cells });
        let mut result = CheckResult::new("surface");
        let facets = Facets::new(&[facet]);
        let terms = terms();
        let crossed = Crossed::new(&facets, &terms, surface);
        Crossed { of_coarser: true, ..crossed }.check(&tree(), &mut result);
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
        let labelled = Crossed::new(&facets, &terms, None).labelled(&tree());
        let words = words_of(|o| o.level == 0 || o.level == 1 && o.digit() == 0);
        for octant in words.into_iter().map(word::octant) {
            let is_crossing = ["0.0", "0.1"].contains(&&*octant.path());
            let side = if is_crossing { Side::Crossing } else { Side::Outside };
            assert_eq!(labelled.locate(octant.corner), Some((octant, side as Kind)), "{octant}");
        }
    }
}
